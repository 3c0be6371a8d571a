"""What `axiscal identify STUDY --json` does, with SciPy: the whole process from the study's path to the answer.

For `swivel-head`, touches CSVs, and the effects location-b, location-c, pretravel, scale-x, scale-y, squareness-xy, block-setup.
"""

import csv
import json
import sys
import tomllib
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from model import SET_UP, Touches, evaluate

EFFECTS = {
    "location-b": ["EX0B", "EZ0B", "EA0B", "EC0B"],
    "location-c": ["EX0C", "EY0C", "EA0C", "EB0C"],
    "pretravel": ["pretravel"],
    "scale-x": ["EXX"],
    "scale-y": ["EYY"],
    "squareness-xy": ["EC0Y"],
}
RANK_TOLERANCE = 1e-9


def load(study_path):
    """The study's effects, measured and nominal touches, labels of the set-ups."""
    with open(study_path, "rb") as f:
        study = tomllib.load(f)
    measured, nominal, rest, set_ups = [], [], [], {}
    for entry in study["data"]:
        plan = json.loads((study_path.parent / entry["plan"]).read_bytes())
        planned = {t["id"]: t for t in plan["touches"]}
        blocks = {b["name"]: b for b in plan["blocks"]}
        with open(study_path.parent / entry["log"], newline="") as f:
            for row in csv.DictReader(f):
                if row.get("status", "hit") != "hit":
                    continue
                t = planned[int(row["id"])]
                block = blocks[t["block"]]
                label = f"{entry.get('mounting', plan['mounting'])}/{block['name']}"
                index, *_ = set_ups.setdefault(label, (len(set_ups), block["carrier"] == "C", block["centre"]))
                measured.append([float(row[k]) for k in "XYZBC"])
                n = t["nominal"]
                nominal.append([n["X"], n["Y"], n["Z"], t["pose"].get("B", 0.0), t["pose"].get("C", 0.0)])
                length = t.get("tool_length_mm", plan["tool_length_mm"])
                rest.append(t["point"] + t["normal"] + [t.get("ball_radius_mm", plan["ball_radius_mm"]), 0.0, 0.0, -length, index])
    rest = np.array(rest)
    turns, centre = [s[1] for s in set_ups.values()], [s[2] for s in set_ups.values()]
    make = lambda at: Touches(at[:, :3], at[:, 3], at[:, 4], rest[:, 0:3], rest[:, 3:6], rest[:, 6], rest[:, 7:10], rest[:, 10], turns, centre)
    return study["model"]["effects"], study.get("noise", {}), make(np.array(measured)), make(np.array(nominal)), list(set_ups)


def main():
    effects, noise, touches, nominal, set_ups = load(Path(sys.argv[1]))
    names = [name for effect, its in EFFECTS.items() if effect in effects for name in its]
    if "block-setup" in effects:
        names += [f"{k}@{label}" for label in set_ups for k in SET_UP]
    sigma = noise.get("touch_um", 1.0) * 1e-3
    _, rows = evaluate(nominal, names, np.zeros(len(names)))
    norm = np.linalg.norm(rows, axis=0)
    norm[norm == 0.0] = 1.0
    _, values, v = np.linalg.svd(rows / norm, full_matrices=False)
    rank = int(np.sum(values > RANK_TOLERANCE * values[0]))
    seen, unseen = v[:rank].T / norm[:, None], v[rank:]

    last = {}

    def residual(phi):
        gap, last["rows"] = evaluate(touches, names, seen @ phi)
        last["phi"] = phi.copy()
        return gap / sigma

    def jacobian(phi):
        if not np.array_equal(phi, last["phi"]):
            residual(phi)
        return last["rows"] @ seen / sigma

    fit = least_squares(residual, np.zeros(rank), jacobian, method="lm", x_scale=1e6, ftol=1e-12, xtol=1e-12, gtol=1e-15)
    a = jacobian(fit.x)
    theta = seen @ fit.x
    half = seen @ np.linalg.inv(np.linalg.qr(a, mode="r"))
    sigmas = np.sqrt(np.sum(half * half, axis=1))
    lost = np.max(np.abs(unseen), axis=0) > 1e-6 if rank < len(names) else np.zeros(len(names), bool)
    parameters = [
        {"name": n, "value": x, "sigma": None if gone else s, "status": "undetermined" if gone else "identified"}
        for n, x, s, gone in zip(names, theta.tolist(), sigmas.tolist(), lost.tolist())
    ]
    rms = float(np.sqrt(np.mean((fit.fun * sigma) ** 2)) * 1e3)
    json.dump({"touches": len(fit.fun), "rank": rank, "rms_um": rms, "parameters": parameters}, sys.stdout, indent=2)


if __name__ == "__main__":
    main()
