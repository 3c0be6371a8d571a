"""The gap at a touch and its derivatives for the machine `swivel-head`, over all touches at once.

Signs and frames: docs/conventions.md. Lengths mm, angles of the unknowns deg, scales um/m, squareness urad.
"""

import numpy as np

DEG = np.pi / 180.0
MICRO = 1e-6
GLOBALS = ["EX0B", "EZ0B", "EA0B", "EC0B", "EX0C", "EY0C", "EA0C", "EB0C", "pretravel", "EXX", "EYY", "EC0Y"]
SET_UP = ["SX", "SY", "SZ", "SA", "SB", "SC"]


class Touches:
    """Arrays over the touches: position (n, 3), B and C in deg, point, normal, ball (n, 3), radius, set-up (n)."""

    def __init__(self, xyz, b_deg, c_deg, point, normal, radius, ball, set_up, turns, centre):
        self.x, self.y, self.z = xyz.T
        self.point, self.normal, self.radius, self.ball = point, normal, radius, ball
        self.set_up = set_up.astype(int)
        self.turns = np.asarray(turns)[self.set_up]  # carried by C, else by the linear axes' table
        self.centre = np.asarray(centre)[self.set_up]
        self.sb, self.cb = np.sin(b_deg * DEG), np.cos(b_deg * DEG)
        self.sc = np.where(self.turns, np.sin(c_deg * DEG), 0.0)
        self.cc = np.where(self.turns, np.cos(c_deg * DEG), 1.0)
        self.planned = turn(list(normal.T), 0, 1, self.sc, self.cc)  # the normal in R as planned


def turn(v, i, j, s, c):
    """Turns the components i and j of v (3, n) and gives the new v."""
    out = list(v)
    out[i], out[j] = c * v[i] - s * v[j], s * v[i] + c * v[j]
    return out


def evaluate(t, names, theta, jacobian=True):
    """Gaps (n) and Jacobian (n, unknowns). `names` are the globals in use, then SX SY SZ SA SB SC of every set-up."""
    at = {name: i for i, name in enumerate(names)}
    g = {name: theta[at[name]] if name in at else 0.0 for name in GLOBALS}
    n_globals = sum(name in at for name in GLOBALS)
    per_block = len(names) > n_globals
    s = theta[n_globals:].reshape(-1, 6)[t.set_up].T if per_block else np.zeros((6, 1))
    sc_ = lambda deg: (np.sin(deg * DEG), np.cos(deg * DEG))
    (sa0, ca0), (sc0, cc0), (sa, ca), (se, ce) = sc_(g["EA0B"]), sc_(g["EC0B"]), sc_(g["EA0C"]), sc_(g["EB0C"])
    sa, se = np.where(t.turns, sa, 0.0), np.where(t.turns, se, 0.0)
    ca, ce = np.where(t.turns, ca, 1.0), np.where(t.turns, ce, 1.0)
    block = [sc_(s[k]) for k in (3, 4, 5)]

    v = [t.ball[:, 0] + g["EX0B"], t.ball[:, 1], t.ball[:, 2] + g["EZ0B"]]
    v = turn(v, 2, 0, t.sb, t.cb)
    x1 = v = turn(v, 1, 2, sa0, ca0)
    x2 = v = turn(v, 0, 1, sc0, cc0)
    v = [v[0] + t.x - MICRO * (g["EXX"] * t.x - g["EC0Y"] * t.y), v[1] + t.y - MICRO * g["EYY"] * t.y, v[2] + t.z]
    # a late trigger has let the axes go on against the planned normal
    v = [v[k] + g["pretravel"] * t.planned[k] for k in range(3)]
    v = [v[0] - t.turns * g["EX0C"], v[1] - t.turns * g["EY0C"], v[2]]
    y1 = v = turn(v, 2, 0, -se, ce)
    y2 = v = turn(v, 1, 2, -sa, ca)
    v = turn(v, 0, 1, -t.sc, t.cc)
    v = [v[k] - t.centre[:, k] - s[k] for k in range(3)]
    z1 = v = turn(v, 0, 1, -block[2][0], block[2][1])
    z2 = v = turn(v, 2, 0, -block[1][0], block[1][1])
    v = turn(v, 1, 2, -block[0][0], block[0][1])
    gap = -t.radius
    for k in range(3):
        gap = gap + t.normal[:, k] * (v[k] + t.centre[:, k] - t.point[:, k])
    if not jacobian:
        return gap, None

    # backward: h = d gap / d point; the slope of an angle is the component of a cross product
    d = {}
    h = list(t.normal.T)
    d["SA"] = -DEG * (h[2] * v[1] - h[1] * v[2])
    h = turn(h, 1, 2, *block[0])
    d["SB"] = -DEG * (h[0] * z2[2] - h[2] * z2[0])
    h = turn(h, 2, 0, *block[1])
    d["SC"] = -DEG * (h[1] * z1[0] - h[0] * z1[1])
    h = turn(h, 0, 1, *block[2])
    d["SX"], d["SY"], d["SZ"] = -h[0], -h[1], -h[2]
    h = turn(h, 0, 1, t.sc, t.cc)
    d["EA0C"] = -DEG * t.turns * (h[2] * y2[1] - h[1] * y2[2])
    h = turn(h, 1, 2, sa, ca)
    d["EB0C"] = -DEG * t.turns * (h[0] * y1[2] - h[2] * y1[0])
    h = turn(h, 2, 0, se, ce)
    d["EX0C"], d["EY0C"] = -(t.turns * h[0]), -(t.turns * h[1])
    d["EXX"], d["EYY"], d["EC0Y"] = -MICRO * t.x * h[0], -MICRO * t.y * h[1], MICRO * t.y * h[0]
    d["pretravel"] = sum(h[k] * t.planned[k] for k in range(3))
    d["EC0B"] = DEG * (h[1] * x2[0] - h[0] * x2[1])
    h = turn(h, 0, 1, -sc0, cc0)
    d["EA0B"] = DEG * (h[2] * x1[1] - h[1] * x1[2])
    h = turn(h, 1, 2, -sa0, ca0)
    h = turn(h, 2, 0, -t.sb, t.cb)
    d["EX0B"], d["EZ0B"] = h[0], h[2]

    rows = np.zeros((len(gap), len(names)))
    for name in GLOBALS:
        if name in at:
            rows[:, at[name]] = d[name]
    if per_block:
        index = np.arange(len(gap))
        for k, name in enumerate(SET_UP):
            rows[index, n_globals + 6 * t.set_up + k] = d[name]
    return gap, rows
