#!/usr/bin/env python3
"""Does the rig tell the truth? Hand-written programs, and numbers that were worked out elsewhere.

    selftest.py [--warp 10] [--only NAME] [--machines FILE]

Nothing of axiscal is used. The check values (the paper's error sets on its machine, exact rotations) are the
documented ones; the rest is arithmetic that a reader can redo. Root only when --warp is above 1, or on the
first run (the components are installed then).
"""
import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
L, R = 202.684, 3.0                              # pivot to ball's centre; ball radius
EXACT = 1.0e-6                                   # mm: the log's last decimal
HEAD_BLOCKS = {"x-": (-30.0, 0.0), "x+": (30.0, 0.0), "y-": (0.0, -30.0), "y+": (0.0, 30.0)}
PAPER_HEAD_1 = "[effects.paper-head]\na_BZ = 0.015\nb_BZ = -0.010\ng_BZ = 0.020\nd_xBZ = 0.03\nd_yBZ = 0.025\n"
PAPER_TABLE_1 = "[effects.paper-table]\na_CY = 0.015\nb_CY = -0.010\nd_xCY = 0.03\nd_yCY = 0.025\n"
PAPER_TABLE_2 = "[effects.paper-table]\nEA0C = 0.025\nE_BOC = 0.034\nEX0C = -0.04\nEY0C = -0.035\n"
# displacement of the ball by the errors of B, set 1, exact
DELTA = {0: (0.065356506, 0.078074891, 0.000010033), -90: (0.029984565, 0.095750060, 0.035375031),
         -30: (0.060611914, 0.106339234, 0.017696204)}
NORMAL = {"+X": (1, 0, 0), "-X": (-1, 0, 0), "+Y": (0, 1, 0), "-Y": (0, -1, 0), "+Z": (0, 0, 1)}

failures = []


def check(what, good, seen=""):
    print(f"  {'ok  ' if good else 'FAIL'} {what}{': ' + str(seen) if seen != '' else ''}")
    if not good:
        failures.append(what)


# --------------------------------------------------------------------------------------------- small programs

def plan(machine, blocks, mounting=None, program="selftest"):
    return {"format": "axiscal-plan/1", "machine": machine, "program": program, "ball_radius_mm": R, "tool_length_mm": L,
            **({"mounting": mounting} if mounting else {}), "touches": [],
            "blocks": [{"name": n, "carrier": c, "centre": [*xy, -L], "size": [10.0, 10.0, 10.0]} for n, c, xy in blocks]}


HEAD_PLAN = plan("swivel-head", [(n, "table", xy) for n, xy in HEAD_BLOCKS.items()], "head")
TABLE_PLAN = plan("swivel-head", [("x+", "C", (30.0, 0.0))], "table")


class Program:
    """Lines of G-code; touches are numbered and logged as `n X Y Z A B C hit`."""

    def __init__(self, fast=600, slow=60, safe=60.0):
        self.fast, self.slow, self.safe, self.n = fast, slow, safe, 0
        self.lines = ["G21 G17 G40 G49 G80 G90 G94 G92.1 G61", "G10 L2 P9 X0 Y0 Z0 A0 B0 C0 R0", "G59.3",
                      "(LOGOPEN,selftest.log)", f"G0 Z{safe}"]

    def add(self, *lines):
        self.lines += lines
        return self

    def pose(self, **angles):
        return self.add(f"G0 Z{self.safe}", "G0 " + " ".join(f"{k}{v}" for k, v in angles.items()))

    def log(self):
        self.n += 1
        return self.add(f"(LOG,{self.n} %.6f#5061 %.6f#5062 %.6f#5063 %.6f#5064 %.6f#5065 %.6f#5066 %.0f#5070)")

    def touch(self, at, normal, slow=None):
        """`at` = axes at the nominal contact; fast touch, release, slow touch, away."""
        where = lambda off: " ".join(f"{k}{a + off * n:.6f}" for k, a, n in zip("XYZ", at, normal))
        self.add(f"G0 X{at[0] + 2 * normal[0]:.6f} Y{at[1] + 2 * normal[1]:.6f}", f"G0 Z{at[2] + 2 * normal[2]:.6f}",
                 f"G38.3 {where(-2)} F{self.fast}", f"G38.5 {where(2)} F{self.fast}", f"G1 {where(0.2)} F1500",
                 f"G38.3 {where(-2)} F{slow or self.slow}")
        self.log()
        return self.add(f"G1 {where(2)} F1500", f"G0 Z{self.safe}")

    def text(self):
        # X and Y at first where they are: the machine stands between the blocks at start
        return "\n".join([*self.lines, f"G0 Z{self.safe}", "(LOGCLOSE)", "M2"]) + "\n"




class Rig:
    def __init__(self, machines, warp, folder):
        self.machines, self.warp, self.folder, self.runs, self.seconds = machines, warp, folder, 0, 0.0

    def __call__(self, program, plan_data, scenario="", *options, machine="swivel-head", expect=0):
        self.runs += 1
        here = os.path.join(self.folder, str(self.runs))
        os.mkdir(here)
        paths = {name: os.path.join(here, name) for name in ("p.ngc", "p.plan.json", "s.toml", "out")}
        letters = {"swivel-head": "BC", "trunnion": "AC", "swivel-table-b": "BC", "double-head": "AB",
                   "nutating-b": "BC", "trunnion-offset": "AC"}[machine]
        text = program if isinstance(program, str) else program.text()
        for letter in "ABC":
            if letter not in letters:
                text = text.replace(f" {letter}0", "")
        for name, content in (("p.ngc", text), ("p.plan.json", json.dumps(plan_data)), ("s.toml", scenario)):
            with open(paths[name], "w") as f:
                f.write(content)
        done = subprocess.run([sys.executable, os.path.join(HERE, "rig.py"), "--machines", self.machines, "--machine", machine,
                               "--plan", paths["p.plan.json"], "--program", paths["p.ngc"], "--scenario", paths["s.toml"],
                               "--out", paths["out"], "--warp", str(self.warp), "--timeout", "120", *options],
                              capture_output=True, text=True)
        result = {}
        try:
            with open(os.path.join(paths["out"], "result.json")) as f:
                result = json.load(f)
        except OSError:
            pass
        self.said = done.stderr
        check(f"run {self.runs} exits with {expect}", done.returncode == expect, f"{done.returncode} {done.stderr.strip()}" if done.returncode != expect else "")
        log = []
        try:
            with open(os.path.join(paths["out"], "selftest.log")) as f:
                log = [[float(w) for w in line.split()] for line in f]
        except OSError:
            pass
        return log, result


# ------------------------------------------------------------------------------------------------- the tests

def head_faces():
    """Touches of the head stage: (B, block, face), the faces a stylus can reach at that B."""
    found = [(0, b, f) for b in HEAD_BLOCKS for f in NORMAL]
    found += [(-90, b, f) for b in ("x-", "y-", "y+") for f in ("+Z", "-X", "+Y", "-Y")]
    found += [(-30, b, f) for b in HEAD_BLOCKS for f in ("+Z", "-X", "+Y", "-Y")]
    return found


def head_program(slow, every=1):
    program, touches, at_b = Program(slow=slow), [], 0
    for b, block, face in head_faces()[::every]:
        if b != at_b:
            program.pose(B=b)
            at_b = b
        n, (cx, cy) = NORMAL[face], HEAD_BLOCKS[block]
        # 4 mm below the top, in the middle of a side face; q = nominal vector from the pivot to the ball
        point = (cx + 5 * n[0], cy + 5 * n[1], -L + (5 if face == "+Z" else 1))
        q = (-L * math.sin(math.radians(b)), 0.0, -L * math.cos(math.radians(b)))
        at = tuple(p + R * k - x for p, k, x in zip(point, n, q))
        program.touch(at, n)
        touches.append((b, face, at))
    return program, touches


def readings(log, touches):
    """e = recorded minus nominal along the outward normal."""
    return [sum(k * (m - a) for k, m, a in zip(NORMAL[face], row[1:4], at)) for row, (_, face, at) in zip(log, touches)]


def paper_head(rig):
    """The head's errors of the paper on swivel-head: every reading is -n.Delta(B)."""
    program, touches = head_program(slow=60)
    log, result = rig(program, HEAD_PLAN, "seed = 1\n" + PAPER_HEAD_1)
    check("every touch is logged and hit", len(log) == len(touches) and all(r[-1] == 1 for r in log), len(log))
    off = [e + sum(k * d for k, d in zip(NORMAL[f], DELTA[b])) for e, (b, f, _) in zip(readings(log, touches), touches)]
    check("readings = -n.Delta(B), 1 nm", max(map(abs, off), default=9) <= EXACT, f"largest {max(map(abs, off), default=9):.2e} mm of {len(off)}")
    check("two contacts a touch, none by the stem", result["touches"] == 2 * len(touches) and not result["stem_touches"], result["touches"])
    check("no contact with anything but blocks", result["block_touches"] == result["touches"] and result["collisions"] == 0)
    check("overtravel is a few um", 0 < result["max_overtravel_mm"] < 0.05, result["max_overtravel_mm"])
    check("the user's G54 is as it was", result["g54_unchanged"])
    return off


def servo_latch(rig):
    """The plain latch is late by 0 .. feed x servo period."""
    feed, period_us = 300, 1000
    bound = feed / 60 * period_us * 1e-6
    program, touches = head_program(slow=feed, every=2)
    log, _ = rig(program, HEAD_PLAN, PAPER_HEAD_1, "--latch", "servo", "--servo-us", str(period_us))
    late = [-(e + sum(k * d for k, d in zip(NORMAL[f], DELTA[b]))) for e, (b, f, _) in zip(readings(log, touches), touches)]
    check(f"late by 0 .. {bound * 1000:g} um at F{feed}", len(late) == len(touches) and -EXACT <= min(late) and max(late) <= bound + EXACT,
          f"{min(late) * 1000:.3f} .. {max(late) * 1000:.3f} um, mean {statistics.mean(late) * 1000:.3f}")
    check("and it is late", max(late) > bound / 4)


def table_touches(program, where, top=True):
    """Outer face and upper face of the block at (30, 0), for each angle of C; NC axes, B = 0."""
    at = []
    for c in where:
        k, s = math.cos(math.radians(c)), math.sin(math.radians(c))
        k, s = round(k, 12) + 0.0, round(s, 12) + 0.0
        program.pose(C=c)
        program.touch((38 * k, 38 * s, 0.0), (k, s, 0.0))
        at.append(((38 * k, 38 * s, 0.0), (k, s, 0.0)))
        if top:
            program.touch((30 * k, 30 * s, 5 + R), (0, 0, 1))
            at.append(((30 * k, 30 * s, 5 + R), (0, 0, 1)))
    return at


def along(log, at):
    return [sum(k * (m - a) for k, m, a in zip(n, row[1:4], p)) for row, (p, n) in zip(log, at)]


def paper_table(rig):
    """The table's errors, both sets: the documented readings on one block at four C."""
    for scenario, side, top in (
            (PAPER_TABLE_1, (0.065375611, 0.078063848, -0.065374453, -0.078061244), (0.005214570, 0.007832564, -0.005257406, -0.007875400)),
            (PAPER_TABLE_2, (-0.160268430, 0.053441176, 0.160281812, -0.053433941), (-0.017863636, 0.013028697, 0.017741085, -0.013151248))):
        program = Program()
        at = table_touches(program, (0, 90, 180, 270))
        log, _ = rig(program, TABLE_PLAN, scenario)
        wanted = [v for pair in zip(side, top) for v in pair]
        off = [e - v for e, v in zip(along(log, at), wanted)]
        check("readings of outer and upper face at C = 0, 90, 180, 270", len(off) == 8 and max(map(abs, off)) <= EXACT,
              f"largest {max(map(abs, off), default=9):.2e} mm")


def harmonic(rig):
    """A radial run-out of C once a turn, in x of R, and a tool-side location error after the rotation of B."""
    program = Program()
    at = table_touches(program, (0, 60, 180, 300), top=False)
    log, _ = rig(program, TABLE_PLAN, '[[harmonic]]\naxis = "C"\ndof = "dx"\nk = 1\ncos_um = 5.0\nsin_um = 2.0\n')
    wanted = []
    for c in (0, 60, 180, 300):
        a = math.radians(c)
        wanted.append(math.cos(a) * (0.005 * math.cos(a) + 0.002 * math.sin(a)))
    off = [e - v for e, v in zip(along(log, at), wanted)]
    check("run-out 5 cos C + 2 sin C um appears along the normal", len(off) == 4 and max(map(abs, off)) <= EXACT, f"largest {max(map(abs, off), default=9):.2e} mm")

    # location-b on the tool's side: the ball is displaced by Ry(B)(x0, 0, z0)
    program, touches = head_program(slow=300, every=3)
    log, _ = rig(program, HEAD_PLAN, "[effects.location-b]\nEX0B = 0.012\nEZ0B = -0.02\n")
    off = []
    for e, (b, f, _) in zip(readings(log, touches), touches):
        s, c = math.sin(math.radians(b)), math.cos(math.radians(b))
        delta = (0.012 * c - 0.02 * s, 0.0, -0.012 * s - 0.02 * c)
        off.append(e + sum(k * d for k, d in zip(NORMAL[f], delta)))
    check("offsets of B stand after its rotation", len(off) == len(touches) and max(map(abs, off)) <= EXACT, f"largest {max(map(abs, off), default=9):.2e} mm")


def double_head(rig):
    """Both axes in the head, set 1 with the labels of the paper's table; documented displacements."""
    delta = {(0, 0): (0.075341684, 0.120528414, -0.009972663), (-90, 0): (0.029963555, 0.138197473, 0.035386143),
             (0, 90): (-0.030766724, 0.024968632, 0.085514325), (0, -90): (0.110766723, 0.025038349, -0.105510834)}
    faces = {(0, 0): ("+X", "-Y", "+Z"), (-90, 0): ("-X", "+Y", "+Z"), (0, 90): ("+X", "-Y", "+Z"), (0, -90): ("-X", "+Y", "+Z")}
    program, at, wanted = Program(slow=300), [], []
    for (b, a), d in delta.items():
        program.pose(A=a, B=b)
        rb, ra = math.radians(b), math.radians(a)
        qa = (0.0, L * math.sin(ra), -L * math.cos(ra))                       # Rx(A) (0, 0, -L)
        q = (math.sin(rb) * qa[2], qa[1], math.cos(rb) * qa[2])               # Ry(B) of it
        block = {(-90, 0): "x-", (0, 90): "y-", (0, -90): "y+"}.get((b, a), "x+")   # the one on the body's side
        for face in faces[(b, a)]:
            n, (cx, cy) = NORMAL[face], HEAD_BLOCKS[block]
            point = (cx + 5 * n[0], cy + 5 * n[1], -L + (5 if face == "+Z" else 1))
            p = tuple(x + R * k - v for x, k, v in zip(point, n, q))
            program.touch(p, n)
            at.append((p, n))
            wanted.append(-sum(k * v for k, v in zip(n, d)))
    log, result = rig(program, plan("double-head", [(n, "table", xy) for n, xy in HEAD_BLOCKS.items()], "head"),
                      "[effects.paper-double-head]\na_BZ = 0.015\nb_BZ = -0.01\ng_BZ = 0.02\nd_xBZ = 0.03\nd_yBZ = 0.025\nd_zBZ = -0.01\n"
                      "a_BA = 0.012\nd_xBA = 0.01\n", machine="double-head")
    off = [e - v for e, v in zip(along(log, at), wanted)]
    check("readings of the two-axis head", len(off) == len(wanted) and max(map(abs, off)) <= EXACT, f"largest {max(map(abs, off), default=9):.2e} mm of {len(off)}; {result['errors']}")


def noise(rig):
    """Seeded normal noise per touch, one draw per press; the vector of an index visit."""
    def many(count):
        program = Program().add("G0 X30", "G0 Z8.2")
        for _ in range(count):
            program.add("G38.3 Z7.5 F300").log().add("G1 Z8.2 F1500")
        return program
    program = many(120)
    log, result = rig(program, HEAD_PLAN, "seed = 7\n[noise]\ntouch_um = 0.5\n")
    z = [row[3] - 8 for row in log]
    sd, mean = statistics.stdev(z) * 1000, statistics.mean(z) * 1000
    check("120 touches of sigma 0.5 um: sd within 4 of its own sigmas, mean too", abs(sd - 0.5) < 4 * 0.5 / math.sqrt(240) and abs(mean) < 4 * 0.5 / math.sqrt(120),
          f"sd {sd:.3f}, mean {mean:+.3f} um")
    check("one contact each: no chatter", result["touches"] == 120, result["touches"])
    again, _ = rig(many(20), HEAD_PLAN, "seed = 7\n[noise]\ntouch_um = 0.5\n")
    check("the same seed gives the same touches", [r[3] for r in again] == [r[3] for r in log[:20]])

    visits = Program()
    for k in range(24):
        visits.pose(B=-10).pose(B=0)
        visits.add("G0 X30 Y0", "G0 Z8.2")
        for _ in range(2):
            visits.add("G38.3 Z7.5 F300").log().add("G1 Z8.2 F1500")
    log, _ = rig(visits, HEAD_PLAN, "seed = 3\n[noise]\nvisit_um = 2.0\n")
    first, second = [r[3] for r in log[::2]], [r[3] for r in log[1::2]]
    sd = statistics.stdev(first) * 1000
    check("a visit's vector holds for the whole visit", first == second and len(first) == 24)
    check("24 visits of sigma 2 um", 1.0 < sd < 3.2, f"sd {sd:.2f} um")


def bodies(rig):
    """Pretravel, a missed touch, a displaced and tilted block, an edge and a corner."""
    program = Program().add("G0 X30", "G0 Z10", "G38.3 Z5 F60").log().add("G1 Z10 F1500")              # 1 pretravel, top
    program.add("G0 X36", "G38.3 Z5 F60").log().add("G1 Z10 F1500")                                    # 2 edge, 1 mm outside
    program.add("G0 X36 Y6", "G38.3 Z5 F60").log().add("G1 Z10 F1500")                                 # 3 corner
    program.add("G0 X45 Y0", "G38.3 Z5 F600").log().add("G1 Z10 F1500")                                # 4 beside: a miss
    program.add("G0 X-28 Y0", "G38.3 Z5 F60").log().add("G1 Z20 F1500")                                # 5 tilted, shifted block
    program.add("G0 X-17", "G0 Z0", "G38.3 X-24 F300").log().add("G1 X-17 F1500")                        # 6 its +X face
    program.add("G0 Z20").add("G0 X0 Y30", "G38.3 Z5 F300").log()                                      # 7 press ...
    program.add("G38.5 Z10 F60").log()                                                                 # 8 ... and release
    log, result = rig(program, HEAD_PLAN, "[effects.pretravel]\npretravel = 0.005\n[[block]]\nmounting = \"head\"\nname = \"x-\"\n"
                      "shift = [0.1, -0.2, 0.05]\ntilt = [0.3, 0.2, -0.4]\n[[block]]\nmounting = \"table\"\nname = \"x+\"\nshift = [9.0, 9.0, 9.0]\n")
    r = R - 0.005
    check("eight lines", len(log) == 8, result["errors"])
    if len(log) != 8:
        return
    near = lambda seen, wanted: abs(seen - wanted) <= EXACT
    check("pretravel 5 um", near(log[0][3], 7.995), log[0][3])
    check("edge", near(log[1][3], 5 + math.sqrt(r * r - 1)), log[1][3])
    check("corner", near(log[2][3], 5 + math.sqrt(r * r - 2)), log[2][3])
    check("a miss says 0 and the end of the move", log[3][-1] == 0 and abs(log[3][3] - 5) < 0.02, log[3])
    # the displaced block: its plane n'.(p - c') = 5, the ball meets it where n'.(p - c') = 5 + r; R's z is 202.684 lower
    (ca, sa), (cb, sb), (cc, sc) = ((math.cos(math.radians(t)), math.sin(math.radians(t))) for t in (0.3, 0.2, -0.4))
    x_axis = (cc * cb, sc * cb, -sb)                                                    # columns of Rz(c) Ry(b) Rx(a)
    z_axis = (cc * sb * ca + sc * sa, sc * sb * ca - cc * sa, cb * ca)
    centre = (-30 + 0.1, -0.2, 0.05)
    def meets(axis, k, at):
        rest = sum(axis[i] * (at[i] - centre[i]) for i in range(3) if i != k)
        return centre[k] + (5 + r - rest) / axis[k]
    check("tilted block, upper face", near(log[4][3], meets(z_axis, 2, (-28, 0, 0))), log[4][3])
    check("tilted block, +X face", near(log[5][1], meets(x_axis, 0, (0, 0, 0))), log[5][1])
    check("G38.5 latches the release where G38.3 latched the press", near(log[7][3], log[6][3]) and log[7][-1] == 1, (log[6][3], log[7][3]))
    check("a block of another mounting stays where it is", near(log[0][3], 7.995))


def refusals(rig):
    """What must end badly: and say so."""
    def head(*lines): return "\n".join(["G21 G17 G40 G49 G90 G94", "G59.3", "G0 Z20", *lines, "M2"]) + "\n"
    _, r = rig(head("G0 X60", "G38.2 Z10 F6000"), HEAD_PLAN, expect=1)
    check("a missed G38.2 stops", any("without making contact" in e for e in r["errors"]), r["errors"])
    _, r = rig(head("G0 X30", "G1 Z6 F3000"), HEAD_PLAN, expect=1)
    check("contact outside a probing move stops", any("non-probe" in e for e in r["errors"]), r["errors"])
    _, r = rig(head("(abort,block x- is missing)"), HEAD_PLAN, expect=1)
    check("the message of an abort arrives", r["errors"] == ["block x- is missing"], r["errors"])
    # at B = -90 the stem lies along X: lowered onto block x- from above it touches first
    _, r = rig(head("G0 Z150", "G0 B-90", "G0 X-202.684", f"G1 Z{-L + 20} F5000", f"G1 Z{-L} F2000"), HEAD_PLAN, expect=1)
    check("the stem touches a block", r["stem_touched"] and r["stem_touches"] == 1 and r["touched"] == ["x-"], (r["stem_touches"], r["touched"]))
    # ball beside block x+, body (75 mm behind it) over block x-
    _, r = rig(head("G0 Z150", "G0 B-90", f"G0 X{55 - L}", f"G1 Z{-L + 30} F5000", f"G1 Z{-L + 15} F2000"), HEAD_PLAN, expect=1)
    check("the probe's body meets a block", r["collisions"] == 1 and r["touched"] == ["x-"], (r["collisions"], r["touched"]))
    rig(head(), HEAD_PLAN, "[effects.head-sag]\nsag = 1.0\n", expect=2)
    check("an unknown effect is named", "head-sag" in rig.said, rig.said.strip()[-60:])
    rig(head(), HEAD_PLAN, "[effects.location-a]\nEY0A = 1.0\n", expect=2)
    check("an axis that the machine lacks is named", "no axis A" in rig.said)


IDENTITY_KINS = r'''
#include "rtapi.h"
#include "rtapi_app.h"
#include "hal.h"
#include "kinematics.h"
MODULE_LICENSE("GPL");
static struct data { hal_float_t *shift; } *pin;
static int id;
KINEMATICS_TYPE kinematicsType(void) { return KINEMATICS_BOTH; }
int kinematicsSwitchable(void) { return 0; }
int kinematicsSwitch(int type) { (void)type; return 0; }
EXPORT_SYMBOL(kinematicsType); EXPORT_SYMBOL(kinematicsSwitchable); EXPORT_SYMBOL(kinematicsSwitch);
int kinematicsForward(const double *j, EmcPose *p, const KINEMATICS_FORWARD_FLAGS *f, KINEMATICS_INVERSE_FLAGS *i) {
    (void)f; (void)i;
    p->tran.x = j[0] - *pin->shift; p->tran.y = j[1]; p->tran.z = j[2]; p->a = 0; p->b = j[3]; p->c = j[4];
    p->u = p->v = p->w = 0;
    return 0;
}
int kinematicsInverse(const EmcPose *p, double *j, const KINEMATICS_INVERSE_FLAGS *i, KINEMATICS_FORWARD_FLAGS *f) {
    (void)f; (void)i;
    j[0] = p->tran.x + *pin->shift; j[1] = p->tran.y; j[2] = p->tran.z; j[3] = p->b; j[4] = p->c;
    return 0;
}
EXPORT_SYMBOL(kinematicsForward); EXPORT_SYMBOL(kinematicsInverse);
int rtapi_app_main(void) {
    id = hal_init("axiscal_selftest_kins");
    if (id < 0) return id;
    pin = hal_malloc(sizeof *pin);
    if (hal_pin_float_new("axiscal_selftest_kins.x-shift", HAL_IN, &pin->shift, id)) return -1;
    return hal_ready(id);
}
void rtapi_app_exit(void) { hal_exit(id); }
'''


def compensation(rig):
    """What an exporter writes: a kinematics component with its pins, axis tables, home offsets, stock TCP modules."""
    folder = rig.folder
    source, hal, ini, table = (os.path.join(folder, n) for n in ("axiscal_selftest_kins.c", "k.hal", "extra.ini", "comp_x.txt"))
    for path, text in ((source, IDENTITY_KINS), (hal, "setp axiscal_selftest_kins.x-shift 0.25\n"),
                       (table, "-400 0.04 0.04\n400 -0.04 -0.04\n"),
                       (ini, "# tables\n[JOINT_0]\nCOMP_FILE = comp_x.txt\nCOMP_FILE_TYPE = 1\n[JOINT_4]\nHOME_OFFSET = 0.5\n")):
        with open(path, "w") as f:
            f.write(text)
    program = Program()
    program.add("G0 X45", "G0 Z0", "G38.3 X30 F300").log().add("G1 X60 F1500", "G0 Z20")
    log, _ = rig(program, HEAD_PLAN, "", "--kins-c", source, "--hal", hal)
    check("own kinematics component with its pin", len(log) == 1 and abs(log[0][1] - 37.75) <= EXACT, log and log[0][1])

    # the axis goes (1 - 1e-4) of what it is told; C stands 0.5 deg back: told C0.5 it stands at 0
    program = Program().pose(C=0.5)
    program.add("G0 X45 Y0", "G0 Z0", "G38.3 X30 F300").log().add("G1 X60 F1500", "G0 Z20")
    log, _ = rig(program, TABLE_PLAN, "", "--ini-extra", ini)
    check("axis table and home offset", len(log) == 1 and abs(log[0][1] * (1 - 1e-4) - 38) <= EXACT, log and log[0][1])

    # TCP: touched in workpiece coordinates at other angles, the readings are those of the first pose
    for machine, first, module in (("trunnion", "A", "xyzac-trt-kins"), ("swivel-table-b", "B", "xyzbc-trt-kins")):
        with open(hal, "w") as f:       # rotary axes meet 250 mm below R, 47.316 below the ball at Z0
            f.write("".join(f"setp {module}.{pin} {v}\n" for pin, v in (("x-rot-point", 0), ("y-rot-point", 0), ("z-rot-point", L - 250))))
        program = Program(safe=100.0)
        for tilt, c in ((0, 0), (-20, 0), (25, 90), (-15, 200)):
            program.add("G0 X0 Y0 Z100", f"G0 {first}{tilt} C{c}", "G0 X33 Y1", "G0 Z9", "G38.3 Z6 F300").log().add("G1 Z10 F1500")
            program.add("G0 Z20", "G0 X40", "G0 Z1", "G38.3 X36 F300").log().add("G1 X40 F1500", "G0 Z60")
        block = plan(machine, [("x+", "C", (30.0, 0.0))], "table")
        log, result = rig(program, block, "", "--kins", module, "--hal", hal, machine=machine)
        off = [abs(row[3] - 8) for row in log[::2]] + [abs(row[1] - 38) for row in log[1::2]]
        check(f"{machine} under {module}: nominal at every angle", len(off) == 8 and max(off) <= EXACT, f"largest {max(off, default=9):.2e} mm; {result['errors']}")


TESTS = [paper_head, servo_latch, paper_table, harmonic, double_head, noise, bodies, refusals, compensation]


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--warp", type=int, default=10 if os.geteuid() == 0 else 1)
    p.add_argument("--only", action="append", choices=[t.__name__ for t in TESTS])
    p.add_argument("--machines", default=os.path.join(HERE, "..", "..", "machines.toml"))
    args = p.parse_args()
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="axiscal-selftest-") as folder:
        rig = Rig(os.path.abspath(args.machines), args.warp, folder)
        for test in TESTS:
            if args.only and test.__name__ not in args.only:
                continue
            print(f"{test.__name__}: {test.__doc__.splitlines()[0]}")
            began = time.monotonic()
            test(rig)
            print(f"  {time.monotonic() - began:.1f} s")
    print(f"{rig.runs} runs, {time.monotonic() - started:.1f} s: {'all good' if not failures else f'{len(failures)} FAILED: ' + '; '.join(failures)}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
