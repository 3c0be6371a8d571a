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
839 FN 0: Q1651 = +2.5
840 CALL LBL 3
841 FN 0: Q1652 = +20
842 CALL LBL 3
843 FN 0: Q1653 = +11.3
844 CALL LBL 3
845 LBL 32
846 CYCL DEF 13.0 ORIENTATION
847 CYCL DEF 13.1 ANGLE+0
848 M19
849 L B-90 R0 FMAX M91
850 FN 0: Q1651 = -235.684
851 FN 0: Q1652 = +20
852 FN 0: Q1653 = +11.3
853 CALL LBL 3
854 FN 0: Q1652 = -2.5
855 CALL LBL 3
856 FN 0: Q1653 = -144.3
857 CALL LBL 3
858 FN 0: Q1607 = +113 ; touch 113: block x- face +Z
859 QS1601 = "block x- face +Z"
860 FN 0: Q1653 = -192.684
861 CALL LBL 2
862 FN 0: Q1661 = +0
863 FN 0: Q1662 = +0
864 FN 0: Q1663 = -4
865 FN 0: Q1664 = +2
866 FN 0: Q1665 = +300
867 FN 0: Q1668 = +2
868 CALL LBL 6
869 FN 0: Q1666 = +60
870 FN 0: Q1667 = -191.3
871 CALL LBL 1
872 FN 0: Q1652 = +2.5
873 CALL LBL 3
874 FN 0: Q1607 = +114 ; touch 114: block x- face +Z
875 FN 0: Q1653 = -192.684
876 CALL LBL 2
877 FN 0: Q1665 = +300
878 CALL LBL 1
879 FN 0: Q1651 = -232.684
880 CALL LBL 3
881 FN 0: Q1652 = -2.5
882 CALL LBL 3
883 FN 0: Q1607 = +115 ; touch 115: block x- face +Z
884 FN 0: Q1653 = -192.684
885 CALL LBL 2
886 CALL LBL 1
887 FN 0: Q1652 = +2.5
888 CALL LBL 3
889 FN 0: Q1607 = +116 ; touch 116: block x- face +Z
890 FN 0: Q1653 = -192.684
891 CALL LBL 2
892 CALL LBL 1
893 FN 0: Q1651 = -229.684
894 CALL LBL 3
895 FN 0: Q1652 = -2.5
896 CALL LBL 3
897 FN 0: Q1607 = +117 ; touch 117: block x- face +Z
898 FN 0: Q1653 = -192.684
899 CALL LBL 2
900 CALL LBL 1
901 FN 0: Q1652 = +2.5
902 CALL LBL 3
903 FN 0: Q1607 = +118 ; touch 118: block x- face +Z
904 FN 0: Q1653 = -192.684
905 CALL LBL 2
906 CALL LBL 1
907 FN 0: Q1651 = -242.684
908 CALL LBL 3
909 FN 0: Q1652 = -2.5
910 CALL LBL 3
911 FN 0: Q1607 = +119 ; touch 119: block x- face -X
912 QS1601 = "block x- face -X"
913 FN 0: Q1653 = -199.684
914 CALL LBL 2
915 FN 0: Q1661 = +4
916 FN 0: Q1663 = +0
917 CALL LBL 1
918 FN 0: Q1607 = +120 ; touch 120: block x- face -X
919 FN 0: Q1653 = -202.684
920 CALL LBL 2
921 CALL LBL 1
922 FN 0: Q1652 = +2.5
923 CALL LBL 3
924 FN 0: Q1607 = +121 ; touch 121: block x- face -X
925 FN 0: Q1653 = -199.684
926 CALL LBL 2
927 CALL LBL 1
928 FN 0: Q1607 = +122 ; touch 122: block x- face -X
929 FN 0: Q1653 = -202.684
930 CALL LBL 2
931 CALL LBL 1
932 FN 0: Q1651 = -235.184
933 CALL LBL 3
934 FN 0: Q1652 = +10
935 CALL LBL 3
936 FN 0: Q1607 = +123 ; touch 123: block x- face +Y
937 QS1601 = "block x- face +Y"
938 FN 0: Q1653 = -201.184
939 CALL LBL 2
940 FN 0: Q1661 = +0
941 FN 0: Q1662 = -4
942 CALL LBL 1
943 FN 0: Q1651 = -230.184
944 CALL LBL 3
945 FN 0: Q1607 = +124 ; touch 124: block x- face +Y
946 FN 0: Q1653 = -201.184
947 CALL LBL 2
948 CALL LBL 1
949 FN 0: Q1651 = -235.184
950 CALL LBL 3
951 FN 0: Q1652 = -10
952 CALL LBL 3
953 FN 0: Q1607 = +125 ; touch 125: block x- face -Y
954 QS1601 = "block x- face -Y"
955 FN 0: Q1653 = -201.184
956 CALL LBL 2
957 FN 0: Q1662 = +4
958 CALL LBL 1
959 FN 0: Q1651 = -230.184
960 CALL LBL 3
961 FN 0: Q1607 = +126 ; touch 126: block x- face -Y
962 FN 0: Q1653 = -201.184
963 CALL LBL 2
964 CALL LBL 1
965 FN 0: Q1651 = -205.684
966 CALL LBL 3
967 FN 0: Q1652 = -32.5
968 CALL LBL 3
969 FN 0: Q1607 = +127 ; touch 127: block y- face +Z
970 QS1601 = "block y- face +Z"
971 FN 0: Q1653 = -192.684
972 CALL LBL 2
973 FN 0: Q1662 = +0
974 FN 0: Q1663 = -4
975 FN 0: Q1665 = +300
976 FN 0: Q1668 = +2
977 CALL LBL 6
978 CALL LBL 1
979 FN 0: Q1652 = -27.5
980 CALL LBL 3
981 FN 0: Q1607 = +128 ; touch 128: block y- face +Z
982 FN 0: Q1653 = -192.684
983 CALL LBL 2
984 FN 0: Q1665 = +300
985 CALL LBL 1
986 FN 0: Q1651 = -202.684
987 CALL LBL 3
988 FN 0: Q1652 = -32.5
989 CALL LBL 3
990 FN 0: Q1607 = +129 ; touch 129: block y- face +Z
991 FN 0: Q1653 = -192.684
992 CALL LBL 2
993 CALL LBL 1
994 FN 0: Q1652 = -27.5
995 CALL LBL 3
996 FN 0: Q1607 = +130 ; touch 130: block y- face +Z
997 FN 0: Q1653 = -192.684
998 CALL LBL 2
999 CALL LBL 1
1000 FN 0: Q1651 = -199.684
1001 CALL LBL 3
1002 FN 0: Q1652 = -32.5
1003 CALL LBL 3
1004 FN 0: Q1607 = +131 ; touch 131: block y- face +Z
1005 FN 0: Q1653 = -192.684
1006 CALL LBL 2
1007 CALL LBL 1
1008 FN 0: Q1652 = -27.5
1009 CALL LBL 3
1010 FN 0: Q1607 = +132 ; touch 132: block y- face +Z
1011 FN 0: Q1653 = -192.684
1012 CALL LBL 2
1013 CALL LBL 1
1014 FN 0: Q1651 = -212.684
1015 CALL LBL 3
1016 FN 0: Q1652 = -32.5
1017 CALL LBL 3
1018 FN 0: Q1607 = +133 ; touch 133: block y- face -X
1019 QS1601 = "block y- face -X"
1020 FN 0: Q1653 = -199.684
1021 CALL LBL 2
1022 FN 0: Q1661 = +4
1023 FN 0: Q1663 = +0
1024 CALL LBL 1
1025 FN 0: Q1607 = +134 ; touch 134: block y- face -X
1026 FN 0: Q1653 = -202.684
1027 CALL LBL 2
1028 CALL LBL 1
1029 FN 0: Q1652 = -27.5
1030 CALL LBL 3
1031 FN 0: Q1607 = +135 ; touch 135: block y- face -X
1032 FN 0: Q1653 = -199.684
1033 CALL LBL 2
1034 CALL LBL 1
1035 FN 0: Q1607 = +136 ; touch 136: block y- face -X
1036 FN 0: Q1653 = -202.684
1037 CALL LBL 2
1038 CALL LBL 1
1039 FN 0: Q1651 = -205.184
1040 CALL LBL 3
1041 FN 0: Q1652 = -20
1042 CALL LBL 3
1043 FN 0: Q1607 = +137 ; touch 137: block y- face +Y
1044 QS1601 = "block y- face +Y"
1045 FN 0: Q1653 = -201.184
1046 CALL LBL 2
1047 FN 0: Q1661 = +0
1048 FN 0: Q1662 = -4
1049 CALL LBL 1
1050 FN 0: Q1651 = -200.184
1051 CALL LBL 3
1052 FN 0: Q1607 = +138 ; touch 138: block y- face +Y
1053 FN 0: Q1653 = -201.184
1054 CALL LBL 2
1055 CALL LBL 1
1056 FN 0: Q1651 = -205.184
1057 CALL LBL 3
1058 FN 0: Q1652 = -40
1059 CALL LBL 3
1060 FN 0: Q1607 = +139 ; touch 139: block y- face -Y
1061 QS1601 = "block y- face -Y"
1062 FN 0: Q1653 = -201.184
1063 CALL LBL 2
1064 FN 0: Q1662 = +4
1065 CALL LBL 1
1066 FN 0: Q1651 = -200.184
1067 CALL LBL 3
1068 FN 0: Q1607 = +140 ; touch 140: block y- face -Y
1069 FN 0: Q1653 = -201.184
1070 CALL LBL 2
1071 CALL LBL 1
1072 FN 0: Q1651 = -205.684
1073 CALL LBL 3
1074 FN 0: Q1652 = +27.5
1075 CALL LBL 3
1076 FN 0: Q1607 = +141 ; touch 141: block y+ face +Z
1077 QS1601 = "block y+ face +Z"
1078 FN 0: Q1653 = -192.684
1079 CALL LBL 2
1080 FN 0: Q1662 = +0
1081 FN 0: Q1663 = -4
1082 FN 0: Q1665 = +300
1083 FN 0: Q1668 = +2
1084 CALL LBL 6
1085 CALL LBL 1
1086 FN 0: Q1652 = +32.5
1087 CALL LBL 3
1088 FN 0: Q1607 = +142 ; touch 142: block y+ face +Z
1089 FN 0: Q1653 = -192.684
1090 CALL LBL 2
1091 FN 0: Q1665 = +300
1092 CALL LBL 1
1093 FN 0: Q1651 = -202.684
1094 CALL LBL 3
1095 FN 0: Q1652 = +27.5
1096 CALL LBL 3
1097 FN 0: Q1607 = +143 ; touch 143: block y+ face +Z
1098 FN 0: Q1653 = -192.684
1099 CALL LBL 2
1100 CALL LBL 1
1101 FN 0: Q1652 = +32.5
1102 CALL LBL 3
1103 FN 0: Q1607 = +144 ; touch 144: block y+ face +Z
1104 FN 0: Q1653 = -192.684
1105 CALL LBL 2
1106 CALL LBL 1
1107 FN 0: Q1651 = -199.684
1108 CALL LBL 3
1109 FN 0: Q1652 = +27.5
1110 CALL LBL 3
1111 FN 0: Q1607 = +145 ; touch 145: block y+ face +Z
1112 FN 0: Q1653 = -192.684
1113 CALL LBL 2
1114 CALL LBL 1
1115 FN 0: Q1652 = +32.5
1116 CALL LBL 3
1117 FN 0: Q1607 = +146 ; touch 146: block y+ face +Z
1118 FN 0: Q1653 = -192.684
1119 CALL LBL 2
1120 CALL LBL 1
1121 FN 0: Q1651 = -212.684
1122 CALL LBL 3
1123 FN 0: Q1652 = +27.5
1124 CALL LBL 3
1125 FN 0: Q1607 = +147 ; touch 147: block y+ face -X
1126 QS1601 = "block y+ face -X"
1127 FN 0: Q1653 = -199.684
1128 CALL LBL 2
1129 FN 0: Q1661 = +4
1130 FN 0: Q1663 = +0
1131 CALL LBL 1
1132 FN 0: Q1607 = +148 ; touch 148: block y+ face -X
1133 FN 0: Q1653 = -202.684
1134 CALL LBL 2
1135 CALL LBL 1
1136 FN 0: Q1652 = +32.5
1137 CALL LBL 3
1138 FN 0: Q1607 = +149 ; touch 149: block y+ face -X
1139 FN 0: Q1653 = -199.684
1140 CALL LBL 2
1141 CALL LBL 1
1142 FN 0: Q1607 = +150 ; touch 150: block y+ face -X
1143 FN 0: Q1653 = -202.684
1144 CALL LBL 2
1145 CALL LBL 1
1146 FN 0: Q1651 = -205.184
1147 CALL LBL 3
1148 FN 0: Q1652 = +40
1149 CALL LBL 3
1150 FN 0: Q1607 = +151 ; touch 151: block y+ face +Y
1151 QS1601 = "block y+ face +Y"
1152 FN 0: Q1653 = -201.184
1153 CALL LBL 2
1154 FN 0: Q1661 = +0
1155 FN 0: Q1662 = -4
1156 CALL LBL 1
1157 FN 0: Q1651 = -200.184
1158 CALL LBL 3
1159 FN 0: Q1607 = +152 ; touch 152: block y+ face +Y
1160 FN 0: Q1653 = -201.184
1161 CALL LBL 2
1162 CALL LBL 1
1163 FN 0: Q1651 = -205.184
1164 CALL LBL 3
1165 FN 0: Q1652 = +20
1166 CALL LBL 3
1167 FN 0: Q1607 = +153 ; touch 153: block y+ face -Y
1168 QS1601 = "block y+ face -Y"
1169 FN 0: Q1653 = -201.184
1170 CALL LBL 2
1171 FN 0: Q1662 = +4
1172 CALL LBL 1
1173 FN 0: Q1651 = -200.184
1174 CALL LBL 3
1175 FN 0: Q1607 = +154 ; touch 154: block y+ face -Y
1176 FN 0: Q1653 = -201.184
1177 CALL LBL 2
1178 FN 0: Q1667 = -144.3
1179 CALL LBL 1
1180 FN 0: Q1653 = -15.8
1181 CALL LBL 3
1182 LBL 31
1183 ; set-up 3: head, B -30 C 0
1184 FN 11: IF +Q1600 GT +3 GOTO LBL 33
1185 FN 12: IF +Q1600 LT +3 GOTO LBL 34
1186 ; the blocks may have been moved: the first search of each is slow again
1187 L B-90 R0 FMAX M91
1188 FN 0: Q1651 = -200.184
1189 CALL LBL 3
1190 FN 0: Q1652 = +20
1191 CALL LBL 3
1192 FN 0: Q1653 = -15.8
1193 CALL LBL 3
1194 LBL 34
1195 CYCL DEF 13.0 ORIENTATION
1196 CYCL DEF 13.1 ANGLE+0
1197 M19
1198 L B-30 R0 FMAX M91
1199 FN 0: Q1651 = -133.842
1200 FN 0: Q1652 = +20
1201 FN 0: Q1653 = -15.8
1202 CALL LBL 3
1203 FN 0: Q1652 = -2.5
1204 CALL LBL 3
1205 FN 0: Q1607 = +155 ; touch 155: block x- face +Z
1206 QS1601 = "block x- face +Z"
1207 FN 0: Q1653 = -17.1545
1208 CALL LBL 2
1209 FN 0: Q1661 = +0
1210 FN 0: Q1662 = +0
1211 FN 0: Q1663 = -4
1212 FN 0: Q1664 = +2
1213 FN 0: Q1665 = +300
1214 FN 0: Q1668 = +3
1215 CALL LBL 6
1216 FN 0: Q1666 = +60
1217 FN 0: Q1667 = -15.8
1218 CALL LBL 1
1219 FN 0: Q1652 = +2.5
1220 CALL LBL 3
1221 FN 0: Q1607 = +156 ; touch 156: block x- face +Z
1222 FN 0: Q1653 = -17.1545
1223 CALL LBL 2
1224 FN 0: Q1665 = +300
1225 CALL LBL 1
1226 FN 0: Q1651 = -128.842
1227 CALL LBL 3
1228 FN 0: Q1652 = -2.5
1229 CALL LBL 3
1230 FN 0: Q1607 = +157 ; touch 157: block x- face +Z
1231 FN 0: Q1653 = -17.1545
1232 CALL LBL 2
1233 CALL LBL 1
1234 FN 0: Q1652 = +2.5
1235 CALL LBL 3
1236 FN 0: Q1607 = +158 ; touch 158: block x- face +Z
1237 FN 0: Q1653 = -17.1545
1238 CALL LBL 2
1239 CALL LBL 1
1240 FN 0: Q1651 = -133.842
1241 CALL LBL 3
1242 FN 0: Q1652 = +10
1243 CALL LBL 3
1244 FN 0: Q1607 = +159 ; touch 159: block x- face +Y
1245 QS1601 = "block x- face +Y"
1246 FN 0: Q1653 = -24.1545
1247 CALL LBL 2
1248 FN 0: Q1662 = -4
1249 FN 0: Q1663 = +0
1250 CALL LBL 1
1251 FN 0: Q1607 = +160 ; touch 160: block x- face +Y
1252 FN 0: Q1653 = -27.1545
1253 CALL LBL 2
1254 CALL LBL 1
1255 FN 0: Q1651 = -128.842
1256 CALL LBL 3
1257 FN 0: Q1607 = +161 ; touch 161: block x- face +Y
1258 FN 0: Q1653 = -24.1545
1259 CALL LBL 2
1260 CALL LBL 1
1261 FN 0: Q1607 = +162 ; touch 162: block x- face +Y
1262 FN 0: Q1653 = -27.1545
1263 CALL LBL 2
1264 CALL LBL 1
1265 FN 0: Q1651 = -133.842
1266 CALL LBL 3
1267 FN 0: Q1652 = -10
1268 CALL LBL 3
1269 FN 0: Q1607 = +163 ; touch 163: block x- face -Y
1270 QS1601 = "block x- face -Y"
1271 FN 0: Q1653 = -24.1545
1272 CALL LBL 2
1273 FN 0: Q1662 = +4
1274 CALL LBL 1
1275 FN 0: Q1607 = +164 ; touch 164: block x- face -Y
1276 FN 0: Q1653 = -27.1545
1277 CALL LBL 2
1278 CALL LBL 1
1279 FN 0: Q1651 = -128.842
1280 CALL LBL 3
1281 FN 0: Q1607 = +165 ; touch 165: block x- face -Y
1282 FN 0: Q1653 = -24.1545
1283 CALL LBL 2
1284 CALL LBL 1
1285 FN 0: Q1607 = +166 ; touch 166: block x- face -Y
1286 FN 0: Q1653 = -27.1545
1287 CALL LBL 2
1288 CALL LBL 1
1289 FN 0: Q1651 = -73.842
1290 CALL LBL 3
1291 FN 0: Q1652 = -2.5
1292 CALL LBL 3
1293 FN 0: Q1607 = +167 ; touch 167: block x+ face +Z
1294 QS1601 = "block x+ face +Z"
1295 FN 0: Q1653 = -17.1545
1296 CALL LBL 2
1297 FN 0: Q1662 = +0
1298 FN 0: Q1663 = -4
1299 FN 0: Q1665 = +300
1300 FN 0: Q1668 = +2
1301 CALL LBL 6
1302 CALL LBL 1
1303 FN 0: Q1652 = +2.5
1304 CALL LBL 3
1305 FN 0: Q1607 = +168 ; touch 168: block x+ face +Z
1306 FN 0: Q1653 = -17.1545
1307 CALL LBL 2
1308 FN 0: Q1665 = +300
1309 CALL LBL 1
1310 FN 0: Q1651 = -68.842
1311 CALL LBL 3
1312 FN 0: Q1652 = -2.5
1313 CALL LBL 3
1314 FN 0: Q1607 = +169 ; touch 169: block x+ face +Z
1315 FN 0: Q1653 = -17.1545
1316 CALL LBL 2
1317 CALL LBL 1
1318 FN 0: Q1652 = +2.5
1319 CALL LBL 3
1320 FN 0: Q1607 = +170 ; touch 170: block x+ face +Z
1321 FN 0: Q1653 = -17.1545
1322 CALL LBL 2
1323 CALL LBL 1
1324 FN 0: Q1651 = -73.842
1325 CALL LBL 3
1326 FN 0: Q1652 = +10
1327 CALL LBL 3
1328 FN 0: Q1607 = +171 ; touch 171: block x+ face +Y
1329 QS1601 = "block x+ face +Y"
1330 FN 0: Q1653 = -24.1545
1331 CALL LBL 2
1332 FN 0: Q1662 = -4
1333 FN 0: Q1663 = +0
1334 CALL LBL 1
1335 FN 0: Q1607 = +172 ; touch 172: block x+ face +Y
1336 FN 0: Q1653 = -27.1545
1337 CALL LBL 2
1338 CALL LBL 1
1339 FN 0: Q1651 = -68.842
1340 CALL LBL 3
1341 FN 0: Q1607 = +173 ; touch 173: block x+ face +Y
1342 FN 0: Q1653 = -24.1545
1343 CALL LBL 2
1344 CALL LBL 1
1345 FN 0: Q1607 = +174 ; touch 174: block x+ face +Y
1346 FN 0: Q1653 = -27.1545
1347 CALL LBL 2
1348 CALL LBL 1
1349 FN 0: Q1651 = -73.842
1350 CALL LBL 3
1351 FN 0: Q1652 = -10
1352 CALL LBL 3
1353 FN 0: Q1607 = +175 ; touch 175: block x+ face -Y
1354 QS1601 = "block x+ face -Y"
1355 FN 0: Q1653 = -24.1545
1356 CALL LBL 2
1357 FN 0: Q1662 = +4
1358 CALL LBL 1
1359 FN 0: Q1607 = +176 ; touch 176: block x+ face -Y
1360 FN 0: Q1653 = -27.1545
1361 CALL LBL 2
1362 CALL LBL 1
1363 FN 0: Q1651 = -68.842
1364 CALL LBL 3
1365 FN 0: Q1607 = +177 ; touch 177: block x+ face -Y
1366 FN 0: Q1653 = -24.1545
1367 CALL LBL 2
1368 CALL LBL 1
1369 FN 0: Q1607 = +178 ; touch 178: block x+ face -Y
1370 FN 0: Q1653 = -27.1545
1371 CALL LBL 2
1372 CALL LBL 1
1373 FN 0: Q1651 = -103.842
1374 CALL LBL 3
1375 FN 0: Q1652 = -32.5
1376 CALL LBL 3
1377 FN 0: Q1607 = +179 ; touch 179: block y- face +Z
1378 QS1601 = "block y- face +Z"
1379 FN 0: Q1653 = -17.1545
1380 CALL LBL 2
1381 FN 0: Q1662 = +0
1382 FN 0: Q1663 = -4
1383 FN 0: Q1665 = +300
1384 FN 0: Q1668 = +3
1385 CALL LBL 6
1386 CALL LBL 1
1387 FN 0: Q1652 = -27.5
1388 CALL LBL 3
1389 FN 0: Q1607 = +180 ; touch 180: block y- face +Z
1390 FN 0: Q1653 = -17.1545
1391 CALL LBL 2
1392 FN 0: Q1665 = +300
1393 CALL LBL 1
1394 FN 0: Q1651 = -98.842
1395 CALL LBL 3
1396 FN 0: Q1652 = -32.5
1397 CALL LBL 3
1398 FN 0: Q1607 = +181 ; touch 181: block y- face +Z
1399 FN 0: Q1653 = -17.1545
1400 CALL LBL 2
1401 CALL LBL 1
1402 FN 0: Q1652 = -27.5
1403 CALL LBL 3
1404 FN 0: Q1607 = +182 ; touch 182: block y- face +Z
1405 FN 0: Q1653 = -17.1545
1406 CALL LBL 2
1407 CALL LBL 1
1408 FN 0: Q1651 = -103.842
1409 CALL LBL 3
1410 FN 0: Q1652 = -20
1411 CALL LBL 3
1412 FN 0: Q1607 = +183 ; touch 183: block y- face +Y
1413 QS1601 = "block y- face +Y"
1414 FN 0: Q1653 = -24.1545
1415 CALL LBL 2
1416 FN 0: Q1662 = -4
1417 FN 0: Q1663 = +0
1418 CALL LBL 1
1419 FN 0: Q1607 = +184 ; touch 184: block y- face +Y
1420 FN 0: Q1653 = -27.1545
1421 CALL LBL 2
1422 CALL LBL 1
1423 FN 0: Q1651 = -98.842
1424 CALL LBL 3
1425 FN 0: Q1607 = +185 ; touch 185: block y- face +Y
1426 FN 0: Q1653 = -24.1545
1427 CALL LBL 2
1428 CALL LBL 1
1429 FN 0: Q1607 = +186 ; touch 186: block y- face +Y
1430 FN 0: Q1653 = -27.1545
1431 CALL LBL 2
1432 CALL LBL 1
1433 FN 0: Q1651 = -103.842
1434 CALL LBL 3
1435 FN 0: Q1652 = -40
1436 CALL LBL 3
1437 FN 0: Q1607 = +187 ; touch 187: block y- face -Y
1438 QS1601 = "block y- face -Y"
1439 FN 0: Q1653 = -24.1545
1440 CALL LBL 2
1441 FN 0: Q1662 = +4
1442 CALL LBL 1
1443 FN 0: Q1607 = +188 ; touch 188: block y- face -Y
1444 FN 0: Q1653 = -27.1545
1445 CALL LBL 2
1446 CALL LBL 1
1447 FN 0: Q1651 = -98.842
1448 CALL LBL 3
1449 FN 0: Q1607 = +189 ; touch 189: block y- face -Y
1450 FN 0: Q1653 = -24.1545
1451 CALL LBL 2
1452 CALL LBL 1
1453 FN 0: Q1607 = +190 ; touch 190: block y- face -Y
1454 FN 0: Q1653 = -27.1545
1455 CALL LBL 2
1456 CALL LBL 1
1457 FN 0: Q1651 = -103.842
1458 CALL LBL 3
1459 FN 0: Q1652 = +27.5
1460 CALL LBL 3
1461 FN 0: Q1607 = +191 ; touch 191: block y+ face +Z
1462 QS1601 = "block y+ face +Z"
1463 FN 0: Q1653 = -17.1545
1464 CALL LBL 2
1465 FN 0: Q1662 = +0
1466 FN 0: Q1663 = -4
1467 FN 0: Q1665 = +300
1468 FN 0: Q1668 = +3
1469 CALL LBL 6
1470 CALL LBL 1
1471 FN 0: Q1652 = +32.5
1472 CALL LBL 3
1473 FN 0: Q1607 = +192 ; touch 192: block y+ face +Z
1474 FN 0: Q1653 = -17.1545
1475 CALL LBL 2
1476 FN 0: Q1665 = +300
1477 CALL LBL 1
1478 FN 0: Q1651 = -98.842
1479 CALL LBL 3
1480 FN 0: Q1652 = +27.5
1481 CALL LBL 3
1482 FN 0: Q1607 = +193 ; touch 193: block y+ face +Z
1483 FN 0: Q1653 = -17.1545
1484 CALL LBL 2
1485 CALL LBL 1
1486 FN 0: Q1652 = +32.5
1487 CALL LBL 3
1488 FN 0: Q1607 = +194 ; touch 194: block y+ face +Z
1489 FN 0: Q1653 = -17.1545
1490 CALL LBL 2
1491 CALL LBL 1
1492 FN 0: Q1651 = -103.842
1493 CALL LBL 3
1494 FN 0: Q1652 = +40
1495 CALL LBL 3
1496 FN 0: Q1607 = +195 ; touch 195: block y+ face +Y
1497 QS1601 = "block y+ face +Y"
1498 FN 0: Q1653 = -24.1545
1499 CALL LBL 2
1500 FN 0: Q1662 = -4
1501 FN 0: Q1663 = +0
1502 CALL LBL 1
1503 FN 0: Q1607 = +196 ; touch 196: block y+ face +Y
1504 FN 0: Q1653 = -27.1545
1505 CALL LBL 2
1506 CALL LBL 1
1507 FN 0: Q1651 = -98.842
1508 CALL LBL 3
1509 FN 0: Q1607 = +197 ; touch 197: block y+ face +Y
1510 FN 0: Q1653 = -24.1545
1511 CALL LBL 2
1512 CALL LBL 1
1513 FN 0: Q1607 = +198 ; touch 198: block y+ face +Y
1514 FN 0: Q1653 = -27.1545
1515 CALL LBL 2
1516 CALL LBL 1
1517 FN 0: Q1651 = -103.842
1518 CALL LBL 3
1519 FN 0: Q1652 = +20
1520 CALL LBL 3
1521 FN 0: Q1607 = +199 ; touch 199: block y+ face -Y
1522 QS1601 = "block y+ face -Y"
1523 FN 0: Q1653 = -24.1545
1524 CALL LBL 2
1525 FN 0: Q1662 = +4
1526 CALL LBL 1
1527 FN 0: Q1607 = +200 ; touch 200: block y+ face -Y
1528 FN 0: Q1653 = -27.1545
1529 CALL LBL 2
1530 CALL LBL 1
1531 FN 0: Q1651 = -98.842
1532 CALL LBL 3
1533 FN 0: Q1607 = +201 ; touch 201: block y+ face -Y
1534 FN 0: Q1653 = -24.1545
1535 CALL LBL 2
1536 CALL LBL 1
1537 FN 0: Q1607 = +202 ; touch 202: block y+ face -Y
1538 FN 0: Q1653 = -27.1545
1539 CALL LBL 2
1540 CALL LBL 1
1541 FN 0: Q1653 = +349
1542 CALL LBL 3
1543 LBL 33
1544 FN 11: IF +Q1610 GT +0 GOTO LBL 9
1545 FN 16: F-PRINT TNC:\AXISCAL\HEAD_E.A / TNC:\AXISCAL\HEAD.LOG
1546 LBL 9
1547 M5
1548 M30
1549 ; routine: one touch and back to where it began, then up along the lift
1550 LBL 1
1551 FN 9: IF +Q1610 EQU +0 GOTO LBL 10
1552 Q1651 = Q1651 + Q1661
1553 Q1652 = Q1652 + Q1662
1554 Q1653 = Q1653 + Q1663
1555 CALL LBL 2
1556 Q1651 = Q1651 - Q1661
1557 Q1652 = Q1652 - Q1662
1558 Q1653 = Q1653 - Q1663
1559 CALL LBL 2
1560 FN 9: IF +0 EQU +0 GOTO LBL 16
1561 LBL 10
1562 Q1681 = Q1661
1563 Q1682 = Q1662
1564 Q1683 = Q1663
1565 Q1684 = SQRT ( Q1681 * Q1681 + Q1682 * Q1682 + Q1683 * Q1683 )
1566 TCH PROBE 4.0 MEASURING IN 3-D
1567 TCH PROBE 4.1 Q1601
1568 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1569 TCH PROBE 4.3 DIST+Q1684 FQ1665 MB0.5 REFERENCE SYSTEM:1
1570 FN 9: IF +Q1604 EQU -1 GOTO LBL 11
1571 Q1605 = ( ( Q1601 - Q1654 ) * Q1681 + ( Q1602 - Q1655 ) * Q1682 + ( Q1603 - Q1656 ) * Q1683 ) / Q1684 - Q1664
1572 Q1615 = 0.05 - Q1664
1573 FN 12: IF +Q1605 LT +Q1615 GOTO LBL 12
1574 FN 11: IF +Q1605 GT +1 GOTO LBL 13
1575 FN 12: IF +Q1605 LT -1 GOTO LBL 13
1576 Q1615 = Q1684 - Q1664 - Q1605 + 0.5
1577 TCH PROBE 4.0 MEASURING IN 3-D
1578 TCH PROBE 4.1 Q1601
1579 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1580 TCH PROBE 4.3 DIST+Q1615 FQ1666 MB0.5 REFERENCE SYSTEM:1
1581 FN 9: IF +Q1604 EQU -1 GOTO LBL 11
1582 Q1606 = ( ( Q1601 - Q1654 ) * Q1681 + ( Q1602 - Q1655 ) * Q1682 + ( Q1603 - Q1656 ) * Q1683 ) / Q1684 - Q1664
1583 Q1606 = ABS ( Q1606 - Q1605 )
1584 FN 11: IF +Q1606 GT +0.25 GOTO LBL 14
1585 FN 0: Q1608 = +1
1586 Q1621 = Q1601 - 0
1587 Q1622 = Q1602 - 0
1588 Q1623 = Q1603 - 0
1589 FN 18: SYSREAD Q1625 = ID240 NR1 IDX5
1590 FN 18: SYSREAD Q1626 = ID240 NR1 IDX6
1591 FN 18: SYSREAD Q1612 = ID320 NR1 IDX0
1592 Q1612 = Q1612 - Q1613
1593 Q1609 = Q1607 + Q1608 + Q1612 + Q1621 + Q1622 + Q1623 + Q1625 + Q1626
1594 FN 16: F-PRINT TNC:\AXISCAL\HEAD_P.A / TNC:\AXISCAL\HEAD.LOG
1595 Q1614 = Q1664 + Q1605 - 0.5
1596 Q1681 = NEG Q1681
1597 Q1682 = NEG Q1682
1598 Q1683 = NEG Q1683
1599 TCH PROBE 4.0 MEASURING IN 3-D
1600 TCH PROBE 4.1 Q1601
1601 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1602 TCH PROBE 4.3 DIST+Q1614 FQ1699 MB0 REFERENCE SYSTEM:1
1603 FN 10: IF +Q1604 NE -1 GOTO LBL 15
1604 L X+Q1654 Y+Q1655 Z+Q1656 R0 FQ1699 M91
1605 LBL 16
1606 Q1653 = Q1667
1607 CALL LBL 2
1608 LBL 0
1609 LBL 11
1610 FN 0: Q1608 = +0
1611 FN 18: SYSREAD Q1621 = ID240 NR1 IDX1
1612 FN 18: SYSREAD Q1622 = ID240 NR1 IDX2
1613 FN 18: SYSREAD Q1623 = ID240 NR1 IDX3
1614 FN 18: SYSREAD Q1625 = ID240 NR1 IDX5
1615 FN 18: SYSREAD Q1626 = ID240 NR1 IDX6
1616 FN 18: SYSREAD Q1612 = ID320 NR1 IDX0
1617 Q1612 = Q1612 - Q1613
1618 Q1609 = Q1607 + Q1608 + Q1612 + Q1621 + Q1622 + Q1623 + Q1625 + Q1626
1619 FN 16: F-PRINT TNC:\AXISCAL\HEAD_P.A / TNC:\AXISCAL\HEAD.LOG
1620 QS1600 = "missed, no contact up to the end of the search"
1621 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1622 STOP
1623 FN 9: IF +0 EQU +0 GOTO LBL 9
1624 LBL 12
1625 QS1600 = "the probe was deflected before the search began"
1626 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1627 STOP
1628 FN 9: IF +0 EQU +0 GOTO LBL 9
1629 LBL 13
1630 QS1600 = "the block does not stand where it should, tolerance 1"
1631 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1632 STOP
1633 FN 9: IF +0 EQU +0 GOTO LBL 9
1634 LBL 14
1635 QS1600 = "search and measuring touch disagree: is the probe still deflected, is the block loose?"
1636 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1637 STOP
1638 FN 9: IF +0 EQU +0 GOTO LBL 9
1639 LBL 15
1640 QS1600 = "the probe triggered on the way, or was triggered before the move"
1641 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1642 STOP
1643 FN 9: IF +0 EQU +0 GOTO LBL 9
1644 ; routine: guarded move, contact stops the program
1645 LBL 2
1646 CALL LBL 5
1647 Q1681 = Q1671 - Q1654
1648 Q1682 = Q1672 - Q1655
1649 Q1683 = Q1673 - Q1656
1650 Q1684 = SQRT ( Q1681 * Q1681 + Q1682 * Q1682 + Q1683 * Q1683 )
1651 FN 12: IF +Q1684 LT +0.0001 GOTO LBL 17
1652 TCH PROBE 4.0 MEASURING IN 3-D
1653 TCH PROBE 4.1 Q1601
1654 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1655 TCH PROBE 4.3 DIST+Q1684 FQ1699 MB0 REFERENCE SYSTEM:1
1656 FN 10: IF +Q1604 NE -1 GOTO LBL 15
1657 L X+Q1671 Y+Q1672 Z+Q1673 R0 FQ1699 M91
1658 LBL 17
1659 Q1654 = Q1671
1660 Q1655 = Q1672
1661 Q1656 = Q1673
1662 LBL 0
1663 ; routine: rapid
1664 LBL 3
1665 CALL LBL 5
1666 L X+Q1671 Y+Q1672 Z+Q1673 R0 FMAX M91
1667 Q1654 = Q1671
1668 Q1655 = Q1672
1669 Q1656 = Q1673
1670 LBL 0
1671 ; routine: a run that starts again at set-up Q1668 or later meets the block first here, and searches
1672 ; slowly
1673 LBL 6
1674 FN 12: IF +Q1600 LT +Q1668 GOTO LBL 19
1675 FN 0: Q1665 = +60
1676 LBL 19
1677 LBL 0
1678 ; routine: where to, higher in the dry run
1679 LBL 5
1680 Q1671 = Q1651
1681 Q1672 = Q1652
1682 Q1673 = Q1653
1683 FN 9: IF +Q1610 EQU +0 GOTO LBL 18
1684 Q1673 = Q1673 + Q1610
1685 FN 12: IF +Q1673 LT +349 GOTO LBL 18
1686 FN 0: Q1673 = +349
1687 LBL 18
1688 LBL 0
1689 END PGM HEAD MM
