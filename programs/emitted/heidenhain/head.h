0 BEGIN PGM HEAD MM
1 ; axiscal 0.1.0: program head, machine swivel-head, controller heidenhain
2 ; the swivelling head B, the paper's first stage: four fixed blocks at B = 0, -90, -30
3 ; 202 touches, about 13 min; the plan head.plan.json belongs to it
4 ; Set up:
5 ; mounting head: four blocks on a bridge plate over the turntable: the plate is screwed to the linear
6 ; axes' table and does not turn with C
7 ; block x-: 10 x 10 x 10 mm, on a riser 60 mm high
8 ; the ball rests on the middle of its upper face at X -30.000 Y 0.000 Z 8.000
9 ; block x+: 10 x 10 x 10 mm, on a riser 60 mm high
10 ; the ball rests on the middle of its upper face at X 30.000 Y 0.000 Z 8.000
11 ; block y-: 10 x 10 x 10 mm, on a riser 60 mm high
12 ; the ball rests on the middle of its upper face at X 0.000 Y -30.000 Z 8.000
13 ; block y+: 10 x 10 x 10 mm, on a riser 60 mm high
14 ; the ball rests on the middle of its upper face at X 0.000 Y 30.000 Z 8.000
15 ; probe with ball 6 mm across, stem 75 mm, 202.684 mm from the pivot or gauge line to the ball's
16 ; centre
17 ; each block within 1 mm of its position, its faces along the machine's axes
18 ; a touch that is further off stops the program; the first of each block is made slowly
19 ; the positions above and below are machine coordinates with all rotary axes at 0, ball's centre
20 ; Before the start:
21 ; probe in the spindle, spindle stopped, nothing that touches the stylus
22 ; check the direction of B: at B -90 the ball must be on the +X side of the pivot
23 ; the first move takes Z straight to 349.000 from where it stands: keep that way free
24 ; the log is TNC:\AXISCAL\HEAD.LOG
25 ; NOT VERIFIED on a real control: 42 entries, see head.notes.txt. Try the program in the control's
26 ; simulation first
27 ; the masks HEAD_H.A, _N.A, _P.A, _E.A and AXISCAL_M.A must lie in TNC:\AXISCAL\
28 ; tilted plane, TCPM and M126 are off after the program; the datum is not touched
29 ; rotary axes in the log: nominal positions (ID240), so a positioning error of the axis itself does
30 ; not show in them
31 ; feed override at 100 percent while it runs; after a message that says what is wrong NC start ends
32 ; the program
33 ; to stop: NC stop or emergency stop. A program that stops by itself says the touch, the face and the
34 ; reason
35 ; to start again at a set-up: set Q1600 below to its number, 1 to 3; 1 is the whole program
36 ; dry run, do it first: set Q1610 below to +50, and all moves are 50 mm higher and nothing is measured
37 ; slower: set Q1699 below to a lower feed of positioning
38 FN 0: Q1600 = +1
39 FN 0: Q1610 = +0
40 FN 0: Q1699 = +1500
41 FN 0: Q1664 = +0
42 FN 0: Q1665 = +60
43 FN 0: Q1666 = +60
44 FN 0: Q1607 = +1
45 Q1620 = Q1600 - INT Q1600
46 FN 12: IF +Q1600 LT +1 GOTO LBL 25
47 FN 10: IF +Q1620 NE +0 GOTO LBL 25
48 FN 11: IF +Q1600 GT +3 GOTO LBL 25
49 FN 9: IF +0 EQU +0 GOTO LBL 26
50 LBL 25
51 QS1600 = "AXISCAL: there is no set-up with the number of Q1600: 1 to 3"
52 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_M.A / SCREEN:
53 STOP
54 FN 9: IF +0 EQU +0 GOTO LBL 9
55 LBL 26
56 M5
57 M9
58 M129
59 PLANE RESET STAY
60 M127
61 FN 18: SYSREAD Q1613 = ID320 NR1 IDX0
62 FN 11: IF +Q1610 GT +0 GOTO LBL 21
63 FN 11: IF +Q1600 GT +1 GOTO LBL 20
64 FN 16: F-PRINT TNC:\AXISCAL\HEAD_N.A / TNC:\AXISCAL\HEAD.LOG
65 FN 9: IF +0 EQU +0 GOTO LBL 21
66 LBL 20
67 FN 16: F-PRINT TNC:\AXISCAL\HEAD_H.A / TNC:\AXISCAL\HEAD.LOG
68 LBL 21
69 ; is the probe closed? down by 0.02 mm: it does not move when it is not
70 FN 0: Q1681 = +0
71 FN 0: Q1682 = +0
72 FN 0: Q1683 = -1
73 TCH PROBE 4.0 MEASURING IN 3-D
74 TCH PROBE 4.1 Q1601
75 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
76 TCH PROBE 4.3 DIST+0.02 F60 MB0 REFERENCE SYSTEM:1
77 FN 9: IF +Q1604 EQU -1 GOTO LBL 24
78 QS1600 = "AXISCAL: the probe is deflected, or not switched on, before the first move"
79 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_M.A / SCREEN:
80 STOP
81 FN 9: IF +0 EQU +0 GOTO LBL 9
82 LBL 24
83 L Z+349 R0 FMAX M91
84 L C-5 R0 FMAX M91
85 L C+0 R0 FMAX M91
86 L B-5 R0 FMAX M91
87 L B+0 R0 FMAX M91
88 L X-33 R0 FMAX M91
89 FN 0: Q1651 = -33
90 FN 0: Q1652 = -3
91 FN 0: Q1653 = +349
92 CALL LBL 3
93 ; set-up 1: head, B 0 C 0
94 FN 11: IF +Q1600 GT +1 GOTO LBL 30
95 CYCL DEF 13.0 ORIENTATION
96 CYCL DEF 13.1 ANGLE+0
97 M19
98 FN 0: Q1651 = -33
99 FN 0: Q1652 = -3
100 FN 0: Q1653 = +11.3
101 CALL LBL 3
102 FN 0: Q1607 = +1 ; touch 1: block x- face +Z
103 QS1601 = "block x- face +Z"
104 FN 0: Q1653 = +10
105 CALL LBL 2
106 FN 0: Q1661 = +0
107 FN 0: Q1662 = +0
108 FN 0: Q1663 = -4
109 FN 0: Q1664 = +2
110 FN 0: Q1665 = +60
111 FN 0: Q1666 = +60
112 FN 0: Q1667 = +11.3
113 CALL LBL 1
114 FN 0: Q1652 = +0
115 CALL LBL 3
116 FN 0: Q1607 = +2 ; touch 2: block x- face +Z
117 FN 0: Q1653 = +10
118 CALL LBL 2
119 FN 0: Q1665 = +300
120 CALL LBL 1
121 FN 0: Q1652 = +3
122 CALL LBL 3
123 FN 0: Q1607 = +3 ; touch 3: block x- face +Z
124 FN 0: Q1653 = +10
125 CALL LBL 2
126 CALL LBL 1
127 FN 0: Q1651 = -31
128 CALL LBL 3
129 FN 0: Q1652 = -3
130 CALL LBL 3
131 FN 0: Q1607 = +4 ; touch 4: block x- face +Z
132 FN 0: Q1653 = +10
133 CALL LBL 2
134 CALL LBL 1
135 FN 0: Q1652 = +0
136 CALL LBL 3
137 FN 0: Q1607 = +5 ; touch 5: block x- face +Z
138 FN 0: Q1653 = +10
139 CALL LBL 2
140 CALL LBL 1
141 FN 0: Q1652 = +3
142 CALL LBL 3
143 FN 0: Q1607 = +6 ; touch 6: block x- face +Z
144 FN 0: Q1653 = +10
145 CALL LBL 2
146 CALL LBL 1
147 FN 0: Q1651 = -29
148 CALL LBL 3
149 FN 0: Q1652 = -3
150 CALL LBL 3
151 FN 0: Q1607 = +7 ; touch 7: block x- face +Z
152 FN 0: Q1653 = +10
153 CALL LBL 2
154 CALL LBL 1
155 FN 0: Q1652 = +0
156 CALL LBL 3
157 FN 0: Q1607 = +8 ; touch 8: block x- face +Z
158 FN 0: Q1653 = +10
159 CALL LBL 2
160 CALL LBL 1
161 FN 0: Q1652 = +3
162 CALL LBL 3
163 FN 0: Q1607 = +9 ; touch 9: block x- face +Z
164 FN 0: Q1653 = +10
165 CALL LBL 2
166 CALL LBL 1
167 FN 0: Q1651 = -27
168 CALL LBL 3
169 FN 0: Q1652 = -3
170 CALL LBL 3
171 FN 0: Q1607 = +10 ; touch 10: block x- face +Z
172 FN 0: Q1653 = +10
173 CALL LBL 2
174 CALL LBL 1
175 FN 0: Q1652 = +0
176 CALL LBL 3
177 FN 0: Q1607 = +11 ; touch 11: block x- face +Z
178 FN 0: Q1653 = +10
179 CALL LBL 2
180 CALL LBL 1
181 FN 0: Q1652 = +3
182 CALL LBL 3
183 FN 0: Q1607 = +12 ; touch 12: block x- face +Z
184 FN 0: Q1653 = +10
185 CALL LBL 2
186 CALL LBL 1
187 FN 0: Q1651 = -20
188 CALL LBL 3
189 FN 0: Q1652 = -2.5
190 CALL LBL 3
191 FN 0: Q1607 = +13 ; touch 13: block x- face +X
192 QS1601 = "block x- face +X"
193 FN 0: Q1653 = +3
194 CALL LBL 2
195 FN 0: Q1661 = -4
196 FN 0: Q1663 = +0
197 CALL LBL 1
198 FN 0: Q1607 = +14 ; touch 14: block x- face +X
199 FN 0: Q1653 = +0
200 CALL LBL 2
201 CALL LBL 1
202 FN 0: Q1652 = +2.5
203 CALL LBL 3
204 FN 0: Q1607 = +15 ; touch 15: block x- face +X
205 FN 0: Q1653 = +3
206 CALL LBL 2
207 CALL LBL 1
208 FN 0: Q1607 = +16 ; touch 16: block x- face +X
209 FN 0: Q1653 = +0
210 CALL LBL 2
211 CALL LBL 1
212 FN 0: Q1651 = -40
213 CALL LBL 3
214 FN 0: Q1652 = -2.5
215 CALL LBL 3
216 FN 0: Q1607 = +17 ; touch 17: block x- face -X
217 QS1601 = "block x- face -X"
218 FN 0: Q1653 = +3
219 CALL LBL 2
220 FN 0: Q1661 = +4
221 CALL LBL 1
222 FN 0: Q1607 = +18 ; touch 18: block x- face -X
223 FN 0: Q1653 = +0
224 CALL LBL 2
225 CALL LBL 1
226 FN 0: Q1652 = +2.5
227 CALL LBL 3
228 FN 0: Q1607 = +19 ; touch 19: block x- face -X
229 FN 0: Q1653 = +3
230 CALL LBL 2
231 CALL LBL 1
232 FN 0: Q1607 = +20 ; touch 20: block x- face -X
233 FN 0: Q1653 = +0
234 CALL LBL 2
235 CALL LBL 1
236 FN 0: Q1651 = -32.5
237 CALL LBL 3
238 FN 0: Q1652 = +10
239 CALL LBL 3
240 FN 0: Q1607 = +21 ; touch 21: block x- face +Y
241 QS1601 = "block x- face +Y"
242 FN 0: Q1653 = +3
243 CALL LBL 2
244 FN 0: Q1661 = +0
245 FN 0: Q1662 = -4
246 CALL LBL 1
247 FN 0: Q1607 = +22 ; touch 22: block x- face +Y
248 FN 0: Q1653 = +0
249 CALL LBL 2
250 CALL LBL 1
251 FN 0: Q1651 = -27.5
252 CALL LBL 3
253 FN 0: Q1607 = +23 ; touch 23: block x- face +Y
254 FN 0: Q1653 = +3
255 CALL LBL 2
256 CALL LBL 1
257 FN 0: Q1607 = +24 ; touch 24: block x- face +Y
258 FN 0: Q1653 = +0
259 CALL LBL 2
260 CALL LBL 1
261 FN 0: Q1651 = -32.5
262 CALL LBL 3
263 FN 0: Q1652 = -10
264 CALL LBL 3
265 FN 0: Q1607 = +25 ; touch 25: block x- face -Y
266 QS1601 = "block x- face -Y"
267 FN 0: Q1653 = +3
268 CALL LBL 2
269 FN 0: Q1662 = +4
270 CALL LBL 1
271 FN 0: Q1607 = +26 ; touch 26: block x- face -Y
272 FN 0: Q1653 = +0
273 CALL LBL 2
274 CALL LBL 1
275 FN 0: Q1651 = -27.5
276 CALL LBL 3
277 FN 0: Q1607 = +27 ; touch 27: block x- face -Y
278 FN 0: Q1653 = +3
279 CALL LBL 2
280 CALL LBL 1
281 FN 0: Q1607 = +28 ; touch 28: block x- face -Y
282 FN 0: Q1653 = +0
283 CALL LBL 2
284 CALL LBL 1
285 FN 0: Q1651 = +27
286 CALL LBL 3
287 FN 0: Q1652 = -3
288 CALL LBL 3
289 FN 0: Q1607 = +29 ; touch 29: block x+ face +Z
290 QS1601 = "block x+ face +Z"
291 FN 0: Q1653 = +10
292 CALL LBL 2
293 FN 0: Q1662 = +0
294 FN 0: Q1663 = -4
295 FN 0: Q1665 = +60
296 CALL LBL 1
297 FN 0: Q1652 = +0
298 CALL LBL 3
299 FN 0: Q1607 = +30 ; touch 30: block x+ face +Z
300 FN 0: Q1653 = +10
301 CALL LBL 2
302 FN 0: Q1665 = +300
303 CALL LBL 1
304 FN 0: Q1652 = +3
305 CALL LBL 3
306 FN 0: Q1607 = +31 ; touch 31: block x+ face +Z
307 FN 0: Q1653 = +10
308 CALL LBL 2
309 CALL LBL 1
310 FN 0: Q1651 = +29
311 CALL LBL 3
312 FN 0: Q1652 = -3
313 CALL LBL 3
314 FN 0: Q1607 = +32 ; touch 32: block x+ face +Z
315 FN 0: Q1653 = +10
316 CALL LBL 2
317 CALL LBL 1
318 FN 0: Q1652 = +0
319 CALL LBL 3
320 FN 0: Q1607 = +33 ; touch 33: block x+ face +Z
321 FN 0: Q1653 = +10
322 CALL LBL 2
323 CALL LBL 1
324 FN 0: Q1652 = +3
325 CALL LBL 3
326 FN 0: Q1607 = +34 ; touch 34: block x+ face +Z
327 FN 0: Q1653 = +10
328 CALL LBL 2
329 CALL LBL 1
330 FN 0: Q1651 = +31
331 CALL LBL 3
332 FN 0: Q1652 = -3
333 CALL LBL 3
334 FN 0: Q1607 = +35 ; touch 35: block x+ face +Z
335 FN 0: Q1653 = +10
336 CALL LBL 2
337 CALL LBL 1
338 FN 0: Q1652 = +0
339 CALL LBL 3
340 FN 0: Q1607 = +36 ; touch 36: block x+ face +Z
341 FN 0: Q1653 = +10
342 CALL LBL 2
343 CALL LBL 1
344 FN 0: Q1652 = +3
345 CALL LBL 3
346 FN 0: Q1607 = +37 ; touch 37: block x+ face +Z
347 FN 0: Q1653 = +10
348 CALL LBL 2
349 CALL LBL 1
350 FN 0: Q1651 = +33
351 CALL LBL 3
352 FN 0: Q1652 = -3
353 CALL LBL 3
354 FN 0: Q1607 = +38 ; touch 38: block x+ face +Z
355 FN 0: Q1653 = +10
356 CALL LBL 2
357 CALL LBL 1
358 FN 0: Q1652 = +0
359 CALL LBL 3
360 FN 0: Q1607 = +39 ; touch 39: block x+ face +Z
361 FN 0: Q1653 = +10
362 CALL LBL 2
363 CALL LBL 1
364 FN 0: Q1652 = +3
365 CALL LBL 3
366 FN 0: Q1607 = +40 ; touch 40: block x+ face +Z
367 FN 0: Q1653 = +10
368 CALL LBL 2
369 CALL LBL 1
370 FN 0: Q1651 = +40
371 CALL LBL 3
372 FN 0: Q1652 = -2.5
373 CALL LBL 3
374 FN 0: Q1607 = +41 ; touch 41: block x+ face +X
375 QS1601 = "block x+ face +X"
376 FN 0: Q1653 = +3
377 CALL LBL 2
378 FN 0: Q1661 = -4
379 FN 0: Q1663 = +0
380 CALL LBL 1
381 FN 0: Q1607 = +42 ; touch 42: block x+ face +X
382 FN 0: Q1653 = +0
383 CALL LBL 2
384 CALL LBL 1
385 FN 0: Q1652 = +2.5
386 CALL LBL 3
387 FN 0: Q1607 = +43 ; touch 43: block x+ face +X
388 FN 0: Q1653 = +3
389 CALL LBL 2
390 CALL LBL 1
391 FN 0: Q1607 = +44 ; touch 44: block x+ face +X
392 FN 0: Q1653 = +0
393 CALL LBL 2
394 CALL LBL 1
395 FN 0: Q1651 = +20
396 CALL LBL 3
397 FN 0: Q1652 = -2.5
398 CALL LBL 3
399 FN 0: Q1607 = +45 ; touch 45: block x+ face -X
400 QS1601 = "block x+ face -X"
401 FN 0: Q1653 = +3
402 CALL LBL 2
403 FN 0: Q1661 = +4
404 CALL LBL 1
405 FN 0: Q1607 = +46 ; touch 46: block x+ face -X
406 FN 0: Q1653 = +0
407 CALL LBL 2
408 CALL LBL 1
409 FN 0: Q1652 = +2.5
410 CALL LBL 3
411 FN 0: Q1607 = +47 ; touch 47: block x+ face -X
412 FN 0: Q1653 = +3
413 CALL LBL 2
414 CALL LBL 1
415 FN 0: Q1607 = +48 ; touch 48: block x+ face -X
416 FN 0: Q1653 = +0
417 CALL LBL 2
418 CALL LBL 1
419 FN 0: Q1651 = +27.5
420 CALL LBL 3
421 FN 0: Q1652 = +10
422 CALL LBL 3
423 FN 0: Q1607 = +49 ; touch 49: block x+ face +Y
424 QS1601 = "block x+ face +Y"
425 FN 0: Q1653 = +3
426 CALL LBL 2
427 FN 0: Q1661 = +0
428 FN 0: Q1662 = -4
429 CALL LBL 1
430 FN 0: Q1607 = +50 ; touch 50: block x+ face +Y
431 FN 0: Q1653 = +0
432 CALL LBL 2
433 CALL LBL 1
434 FN 0: Q1651 = +32.5
435 CALL LBL 3
436 FN 0: Q1607 = +51 ; touch 51: block x+ face +Y
437 FN 0: Q1653 = +3
438 CALL LBL 2
439 CALL LBL 1
440 FN 0: Q1607 = +52 ; touch 52: block x+ face +Y
441 FN 0: Q1653 = +0
442 CALL LBL 2
443 CALL LBL 1
444 FN 0: Q1651 = +27.5
445 CALL LBL 3
446 FN 0: Q1652 = -10
447 CALL LBL 3
448 FN 0: Q1607 = +53 ; touch 53: block x+ face -Y
449 QS1601 = "block x+ face -Y"
450 FN 0: Q1653 = +3
451 CALL LBL 2
452 FN 0: Q1662 = +4
453 CALL LBL 1
454 FN 0: Q1607 = +54 ; touch 54: block x+ face -Y
455 FN 0: Q1653 = +0
456 CALL LBL 2
457 CALL LBL 1
458 FN 0: Q1651 = +32.5
459 CALL LBL 3
460 FN 0: Q1607 = +55 ; touch 55: block x+ face -Y
461 FN 0: Q1653 = +3
462 CALL LBL 2
463 CALL LBL 1
464 FN 0: Q1607 = +56 ; touch 56: block x+ face -Y
465 FN 0: Q1653 = +0
466 CALL LBL 2
467 CALL LBL 1
468 FN 0: Q1651 = -3
469 CALL LBL 3
470 FN 0: Q1652 = -33
471 CALL LBL 3
472 FN 0: Q1607 = +57 ; touch 57: block y- face +Z
473 QS1601 = "block y- face +Z"
474 FN 0: Q1653 = +10
475 CALL LBL 2
476 FN 0: Q1662 = +0
477 FN 0: Q1663 = -4
478 FN 0: Q1665 = +60
479 CALL LBL 1
480 FN 0: Q1652 = -30
481 CALL LBL 3
482 FN 0: Q1607 = +58 ; touch 58: block y- face +Z
483 FN 0: Q1653 = +10
484 CALL LBL 2
485 FN 0: Q1665 = +300
486 CALL LBL 1
487 FN 0: Q1652 = -27
488 CALL LBL 3
489 FN 0: Q1607 = +59 ; touch 59: block y- face +Z
490 FN 0: Q1653 = +10
491 CALL LBL 2
492 CALL LBL 1
493 FN 0: Q1651 = -1
494 CALL LBL 3
495 FN 0: Q1652 = -33
496 CALL LBL 3
497 FN 0: Q1607 = +60 ; touch 60: block y- face +Z
498 FN 0: Q1653 = +10
499 CALL LBL 2
500 CALL LBL 1
501 FN 0: Q1652 = -30
502 CALL LBL 3
503 FN 0: Q1607 = +61 ; touch 61: block y- face +Z
504 FN 0: Q1653 = +10
505 CALL LBL 2
506 CALL LBL 1
507 FN 0: Q1652 = -27
508 CALL LBL 3
509 FN 0: Q1607 = +62 ; touch 62: block y- face +Z
510 FN 0: Q1653 = +10
511 CALL LBL 2
512 CALL LBL 1
513 FN 0: Q1651 = +1
514 CALL LBL 3
515 FN 0: Q1652 = -33
516 CALL LBL 3
517 FN 0: Q1607 = +63 ; touch 63: block y- face +Z
518 FN 0: Q1653 = +10
519 CALL LBL 2
520 CALL LBL 1
521 FN 0: Q1652 = -30
522 CALL LBL 3
523 FN 0: Q1607 = +64 ; touch 64: block y- face +Z
524 FN 0: Q1653 = +10
525 CALL LBL 2
526 CALL LBL 1
527 FN 0: Q1652 = -27
528 CALL LBL 3
529 FN 0: Q1607 = +65 ; touch 65: block y- face +Z
530 FN 0: Q1653 = +10
531 CALL LBL 2
532 CALL LBL 1
533 FN 0: Q1651 = +3
534 CALL LBL 3
535 FN 0: Q1652 = -33
536 CALL LBL 3
537 FN 0: Q1607 = +66 ; touch 66: block y- face +Z
538 FN 0: Q1653 = +10
539 CALL LBL 2
540 CALL LBL 1
541 FN 0: Q1652 = -30
542 CALL LBL 3
543 FN 0: Q1607 = +67 ; touch 67: block y- face +Z
544 FN 0: Q1653 = +10
545 CALL LBL 2
546 CALL LBL 1
547 FN 0: Q1652 = -27
548 CALL LBL 3
549 FN 0: Q1607 = +68 ; touch 68: block y- face +Z
550 FN 0: Q1653 = +10
551 CALL LBL 2
552 CALL LBL 1
553 FN 0: Q1651 = +10
554 CALL LBL 3
555 FN 0: Q1652 = -32.5
556 CALL LBL 3
557 FN 0: Q1607 = +69 ; touch 69: block y- face +X
558 QS1601 = "block y- face +X"
559 FN 0: Q1653 = +3
560 CALL LBL 2
561 FN 0: Q1661 = -4
562 FN 0: Q1663 = +0
563 CALL LBL 1
564 FN 0: Q1607 = +70 ; touch 70: block y- face +X
565 FN 0: Q1653 = +0
566 CALL LBL 2
567 CALL LBL 1
568 FN 0: Q1652 = -27.5
569 CALL LBL 3
570 FN 0: Q1607 = +71 ; touch 71: block y- face +X
571 FN 0: Q1653 = +3
572 CALL LBL 2
573 CALL LBL 1
574 FN 0: Q1607 = +72 ; touch 72: block y- face +X
575 FN 0: Q1653 = +0
576 CALL LBL 2
577 CALL LBL 1
578 FN 0: Q1651 = -10
579 CALL LBL 3
580 FN 0: Q1652 = -32.5
581 CALL LBL 3
582 FN 0: Q1607 = +73 ; touch 73: block y- face -X
583 QS1601 = "block y- face -X"
584 FN 0: Q1653 = +3
585 CALL LBL 2
586 FN 0: Q1661 = +4
587 CALL LBL 1
588 FN 0: Q1607 = +74 ; touch 74: block y- face -X
589 FN 0: Q1653 = +0
590 CALL LBL 2
591 CALL LBL 1
592 FN 0: Q1652 = -27.5
593 CALL LBL 3
594 FN 0: Q1607 = +75 ; touch 75: block y- face -X
595 FN 0: Q1653 = +3
596 CALL LBL 2
597 CALL LBL 1
598 FN 0: Q1607 = +76 ; touch 76: block y- face -X
599 FN 0: Q1653 = +0
600 CALL LBL 2
601 CALL LBL 1
602 FN 0: Q1651 = -2.5
603 CALL LBL 3
604 FN 0: Q1652 = -20
605 CALL LBL 3
606 FN 0: Q1607 = +77 ; touch 77: block y- face +Y
607 QS1601 = "block y- face +Y"
608 FN 0: Q1653 = +3
609 CALL LBL 2
610 FN 0: Q1661 = +0
611 FN 0: Q1662 = -4
612 CALL LBL 1
613 FN 0: Q1607 = +78 ; touch 78: block y- face +Y
614 FN 0: Q1653 = +0
615 CALL LBL 2
616 CALL LBL 1
617 FN 0: Q1651 = +2.5
618 CALL LBL 3
619 FN 0: Q1607 = +79 ; touch 79: block y- face +Y
620 FN 0: Q1653 = +3
621 CALL LBL 2
622 CALL LBL 1
623 FN 0: Q1607 = +80 ; touch 80: block y- face +Y
624 FN 0: Q1653 = +0
625 CALL LBL 2
626 CALL LBL 1
627 FN 0: Q1651 = -2.5
628 CALL LBL 3
629 FN 0: Q1652 = -40
630 CALL LBL 3
631 FN 0: Q1607 = +81 ; touch 81: block y- face -Y
632 QS1601 = "block y- face -Y"
633 FN 0: Q1653 = +3
634 CALL LBL 2
635 FN 0: Q1662 = +4
636 CALL LBL 1
637 FN 0: Q1607 = +82 ; touch 82: block y- face -Y
638 FN 0: Q1653 = +0
639 CALL LBL 2
640 CALL LBL 1
641 FN 0: Q1651 = +2.5
642 CALL LBL 3
643 FN 0: Q1607 = +83 ; touch 83: block y- face -Y
644 FN 0: Q1653 = +3
645 CALL LBL 2
646 CALL LBL 1
647 FN 0: Q1607 = +84 ; touch 84: block y- face -Y
648 FN 0: Q1653 = +0
649 CALL LBL 2
650 CALL LBL 1
651 FN 0: Q1651 = -3
652 CALL LBL 3
653 FN 0: Q1652 = +27
654 CALL LBL 3
655 FN 0: Q1607 = +85 ; touch 85: block y+ face +Z
656 QS1601 = "block y+ face +Z"
657 FN 0: Q1653 = +10
658 CALL LBL 2
659 FN 0: Q1662 = +0
660 FN 0: Q1663 = -4
661 FN 0: Q1665 = +60
662 CALL LBL 1
663 FN 0: Q1652 = +30
664 CALL LBL 3
665 FN 0: Q1607 = +86 ; touch 86: block y+ face +Z
666 FN 0: Q1653 = +10
667 CALL LBL 2
668 FN 0: Q1665 = +300
669 CALL LBL 1
670 FN 0: Q1652 = +33
671 CALL LBL 3
672 FN 0: Q1607 = +87 ; touch 87: block y+ face +Z
673 FN 0: Q1653 = +10
674 CALL LBL 2
675 CALL LBL 1
676 FN 0: Q1651 = -1
677 CALL LBL 3
678 FN 0: Q1652 = +27
679 CALL LBL 3
680 FN 0: Q1607 = +88 ; touch 88: block y+ face +Z
681 FN 0: Q1653 = +10
682 CALL LBL 2
683 CALL LBL 1
684 FN 0: Q1652 = +30
685 CALL LBL 3
686 FN 0: Q1607 = +89 ; touch 89: block y+ face +Z
687 FN 0: Q1653 = +10
688 CALL LBL 2
689 CALL LBL 1
690 FN 0: Q1652 = +33
691 CALL LBL 3
692 FN 0: Q1607 = +90 ; touch 90: block y+ face +Z
693 FN 0: Q1653 = +10
694 CALL LBL 2
695 CALL LBL 1
696 FN 0: Q1651 = +1
697 CALL LBL 3
698 FN 0: Q1652 = +27
699 CALL LBL 3
700 FN 0: Q1607 = +91 ; touch 91: block y+ face +Z
701 FN 0: Q1653 = +10
702 CALL LBL 2
703 CALL LBL 1
704 FN 0: Q1652 = +30
705 CALL LBL 3
706 FN 0: Q1607 = +92 ; touch 92: block y+ face +Z
707 FN 0: Q1653 = +10
708 CALL LBL 2
709 CALL LBL 1
710 FN 0: Q1652 = +33
711 CALL LBL 3
712 FN 0: Q1607 = +93 ; touch 93: block y+ face +Z
713 FN 0: Q1653 = +10
714 CALL LBL 2
715 CALL LBL 1
716 FN 0: Q1651 = +3
717 CALL LBL 3
718 FN 0: Q1652 = +27
719 CALL LBL 3
720 FN 0: Q1607 = +94 ; touch 94: block y+ face +Z
721 FN 0: Q1653 = +10
722 CALL LBL 2
723 CALL LBL 1
724 FN 0: Q1652 = +30
725 CALL LBL 3
726 FN 0: Q1607 = +95 ; touch 95: block y+ face +Z
727 FN 0: Q1653 = +10
728 CALL LBL 2
729 CALL LBL 1
730 FN 0: Q1652 = +33
731 CALL LBL 3
732 FN 0: Q1607 = +96 ; touch 96: block y+ face +Z
733 FN 0: Q1653 = +10
734 CALL LBL 2
735 CALL LBL 1
736 FN 0: Q1651 = +10
737 CALL LBL 3
738 FN 0: Q1652 = +27.5
739 CALL LBL 3
740 FN 0: Q1607 = +97 ; touch 97: block y+ face +X
741 QS1601 = "block y+ face +X"
742 FN 0: Q1653 = +3
743 CALL LBL 2
744 FN 0: Q1661 = -4
745 FN 0: Q1663 = +0
746 CALL LBL 1
747 FN 0: Q1607 = +98 ; touch 98: block y+ face +X
748 FN 0: Q1653 = +0
749 CALL LBL 2
750 CALL LBL 1
751 FN 0: Q1652 = +32.5
752 CALL LBL 3
753 FN 0: Q1607 = +99 ; touch 99: block y+ face +X
754 FN 0: Q1653 = +3
755 CALL LBL 2
756 CALL LBL 1
757 FN 0: Q1607 = +100 ; touch 100: block y+ face +X
758 FN 0: Q1653 = +0
759 CALL LBL 2
760 CALL LBL 1
761 FN 0: Q1651 = -10
762 CALL LBL 3
763 FN 0: Q1652 = +27.5
764 CALL LBL 3
765 FN 0: Q1607 = +101 ; touch 101: block y+ face -X
766 QS1601 = "block y+ face -X"
767 FN 0: Q1653 = +3
768 CALL LBL 2
769 FN 0: Q1661 = +4
770 CALL LBL 1
771 FN 0: Q1607 = +102 ; touch 102: block y+ face -X
772 FN 0: Q1653 = +0
773 CALL LBL 2
774 CALL LBL 1
775 FN 0: Q1652 = +32.5
776 CALL LBL 3
777 FN 0: Q1607 = +103 ; touch 103: block y+ face -X
778 FN 0: Q1653 = +3
779 CALL LBL 2
780 CALL LBL 1
781 FN 0: Q1607 = +104 ; touch 104: block y+ face -X
782 FN 0: Q1653 = +0
783 CALL LBL 2
784 CALL LBL 1
785 FN 0: Q1651 = -2.5
786 CALL LBL 3
787 FN 0: Q1652 = +40
788 CALL LBL 3
789 FN 0: Q1607 = +105 ; touch 105: block y+ face +Y
790 QS1601 = "block y+ face +Y"
791 FN 0: Q1653 = +3
792 CALL LBL 2
793 FN 0: Q1661 = +0
794 FN 0: Q1662 = -4
795 CALL LBL 1
796 FN 0: Q1607 = +106 ; touch 106: block y+ face +Y
797 FN 0: Q1653 = +0
798 CALL LBL 2
799 CALL LBL 1
800 FN 0: Q1651 = +2.5
801 CALL LBL 3
802 FN 0: Q1607 = +107 ; touch 107: block y+ face +Y
803 FN 0: Q1653 = +3
804 CALL LBL 2
805 CALL LBL 1
806 FN 0: Q1607 = +108 ; touch 108: block y+ face +Y
807 FN 0: Q1653 = +0
808 CALL LBL 2
809 CALL LBL 1
810 FN 0: Q1651 = -2.5
811 CALL LBL 3
812 FN 0: Q1652 = +20
813 CALL LBL 3
814 FN 0: Q1607 = +109 ; touch 109: block y+ face -Y
815 QS1601 = "block y+ face -Y"
816 FN 0: Q1653 = +3
817 CALL LBL 2
818 FN 0: Q1662 = +4
819 CALL LBL 1
820 FN 0: Q1607 = +110 ; touch 110: block y+ face -Y
821 FN 0: Q1653 = +0
822 CALL LBL 2
823 CALL LBL 1
824 FN 0: Q1651 = +2.5
825 CALL LBL 3
826 FN 0: Q1607 = +111 ; touch 111: block y+ face -Y
827 FN 0: Q1653 = +3
828 CALL LBL 2
829 CALL LBL 1
830 FN 0: Q1607 = +112 ; touch 112: block y+ face -Y
831 FN 0: Q1653 = +0
832 CALL LBL 2
833 CALL LBL 1
834 LBL 30
835 ; set-up 2: head, B -90 C 0
836 FN 11: IF +Q1600 GT +2 GOTO LBL 31
837 FN 12: IF +Q1600 LT +2 GOTO LBL 32
838 ; the blocks may have been moved: the first search of each is slow again
839 L X+2.5 R0 FMAX M91
840 L Y+20 R0 FMAX M91
841 L Z+11.3 R0 FMAX M91
842 LBL 32
843 CYCL DEF 13.0 ORIENTATION
844 CYCL DEF 13.1 ANGLE+0
845 M19
846 L B-90 R0 FMAX M91
847 FN 0: Q1651 = -235.684
848 FN 0: Q1652 = +20
849 FN 0: Q1653 = +11.3
850 CALL LBL 3
851 FN 0: Q1652 = -2.5
852 CALL LBL 3
853 FN 0: Q1653 = -144.3
854 CALL LBL 3
855 FN 0: Q1607 = +113 ; touch 113: block x- face +Z
856 QS1601 = "block x- face +Z"
857 FN 0: Q1653 = -192.684
858 CALL LBL 2
859 FN 0: Q1661 = +0
860 FN 0: Q1662 = +0
861 FN 0: Q1663 = -4
862 FN 0: Q1664 = +2
863 FN 0: Q1665 = +300
864 FN 0: Q1668 = +2
865 CALL LBL 6
866 FN 0: Q1666 = +60
867 FN 0: Q1667 = -191.3
868 CALL LBL 1
869 FN 0: Q1652 = +2.5
870 CALL LBL 3
871 FN 0: Q1607 = +114 ; touch 114: block x- face +Z
872 FN 0: Q1653 = -192.684
873 CALL LBL 2
874 FN 0: Q1665 = +300
875 CALL LBL 1
876 FN 0: Q1651 = -232.684
877 CALL LBL 3
878 FN 0: Q1652 = -2.5
879 CALL LBL 3
880 FN 0: Q1607 = +115 ; touch 115: block x- face +Z
881 FN 0: Q1653 = -192.684
882 CALL LBL 2
883 CALL LBL 1
884 FN 0: Q1652 = +2.5
885 CALL LBL 3
886 FN 0: Q1607 = +116 ; touch 116: block x- face +Z
887 FN 0: Q1653 = -192.684
888 CALL LBL 2
889 CALL LBL 1
890 FN 0: Q1651 = -229.684
891 CALL LBL 3
892 FN 0: Q1652 = -2.5
893 CALL LBL 3
894 FN 0: Q1607 = +117 ; touch 117: block x- face +Z
895 FN 0: Q1653 = -192.684
896 CALL LBL 2
897 CALL LBL 1
898 FN 0: Q1652 = +2.5
899 CALL LBL 3
900 FN 0: Q1607 = +118 ; touch 118: block x- face +Z
901 FN 0: Q1653 = -192.684
902 CALL LBL 2
903 CALL LBL 1
904 FN 0: Q1651 = -242.684
905 CALL LBL 3
906 FN 0: Q1652 = -2.5
907 CALL LBL 3
908 FN 0: Q1607 = +119 ; touch 119: block x- face -X
909 QS1601 = "block x- face -X"
910 FN 0: Q1653 = -199.684
911 CALL LBL 2
912 FN 0: Q1661 = +4
913 FN 0: Q1663 = +0
914 CALL LBL 1
915 FN 0: Q1607 = +120 ; touch 120: block x- face -X
916 FN 0: Q1653 = -202.684
917 CALL LBL 2
918 CALL LBL 1
919 FN 0: Q1652 = +2.5
920 CALL LBL 3
921 FN 0: Q1607 = +121 ; touch 121: block x- face -X
922 FN 0: Q1653 = -199.684
923 CALL LBL 2
924 CALL LBL 1
925 FN 0: Q1607 = +122 ; touch 122: block x- face -X
926 FN 0: Q1653 = -202.684
927 CALL LBL 2
928 CALL LBL 1
929 FN 0: Q1651 = -235.184
930 CALL LBL 3
931 FN 0: Q1652 = +10
932 CALL LBL 3
933 FN 0: Q1607 = +123 ; touch 123: block x- face +Y
934 QS1601 = "block x- face +Y"
935 FN 0: Q1653 = -201.184
936 CALL LBL 2
937 FN 0: Q1661 = +0
938 FN 0: Q1662 = -4
939 CALL LBL 1
940 FN 0: Q1651 = -230.184
941 CALL LBL 3
942 FN 0: Q1607 = +124 ; touch 124: block x- face +Y
943 FN 0: Q1653 = -201.184
944 CALL LBL 2
945 CALL LBL 1
946 FN 0: Q1651 = -235.184
947 CALL LBL 3
948 FN 0: Q1652 = -10
949 CALL LBL 3
950 FN 0: Q1607 = +125 ; touch 125: block x- face -Y
951 QS1601 = "block x- face -Y"
952 FN 0: Q1653 = -201.184
953 CALL LBL 2
954 FN 0: Q1662 = +4
955 CALL LBL 1
956 FN 0: Q1651 = -230.184
957 CALL LBL 3
958 FN 0: Q1607 = +126 ; touch 126: block x- face -Y
959 FN 0: Q1653 = -201.184
960 CALL LBL 2
961 CALL LBL 1
962 FN 0: Q1651 = -205.684
963 CALL LBL 3
964 FN 0: Q1652 = -32.5
965 CALL LBL 3
966 FN 0: Q1607 = +127 ; touch 127: block y- face +Z
967 QS1601 = "block y- face +Z"
968 FN 0: Q1653 = -192.684
969 CALL LBL 2
970 FN 0: Q1662 = +0
971 FN 0: Q1663 = -4
972 FN 0: Q1665 = +300
973 FN 0: Q1668 = +2
974 CALL LBL 6
975 CALL LBL 1
976 FN 0: Q1652 = -27.5
977 CALL LBL 3
978 FN 0: Q1607 = +128 ; touch 128: block y- face +Z
979 FN 0: Q1653 = -192.684
980 CALL LBL 2
981 FN 0: Q1665 = +300
982 CALL LBL 1
983 FN 0: Q1651 = -202.684
984 CALL LBL 3
985 FN 0: Q1652 = -32.5
986 CALL LBL 3
987 FN 0: Q1607 = +129 ; touch 129: block y- face +Z
988 FN 0: Q1653 = -192.684
989 CALL LBL 2
990 CALL LBL 1
991 FN 0: Q1652 = -27.5
992 CALL LBL 3
993 FN 0: Q1607 = +130 ; touch 130: block y- face +Z
994 FN 0: Q1653 = -192.684
995 CALL LBL 2
996 CALL LBL 1
997 FN 0: Q1651 = -199.684
998 CALL LBL 3
999 FN 0: Q1652 = -32.5
1000 CALL LBL 3
1001 FN 0: Q1607 = +131 ; touch 131: block y- face +Z
1002 FN 0: Q1653 = -192.684
1003 CALL LBL 2
1004 CALL LBL 1
1005 FN 0: Q1652 = -27.5
1006 CALL LBL 3
1007 FN 0: Q1607 = +132 ; touch 132: block y- face +Z
1008 FN 0: Q1653 = -192.684
1009 CALL LBL 2
1010 CALL LBL 1
1011 FN 0: Q1651 = -212.684
1012 CALL LBL 3
1013 FN 0: Q1652 = -32.5
1014 CALL LBL 3
1015 FN 0: Q1607 = +133 ; touch 133: block y- face -X
1016 QS1601 = "block y- face -X"
1017 FN 0: Q1653 = -199.684
1018 CALL LBL 2
1019 FN 0: Q1661 = +4
1020 FN 0: Q1663 = +0
1021 CALL LBL 1
1022 FN 0: Q1607 = +134 ; touch 134: block y- face -X
1023 FN 0: Q1653 = -202.684
1024 CALL LBL 2
1025 CALL LBL 1
1026 FN 0: Q1652 = -27.5
1027 CALL LBL 3
1028 FN 0: Q1607 = +135 ; touch 135: block y- face -X
1029 FN 0: Q1653 = -199.684
1030 CALL LBL 2
1031 CALL LBL 1
1032 FN 0: Q1607 = +136 ; touch 136: block y- face -X
1033 FN 0: Q1653 = -202.684
1034 CALL LBL 2
1035 CALL LBL 1
1036 FN 0: Q1651 = -205.184
1037 CALL LBL 3
1038 FN 0: Q1652 = -20
1039 CALL LBL 3
1040 FN 0: Q1607 = +137 ; touch 137: block y- face +Y
1041 QS1601 = "block y- face +Y"
1042 FN 0: Q1653 = -201.184
1043 CALL LBL 2
1044 FN 0: Q1661 = +0
1045 FN 0: Q1662 = -4
1046 CALL LBL 1
1047 FN 0: Q1651 = -200.184
1048 CALL LBL 3
1049 FN 0: Q1607 = +138 ; touch 138: block y- face +Y
1050 FN 0: Q1653 = -201.184
1051 CALL LBL 2
1052 CALL LBL 1
1053 FN 0: Q1651 = -205.184
1054 CALL LBL 3
1055 FN 0: Q1652 = -40
1056 CALL LBL 3
1057 FN 0: Q1607 = +139 ; touch 139: block y- face -Y
1058 QS1601 = "block y- face -Y"
1059 FN 0: Q1653 = -201.184
1060 CALL LBL 2
1061 FN 0: Q1662 = +4
1062 CALL LBL 1
1063 FN 0: Q1651 = -200.184
1064 CALL LBL 3
1065 FN 0: Q1607 = +140 ; touch 140: block y- face -Y
1066 FN 0: Q1653 = -201.184
1067 CALL LBL 2
1068 CALL LBL 1
1069 FN 0: Q1651 = -205.684
1070 CALL LBL 3
1071 FN 0: Q1652 = +27.5
1072 CALL LBL 3
1073 FN 0: Q1607 = +141 ; touch 141: block y+ face +Z
1074 QS1601 = "block y+ face +Z"
1075 FN 0: Q1653 = -192.684
1076 CALL LBL 2
1077 FN 0: Q1662 = +0
1078 FN 0: Q1663 = -4
1079 FN 0: Q1665 = +300
1080 FN 0: Q1668 = +2
1081 CALL LBL 6
1082 CALL LBL 1
1083 FN 0: Q1652 = +32.5
1084 CALL LBL 3
1085 FN 0: Q1607 = +142 ; touch 142: block y+ face +Z
1086 FN 0: Q1653 = -192.684
1087 CALL LBL 2
1088 FN 0: Q1665 = +300
1089 CALL LBL 1
1090 FN 0: Q1651 = -202.684
1091 CALL LBL 3
1092 FN 0: Q1652 = +27.5
1093 CALL LBL 3
1094 FN 0: Q1607 = +143 ; touch 143: block y+ face +Z
1095 FN 0: Q1653 = -192.684
1096 CALL LBL 2
1097 CALL LBL 1
1098 FN 0: Q1652 = +32.5
1099 CALL LBL 3
1100 FN 0: Q1607 = +144 ; touch 144: block y+ face +Z
1101 FN 0: Q1653 = -192.684
1102 CALL LBL 2
1103 CALL LBL 1
1104 FN 0: Q1651 = -199.684
1105 CALL LBL 3
1106 FN 0: Q1652 = +27.5
1107 CALL LBL 3
1108 FN 0: Q1607 = +145 ; touch 145: block y+ face +Z
1109 FN 0: Q1653 = -192.684
1110 CALL LBL 2
1111 CALL LBL 1
1112 FN 0: Q1652 = +32.5
1113 CALL LBL 3
1114 FN 0: Q1607 = +146 ; touch 146: block y+ face +Z
1115 FN 0: Q1653 = -192.684
1116 CALL LBL 2
1117 CALL LBL 1
1118 FN 0: Q1651 = -212.684
1119 CALL LBL 3
1120 FN 0: Q1652 = +27.5
1121 CALL LBL 3
1122 FN 0: Q1607 = +147 ; touch 147: block y+ face -X
1123 QS1601 = "block y+ face -X"
1124 FN 0: Q1653 = -199.684
1125 CALL LBL 2
1126 FN 0: Q1661 = +4
1127 FN 0: Q1663 = +0
1128 CALL LBL 1
1129 FN 0: Q1607 = +148 ; touch 148: block y+ face -X
1130 FN 0: Q1653 = -202.684
1131 CALL LBL 2
1132 CALL LBL 1
1133 FN 0: Q1652 = +32.5
1134 CALL LBL 3
1135 FN 0: Q1607 = +149 ; touch 149: block y+ face -X
1136 FN 0: Q1653 = -199.684
1137 CALL LBL 2
1138 CALL LBL 1
1139 FN 0: Q1607 = +150 ; touch 150: block y+ face -X
1140 FN 0: Q1653 = -202.684
1141 CALL LBL 2
1142 CALL LBL 1
1143 FN 0: Q1651 = -205.184
1144 CALL LBL 3
1145 FN 0: Q1652 = +40
1146 CALL LBL 3
1147 FN 0: Q1607 = +151 ; touch 151: block y+ face +Y
1148 QS1601 = "block y+ face +Y"
1149 FN 0: Q1653 = -201.184
1150 CALL LBL 2
1151 FN 0: Q1661 = +0
1152 FN 0: Q1662 = -4
1153 CALL LBL 1
1154 FN 0: Q1651 = -200.184
1155 CALL LBL 3
1156 FN 0: Q1607 = +152 ; touch 152: block y+ face +Y
1157 FN 0: Q1653 = -201.184
1158 CALL LBL 2
1159 CALL LBL 1
1160 FN 0: Q1651 = -205.184
1161 CALL LBL 3
1162 FN 0: Q1652 = +20
1163 CALL LBL 3
1164 FN 0: Q1607 = +153 ; touch 153: block y+ face -Y
1165 QS1601 = "block y+ face -Y"
1166 FN 0: Q1653 = -201.184
1167 CALL LBL 2
1168 FN 0: Q1662 = +4
1169 CALL LBL 1
1170 FN 0: Q1651 = -200.184
1171 CALL LBL 3
1172 FN 0: Q1607 = +154 ; touch 154: block y+ face -Y
1173 FN 0: Q1653 = -201.184
1174 CALL LBL 2
1175 FN 0: Q1667 = -144.3
1176 CALL LBL 1
1177 FN 0: Q1653 = -15.8
1178 CALL LBL 3
1179 LBL 31
1180 ; set-up 3: head, B -30 C 0
1181 FN 11: IF +Q1600 GT +3 GOTO LBL 33
1182 FN 12: IF +Q1600 LT +3 GOTO LBL 34
1183 ; the blocks may have been moved: the first search of each is slow again
1184 L B-90 R0 FMAX M91
1185 L X-200.184 R0 FMAX M91
1186 L Y+20 R0 FMAX M91
1187 L Z-15.8 R0 FMAX M91
1188 LBL 34
1189 CYCL DEF 13.0 ORIENTATION
1190 CYCL DEF 13.1 ANGLE+0
1191 M19
1192 L B-30 R0 FMAX M91
1193 FN 0: Q1651 = -133.842
1194 FN 0: Q1652 = +20
1195 FN 0: Q1653 = -15.8
1196 CALL LBL 3
1197 FN 0: Q1652 = -2.5
1198 CALL LBL 3
1199 FN 0: Q1607 = +155 ; touch 155: block x- face +Z
1200 QS1601 = "block x- face +Z"
1201 FN 0: Q1653 = -17.1545
1202 CALL LBL 2
1203 FN 0: Q1661 = +0
1204 FN 0: Q1662 = +0
1205 FN 0: Q1663 = -4
1206 FN 0: Q1664 = +2
1207 FN 0: Q1665 = +300
1208 FN 0: Q1668 = +3
1209 CALL LBL 6
1210 FN 0: Q1666 = +60
1211 FN 0: Q1667 = -15.8
1212 CALL LBL 1
1213 FN 0: Q1652 = +2.5
1214 CALL LBL 3
1215 FN 0: Q1607 = +156 ; touch 156: block x- face +Z
1216 FN 0: Q1653 = -17.1545
1217 CALL LBL 2
1218 FN 0: Q1665 = +300
1219 CALL LBL 1
1220 FN 0: Q1651 = -128.842
1221 CALL LBL 3
1222 FN 0: Q1652 = -2.5
1223 CALL LBL 3
1224 FN 0: Q1607 = +157 ; touch 157: block x- face +Z
1225 FN 0: Q1653 = -17.1545
1226 CALL LBL 2
1227 CALL LBL 1
1228 FN 0: Q1652 = +2.5
1229 CALL LBL 3
1230 FN 0: Q1607 = +158 ; touch 158: block x- face +Z
1231 FN 0: Q1653 = -17.1545
1232 CALL LBL 2
1233 CALL LBL 1
1234 FN 0: Q1651 = -133.842
1235 CALL LBL 3
1236 FN 0: Q1652 = +10
1237 CALL LBL 3
1238 FN 0: Q1607 = +159 ; touch 159: block x- face +Y
1239 QS1601 = "block x- face +Y"
1240 FN 0: Q1653 = -24.1545
1241 CALL LBL 2
1242 FN 0: Q1662 = -4
1243 FN 0: Q1663 = +0
1244 CALL LBL 1
1245 FN 0: Q1607 = +160 ; touch 160: block x- face +Y
1246 FN 0: Q1653 = -27.1545
1247 CALL LBL 2
1248 CALL LBL 1
1249 FN 0: Q1651 = -128.842
1250 CALL LBL 3
1251 FN 0: Q1607 = +161 ; touch 161: block x- face +Y
1252 FN 0: Q1653 = -24.1545
1253 CALL LBL 2
1254 CALL LBL 1
1255 FN 0: Q1607 = +162 ; touch 162: block x- face +Y
1256 FN 0: Q1653 = -27.1545
1257 CALL LBL 2
1258 CALL LBL 1
1259 FN 0: Q1651 = -133.842
1260 CALL LBL 3
1261 FN 0: Q1652 = -10
1262 CALL LBL 3
1263 FN 0: Q1607 = +163 ; touch 163: block x- face -Y
1264 QS1601 = "block x- face -Y"
1265 FN 0: Q1653 = -24.1545
1266 CALL LBL 2
1267 FN 0: Q1662 = +4
1268 CALL LBL 1
1269 FN 0: Q1607 = +164 ; touch 164: block x- face -Y
1270 FN 0: Q1653 = -27.1545
1271 CALL LBL 2
1272 CALL LBL 1
1273 FN 0: Q1651 = -128.842
1274 CALL LBL 3
1275 FN 0: Q1607 = +165 ; touch 165: block x- face -Y
1276 FN 0: Q1653 = -24.1545
1277 CALL LBL 2
1278 CALL LBL 1
1279 FN 0: Q1607 = +166 ; touch 166: block x- face -Y
1280 FN 0: Q1653 = -27.1545
1281 CALL LBL 2
1282 CALL LBL 1
1283 FN 0: Q1651 = -73.842
1284 CALL LBL 3
1285 FN 0: Q1652 = -2.5
1286 CALL LBL 3
1287 FN 0: Q1607 = +167 ; touch 167: block x+ face +Z
1288 QS1601 = "block x+ face +Z"
1289 FN 0: Q1653 = -17.1545
1290 CALL LBL 2
1291 FN 0: Q1662 = +0
1292 FN 0: Q1663 = -4
1293 FN 0: Q1665 = +300
1294 FN 0: Q1668 = +2
1295 CALL LBL 6
1296 CALL LBL 1
1297 FN 0: Q1652 = +2.5
1298 CALL LBL 3
1299 FN 0: Q1607 = +168 ; touch 168: block x+ face +Z
1300 FN 0: Q1653 = -17.1545
1301 CALL LBL 2
1302 FN 0: Q1665 = +300
1303 CALL LBL 1
1304 FN 0: Q1651 = -68.842
1305 CALL LBL 3
1306 FN 0: Q1652 = -2.5
1307 CALL LBL 3
1308 FN 0: Q1607 = +169 ; touch 169: block x+ face +Z
1309 FN 0: Q1653 = -17.1545
1310 CALL LBL 2
1311 CALL LBL 1
1312 FN 0: Q1652 = +2.5
1313 CALL LBL 3
1314 FN 0: Q1607 = +170 ; touch 170: block x+ face +Z
1315 FN 0: Q1653 = -17.1545
1316 CALL LBL 2
1317 CALL LBL 1
1318 FN 0: Q1651 = -73.842
1319 CALL LBL 3
1320 FN 0: Q1652 = +10
1321 CALL LBL 3
1322 FN 0: Q1607 = +171 ; touch 171: block x+ face +Y
1323 QS1601 = "block x+ face +Y"
1324 FN 0: Q1653 = -24.1545
1325 CALL LBL 2
1326 FN 0: Q1662 = -4
1327 FN 0: Q1663 = +0
1328 CALL LBL 1
1329 FN 0: Q1607 = +172 ; touch 172: block x+ face +Y
1330 FN 0: Q1653 = -27.1545
1331 CALL LBL 2
1332 CALL LBL 1
1333 FN 0: Q1651 = -68.842
1334 CALL LBL 3
1335 FN 0: Q1607 = +173 ; touch 173: block x+ face +Y
1336 FN 0: Q1653 = -24.1545
1337 CALL LBL 2
1338 CALL LBL 1
1339 FN 0: Q1607 = +174 ; touch 174: block x+ face +Y
1340 FN 0: Q1653 = -27.1545
1341 CALL LBL 2
1342 CALL LBL 1
1343 FN 0: Q1651 = -73.842
1344 CALL LBL 3
1345 FN 0: Q1652 = -10
1346 CALL LBL 3
1347 FN 0: Q1607 = +175 ; touch 175: block x+ face -Y
1348 QS1601 = "block x+ face -Y"
1349 FN 0: Q1653 = -24.1545
1350 CALL LBL 2
1351 FN 0: Q1662 = +4
1352 CALL LBL 1
1353 FN 0: Q1607 = +176 ; touch 176: block x+ face -Y
1354 FN 0: Q1653 = -27.1545
1355 CALL LBL 2
1356 CALL LBL 1
1357 FN 0: Q1651 = -68.842
1358 CALL LBL 3
1359 FN 0: Q1607 = +177 ; touch 177: block x+ face -Y
1360 FN 0: Q1653 = -24.1545
1361 CALL LBL 2
1362 CALL LBL 1
1363 FN 0: Q1607 = +178 ; touch 178: block x+ face -Y
1364 FN 0: Q1653 = -27.1545
1365 CALL LBL 2
1366 CALL LBL 1
1367 FN 0: Q1651 = -103.842
1368 CALL LBL 3
1369 FN 0: Q1652 = -32.5
1370 CALL LBL 3
1371 FN 0: Q1607 = +179 ; touch 179: block y- face +Z
1372 QS1601 = "block y- face +Z"
1373 FN 0: Q1653 = -17.1545
1374 CALL LBL 2
1375 FN 0: Q1662 = +0
1376 FN 0: Q1663 = -4
1377 FN 0: Q1665 = +300
1378 FN 0: Q1668 = +3
1379 CALL LBL 6
1380 CALL LBL 1
1381 FN 0: Q1652 = -27.5
1382 CALL LBL 3
1383 FN 0: Q1607 = +180 ; touch 180: block y- face +Z
1384 FN 0: Q1653 = -17.1545
1385 CALL LBL 2
1386 FN 0: Q1665 = +300
1387 CALL LBL 1
1388 FN 0: Q1651 = -98.842
1389 CALL LBL 3
1390 FN 0: Q1652 = -32.5
1391 CALL LBL 3
1392 FN 0: Q1607 = +181 ; touch 181: block y- face +Z
1393 FN 0: Q1653 = -17.1545
1394 CALL LBL 2
1395 CALL LBL 1
1396 FN 0: Q1652 = -27.5
1397 CALL LBL 3
1398 FN 0: Q1607 = +182 ; touch 182: block y- face +Z
1399 FN 0: Q1653 = -17.1545
1400 CALL LBL 2
1401 CALL LBL 1
1402 FN 0: Q1651 = -103.842
1403 CALL LBL 3
1404 FN 0: Q1652 = -20
1405 CALL LBL 3
1406 FN 0: Q1607 = +183 ; touch 183: block y- face +Y
1407 QS1601 = "block y- face +Y"
1408 FN 0: Q1653 = -24.1545
1409 CALL LBL 2
1410 FN 0: Q1662 = -4
1411 FN 0: Q1663 = +0
1412 CALL LBL 1
1413 FN 0: Q1607 = +184 ; touch 184: block y- face +Y
1414 FN 0: Q1653 = -27.1545
1415 CALL LBL 2
1416 CALL LBL 1
1417 FN 0: Q1651 = -98.842
1418 CALL LBL 3
1419 FN 0: Q1607 = +185 ; touch 185: block y- face +Y
1420 FN 0: Q1653 = -24.1545
1421 CALL LBL 2
1422 CALL LBL 1
1423 FN 0: Q1607 = +186 ; touch 186: block y- face +Y
1424 FN 0: Q1653 = -27.1545
1425 CALL LBL 2
1426 CALL LBL 1
1427 FN 0: Q1651 = -103.842
1428 CALL LBL 3
1429 FN 0: Q1652 = -40
1430 CALL LBL 3
1431 FN 0: Q1607 = +187 ; touch 187: block y- face -Y
1432 QS1601 = "block y- face -Y"
1433 FN 0: Q1653 = -24.1545
1434 CALL LBL 2
1435 FN 0: Q1662 = +4
1436 CALL LBL 1
1437 FN 0: Q1607 = +188 ; touch 188: block y- face -Y
1438 FN 0: Q1653 = -27.1545
1439 CALL LBL 2
1440 CALL LBL 1
1441 FN 0: Q1651 = -98.842
1442 CALL LBL 3
1443 FN 0: Q1607 = +189 ; touch 189: block y- face -Y
1444 FN 0: Q1653 = -24.1545
1445 CALL LBL 2
1446 CALL LBL 1
1447 FN 0: Q1607 = +190 ; touch 190: block y- face -Y
1448 FN 0: Q1653 = -27.1545
1449 CALL LBL 2
1450 CALL LBL 1
1451 FN 0: Q1651 = -103.842
1452 CALL LBL 3
1453 FN 0: Q1652 = +27.5
1454 CALL LBL 3
1455 FN 0: Q1607 = +191 ; touch 191: block y+ face +Z
1456 QS1601 = "block y+ face +Z"
1457 FN 0: Q1653 = -17.1545
1458 CALL LBL 2
1459 FN 0: Q1662 = +0
1460 FN 0: Q1663 = -4
1461 FN 0: Q1665 = +300
1462 FN 0: Q1668 = +3
1463 CALL LBL 6
1464 CALL LBL 1
1465 FN 0: Q1652 = +32.5
1466 CALL LBL 3
1467 FN 0: Q1607 = +192 ; touch 192: block y+ face +Z
1468 FN 0: Q1653 = -17.1545
1469 CALL LBL 2
1470 FN 0: Q1665 = +300
1471 CALL LBL 1
1472 FN 0: Q1651 = -98.842
1473 CALL LBL 3
1474 FN 0: Q1652 = +27.5
1475 CALL LBL 3
1476 FN 0: Q1607 = +193 ; touch 193: block y+ face +Z
1477 FN 0: Q1653 = -17.1545
1478 CALL LBL 2
1479 CALL LBL 1
1480 FN 0: Q1652 = +32.5
1481 CALL LBL 3
1482 FN 0: Q1607 = +194 ; touch 194: block y+ face +Z
1483 FN 0: Q1653 = -17.1545
1484 CALL LBL 2
1485 CALL LBL 1
1486 FN 0: Q1651 = -103.842
1487 CALL LBL 3
1488 FN 0: Q1652 = +40
1489 CALL LBL 3
1490 FN 0: Q1607 = +195 ; touch 195: block y+ face +Y
1491 QS1601 = "block y+ face +Y"
1492 FN 0: Q1653 = -24.1545
1493 CALL LBL 2
1494 FN 0: Q1662 = -4
1495 FN 0: Q1663 = +0
1496 CALL LBL 1
1497 FN 0: Q1607 = +196 ; touch 196: block y+ face +Y
1498 FN 0: Q1653 = -27.1545
1499 CALL LBL 2
1500 CALL LBL 1
1501 FN 0: Q1651 = -98.842
1502 CALL LBL 3
1503 FN 0: Q1607 = +197 ; touch 197: block y+ face +Y
1504 FN 0: Q1653 = -24.1545
1505 CALL LBL 2
1506 CALL LBL 1
1507 FN 0: Q1607 = +198 ; touch 198: block y+ face +Y
1508 FN 0: Q1653 = -27.1545
1509 CALL LBL 2
1510 CALL LBL 1
1511 FN 0: Q1651 = -103.842
1512 CALL LBL 3
1513 FN 0: Q1652 = +20
1514 CALL LBL 3
1515 FN 0: Q1607 = +199 ; touch 199: block y+ face -Y
1516 QS1601 = "block y+ face -Y"
1517 FN 0: Q1653 = -24.1545
1518 CALL LBL 2
1519 FN 0: Q1662 = +4
1520 CALL LBL 1
1521 FN 0: Q1607 = +200 ; touch 200: block y+ face -Y
1522 FN 0: Q1653 = -27.1545
1523 CALL LBL 2
1524 CALL LBL 1
1525 FN 0: Q1651 = -98.842
1526 CALL LBL 3
1527 FN 0: Q1607 = +201 ; touch 201: block y+ face -Y
1528 FN 0: Q1653 = -24.1545
1529 CALL LBL 2
1530 CALL LBL 1
1531 FN 0: Q1607 = +202 ; touch 202: block y+ face -Y
1532 FN 0: Q1653 = -27.1545
1533 CALL LBL 2
1534 CALL LBL 1
1535 FN 0: Q1653 = +349
1536 CALL LBL 3
1537 LBL 33
1538 FN 11: IF +Q1610 GT +0 GOTO LBL 9
1539 FN 16: F-PRINT TNC:\AXISCAL\HEAD_E.A / TNC:\AXISCAL\HEAD.LOG
1540 LBL 9
1541 M5
1542 M30
1543 ; routine: one touch and back to where it began, then up along the lift
1544 LBL 1
1545 FN 9: IF +Q1610 EQU +0 GOTO LBL 10
1546 Q1651 = Q1651 + Q1661
1547 Q1652 = Q1652 + Q1662
1548 Q1653 = Q1653 + Q1663
1549 CALL LBL 2
1550 Q1651 = Q1651 - Q1661
1551 Q1652 = Q1652 - Q1662
1552 Q1653 = Q1653 - Q1663
1553 CALL LBL 2
1554 FN 9: IF +0 EQU +0 GOTO LBL 16
1555 LBL 10
1556 Q1681 = Q1661
1557 Q1682 = Q1662
1558 Q1683 = Q1663
1559 Q1684 = SQRT ( Q1681 * Q1681 + Q1682 * Q1682 + Q1683 * Q1683 )
1560 TCH PROBE 4.0 MEASURING IN 3-D
1561 TCH PROBE 4.1 Q1601
1562 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1563 TCH PROBE 4.3 DIST+Q1684 FQ1665 MB0.5 REFERENCE SYSTEM:1
1564 FN 9: IF +Q1604 EQU -1 GOTO LBL 11
1565 Q1605 = ( ( Q1601 - Q1654 ) * Q1681 + ( Q1602 - Q1655 ) * Q1682 + ( Q1603 - Q1656 ) * Q1683 ) / Q1684 - Q1664
1566 Q1615 = 0.05 - Q1664
1567 FN 12: IF +Q1605 LT +Q1615 GOTO LBL 12
1568 FN 11: IF +Q1605 GT +1 GOTO LBL 13
1569 FN 12: IF +Q1605 LT -1 GOTO LBL 13
1570 Q1615 = Q1684 - Q1664 - Q1605 + 0.5
1571 TCH PROBE 4.0 MEASURING IN 3-D
1572 TCH PROBE 4.1 Q1601
1573 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1574 TCH PROBE 4.3 DIST+Q1615 FQ1666 MB0.5 REFERENCE SYSTEM:1
1575 FN 9: IF +Q1604 EQU -1 GOTO LBL 11
1576 Q1606 = ( ( Q1601 - Q1654 ) * Q1681 + ( Q1602 - Q1655 ) * Q1682 + ( Q1603 - Q1656 ) * Q1683 ) / Q1684 - Q1664
1577 Q1606 = ABS ( Q1606 - Q1605 )
1578 FN 11: IF +Q1606 GT +0.25 GOTO LBL 14
1579 FN 0: Q1608 = +1
1580 Q1621 = Q1601 - 0
1581 Q1622 = Q1602 - 0
1582 Q1623 = Q1603 - 0
1583 FN 18: SYSREAD Q1625 = ID240 NR1 IDX5
1584 FN 18: SYSREAD Q1626 = ID240 NR1 IDX6
1585 FN 18: SYSREAD Q1612 = ID320 NR1 IDX0
1586 Q1612 = Q1612 - Q1613
1587 Q1609 = Q1607 + Q1608 + Q1612 + Q1621 + Q1622 + Q1623 + Q1625 + Q1626
1588 FN 16: F-PRINT TNC:\AXISCAL\HEAD_P.A / TNC:\AXISCAL\HEAD.LOG
1589 Q1614 = Q1664 + Q1605 - 0.5
1590 Q1681 = NEG Q1681
1591 Q1682 = NEG Q1682
1592 Q1683 = NEG Q1683
1593 TCH PROBE 4.0 MEASURING IN 3-D
1594 TCH PROBE 4.1 Q1601
1595 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1596 TCH PROBE 4.3 DIST+Q1614 FQ1699 MB0 REFERENCE SYSTEM:1
1597 FN 10: IF +Q1604 NE -1 GOTO LBL 15
1598 L X+Q1654 Y+Q1655 Z+Q1656 R0 FQ1699 M91
1599 LBL 16
1600 Q1653 = Q1667
1601 CALL LBL 2
1602 LBL 0
1603 LBL 11
1604 FN 0: Q1608 = +0
1605 FN 18: SYSREAD Q1621 = ID240 NR1 IDX1
1606 FN 18: SYSREAD Q1622 = ID240 NR1 IDX2
1607 FN 18: SYSREAD Q1623 = ID240 NR1 IDX3
1608 FN 18: SYSREAD Q1625 = ID240 NR1 IDX5
1609 FN 18: SYSREAD Q1626 = ID240 NR1 IDX6
1610 FN 18: SYSREAD Q1612 = ID320 NR1 IDX0
1611 Q1612 = Q1612 - Q1613
1612 Q1609 = Q1607 + Q1608 + Q1612 + Q1621 + Q1622 + Q1623 + Q1625 + Q1626
1613 FN 16: F-PRINT TNC:\AXISCAL\HEAD_P.A / TNC:\AXISCAL\HEAD.LOG
1614 QS1600 = "missed, no contact up to the end of the search"
1615 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1616 STOP
1617 FN 9: IF +0 EQU +0 GOTO LBL 9
1618 LBL 12
1619 QS1600 = "the probe was deflected before the search began"
1620 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1621 STOP
1622 FN 9: IF +0 EQU +0 GOTO LBL 9
1623 LBL 13
1624 QS1600 = "the block does not stand where it should, tolerance 1"
1625 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1626 STOP
1627 FN 9: IF +0 EQU +0 GOTO LBL 9
1628 LBL 14
1629 QS1600 = "search and measuring touch disagree: is the probe still deflected, is the block loose?"
1630 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1631 STOP
1632 FN 9: IF +0 EQU +0 GOTO LBL 9
1633 LBL 15
1634 QS1600 = "the probe triggered on the way, or was triggered before the move"
1635 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1636 STOP
1637 FN 9: IF +0 EQU +0 GOTO LBL 9
1638 ; routine: guarded move, contact stops the program
1639 LBL 2
1640 CALL LBL 5
1641 Q1681 = Q1671 - Q1654
1642 Q1682 = Q1672 - Q1655
1643 Q1683 = Q1673 - Q1656
1644 Q1684 = SQRT ( Q1681 * Q1681 + Q1682 * Q1682 + Q1683 * Q1683 )
1645 FN 12: IF +Q1684 LT +0.0001 GOTO LBL 17
1646 TCH PROBE 4.0 MEASURING IN 3-D
1647 TCH PROBE 4.1 Q1601
1648 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1649 TCH PROBE 4.3 DIST+Q1684 FQ1699 MB0 REFERENCE SYSTEM:1
1650 FN 10: IF +Q1604 NE -1 GOTO LBL 15
1651 L X+Q1671 Y+Q1672 Z+Q1673 R0 FQ1699 M91
1652 LBL 17
1653 Q1654 = Q1671
1654 Q1655 = Q1672
1655 Q1656 = Q1673
1656 LBL 0
1657 ; routine: rapid
1658 LBL 3
1659 CALL LBL 5
1660 L X+Q1671 Y+Q1672 Z+Q1673 R0 FMAX M91
1661 Q1654 = Q1671
1662 Q1655 = Q1672
1663 Q1656 = Q1673
1664 LBL 0
1665 ; routine: a run that starts again at set-up Q1668 or later meets the block first here, and searches
1666 ; slowly
1667 LBL 6
1668 FN 12: IF +Q1600 LT +Q1668 GOTO LBL 19
1669 FN 0: Q1665 = +60
1670 LBL 19
1671 LBL 0
1672 ; routine: where to, higher in the dry run
1673 LBL 5
1674 Q1671 = Q1651
1675 Q1672 = Q1652
1676 Q1673 = Q1653
1677 FN 9: IF +Q1610 EQU +0 GOTO LBL 18
1678 Q1673 = Q1673 + Q1610
1679 FN 12: IF +Q1673 LT +349 GOTO LBL 18
1680 FN 0: Q1673 = +349
1681 LBL 18
1682 LBL 0
1683 END PGM HEAD MM
