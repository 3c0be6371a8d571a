#!/usr/bin/env python3
"""Makes expressions.json and built_in.json: formulas with their values as Python computes them.

Run it in this folder: python3 make.py. The seed is fixed, so the same table comes out.
A formula of axiscal becomes Python by writing ** for ^; everything else is the same, mod is Python's %.
"""
import json
import math
import pathlib
import random
import tomllib

SEED = 29
COUNT = 300
VALUES = {"X": 1.7, "Y": -0.6, "Z": 2.3, "A": 0.4, "B": -1.1, "C": 2.9, "t": 0.75, "T": 21.5}
NAMES = {
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan,
    "atan2": math.atan2, "exp": math.exp, "ln": math.log, "sqrt": math.sqrt, "abs": abs, "floor": math.floor,
    "mod": lambda a, b: a % b, "sign": lambda x: (x > 0) - (x < 0), "step": lambda x: 1 if x >= 0 else 0,
    "pi": math.pi, "PI": math.pi,
}
ONE = ["sin", "cos", "tan", "atan", "exp", "ln", "sqrt", "abs", "floor", "sign", "step", "asin", "acos"]
# a hair beside the variables: what jumps or nearly loses all digits there is left out
NUDGE = 1e-9


def value(text, variables):
    """The value of a formula, or None where it has none that is a plain number."""
    try:
        result = eval(text.replace("^", "**"), {"__builtins__": {}}, {**NAMES, **variables})
        return float(result) if not isinstance(result, complex) and math.isfinite(result) else None
    except (ValueError, ZeroDivisionError, OverflowError, TypeError):
        return None


def steady(text, variables):
    here = value(text, variables)
    if here is None or not 1e-6 < abs(here) < 1e6:
        return None
    for sign in (-1, 1):
        beside = value(text, {k: v * (1 + sign * NUDGE) for k, v in variables.items()})
        if beside is None or abs(beside - here) > 1e-6 * abs(here):
            return None
    return here


def atom(dice):
    kind = dice.random()
    if kind < 0.55:
        return dice.choice(list(VALUES))
    if kind < 0.62:
        return "pi"
    return dice.choice(["2", "3", "0.5", "1.25", "7", "1.5e-1", "2E+0", ".4"])


def expression(dice, depth):
    """Signs, powers, sums and products without brackets: the order is what is tested."""
    if depth == 0:
        return atom(dice)
    kind = dice.random()
    if kind < 0.20:
        return dice.choice(["-", "-", "+"]) + expression(dice, depth - 1)
    if kind < 0.38:
        base = dice.choice([atom(dice), f"({expression(dice, depth - 1)})"])
        power = dice.choice(["2", "3", "-2", "-1", "2^2", "-X^2", "0.5", atom(dice)])
        return f"{base}^{power}"
    if kind < 0.72:
        sign = dice.choice([" + ", " - ", "*", "/", " - ", "/"])
        return expression(dice, depth - 1) + sign + expression(dice, depth - 1)
    if kind < 0.80:
        return f"({expression(dice, depth - 1)})"
    if kind < 0.88:
        name = dice.choice(["mod", "atan2"])
        return f"{name}({expression(dice, depth - 1)}, {expression(dice, depth - 1)})"
    return f"{dice.choice(ONE)}({expression(dice, depth - 1)})"


def each_axis(rows):
    """Rows with `axes` (docs/guide/effects.md) → one row for each axis."""
    out, axes = [], []
    for row in rows:
        axes = row.get("axes", axes if row.get("with_previous") else [])
        for axis in axes:
            own = "XYZABC".index(axis) % 3
            text = json.dumps(row)
            for i, meant in enumerate([own] + [k for k in range(3) if k != own]):
                for letters in ("XYZ", "ABC", "xyz", "abc"):
                    text = text.replace("{" + letters[i] + "}", letters[meant])
            out.append(json.loads(text))
        out += [] if axes else [row]
    return out


def main():
    dice = random.Random(SEED)
    rows = [(text, steady(text, VALUES)) for text in ["-(X)^2", "exp(-(X - Y)^2)", "2^-X^2", "2^3^2", "-X^2^0.5", "--X", "X - -Y"]]
    seen = {text for text, _ in rows}
    while len(rows) < COUNT:
        text = expression(dice, dice.choice([2, 3, 4]))
        if text in seen:
            continue
        seen.add(text)
        if len(text) < 120 and any(c in text for c in "+-*/^,") and (found := steady(text, VALUES)) is not None:
            rows.append((text, found))
    here = pathlib.Path(__file__).parent
    table = {"variables": VALUES, "rows": [{"formula": text, "value": found} for text, found in rows]}
    (here / "expressions.json").write_text(json.dumps(table, indent=0) + "\n")

    effects = each_axis(tomllib.loads((here / "../../effects.toml").read_text())["effect"])
    texts = sorted({term["formula"] for effect in effects for term in effect.get("terms", [])})
    shapes = {shape["parameter"]: shape["start"] for effect in effects for shape in effect.get("shape", [])}
    names = ("X Y Z A B C t T nx ny nz mx my mz sX sY sZ sA sB sC feed S gx gy gz L L0 bx by bz px py pz ox oy oz "
             "edge wA wB wC").split()
    variables = {name: 0.35 + 0.61 * math.sin(2.1 * i + 1) for i, name in enumerate(names)}
    variables |= {"L": 250.0, "L0": 202.684, "feed": 60.0, "X": 120.5, "Y": -81.25, "Z": 240.75}
    rows = []
    for text in texts:
        found = value(text, {**variables, **shapes})
        if found is not None:
            rows.append({"formula": text, "value": found})
    table = {"variables": variables, "shapes": shapes, "rows": rows}
    (here / "built_in.json").write_text(json.dumps(table, indent=0) + "\n")
    print(f"{COUNT} expressions, {len(rows)} of {len(texts)} built-in formulas")


main()
