0 BEGIN PGM HEAD MM
1 ; axiscal 0.1.0: program head, machine swivel-head, controller heidenhain
2 ; Probing program head for swivel-head
3 ; the swivelling head B, the paper's first stage: four fixed blocks at B = 0, -90, -30
4 ; 202 touches, about 13 min; the plan head.plan.json belongs to it
5 ; Set up:
6 ; mounting head: four blocks on a bridge plate over the turntable: the plate is screwed to the linear
7 ; axes' table and does not turn with C
8 ; block x-: 10 x 10 x 10 mm, on a riser 60 mm high
9 ; the ball rests on the middle of its upper face at X -30.000 Y 0.000 Z 8.000
10 ; block x+: 10 x 10 x 10 mm, on a riser 60 mm high
11 ; the ball rests on the middle of its upper face at X 30.000 Y 0.000 Z 8.000
12 ; block y-: 10 x 10 x 10 mm, on a riser 60 mm high
13 ; the ball rests on the middle of its upper face at X 0.000 Y -30.000 Z 8.000
14 ; block y+: 10 x 10 x 10 mm, on a riser 60 mm high
15 ; the ball rests on the middle of its upper face at X 0.000 Y 30.000 Z 8.000
16 ; probe with ball 6 mm across, stem 75 mm, 202.684 mm from the pivot or gauge line to the ball's
17 ; centre
18 ; each block within 1 mm of its place, its faces along the machine's axes
19 ; a touch that is further off stops the program; the first of each block is made slowly
20 ; the positions above and below are machine coordinates with all rotary axes at 0, ball's centre
21 ; Before the start:
22 ; probe in the spindle, spindle stopped, nothing that touches the stylus
23 ; check the sense: at B -90 the ball stands towards +X of the pivot
24 ; the first move takes Z straight to 349.000 from where it stands: keep that way free
25 ; the log is TNC:\AXISCAL\HEAD.LOG
26 ; NOT VERIFIED on a real control: 37 entries, see head.notes.txt. Try the program in the control's
27 ; simulation first
28 ; the masks HEAD_H.A, _N.A, _P.A, _E.A and AXISCAL_M.A must lie in TNC:\AXISCAL\
29 ; tilted plane, TCPM and M126 are off after the program; the datum is not touched
30 ; rotary axes in the log: nominal positions (ID240), so a positioning error of the axis itself does
31 ; not show in them
32 ; feed override at 100 percent while it runs; after a message that says what is wrong NC start ends
33 ; the program
34 ; to stop: NC stop or emergency stop. A program that stops by itself says the touch, the face and the
35 ; reason
36 ; start again at a set-up: write its number, 1 to 3, behind Q1600; 1 is the whole program
37 ; dry run: +50 behind Q1610 lifts all moves by 50 mm and measures nothing. Do that first
38 ; slower: write a lower feed of positioning behind Q1699
39 FN 0: Q1600 = +1
40 FN 0: Q1610 = +0
41 FN 0: Q1699 = +1500
42 FN 0: Q1664 = +0
43 FN 0: Q1665 = +60
44 FN 0: Q1666 = +60
45 FN 0: Q1607 = +1
46 Q1620 = Q1600 - INT Q1600
47 FN 12: IF +Q1600 LT +1 GOTO LBL 25
48 FN 10: IF +Q1620 NE +0 GOTO LBL 25
49 FN 11: IF +Q1600 GT +3 GOTO LBL 25
50 FN 9: IF +0 EQU +0 GOTO LBL 26
51 LBL 25
52 QS1600 = "AXISCAL: there is no set-up with the number of Q1600: 1 to 3"
53 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_M.A / SCREEN:
54 STOP
55 FN 9: IF +0 EQU +0 GOTO LBL 9
56 LBL 26
57 M5
58 M9
59 M129
60 PLANE RESET STAY
61 M127
62 FN 18: SYSREAD Q1613 = ID320 NR1 IDX0
63 FN 11: IF +Q1610 GT +0 GOTO LBL 21
64 FN 11: IF +Q1600 GT +1 GOTO LBL 20
65 FN 16: F-PRINT TNC:\AXISCAL\HEAD_N.A / TNC:\AXISCAL\HEAD.LOG
66 FN 9: IF +0 EQU +0 GOTO LBL 21
67 LBL 20
68 FN 16: F-PRINT TNC:\AXISCAL\HEAD_H.A / TNC:\AXISCAL\HEAD.LOG
69 LBL 21
70 ; is the probe closed? down by 0.02 mm: it does not move when it is not
71 FN 0: Q1681 = +0
72 FN 0: Q1682 = +0
73 FN 0: Q1683 = -1
74 TCH PROBE 4.0 MEASURING IN 3-D
75 TCH PROBE 4.1 Q1601
76 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
77 TCH PROBE 4.3 DIST+0.02 F60 MB0 REFERENCE SYSTEM:1
78 FN 9: IF +Q1604 EQU -1 GOTO LBL 24
79 QS1600 = "AXISCAL: the probe is deflected, or not switched on, before the first move"
80 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_M.A / SCREEN:
81 STOP
82 FN 9: IF +0 EQU +0 GOTO LBL 9
83 LBL 24
84 L Z+349 R0 FMAX M91
85 L C-5 R0 FMAX M91
86 L C+0 R0 FMAX M91
87 L B-5 R0 FMAX M91
88 L B+0 R0 FMAX M91
89 L X-33 R0 FMAX M91
90 FN 0: Q1651 = -33
91 FN 0: Q1652 = -3
92 FN 0: Q1653 = +349
93 CALL LBL 3
94 ; set-up 1: head, B 0 C 0
95 FN 11: IF +Q1600 GT +1 GOTO LBL 30
96 CYCL DEF 13.0 ORIENTATION
97 CYCL DEF 13.1 ANGLE+0
98 M19
99 FN 0: Q1651 = -33
100 FN 0: Q1652 = -3
101 FN 0: Q1653 = +11.3
102 CALL LBL 3
103 FN 0: Q1607 = +1 ; touch 1: block x- face +Z
104 QS1601 = "block x- face +Z"
105 FN 0: Q1653 = +10
106 CALL LBL 2
107 FN 0: Q1661 = +0
108 FN 0: Q1662 = +0
109 FN 0: Q1663 = -4
110 FN 0: Q1664 = +2
111 FN 0: Q1665 = +60
112 FN 0: Q1666 = +60
113 FN 0: Q1667 = +11.3
114 CALL LBL 1
115 FN 0: Q1652 = +0
116 CALL LBL 3
117 FN 0: Q1607 = +2 ; touch 2: block x- face +Z
118 FN 0: Q1653 = +10
119 CALL LBL 2
120 FN 0: Q1665 = +300
121 CALL LBL 1
122 FN 0: Q1652 = +3
123 CALL LBL 3
124 FN 0: Q1607 = +3 ; touch 3: block x- face +Z
125 FN 0: Q1653 = +10
126 CALL LBL 2
127 CALL LBL 1
128 FN 0: Q1651 = -31
129 CALL LBL 3
130 FN 0: Q1652 = -3
131 CALL LBL 3
132 FN 0: Q1607 = +4 ; touch 4: block x- face +Z
133 FN 0: Q1653 = +10
134 CALL LBL 2
135 CALL LBL 1
136 FN 0: Q1652 = +0
137 CALL LBL 3
138 FN 0: Q1607 = +5 ; touch 5: block x- face +Z
139 FN 0: Q1653 = +10
140 CALL LBL 2
141 CALL LBL 1
142 FN 0: Q1652 = +3
143 CALL LBL 3
144 FN 0: Q1607 = +6 ; touch 6: block x- face +Z
145 FN 0: Q1653 = +10
146 CALL LBL 2
147 CALL LBL 1
148 FN 0: Q1651 = -29
149 CALL LBL 3
150 FN 0: Q1652 = -3
151 CALL LBL 3
152 FN 0: Q1607 = +7 ; touch 7: block x- face +Z
153 FN 0: Q1653 = +10
154 CALL LBL 2
155 CALL LBL 1
156 FN 0: Q1652 = +0
157 CALL LBL 3
158 FN 0: Q1607 = +8 ; touch 8: block x- face +Z
159 FN 0: Q1653 = +10
160 CALL LBL 2
161 CALL LBL 1
162 FN 0: Q1652 = +3
163 CALL LBL 3
164 FN 0: Q1607 = +9 ; touch 9: block x- face +Z
165 FN 0: Q1653 = +10
166 CALL LBL 2
167 CALL LBL 1
168 FN 0: Q1651 = -27
169 CALL LBL 3
170 FN 0: Q1652 = -3
171 CALL LBL 3
172 FN 0: Q1607 = +10 ; touch 10: block x- face +Z
173 FN 0: Q1653 = +10
174 CALL LBL 2
175 CALL LBL 1
176 FN 0: Q1652 = +0
177 CALL LBL 3
178 FN 0: Q1607 = +11 ; touch 11: block x- face +Z
179 FN 0: Q1653 = +10
180 CALL LBL 2
181 CALL LBL 1
182 FN 0: Q1652 = +3
183 CALL LBL 3
184 FN 0: Q1607 = +12 ; touch 12: block x- face +Z
185 FN 0: Q1653 = +10
186 CALL LBL 2
187 CALL LBL 1
188 FN 0: Q1651 = -20
189 CALL LBL 3
190 FN 0: Q1652 = -2.5
191 CALL LBL 3
192 FN 0: Q1607 = +13 ; touch 13: block x- face +X
193 QS1601 = "block x- face +X"
194 FN 0: Q1653 = +3
195 CALL LBL 2
196 FN 0: Q1661 = -4
197 FN 0: Q1663 = +0
198 CALL LBL 1
199 FN 0: Q1607 = +14 ; touch 14: block x- face +X
200 FN 0: Q1653 = +0
201 CALL LBL 2
202 CALL LBL 1
203 FN 0: Q1652 = +2.5
204 CALL LBL 3
205 FN 0: Q1607 = +15 ; touch 15: block x- face +X
206 FN 0: Q1653 = +3
207 CALL LBL 2
208 CALL LBL 1
209 FN 0: Q1607 = +16 ; touch 16: block x- face +X
210 FN 0: Q1653 = +0
211 CALL LBL 2
212 CALL LBL 1
213 FN 0: Q1651 = -40
214 CALL LBL 3
215 FN 0: Q1652 = -2.5
216 CALL LBL 3
217 FN 0: Q1607 = +17 ; touch 17: block x- face -X
218 QS1601 = "block x- face -X"
219 FN 0: Q1653 = +3
220 CALL LBL 2
221 FN 0: Q1661 = +4
222 CALL LBL 1
223 FN 0: Q1607 = +18 ; touch 18: block x- face -X
224 FN 0: Q1653 = +0
225 CALL LBL 2
226 CALL LBL 1
227 FN 0: Q1652 = +2.5
228 CALL LBL 3
229 FN 0: Q1607 = +19 ; touch 19: block x- face -X
230 FN 0: Q1653 = +3
231 CALL LBL 2
232 CALL LBL 1
233 FN 0: Q1607 = +20 ; touch 20: block x- face -X
234 FN 0: Q1653 = +0
235 CALL LBL 2
236 CALL LBL 1
237 FN 0: Q1651 = -32.5
238 CALL LBL 3
239 FN 0: Q1652 = +10
240 CALL LBL 3
241 FN 0: Q1607 = +21 ; touch 21: block x- face +Y
242 QS1601 = "block x- face +Y"
243 FN 0: Q1653 = +3
244 CALL LBL 2
245 FN 0: Q1661 = +0
246 FN 0: Q1662 = -4
247 CALL LBL 1
248 FN 0: Q1607 = +22 ; touch 22: block x- face +Y
249 FN 0: Q1653 = +0
250 CALL LBL 2
251 CALL LBL 1
252 FN 0: Q1651 = -27.5
253 CALL LBL 3
254 FN 0: Q1607 = +23 ; touch 23: block x- face +Y
255 FN 0: Q1653 = +3
256 CALL LBL 2
257 CALL LBL 1
258 FN 0: Q1607 = +24 ; touch 24: block x- face +Y
259 FN 0: Q1653 = +0
260 CALL LBL 2
261 CALL LBL 1
262 FN 0: Q1651 = -32.5
263 CALL LBL 3
264 FN 0: Q1652 = -10
265 CALL LBL 3
266 FN 0: Q1607 = +25 ; touch 25: block x- face -Y
267 QS1601 = "block x- face -Y"
268 FN 0: Q1653 = +3
269 CALL LBL 2
270 FN 0: Q1662 = +4
271 CALL LBL 1
272 FN 0: Q1607 = +26 ; touch 26: block x- face -Y
273 FN 0: Q1653 = +0
274 CALL LBL 2
275 CALL LBL 1
276 FN 0: Q1651 = -27.5
277 CALL LBL 3
278 FN 0: Q1607 = +27 ; touch 27: block x- face -Y
279 FN 0: Q1653 = +3
280 CALL LBL 2
281 CALL LBL 1
282 FN 0: Q1607 = +28 ; touch 28: block x- face -Y
283 FN 0: Q1653 = +0
284 CALL LBL 2
285 CALL LBL 1
286 FN 0: Q1651 = +27
287 CALL LBL 3
288 FN 0: Q1652 = -3
289 CALL LBL 3
290 FN 0: Q1607 = +29 ; touch 29: block x+ face +Z
291 QS1601 = "block x+ face +Z"
292 FN 0: Q1653 = +10
293 CALL LBL 2
294 FN 0: Q1662 = +0
295 FN 0: Q1663 = -4
296 FN 0: Q1665 = +60
297 CALL LBL 1
298 FN 0: Q1652 = +0
299 CALL LBL 3
300 FN 0: Q1607 = +30 ; touch 30: block x+ face +Z
301 FN 0: Q1653 = +10
302 CALL LBL 2
303 FN 0: Q1665 = +300
304 CALL LBL 1
305 FN 0: Q1652 = +3
306 CALL LBL 3
307 FN 0: Q1607 = +31 ; touch 31: block x+ face +Z
308 FN 0: Q1653 = +10
309 CALL LBL 2
310 CALL LBL 1
311 FN 0: Q1651 = +29
312 CALL LBL 3
313 FN 0: Q1652 = -3
314 CALL LBL 3
315 FN 0: Q1607 = +32 ; touch 32: block x+ face +Z
316 FN 0: Q1653 = +10
317 CALL LBL 2
318 CALL LBL 1
319 FN 0: Q1652 = +0
320 CALL LBL 3
321 FN 0: Q1607 = +33 ; touch 33: block x+ face +Z
322 FN 0: Q1653 = +10
323 CALL LBL 2
324 CALL LBL 1
325 FN 0: Q1652 = +3
326 CALL LBL 3
327 FN 0: Q1607 = +34 ; touch 34: block x+ face +Z
328 FN 0: Q1653 = +10
329 CALL LBL 2
330 CALL LBL 1
331 FN 0: Q1651 = +31
332 CALL LBL 3
333 FN 0: Q1652 = -3
334 CALL LBL 3
335 FN 0: Q1607 = +35 ; touch 35: block x+ face +Z
336 FN 0: Q1653 = +10
337 CALL LBL 2
338 CALL LBL 1
339 FN 0: Q1652 = +0
340 CALL LBL 3
341 FN 0: Q1607 = +36 ; touch 36: block x+ face +Z
342 FN 0: Q1653 = +10
343 CALL LBL 2
344 CALL LBL 1
345 FN 0: Q1652 = +3
346 CALL LBL 3
347 FN 0: Q1607 = +37 ; touch 37: block x+ face +Z
348 FN 0: Q1653 = +10
349 CALL LBL 2
350 CALL LBL 1
351 FN 0: Q1651 = +33
352 CALL LBL 3
353 FN 0: Q1652 = -3
354 CALL LBL 3
355 FN 0: Q1607 = +38 ; touch 38: block x+ face +Z
356 FN 0: Q1653 = +10
357 CALL LBL 2
358 CALL LBL 1
359 FN 0: Q1652 = +0
360 CALL LBL 3
361 FN 0: Q1607 = +39 ; touch 39: block x+ face +Z
362 FN 0: Q1653 = +10
363 CALL LBL 2
364 CALL LBL 1
365 FN 0: Q1652 = +3
366 CALL LBL 3
367 FN 0: Q1607 = +40 ; touch 40: block x+ face +Z
368 FN 0: Q1653 = +10
369 CALL LBL 2
370 CALL LBL 1
371 FN 0: Q1651 = +40
372 CALL LBL 3
373 FN 0: Q1652 = -2.5
374 CALL LBL 3
375 FN 0: Q1607 = +41 ; touch 41: block x+ face +X
376 QS1601 = "block x+ face +X"
377 FN 0: Q1653 = +3
378 CALL LBL 2
379 FN 0: Q1661 = -4
380 FN 0: Q1663 = +0
381 CALL LBL 1
382 FN 0: Q1607 = +42 ; touch 42: block x+ face +X
383 FN 0: Q1653 = +0
384 CALL LBL 2
385 CALL LBL 1
386 FN 0: Q1652 = +2.5
387 CALL LBL 3
388 FN 0: Q1607 = +43 ; touch 43: block x+ face +X
389 FN 0: Q1653 = +3
390 CALL LBL 2
391 CALL LBL 1
392 FN 0: Q1607 = +44 ; touch 44: block x+ face +X
393 FN 0: Q1653 = +0
394 CALL LBL 2
395 CALL LBL 1
396 FN 0: Q1651 = +20
397 CALL LBL 3
398 FN 0: Q1652 = -2.5
399 CALL LBL 3
400 FN 0: Q1607 = +45 ; touch 45: block x+ face -X
401 QS1601 = "block x+ face -X"
402 FN 0: Q1653 = +3
403 CALL LBL 2
404 FN 0: Q1661 = +4
405 CALL LBL 1
406 FN 0: Q1607 = +46 ; touch 46: block x+ face -X
407 FN 0: Q1653 = +0
408 CALL LBL 2
409 CALL LBL 1
410 FN 0: Q1652 = +2.5
411 CALL LBL 3
412 FN 0: Q1607 = +47 ; touch 47: block x+ face -X
413 FN 0: Q1653 = +3
414 CALL LBL 2
415 CALL LBL 1
416 FN 0: Q1607 = +48 ; touch 48: block x+ face -X
417 FN 0: Q1653 = +0
418 CALL LBL 2
419 CALL LBL 1
420 FN 0: Q1651 = +27.5
421 CALL LBL 3
422 FN 0: Q1652 = +10
423 CALL LBL 3
424 FN 0: Q1607 = +49 ; touch 49: block x+ face +Y
425 QS1601 = "block x+ face +Y"
426 FN 0: Q1653 = +3
427 CALL LBL 2
428 FN 0: Q1661 = +0
429 FN 0: Q1662 = -4
430 CALL LBL 1
431 FN 0: Q1607 = +50 ; touch 50: block x+ face +Y
432 FN 0: Q1653 = +0
433 CALL LBL 2
434 CALL LBL 1
435 FN 0: Q1651 = +32.5
436 CALL LBL 3
437 FN 0: Q1607 = +51 ; touch 51: block x+ face +Y
438 FN 0: Q1653 = +3
439 CALL LBL 2
440 CALL LBL 1
441 FN 0: Q1607 = +52 ; touch 52: block x+ face +Y
442 FN 0: Q1653 = +0
443 CALL LBL 2
444 CALL LBL 1
445 FN 0: Q1651 = +27.5
446 CALL LBL 3
447 FN 0: Q1652 = -10
448 CALL LBL 3
449 FN 0: Q1607 = +53 ; touch 53: block x+ face -Y
450 QS1601 = "block x+ face -Y"
451 FN 0: Q1653 = +3
452 CALL LBL 2
453 FN 0: Q1662 = +4
454 CALL LBL 1
455 FN 0: Q1607 = +54 ; touch 54: block x+ face -Y
456 FN 0: Q1653 = +0
457 CALL LBL 2
458 CALL LBL 1
459 FN 0: Q1651 = +32.5
460 CALL LBL 3
461 FN 0: Q1607 = +55 ; touch 55: block x+ face -Y
462 FN 0: Q1653 = +3
463 CALL LBL 2
464 CALL LBL 1
465 FN 0: Q1607 = +56 ; touch 56: block x+ face -Y
466 FN 0: Q1653 = +0
467 CALL LBL 2
468 CALL LBL 1
469 FN 0: Q1651 = -3
470 CALL LBL 3
471 FN 0: Q1652 = -33
472 CALL LBL 3
473 FN 0: Q1607 = +57 ; touch 57: block y- face +Z
474 QS1601 = "block y- face +Z"
475 FN 0: Q1653 = +10
476 CALL LBL 2
477 FN 0: Q1662 = +0
478 FN 0: Q1663 = -4
479 FN 0: Q1665 = +60
480 CALL LBL 1
481 FN 0: Q1652 = -30
482 CALL LBL 3
483 FN 0: Q1607 = +58 ; touch 58: block y- face +Z
484 FN 0: Q1653 = +10
485 CALL LBL 2
486 FN 0: Q1665 = +300
487 CALL LBL 1
488 FN 0: Q1652 = -27
489 CALL LBL 3
490 FN 0: Q1607 = +59 ; touch 59: block y- face +Z
491 FN 0: Q1653 = +10
492 CALL LBL 2
493 CALL LBL 1
494 FN 0: Q1651 = -1
495 CALL LBL 3
496 FN 0: Q1652 = -33
497 CALL LBL 3
498 FN 0: Q1607 = +60 ; touch 60: block y- face +Z
499 FN 0: Q1653 = +10
500 CALL LBL 2
501 CALL LBL 1
502 FN 0: Q1652 = -30
503 CALL LBL 3
504 FN 0: Q1607 = +61 ; touch 61: block y- face +Z
505 FN 0: Q1653 = +10
506 CALL LBL 2
507 CALL LBL 1
508 FN 0: Q1652 = -27
509 CALL LBL 3
510 FN 0: Q1607 = +62 ; touch 62: block y- face +Z
511 FN 0: Q1653 = +10
512 CALL LBL 2
513 CALL LBL 1
514 FN 0: Q1651 = +1
515 CALL LBL 3
516 FN 0: Q1652 = -33
517 CALL LBL 3
518 FN 0: Q1607 = +63 ; touch 63: block y- face +Z
519 FN 0: Q1653 = +10
520 CALL LBL 2
521 CALL LBL 1
522 FN 0: Q1652 = -30
523 CALL LBL 3
524 FN 0: Q1607 = +64 ; touch 64: block y- face +Z
525 FN 0: Q1653 = +10
526 CALL LBL 2
527 CALL LBL 1
528 FN 0: Q1652 = -27
529 CALL LBL 3
530 FN 0: Q1607 = +65 ; touch 65: block y- face +Z
531 FN 0: Q1653 = +10
532 CALL LBL 2
533 CALL LBL 1
534 FN 0: Q1651 = +3
535 CALL LBL 3
536 FN 0: Q1652 = -33
537 CALL LBL 3
538 FN 0: Q1607 = +66 ; touch 66: block y- face +Z
539 FN 0: Q1653 = +10
540 CALL LBL 2
541 CALL LBL 1
542 FN 0: Q1652 = -30
543 CALL LBL 3
544 FN 0: Q1607 = +67 ; touch 67: block y- face +Z
545 FN 0: Q1653 = +10
546 CALL LBL 2
547 CALL LBL 1
548 FN 0: Q1652 = -27
549 CALL LBL 3
550 FN 0: Q1607 = +68 ; touch 68: block y- face +Z
551 FN 0: Q1653 = +10
552 CALL LBL 2
553 CALL LBL 1
554 FN 0: Q1651 = +10
555 CALL LBL 3
556 FN 0: Q1652 = -32.5
557 CALL LBL 3
558 FN 0: Q1607 = +69 ; touch 69: block y- face +X
559 QS1601 = "block y- face +X"
560 FN 0: Q1653 = +3
561 CALL LBL 2
562 FN 0: Q1661 = -4
563 FN 0: Q1663 = +0
564 CALL LBL 1
565 FN 0: Q1607 = +70 ; touch 70: block y- face +X
566 FN 0: Q1653 = +0
567 CALL LBL 2
568 CALL LBL 1
569 FN 0: Q1652 = -27.5
570 CALL LBL 3
571 FN 0: Q1607 = +71 ; touch 71: block y- face +X
572 FN 0: Q1653 = +3
573 CALL LBL 2
574 CALL LBL 1
575 FN 0: Q1607 = +72 ; touch 72: block y- face +X
576 FN 0: Q1653 = +0
577 CALL LBL 2
578 CALL LBL 1
579 FN 0: Q1651 = -10
580 CALL LBL 3
581 FN 0: Q1652 = -32.5
582 CALL LBL 3
583 FN 0: Q1607 = +73 ; touch 73: block y- face -X
584 QS1601 = "block y- face -X"
585 FN 0: Q1653 = +3
586 CALL LBL 2
587 FN 0: Q1661 = +4
588 CALL LBL 1
589 FN 0: Q1607 = +74 ; touch 74: block y- face -X
590 FN 0: Q1653 = +0
591 CALL LBL 2
592 CALL LBL 1
593 FN 0: Q1652 = -27.5
594 CALL LBL 3
595 FN 0: Q1607 = +75 ; touch 75: block y- face -X
596 FN 0: Q1653 = +3
597 CALL LBL 2
598 CALL LBL 1
599 FN 0: Q1607 = +76 ; touch 76: block y- face -X
600 FN 0: Q1653 = +0
601 CALL LBL 2
602 CALL LBL 1
603 FN 0: Q1651 = -2.5
604 CALL LBL 3
605 FN 0: Q1652 = -20
606 CALL LBL 3
607 FN 0: Q1607 = +77 ; touch 77: block y- face +Y
608 QS1601 = "block y- face +Y"
609 FN 0: Q1653 = +3
610 CALL LBL 2
611 FN 0: Q1661 = +0
612 FN 0: Q1662 = -4
613 CALL LBL 1
614 FN 0: Q1607 = +78 ; touch 78: block y- face +Y
615 FN 0: Q1653 = +0
616 CALL LBL 2
617 CALL LBL 1
618 FN 0: Q1651 = +2.5
619 CALL LBL 3
620 FN 0: Q1607 = +79 ; touch 79: block y- face +Y
621 FN 0: Q1653 = +3
622 CALL LBL 2
623 CALL LBL 1
624 FN 0: Q1607 = +80 ; touch 80: block y- face +Y
625 FN 0: Q1653 = +0
626 CALL LBL 2
627 CALL LBL 1
628 FN 0: Q1651 = -2.5
629 CALL LBL 3
630 FN 0: Q1652 = -40
631 CALL LBL 3
632 FN 0: Q1607 = +81 ; touch 81: block y- face -Y
633 QS1601 = "block y- face -Y"
634 FN 0: Q1653 = +3
635 CALL LBL 2
636 FN 0: Q1662 = +4
637 CALL LBL 1
638 FN 0: Q1607 = +82 ; touch 82: block y- face -Y
639 FN 0: Q1653 = +0
640 CALL LBL 2
641 CALL LBL 1
642 FN 0: Q1651 = +2.5
643 CALL LBL 3
644 FN 0: Q1607 = +83 ; touch 83: block y- face -Y
645 FN 0: Q1653 = +3
646 CALL LBL 2
647 CALL LBL 1
648 FN 0: Q1607 = +84 ; touch 84: block y- face -Y
649 FN 0: Q1653 = +0
650 CALL LBL 2
651 CALL LBL 1
652 FN 0: Q1651 = -3
653 CALL LBL 3
654 FN 0: Q1652 = +27
655 CALL LBL 3
656 FN 0: Q1607 = +85 ; touch 85: block y+ face +Z
657 QS1601 = "block y+ face +Z"
658 FN 0: Q1653 = +10
659 CALL LBL 2
660 FN 0: Q1662 = +0
661 FN 0: Q1663 = -4
662 FN 0: Q1665 = +60
663 CALL LBL 1
664 FN 0: Q1652 = +30
665 CALL LBL 3
666 FN 0: Q1607 = +86 ; touch 86: block y+ face +Z
667 FN 0: Q1653 = +10
668 CALL LBL 2
669 FN 0: Q1665 = +300
670 CALL LBL 1
671 FN 0: Q1652 = +33
672 CALL LBL 3
673 FN 0: Q1607 = +87 ; touch 87: block y+ face +Z
674 FN 0: Q1653 = +10
675 CALL LBL 2
676 CALL LBL 1
677 FN 0: Q1651 = -1
678 CALL LBL 3
679 FN 0: Q1652 = +27
680 CALL LBL 3
681 FN 0: Q1607 = +88 ; touch 88: block y+ face +Z
682 FN 0: Q1653 = +10
683 CALL LBL 2
684 CALL LBL 1
685 FN 0: Q1652 = +30
686 CALL LBL 3
687 FN 0: Q1607 = +89 ; touch 89: block y+ face +Z
688 FN 0: Q1653 = +10
689 CALL LBL 2
690 CALL LBL 1
691 FN 0: Q1652 = +33
692 CALL LBL 3
693 FN 0: Q1607 = +90 ; touch 90: block y+ face +Z
694 FN 0: Q1653 = +10
695 CALL LBL 2
696 CALL LBL 1
697 FN 0: Q1651 = +1
698 CALL LBL 3
699 FN 0: Q1652 = +27
700 CALL LBL 3
701 FN 0: Q1607 = +91 ; touch 91: block y+ face +Z
702 FN 0: Q1653 = +10
703 CALL LBL 2
704 CALL LBL 1
705 FN 0: Q1652 = +30
706 CALL LBL 3
707 FN 0: Q1607 = +92 ; touch 92: block y+ face +Z
708 FN 0: Q1653 = +10
709 CALL LBL 2
710 CALL LBL 1
711 FN 0: Q1652 = +33
712 CALL LBL 3
713 FN 0: Q1607 = +93 ; touch 93: block y+ face +Z
714 FN 0: Q1653 = +10
715 CALL LBL 2
716 CALL LBL 1
717 FN 0: Q1651 = +3
718 CALL LBL 3
719 FN 0: Q1652 = +27
720 CALL LBL 3
721 FN 0: Q1607 = +94 ; touch 94: block y+ face +Z
722 FN 0: Q1653 = +10
723 CALL LBL 2
724 CALL LBL 1
725 FN 0: Q1652 = +30
726 CALL LBL 3
727 FN 0: Q1607 = +95 ; touch 95: block y+ face +Z
728 FN 0: Q1653 = +10
729 CALL LBL 2
730 CALL LBL 1
731 FN 0: Q1652 = +33
732 CALL LBL 3
733 FN 0: Q1607 = +96 ; touch 96: block y+ face +Z
734 FN 0: Q1653 = +10
735 CALL LBL 2
736 CALL LBL 1
737 FN 0: Q1651 = +10
738 CALL LBL 3
739 FN 0: Q1652 = +27.5
740 CALL LBL 3
741 FN 0: Q1607 = +97 ; touch 97: block y+ face +X
742 QS1601 = "block y+ face +X"
743 FN 0: Q1653 = +3
744 CALL LBL 2
745 FN 0: Q1661 = -4
746 FN 0: Q1663 = +0
747 CALL LBL 1
748 FN 0: Q1607 = +98 ; touch 98: block y+ face +X
749 FN 0: Q1653 = +0
750 CALL LBL 2
751 CALL LBL 1
752 FN 0: Q1652 = +32.5
753 CALL LBL 3
754 FN 0: Q1607 = +99 ; touch 99: block y+ face +X
755 FN 0: Q1653 = +3
756 CALL LBL 2
757 CALL LBL 1
758 FN 0: Q1607 = +100 ; touch 100: block y+ face +X
759 FN 0: Q1653 = +0
760 CALL LBL 2
761 CALL LBL 1
762 FN 0: Q1651 = -10
763 CALL LBL 3
764 FN 0: Q1652 = +27.5
765 CALL LBL 3
766 FN 0: Q1607 = +101 ; touch 101: block y+ face -X
767 QS1601 = "block y+ face -X"
768 FN 0: Q1653 = +3
769 CALL LBL 2
770 FN 0: Q1661 = +4
771 CALL LBL 1
772 FN 0: Q1607 = +102 ; touch 102: block y+ face -X
773 FN 0: Q1653 = +0
774 CALL LBL 2
775 CALL LBL 1
776 FN 0: Q1652 = +32.5
777 CALL LBL 3
778 FN 0: Q1607 = +103 ; touch 103: block y+ face -X
779 FN 0: Q1653 = +3
780 CALL LBL 2
781 CALL LBL 1
782 FN 0: Q1607 = +104 ; touch 104: block y+ face -X
783 FN 0: Q1653 = +0
784 CALL LBL 2
785 CALL LBL 1
786 FN 0: Q1651 = -2.5
787 CALL LBL 3
788 FN 0: Q1652 = +40
789 CALL LBL 3
790 FN 0: Q1607 = +105 ; touch 105: block y+ face +Y
791 QS1601 = "block y+ face +Y"
792 FN 0: Q1653 = +3
793 CALL LBL 2
794 FN 0: Q1661 = +0
795 FN 0: Q1662 = -4
796 CALL LBL 1
797 FN 0: Q1607 = +106 ; touch 106: block y+ face +Y
798 FN 0: Q1653 = +0
799 CALL LBL 2
800 CALL LBL 1
801 FN 0: Q1651 = +2.5
802 CALL LBL 3
803 FN 0: Q1607 = +107 ; touch 107: block y+ face +Y
804 FN 0: Q1653 = +3
805 CALL LBL 2
806 CALL LBL 1
807 FN 0: Q1607 = +108 ; touch 108: block y+ face +Y
808 FN 0: Q1653 = +0
809 CALL LBL 2
810 CALL LBL 1
811 FN 0: Q1651 = -2.5
812 CALL LBL 3
813 FN 0: Q1652 = +20
814 CALL LBL 3
815 FN 0: Q1607 = +109 ; touch 109: block y+ face -Y
816 QS1601 = "block y+ face -Y"
817 FN 0: Q1653 = +3
818 CALL LBL 2
819 FN 0: Q1662 = +4
820 CALL LBL 1
821 FN 0: Q1607 = +110 ; touch 110: block y+ face -Y
822 FN 0: Q1653 = +0
823 CALL LBL 2
824 CALL LBL 1
825 FN 0: Q1651 = +2.5
826 CALL LBL 3
827 FN 0: Q1607 = +111 ; touch 111: block y+ face -Y
828 FN 0: Q1653 = +3
829 CALL LBL 2
830 CALL LBL 1
831 FN 0: Q1607 = +112 ; touch 112: block y+ face -Y
832 FN 0: Q1653 = +0
833 CALL LBL 2
834 CALL LBL 1
835 LBL 30
836 ; set-up 2: head, B -90 C 0
837 FN 11: IF +Q1600 GT +2 GOTO LBL 31
838 FN 12: IF +Q1600 LT +2 GOTO LBL 32
839 ; the blocks may have been moved: the first search of each is slow again
840 L X+2.5 R0 FMAX M91
841 L Y+20 R0 FMAX M91
842 L Z+11.3 R0 FMAX M91
843 LBL 32
844 CYCL DEF 13.0 ORIENTATION
845 CYCL DEF 13.1 ANGLE+0
846 M19
847 L B-90 R0 FMAX M91
848 FN 0: Q1651 = -235.684
849 FN 0: Q1652 = +20
850 FN 0: Q1653 = +11.3
851 CALL LBL 3
852 FN 0: Q1652 = -2.5
853 CALL LBL 3
854 FN 0: Q1653 = -144.3
855 CALL LBL 3
856 FN 0: Q1607 = +113 ; touch 113: block x- face +Z
857 QS1601 = "block x- face +Z"
858 FN 0: Q1653 = -192.684
859 CALL LBL 2
860 FN 0: Q1661 = +0
861 FN 0: Q1662 = +0
862 FN 0: Q1663 = -4
863 FN 0: Q1664 = +2
864 FN 0: Q1665 = +300
865 FN 0: Q1668 = +2
866 CALL LBL 6
867 FN 0: Q1666 = +60
868 FN 0: Q1667 = -191.3
869 CALL LBL 1
870 FN 0: Q1652 = +2.5
871 CALL LBL 3
872 FN 0: Q1607 = +114 ; touch 114: block x- face +Z
873 FN 0: Q1653 = -192.684
874 CALL LBL 2
875 FN 0: Q1665 = +300
876 CALL LBL 1
877 FN 0: Q1651 = -232.684
878 CALL LBL 3
879 FN 0: Q1652 = -2.5
880 CALL LBL 3
881 FN 0: Q1607 = +115 ; touch 115: block x- face +Z
882 FN 0: Q1653 = -192.684
883 CALL LBL 2
884 CALL LBL 1
885 FN 0: Q1652 = +2.5
886 CALL LBL 3
887 FN 0: Q1607 = +116 ; touch 116: block x- face +Z
888 FN 0: Q1653 = -192.684
889 CALL LBL 2
890 CALL LBL 1
891 FN 0: Q1651 = -229.684
892 CALL LBL 3
893 FN 0: Q1652 = -2.5
894 CALL LBL 3
895 FN 0: Q1607 = +117 ; touch 117: block x- face +Z
896 FN 0: Q1653 = -192.684
897 CALL LBL 2
898 CALL LBL 1
899 FN 0: Q1652 = +2.5
900 CALL LBL 3
901 FN 0: Q1607 = +118 ; touch 118: block x- face +Z
902 FN 0: Q1653 = -192.684
903 CALL LBL 2
904 CALL LBL 1
905 FN 0: Q1651 = -242.684
906 CALL LBL 3
907 FN 0: Q1652 = -2.5
908 CALL LBL 3
909 FN 0: Q1607 = +119 ; touch 119: block x- face -X
910 QS1601 = "block x- face -X"
911 FN 0: Q1653 = -199.684
912 CALL LBL 2
913 FN 0: Q1661 = +4
914 FN 0: Q1663 = +0
915 CALL LBL 1
916 FN 0: Q1607 = +120 ; touch 120: block x- face -X
917 FN 0: Q1653 = -202.684
918 CALL LBL 2
919 CALL LBL 1
920 FN 0: Q1652 = +2.5
921 CALL LBL 3
922 FN 0: Q1607 = +121 ; touch 121: block x- face -X
923 FN 0: Q1653 = -199.684
924 CALL LBL 2
925 CALL LBL 1
926 FN 0: Q1607 = +122 ; touch 122: block x- face -X
927 FN 0: Q1653 = -202.684
928 CALL LBL 2
929 CALL LBL 1
930 FN 0: Q1651 = -235.184
931 CALL LBL 3
932 FN 0: Q1652 = +10
933 CALL LBL 3
934 FN 0: Q1607 = +123 ; touch 123: block x- face +Y
935 QS1601 = "block x- face +Y"
936 FN 0: Q1653 = -201.184
937 CALL LBL 2
938 FN 0: Q1661 = +0
939 FN 0: Q1662 = -4
940 CALL LBL 1
941 FN 0: Q1651 = -230.184
942 CALL LBL 3
943 FN 0: Q1607 = +124 ; touch 124: block x- face +Y
944 FN 0: Q1653 = -201.184
945 CALL LBL 2
946 CALL LBL 1
947 FN 0: Q1651 = -235.184
948 CALL LBL 3
949 FN 0: Q1652 = -10
950 CALL LBL 3
951 FN 0: Q1607 = +125 ; touch 125: block x- face -Y
952 QS1601 = "block x- face -Y"
953 FN 0: Q1653 = -201.184
954 CALL LBL 2
955 FN 0: Q1662 = +4
956 CALL LBL 1
957 FN 0: Q1651 = -230.184
958 CALL LBL 3
959 FN 0: Q1607 = +126 ; touch 126: block x- face -Y
960 FN 0: Q1653 = -201.184
961 CALL LBL 2
962 CALL LBL 1
963 FN 0: Q1651 = -205.684
964 CALL LBL 3
965 FN 0: Q1652 = -32.5
966 CALL LBL 3
967 FN 0: Q1607 = +127 ; touch 127: block y- face +Z
968 QS1601 = "block y- face +Z"
969 FN 0: Q1653 = -192.684
970 CALL LBL 2
971 FN 0: Q1662 = +0
972 FN 0: Q1663 = -4
973 FN 0: Q1665 = +300
974 FN 0: Q1668 = +2
975 CALL LBL 6
976 CALL LBL 1
977 FN 0: Q1652 = -27.5
978 CALL LBL 3
979 FN 0: Q1607 = +128 ; touch 128: block y- face +Z
980 FN 0: Q1653 = -192.684
981 CALL LBL 2
982 FN 0: Q1665 = +300
983 CALL LBL 1
984 FN 0: Q1651 = -202.684
985 CALL LBL 3
986 FN 0: Q1652 = -32.5
987 CALL LBL 3
988 FN 0: Q1607 = +129 ; touch 129: block y- face +Z
989 FN 0: Q1653 = -192.684
990 CALL LBL 2
991 CALL LBL 1
992 FN 0: Q1652 = -27.5
993 CALL LBL 3
994 FN 0: Q1607 = +130 ; touch 130: block y- face +Z
995 FN 0: Q1653 = -192.684
996 CALL LBL 2
997 CALL LBL 1
998 FN 0: Q1651 = -199.684
999 CALL LBL 3
1000 FN 0: Q1652 = -32.5
1001 CALL LBL 3
1002 FN 0: Q1607 = +131 ; touch 131: block y- face +Z
1003 FN 0: Q1653 = -192.684
1004 CALL LBL 2
1005 CALL LBL 1
1006 FN 0: Q1652 = -27.5
1007 CALL LBL 3
1008 FN 0: Q1607 = +132 ; touch 132: block y- face +Z
1009 FN 0: Q1653 = -192.684
1010 CALL LBL 2
1011 CALL LBL 1
1012 FN 0: Q1651 = -212.684
1013 CALL LBL 3
1014 FN 0: Q1652 = -32.5
1015 CALL LBL 3
1016 FN 0: Q1607 = +133 ; touch 133: block y- face -X
1017 QS1601 = "block y- face -X"
1018 FN 0: Q1653 = -199.684
1019 CALL LBL 2
1020 FN 0: Q1661 = +4
1021 FN 0: Q1663 = +0
1022 CALL LBL 1
1023 FN 0: Q1607 = +134 ; touch 134: block y- face -X
1024 FN 0: Q1653 = -202.684
1025 CALL LBL 2
1026 CALL LBL 1
1027 FN 0: Q1652 = -27.5
1028 CALL LBL 3
1029 FN 0: Q1607 = +135 ; touch 135: block y- face -X
1030 FN 0: Q1653 = -199.684
1031 CALL LBL 2
1032 CALL LBL 1
1033 FN 0: Q1607 = +136 ; touch 136: block y- face -X
1034 FN 0: Q1653 = -202.684
1035 CALL LBL 2
1036 CALL LBL 1
1037 FN 0: Q1651 = -205.184
1038 CALL LBL 3
1039 FN 0: Q1652 = -20
1040 CALL LBL 3
1041 FN 0: Q1607 = +137 ; touch 137: block y- face +Y
1042 QS1601 = "block y- face +Y"
1043 FN 0: Q1653 = -201.184
1044 CALL LBL 2
1045 FN 0: Q1661 = +0
1046 FN 0: Q1662 = -4
1047 CALL LBL 1
1048 FN 0: Q1651 = -200.184
1049 CALL LBL 3
1050 FN 0: Q1607 = +138 ; touch 138: block y- face +Y
1051 FN 0: Q1653 = -201.184
1052 CALL LBL 2
1053 CALL LBL 1
1054 FN 0: Q1651 = -205.184
1055 CALL LBL 3
1056 FN 0: Q1652 = -40
1057 CALL LBL 3
1058 FN 0: Q1607 = +139 ; touch 139: block y- face -Y
1059 QS1601 = "block y- face -Y"
1060 FN 0: Q1653 = -201.184
1061 CALL LBL 2
1062 FN 0: Q1662 = +4
1063 CALL LBL 1
1064 FN 0: Q1651 = -200.184
1065 CALL LBL 3
1066 FN 0: Q1607 = +140 ; touch 140: block y- face -Y
1067 FN 0: Q1653 = -201.184
1068 CALL LBL 2
1069 CALL LBL 1
1070 FN 0: Q1651 = -205.684
1071 CALL LBL 3
1072 FN 0: Q1652 = +27.5
1073 CALL LBL 3
1074 FN 0: Q1607 = +141 ; touch 141: block y+ face +Z
1075 QS1601 = "block y+ face +Z"
1076 FN 0: Q1653 = -192.684
1077 CALL LBL 2
1078 FN 0: Q1662 = +0
1079 FN 0: Q1663 = -4
1080 FN 0: Q1665 = +300
1081 FN 0: Q1668 = +2
1082 CALL LBL 6
1083 CALL LBL 1
1084 FN 0: Q1652 = +32.5
1085 CALL LBL 3
1086 FN 0: Q1607 = +142 ; touch 142: block y+ face +Z
1087 FN 0: Q1653 = -192.684
1088 CALL LBL 2
1089 FN 0: Q1665 = +300
1090 CALL LBL 1
1091 FN 0: Q1651 = -202.684
1092 CALL LBL 3
1093 FN 0: Q1652 = +27.5
1094 CALL LBL 3
1095 FN 0: Q1607 = +143 ; touch 143: block y+ face +Z
1096 FN 0: Q1653 = -192.684
1097 CALL LBL 2
1098 CALL LBL 1
1099 FN 0: Q1652 = +32.5
1100 CALL LBL 3
1101 FN 0: Q1607 = +144 ; touch 144: block y+ face +Z
1102 FN 0: Q1653 = -192.684
1103 CALL LBL 2
1104 CALL LBL 1
1105 FN 0: Q1651 = -199.684
1106 CALL LBL 3
1107 FN 0: Q1652 = +27.5
1108 CALL LBL 3
1109 FN 0: Q1607 = +145 ; touch 145: block y+ face +Z
1110 FN 0: Q1653 = -192.684
1111 CALL LBL 2
1112 CALL LBL 1
1113 FN 0: Q1652 = +32.5
1114 CALL LBL 3
1115 FN 0: Q1607 = +146 ; touch 146: block y+ face +Z
1116 FN 0: Q1653 = -192.684
1117 CALL LBL 2
1118 CALL LBL 1
1119 FN 0: Q1651 = -212.684
1120 CALL LBL 3
1121 FN 0: Q1652 = +27.5
1122 CALL LBL 3
1123 FN 0: Q1607 = +147 ; touch 147: block y+ face -X
1124 QS1601 = "block y+ face -X"
1125 FN 0: Q1653 = -199.684
1126 CALL LBL 2
1127 FN 0: Q1661 = +4
1128 FN 0: Q1663 = +0
1129 CALL LBL 1
1130 FN 0: Q1607 = +148 ; touch 148: block y+ face -X
1131 FN 0: Q1653 = -202.684
1132 CALL LBL 2
1133 CALL LBL 1
1134 FN 0: Q1652 = +32.5
1135 CALL LBL 3
1136 FN 0: Q1607 = +149 ; touch 149: block y+ face -X
1137 FN 0: Q1653 = -199.684
1138 CALL LBL 2
1139 CALL LBL 1
1140 FN 0: Q1607 = +150 ; touch 150: block y+ face -X
1141 FN 0: Q1653 = -202.684
1142 CALL LBL 2
1143 CALL LBL 1
1144 FN 0: Q1651 = -205.184
1145 CALL LBL 3
1146 FN 0: Q1652 = +40
1147 CALL LBL 3
1148 FN 0: Q1607 = +151 ; touch 151: block y+ face +Y
1149 QS1601 = "block y+ face +Y"
1150 FN 0: Q1653 = -201.184
1151 CALL LBL 2
1152 FN 0: Q1661 = +0
1153 FN 0: Q1662 = -4
1154 CALL LBL 1
1155 FN 0: Q1651 = -200.184
1156 CALL LBL 3
1157 FN 0: Q1607 = +152 ; touch 152: block y+ face +Y
1158 FN 0: Q1653 = -201.184
1159 CALL LBL 2
1160 CALL LBL 1
1161 FN 0: Q1651 = -205.184
1162 CALL LBL 3
1163 FN 0: Q1652 = +20
1164 CALL LBL 3
1165 FN 0: Q1607 = +153 ; touch 153: block y+ face -Y
1166 QS1601 = "block y+ face -Y"
1167 FN 0: Q1653 = -201.184
1168 CALL LBL 2
1169 FN 0: Q1662 = +4
1170 CALL LBL 1
1171 FN 0: Q1651 = -200.184
1172 CALL LBL 3
1173 FN 0: Q1607 = +154 ; touch 154: block y+ face -Y
1174 FN 0: Q1653 = -201.184
1175 CALL LBL 2
1176 FN 0: Q1667 = -144.3
1177 CALL LBL 1
1178 FN 0: Q1653 = -15.8
1179 CALL LBL 3
1180 LBL 31
1181 ; set-up 3: head, B -30 C 0
1182 FN 11: IF +Q1600 GT +3 GOTO LBL 33
1183 FN 12: IF +Q1600 LT +3 GOTO LBL 34
1184 ; the blocks may have been moved: the first search of each is slow again
1185 L B-90 R0 FMAX M91
1186 L X-200.184 R0 FMAX M91
1187 L Y+20 R0 FMAX M91
1188 L Z-15.8 R0 FMAX M91
1189 LBL 34
1190 CYCL DEF 13.0 ORIENTATION
1191 CYCL DEF 13.1 ANGLE+0
1192 M19
1193 L B-30 R0 FMAX M91
1194 FN 0: Q1651 = -133.842
1195 FN 0: Q1652 = +20
1196 FN 0: Q1653 = -15.8
1197 CALL LBL 3
1198 FN 0: Q1652 = -2.5
1199 CALL LBL 3
1200 FN 0: Q1607 = +155 ; touch 155: block x- face +Z
1201 QS1601 = "block x- face +Z"
1202 FN 0: Q1653 = -17.1545
1203 CALL LBL 2
1204 FN 0: Q1661 = +0
1205 FN 0: Q1662 = +0
1206 FN 0: Q1663 = -4
1207 FN 0: Q1664 = +2
1208 FN 0: Q1665 = +300
1209 FN 0: Q1668 = +3
1210 CALL LBL 6
1211 FN 0: Q1666 = +60
1212 FN 0: Q1667 = -15.8
1213 CALL LBL 1
1214 FN 0: Q1652 = +2.5
1215 CALL LBL 3
1216 FN 0: Q1607 = +156 ; touch 156: block x- face +Z
1217 FN 0: Q1653 = -17.1545
1218 CALL LBL 2
1219 FN 0: Q1665 = +300
1220 CALL LBL 1
1221 FN 0: Q1651 = -128.842
1222 CALL LBL 3
1223 FN 0: Q1652 = -2.5
1224 CALL LBL 3
1225 FN 0: Q1607 = +157 ; touch 157: block x- face +Z
1226 FN 0: Q1653 = -17.1545
1227 CALL LBL 2
1228 CALL LBL 1
1229 FN 0: Q1652 = +2.5
1230 CALL LBL 3
1231 FN 0: Q1607 = +158 ; touch 158: block x- face +Z
1232 FN 0: Q1653 = -17.1545
1233 CALL LBL 2
1234 CALL LBL 1
1235 FN 0: Q1651 = -133.842
1236 CALL LBL 3
1237 FN 0: Q1652 = +10
1238 CALL LBL 3
1239 FN 0: Q1607 = +159 ; touch 159: block x- face +Y
1240 QS1601 = "block x- face +Y"
1241 FN 0: Q1653 = -24.1545
1242 CALL LBL 2
1243 FN 0: Q1662 = -4
1244 FN 0: Q1663 = +0
1245 CALL LBL 1
1246 FN 0: Q1607 = +160 ; touch 160: block x- face +Y
1247 FN 0: Q1653 = -27.1545
1248 CALL LBL 2
1249 CALL LBL 1
1250 FN 0: Q1651 = -128.842
1251 CALL LBL 3
1252 FN 0: Q1607 = +161 ; touch 161: block x- face +Y
1253 FN 0: Q1653 = -24.1545
1254 CALL LBL 2
1255 CALL LBL 1
1256 FN 0: Q1607 = +162 ; touch 162: block x- face +Y
1257 FN 0: Q1653 = -27.1545
1258 CALL LBL 2
1259 CALL LBL 1
1260 FN 0: Q1651 = -133.842
1261 CALL LBL 3
1262 FN 0: Q1652 = -10
1263 CALL LBL 3
1264 FN 0: Q1607 = +163 ; touch 163: block x- face -Y
1265 QS1601 = "block x- face -Y"
1266 FN 0: Q1653 = -24.1545
1267 CALL LBL 2
1268 FN 0: Q1662 = +4
1269 CALL LBL 1
1270 FN 0: Q1607 = +164 ; touch 164: block x- face -Y
1271 FN 0: Q1653 = -27.1545
1272 CALL LBL 2
1273 CALL LBL 1
1274 FN 0: Q1651 = -128.842
1275 CALL LBL 3
1276 FN 0: Q1607 = +165 ; touch 165: block x- face -Y
1277 FN 0: Q1653 = -24.1545
1278 CALL LBL 2
1279 CALL LBL 1
1280 FN 0: Q1607 = +166 ; touch 166: block x- face -Y
1281 FN 0: Q1653 = -27.1545
1282 CALL LBL 2
1283 CALL LBL 1
1284 FN 0: Q1651 = -73.842
1285 CALL LBL 3
1286 FN 0: Q1652 = -2.5
1287 CALL LBL 3
1288 FN 0: Q1607 = +167 ; touch 167: block x+ face +Z
1289 QS1601 = "block x+ face +Z"
1290 FN 0: Q1653 = -17.1545
1291 CALL LBL 2
1292 FN 0: Q1662 = +0
1293 FN 0: Q1663 = -4
1294 FN 0: Q1665 = +300
1295 FN 0: Q1668 = +2
1296 CALL LBL 6
1297 CALL LBL 1
1298 FN 0: Q1652 = +2.5
1299 CALL LBL 3
1300 FN 0: Q1607 = +168 ; touch 168: block x+ face +Z
1301 FN 0: Q1653 = -17.1545
1302 CALL LBL 2
1303 FN 0: Q1665 = +300
1304 CALL LBL 1
1305 FN 0: Q1651 = -68.842
1306 CALL LBL 3
1307 FN 0: Q1652 = -2.5
1308 CALL LBL 3
1309 FN 0: Q1607 = +169 ; touch 169: block x+ face +Z
1310 FN 0: Q1653 = -17.1545
1311 CALL LBL 2
1312 CALL LBL 1
1313 FN 0: Q1652 = +2.5
1314 CALL LBL 3
1315 FN 0: Q1607 = +170 ; touch 170: block x+ face +Z
1316 FN 0: Q1653 = -17.1545
1317 CALL LBL 2
1318 CALL LBL 1
1319 FN 0: Q1651 = -73.842
1320 CALL LBL 3
1321 FN 0: Q1652 = +10
1322 CALL LBL 3
1323 FN 0: Q1607 = +171 ; touch 171: block x+ face +Y
1324 QS1601 = "block x+ face +Y"
1325 FN 0: Q1653 = -24.1545
1326 CALL LBL 2
1327 FN 0: Q1662 = -4
1328 FN 0: Q1663 = +0
1329 CALL LBL 1
1330 FN 0: Q1607 = +172 ; touch 172: block x+ face +Y
1331 FN 0: Q1653 = -27.1545
1332 CALL LBL 2
1333 CALL LBL 1
1334 FN 0: Q1651 = -68.842
1335 CALL LBL 3
1336 FN 0: Q1607 = +173 ; touch 173: block x+ face +Y
1337 FN 0: Q1653 = -24.1545
1338 CALL LBL 2
1339 CALL LBL 1
1340 FN 0: Q1607 = +174 ; touch 174: block x+ face +Y
1341 FN 0: Q1653 = -27.1545
1342 CALL LBL 2
1343 CALL LBL 1
1344 FN 0: Q1651 = -73.842
1345 CALL LBL 3
1346 FN 0: Q1652 = -10
1347 CALL LBL 3
1348 FN 0: Q1607 = +175 ; touch 175: block x+ face -Y
1349 QS1601 = "block x+ face -Y"
1350 FN 0: Q1653 = -24.1545
1351 CALL LBL 2
1352 FN 0: Q1662 = +4
1353 CALL LBL 1
1354 FN 0: Q1607 = +176 ; touch 176: block x+ face -Y
1355 FN 0: Q1653 = -27.1545
1356 CALL LBL 2
1357 CALL LBL 1
1358 FN 0: Q1651 = -68.842
1359 CALL LBL 3
1360 FN 0: Q1607 = +177 ; touch 177: block x+ face -Y
1361 FN 0: Q1653 = -24.1545
1362 CALL LBL 2
1363 CALL LBL 1
1364 FN 0: Q1607 = +178 ; touch 178: block x+ face -Y
1365 FN 0: Q1653 = -27.1545
1366 CALL LBL 2
1367 CALL LBL 1
1368 FN 0: Q1651 = -103.842
1369 CALL LBL 3
1370 FN 0: Q1652 = -32.5
1371 CALL LBL 3
1372 FN 0: Q1607 = +179 ; touch 179: block y- face +Z
1373 QS1601 = "block y- face +Z"
1374 FN 0: Q1653 = -17.1545
1375 CALL LBL 2
1376 FN 0: Q1662 = +0
1377 FN 0: Q1663 = -4
1378 FN 0: Q1665 = +300
1379 FN 0: Q1668 = +3
1380 CALL LBL 6
1381 CALL LBL 1
1382 FN 0: Q1652 = -27.5
1383 CALL LBL 3
1384 FN 0: Q1607 = +180 ; touch 180: block y- face +Z
1385 FN 0: Q1653 = -17.1545
1386 CALL LBL 2
1387 FN 0: Q1665 = +300
1388 CALL LBL 1
1389 FN 0: Q1651 = -98.842
1390 CALL LBL 3
1391 FN 0: Q1652 = -32.5
1392 CALL LBL 3
1393 FN 0: Q1607 = +181 ; touch 181: block y- face +Z
1394 FN 0: Q1653 = -17.1545
1395 CALL LBL 2
1396 CALL LBL 1
1397 FN 0: Q1652 = -27.5
1398 CALL LBL 3
1399 FN 0: Q1607 = +182 ; touch 182: block y- face +Z
1400 FN 0: Q1653 = -17.1545
1401 CALL LBL 2
1402 CALL LBL 1
1403 FN 0: Q1651 = -103.842
1404 CALL LBL 3
1405 FN 0: Q1652 = -20
1406 CALL LBL 3
1407 FN 0: Q1607 = +183 ; touch 183: block y- face +Y
1408 QS1601 = "block y- face +Y"
1409 FN 0: Q1653 = -24.1545
1410 CALL LBL 2
1411 FN 0: Q1662 = -4
1412 FN 0: Q1663 = +0
1413 CALL LBL 1
1414 FN 0: Q1607 = +184 ; touch 184: block y- face +Y
1415 FN 0: Q1653 = -27.1545
1416 CALL LBL 2
1417 CALL LBL 1
1418 FN 0: Q1651 = -98.842
1419 CALL LBL 3
1420 FN 0: Q1607 = +185 ; touch 185: block y- face +Y
1421 FN 0: Q1653 = -24.1545
1422 CALL LBL 2
1423 CALL LBL 1
1424 FN 0: Q1607 = +186 ; touch 186: block y- face +Y
1425 FN 0: Q1653 = -27.1545
1426 CALL LBL 2
1427 CALL LBL 1
1428 FN 0: Q1651 = -103.842
1429 CALL LBL 3
1430 FN 0: Q1652 = -40
1431 CALL LBL 3
1432 FN 0: Q1607 = +187 ; touch 187: block y- face -Y
1433 QS1601 = "block y- face -Y"
1434 FN 0: Q1653 = -24.1545
1435 CALL LBL 2
1436 FN 0: Q1662 = +4
1437 CALL LBL 1
1438 FN 0: Q1607 = +188 ; touch 188: block y- face -Y
1439 FN 0: Q1653 = -27.1545
1440 CALL LBL 2
1441 CALL LBL 1
1442 FN 0: Q1651 = -98.842
1443 CALL LBL 3
1444 FN 0: Q1607 = +189 ; touch 189: block y- face -Y
1445 FN 0: Q1653 = -24.1545
1446 CALL LBL 2
1447 CALL LBL 1
1448 FN 0: Q1607 = +190 ; touch 190: block y- face -Y
1449 FN 0: Q1653 = -27.1545
1450 CALL LBL 2
1451 CALL LBL 1
1452 FN 0: Q1651 = -103.842
1453 CALL LBL 3
1454 FN 0: Q1652 = +27.5
1455 CALL LBL 3
1456 FN 0: Q1607 = +191 ; touch 191: block y+ face +Z
1457 QS1601 = "block y+ face +Z"
1458 FN 0: Q1653 = -17.1545
1459 CALL LBL 2
1460 FN 0: Q1662 = +0
1461 FN 0: Q1663 = -4
1462 FN 0: Q1665 = +300
1463 FN 0: Q1668 = +3
1464 CALL LBL 6
1465 CALL LBL 1
1466 FN 0: Q1652 = +32.5
1467 CALL LBL 3
1468 FN 0: Q1607 = +192 ; touch 192: block y+ face +Z
1469 FN 0: Q1653 = -17.1545
1470 CALL LBL 2
1471 FN 0: Q1665 = +300
1472 CALL LBL 1
1473 FN 0: Q1651 = -98.842
1474 CALL LBL 3
1475 FN 0: Q1652 = +27.5
1476 CALL LBL 3
1477 FN 0: Q1607 = +193 ; touch 193: block y+ face +Z
1478 FN 0: Q1653 = -17.1545
1479 CALL LBL 2
1480 CALL LBL 1
1481 FN 0: Q1652 = +32.5
1482 CALL LBL 3
1483 FN 0: Q1607 = +194 ; touch 194: block y+ face +Z
1484 FN 0: Q1653 = -17.1545
1485 CALL LBL 2
1486 CALL LBL 1
1487 FN 0: Q1651 = -103.842
1488 CALL LBL 3
1489 FN 0: Q1652 = +40
1490 CALL LBL 3
1491 FN 0: Q1607 = +195 ; touch 195: block y+ face +Y
1492 QS1601 = "block y+ face +Y"
1493 FN 0: Q1653 = -24.1545
1494 CALL LBL 2
1495 FN 0: Q1662 = -4
1496 FN 0: Q1663 = +0
1497 CALL LBL 1
1498 FN 0: Q1607 = +196 ; touch 196: block y+ face +Y
1499 FN 0: Q1653 = -27.1545
1500 CALL LBL 2
1501 CALL LBL 1
1502 FN 0: Q1651 = -98.842
1503 CALL LBL 3
1504 FN 0: Q1607 = +197 ; touch 197: block y+ face +Y
1505 FN 0: Q1653 = -24.1545
1506 CALL LBL 2
1507 CALL LBL 1
1508 FN 0: Q1607 = +198 ; touch 198: block y+ face +Y
1509 FN 0: Q1653 = -27.1545
1510 CALL LBL 2
1511 CALL LBL 1
1512 FN 0: Q1651 = -103.842
1513 CALL LBL 3
1514 FN 0: Q1652 = +20
1515 CALL LBL 3
1516 FN 0: Q1607 = +199 ; touch 199: block y+ face -Y
1517 QS1601 = "block y+ face -Y"
1518 FN 0: Q1653 = -24.1545
1519 CALL LBL 2
1520 FN 0: Q1662 = +4
1521 CALL LBL 1
1522 FN 0: Q1607 = +200 ; touch 200: block y+ face -Y
1523 FN 0: Q1653 = -27.1545
1524 CALL LBL 2
1525 CALL LBL 1
1526 FN 0: Q1651 = -98.842
1527 CALL LBL 3
1528 FN 0: Q1607 = +201 ; touch 201: block y+ face -Y
1529 FN 0: Q1653 = -24.1545
1530 CALL LBL 2
1531 CALL LBL 1
1532 FN 0: Q1607 = +202 ; touch 202: block y+ face -Y
1533 FN 0: Q1653 = -27.1545
1534 CALL LBL 2
1535 CALL LBL 1
1536 FN 0: Q1653 = +349
1537 CALL LBL 3
1538 LBL 33
1539 FN 11: IF +Q1610 GT +0 GOTO LBL 9
1540 FN 16: F-PRINT TNC:\AXISCAL\HEAD_E.A / TNC:\AXISCAL\HEAD.LOG
1541 LBL 9
1542 M5
1543 M30
1544 ; routine: one touch and back to where it began, then up along the lift
1545 LBL 1
1546 FN 9: IF +Q1610 EQU +0 GOTO LBL 10
1547 Q1651 = Q1651 + Q1661
1548 Q1652 = Q1652 + Q1662
1549 Q1653 = Q1653 + Q1663
1550 CALL LBL 2
1551 Q1651 = Q1651 - Q1661
1552 Q1652 = Q1652 - Q1662
1553 Q1653 = Q1653 - Q1663
1554 CALL LBL 2
1555 FN 9: IF +0 EQU +0 GOTO LBL 16
1556 LBL 10
1557 Q1681 = Q1661
1558 Q1682 = Q1662
1559 Q1683 = Q1663
1560 Q1684 = SQRT ( Q1681 * Q1681 + Q1682 * Q1682 + Q1683 * Q1683 )
1561 TCH PROBE 4.0 MEASURING IN 3-D
1562 TCH PROBE 4.1 Q1601
1563 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1564 TCH PROBE 4.3 DIST+Q1684 FQ1665 MB0.5 REFERENCE SYSTEM:1
1565 FN 9: IF +Q1604 EQU -1 GOTO LBL 11
1566 Q1605 = ( ( Q1601 - Q1654 ) * Q1681 + ( Q1602 - Q1655 ) * Q1682 + ( Q1603 - Q1656 ) * Q1683 ) / Q1684 - Q1664
1567 Q1615 = 0.05 - Q1664
1568 FN 12: IF +Q1605 LT +Q1615 GOTO LBL 12
1569 FN 11: IF +Q1605 GT +1 GOTO LBL 13
1570 FN 12: IF +Q1605 LT -1 GOTO LBL 13
1571 Q1615 = Q1684 - Q1664 - Q1605 + 0.5
1572 TCH PROBE 4.0 MEASURING IN 3-D
1573 TCH PROBE 4.1 Q1601
1574 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1575 TCH PROBE 4.3 DIST+Q1615 FQ1666 MB0.5 REFERENCE SYSTEM:1
1576 FN 9: IF +Q1604 EQU -1 GOTO LBL 11
1577 Q1606 = ( ( Q1601 - Q1654 ) * Q1681 + ( Q1602 - Q1655 ) * Q1682 + ( Q1603 - Q1656 ) * Q1683 ) / Q1684 - Q1664
1578 Q1606 = ABS ( Q1606 - Q1605 )
1579 FN 11: IF +Q1606 GT +0.25 GOTO LBL 14
1580 FN 0: Q1608 = +1
1581 Q1621 = Q1601 - 0
1582 Q1622 = Q1602 - 0
1583 Q1623 = Q1603 - 0
1584 FN 18: SYSREAD Q1625 = ID240 NR1 IDX5
1585 FN 18: SYSREAD Q1626 = ID240 NR1 IDX6
1586 FN 18: SYSREAD Q1612 = ID320 NR1 IDX0
1587 Q1612 = Q1612 - Q1613
1588 Q1609 = Q1607 + Q1608 + Q1612 + Q1621 + Q1622 + Q1623 + Q1625 + Q1626
1589 FN 16: F-PRINT TNC:\AXISCAL\HEAD_P.A / TNC:\AXISCAL\HEAD.LOG
1590 Q1614 = Q1664 + Q1605 - 0.5
1591 Q1681 = NEG Q1681
1592 Q1682 = NEG Q1682
1593 Q1683 = NEG Q1683
1594 TCH PROBE 4.0 MEASURING IN 3-D
1595 TCH PROBE 4.1 Q1601
1596 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1597 TCH PROBE 4.3 DIST+Q1614 FQ1699 MB0 REFERENCE SYSTEM:1
1598 FN 10: IF +Q1604 NE -1 GOTO LBL 15
1599 L X+Q1654 Y+Q1655 Z+Q1656 R0 FQ1699 M91
1600 LBL 16
1601 Q1653 = Q1667
1602 CALL LBL 2
1603 LBL 0
1604 LBL 11
1605 FN 0: Q1608 = +0
1606 FN 18: SYSREAD Q1621 = ID240 NR1 IDX1
1607 FN 18: SYSREAD Q1622 = ID240 NR1 IDX2
1608 FN 18: SYSREAD Q1623 = ID240 NR1 IDX3
1609 FN 18: SYSREAD Q1625 = ID240 NR1 IDX5
1610 FN 18: SYSREAD Q1626 = ID240 NR1 IDX6
1611 FN 18: SYSREAD Q1612 = ID320 NR1 IDX0
1612 Q1612 = Q1612 - Q1613
1613 Q1609 = Q1607 + Q1608 + Q1612 + Q1621 + Q1622 + Q1623 + Q1625 + Q1626
1614 FN 16: F-PRINT TNC:\AXISCAL\HEAD_P.A / TNC:\AXISCAL\HEAD.LOG
1615 QS1600 = "missed, no contact up to the end of the search"
1616 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1617 STOP
1618 FN 9: IF +0 EQU +0 GOTO LBL 9
1619 LBL 12
1620 QS1600 = "the probe was deflected before the search began"
1621 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1622 STOP
1623 FN 9: IF +0 EQU +0 GOTO LBL 9
1624 LBL 13
1625 QS1600 = "the block does not stand where it should, tolerance 1"
1626 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1627 STOP
1628 FN 9: IF +0 EQU +0 GOTO LBL 9
1629 LBL 14
1630 QS1600 = "search and measuring touch disagree: is the probe still deflected, is the block loose?"
1631 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1632 STOP
1633 FN 9: IF +0 EQU +0 GOTO LBL 9
1634 LBL 15
1635 QS1600 = "the probe triggered on the way, or was triggered before the move"
1636 FN 16: F-PRINT TNC:\AXISCAL\AXISCAL_T.A / SCREEN:
1637 STOP
1638 FN 9: IF +0 EQU +0 GOTO LBL 9
1639 ; routine: guarded move, contact stops the program
1640 LBL 2
1641 CALL LBL 5
1642 Q1681 = Q1671 - Q1654
1643 Q1682 = Q1672 - Q1655
1644 Q1683 = Q1673 - Q1656
1645 Q1684 = SQRT ( Q1681 * Q1681 + Q1682 * Q1682 + Q1683 * Q1683 )
1646 FN 12: IF +Q1684 LT +0.0001 GOTO LBL 17
1647 TCH PROBE 4.0 MEASURING IN 3-D
1648 TCH PROBE 4.1 Q1601
1649 TCH PROBE 4.2 IX+Q1681 IY+Q1682 IZ+Q1683
1650 TCH PROBE 4.3 DIST+Q1684 FQ1699 MB0 REFERENCE SYSTEM:1
1651 FN 10: IF +Q1604 NE -1 GOTO LBL 15
1652 L X+Q1671 Y+Q1672 Z+Q1673 R0 FQ1699 M91
1653 LBL 17
1654 Q1654 = Q1671
1655 Q1655 = Q1672
1656 Q1656 = Q1673
1657 LBL 0
1658 ; routine: rapid
1659 LBL 3
1660 CALL LBL 5
1661 L X+Q1671 Y+Q1672 Z+Q1673 R0 FMAX M91
1662 Q1654 = Q1671
1663 Q1655 = Q1672
1664 Q1656 = Q1673
1665 LBL 0
1666 ; routine: a run that starts again at set-up Q1668 or later meets the block first here, and searches
1667 ; slowly
1668 LBL 6
1669 FN 12: IF +Q1600 LT +Q1668 GOTO LBL 19
1670 FN 0: Q1665 = +60
1671 LBL 19
1672 LBL 0
1673 ; routine: where to, higher in the dry run
1674 LBL 5
1675 Q1671 = Q1651
1676 Q1672 = Q1652
1677 Q1673 = Q1653
1678 FN 9: IF +Q1610 EQU +0 GOTO LBL 18
1679 Q1673 = Q1673 + Q1610
1680 FN 12: IF +Q1673 LT +349 GOTO LBL 18
1681 FN 0: Q1673 = +349
1682 LBL 18
1683 LBL 0
1684 END PGM HEAD MM
