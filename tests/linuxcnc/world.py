"""Machine description + plan + scenario -> the virtual world that probe.c reads.

Written from the documents (frames, signs, places of the errors), not from axiscal's code: the rig is a
referee. Pure functions; the only thing that leaves here is text. Units in the files: mm, degrees; in the
world file: mm, radian.
"""
import json
import math
import re
import tomllib

DOFS = {"X": 0, "Y": 1, "Z": 2, "A": 3, "B": 4, "C": 5}
HARMONIC_DOFS = {"dx": 0, "dy": 1, "dz": 2, "rx": 3, "ry": 4, "rz": 5}
STANDARD_ORDER = "XYZABCUVW"


class Unusable(Exception):
    """An input that the rig cannot take; the text says which and why."""


def load_toml(path):
    try:
        with open(path, "rb") as f:
            return tomllib.load(f)
    except tomllib.TOMLDecodeError as e:
        raise Unusable(f"{path}: not TOML that Python can read: {e}") from e
    except OSError as e:
        raise Unusable(f"{path}: {e.strerror}") from e


def load_json(path):
    try:
        with open(path, encoding="utf-8") as f:
            return json.load(f)
    except ValueError as e:
        raise Unusable(f"{path}: not JSON: {e}") from e
    except OSError as e:
        raise Unusable(f"{path}: {e.strerror}") from e


# ------------------------------------------------------------------------------------------------ machine

class Machine:
    """The chain of one `[[machine]]`: axes by letter, who carries whom, on which side."""

    def __init__(self, data, where):
        self.data, self.name = data, data["name"]
        self.axes = {a["name"]: a for a in data["axis"]}
        for a in self.axes.values():
            if a["kind"] not in ("linear", "rotary") or a["name"] not in STANDARD_ORDER:
                raise Unusable(f"{where}: machine {self.name}: axis {a['name']} of kind {a['kind']} is not known to the rig")
        self.letters = sorted(self.axes, key=STANDARD_ORDER.index)
        self.workpiece = self.path(data["workpiece"]["parent"], where)
        self.tool = self.path(data["tool"]["parent"], where)
        for letter in self.letters:
            if (letter in self.workpiece) == (letter in self.tool):
                raise Unusable(f"{where}: machine {self.name}: axis {letter} must carry either the workpiece or the tool")

    def path(self, end, where):
        """Axes from the base up to `end`."""
        found = []
        while end != "base":
            if end not in self.axes or end in found:
                raise Unusable(f"{where}: machine {self.name}: '{end}' is no axis, or hangs on itself")
            found.insert(0, end)
            end = self.axes[end]["parent"]
        return found

    def rotary(self, letter):
        return self.axes[letter]["kind"] == "rotary"

    def side(self, letter):
        return "tool" if letter in self.tool else "workpiece"

    def origin(self, letter):
        return float(self.data.get("origin", {}).get(letter, 0.0))

    def limits(self, letter):
        """Travel: `range` is written in machine coordinates, as the control displays it."""
        return tuple(self.axes[letter]["range"])

    def carrier(self, name, where):
        """The axis letter (or `base`) that bears a block: `table` is the last linear axis below the workpiece."""
        if name == "table":
            linear = [a for a in self.workpiece if not self.rotary(a)]
            return linear[-1] if linear else "base"
        if name == "base" or name in self.workpiece:
            return name
        raise Unusable(f"{where}: carrier '{name}' is not on the workpiece's side of {self.name}")


def load_machine(path, name):
    machines = load_toml(path).get("machine", [])
    for data in machines:
        if data.get("name") == name:
            try:
                return Machine(data, path)
            except KeyError as e:
                raise Unusable(f"{path}: machine {name}: {e} is missing") from e
    raise Unusable(f"{path}: no machine '{name}' (there are: {', '.join(m.get('name', '?') for m in machines)})")


# ------------------------------------------------------------------------------------------------ scenario

# effect -> {(axis, component): place}; `location-?` is made below because its places depend on the side
EFFECTS = {
    "paper-head": {("B", c): "before" for c in "XYABC"},
    "paper-table": {("C", c): "before" for c in "XYAB"},
    "paper-double-head": {**{("B", c): "before" for c in "XYZABC"}, **{("A", c): "before" for c in "XA"}},
    "double-head-10": {**{("B", c): "before" for c in "XYZABC"}, **{("A", c): "before" for c in "XZAC"}},
}
SIDE = {"paper-head": "tool", "paper-table": "workpiece", "paper-double-head": "tool", "double-head-10": "tool"}
# the axis itself and the component along or about it are no part of a location
LOCATION = {"A": "YZBC", "B": "XZAC", "C": "XYAB"}
PAPER_AXIS = {"BZ": "B", "CY": "C", "BA": "A"}
PAPER_COMPONENT = {"a": "A", "b": "B", "g": "C", "dx": "X", "dy": "Y", "dz": "Z"}


def symbol(text):
    """`EA0B`, `E_AOB`, `A0B` or the paper's `a_BZ` -> (axis, component); None when it is neither."""
    s = text.replace("_", "").replace("-", "")
    if m := re.fullmatch(r"([abg]|d[xyz])(BZ|CY|BA)", s):
        return PAPER_AXIS[m[2]], PAPER_COMPONENT[m[1]]
    if m := re.fullmatch(r"E?([XYZABC])[0O]([ABC])", s.upper()):
        return m[2], m[1]
    return None


def number(value, where):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise Unusable(f"{where}: {value!r} is not a number")
    return float(value)


def vector(value, where):
    if not isinstance(value, list) or len(value) != 3:
        raise Unusable(f"{where}: three numbers are wanted, not {value!r}")
    return [number(v, where) for v in value]


def only(table, known, where):
    if extra := sorted(set(table) - set(known)):
        raise Unusable(f"{where}: unknown {', '.join(extra)} (known: {', '.join(known)})")


class Scenario:
    def __init__(self, data, machine, where):
        self.before = {a: [0.0] * 6 for a in machine.letters}
        self.after = {a: [0.0] * 6 for a in machine.letters}
        self.pretravel, self.harmonics, self.blocks, self.scales = 0.0, [], [], {}
        only(data, ("seed", "effects", "block", "noise", "harmonic"), where)
        self.seed = data.get("seed", 1)
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
            raise Unusable(f"{where}: seed: {self.seed!r} is not a whole number from 0")
        for name, values in data.get("effects", {}).items():
            self.plant(name, values, machine, f"{where}: effects.{name}")
        noise = data.get("noise", {})
        only(noise, ("touch_um", "visit_um"), f"{where}: noise")
        self.touch_mm = number(noise.get("touch_um", 0.0), f"{where}: noise.touch_um") / 1000
        self.visit_mm = number(noise.get("visit_um", 0.0), f"{where}: noise.visit_um") / 1000
        for i, b in enumerate(data.get("block", [])):
            here = f"{where}: block {i + 1}"
            only(b, ("mounting", "name", "shift", "tilt"), here)
            if "name" not in b:
                raise Unusable(f"{here}: name is missing")
            self.blocks.append({"mounting": b.get("mounting"), "name": b["name"],
                                "shift": vector(b.get("shift", [0.0] * 3), here + ": shift"),
                                "tilt": vector(b.get("tilt", [0.0] * 3), here + ": tilt")})
        for i, h in enumerate(data.get("harmonic", [])):
            self.add_harmonic(h, machine, f"{where}: harmonic {i + 1}")

    def plant(self, effect, values, machine, where):
        if effect == "pretravel":
            only(values, ("pretravel",), where)
            self.pretravel += number(values.get("pretravel", 0.0), where + ".pretravel")
            return
        if m := re.fullmatch(r"location-([abc])", effect):
            axis = m[1].upper()
            if axis not in machine.axes:
                raise Unusable(f"{where}: {machine.name} has no axis {axis}")
            # on the tool's side the offsets turn with the axis: they stand after its rotation
            on_tool = machine.side(axis) == "tool"
            places = {(axis, c): "after" if on_tool and c in "XYZ" else "before" for c in LOCATION[axis]}
        elif m := re.fullmatch(r"zero-([abc])", effect):
            axis = m[1].upper()
            if axis not in machine.axes:
                raise Unusable(f"{where}: {machine.name} has no axis {axis}")
            places = {(axis, axis): "before"}
        elif m := re.fullmatch(r"scale-([xyz])", effect):
            axis = m[1].upper()
            only(values, (f"E{axis}{axis}",), where)
            self.scales[axis] = number(values.get(f"E{axis}{axis}", 0.0), where) * 1e-6
            return
        elif effect in EFFECTS:
            places = EFFECTS[effect]
            for axis in {a for a, _ in places}:
                if axis not in machine.axes or machine.side(axis) != SIDE[effect]:
                    raise Unusable(f"{where}: {machine.name} has no axis {axis} on the {SIDE[effect]}'s side")
        else:
            raise Unusable(f"{where}: the rig does not know this effect (it knows {', '.join(EFFECTS)}, location-a, "
                           "location-b, location-c, zero-a …, scale-x …, pretravel; [[harmonic]] for periodic errors)")
        for text, value in values.items():
            at = symbol(text)
            if at not in places:
                raise Unusable(f"{where}: unknown parameter {text}")
            axis, component = at
            value = number(value, f"{where}.{text}")
            target = self.before if places[at] == "before" else self.after
            target[axis][DOFS[component]] += value if component in "XYZ" else math.radians(value)

    def add_harmonic(self, h, machine, where):
        only(h, ("axis", "dof", "k", "of", "cos_um", "sin_um", "cos_urad", "sin_urad"), where)
        axis, dof, of = h.get("axis"), h.get("dof"), h.get("of", h.get("axis"))
        for a in (axis, of):
            if a not in machine.axes or not machine.rotary(a):
                raise Unusable(f"{where}: '{a}' is no rotary axis of {machine.name}")
        if dof not in HARMONIC_DOFS:
            raise Unusable(f"{where}: dof '{dof}' is none of {', '.join(HARMONIC_DOFS)}")
        unit, scale, other = ("um", 1e-3, "urad") if dof[0] == "d" else ("urad", 1e-6, "um")
        if f"cos_{other}" in h or f"sin_{other}" in h:
            raise Unusable(f"{where}: dof {dof} takes cos_{unit} and sin_{unit}")
        k = h.get("k", 1)
        if isinstance(k, bool) or not isinstance(k, int) or k < 0:
            raise Unusable(f"{where}: k = {k!r} is not a whole number from 0")
        self.harmonics.append((axis, of, HARMONIC_DOFS[dof], k,
                               number(h.get(f"cos_{unit}", 0.0), where) * scale, number(h.get(f"sin_{unit}", 0.0), where) * scale))


# ---------------------------------------------------------------------------------------------------- plan

def one_mounting(plan, where):
    """The rig cannot put up other blocks in the middle of a program: one mounting, one ball per run."""
    found = {t[key] for t in plan.get("touches", []) for key in ("mounting",) if t.get(key) is not None}
    if len(found) > 1:
        raise Unusable(f"{where}: touches of several mountings ({', '.join(sorted(found))}): the rig runs one per program")
    if found - {plan.get("mounting")} and plan.get("mounting"):
        raise Unusable(f"{where}: touches of another mounting than the plan's: the rig runs one per program")
    if any("ball_radius_mm" in t and t["ball_radius_mm"] != plan.get("ball_radius_mm") for t in plan.get("touches", [])):
        raise Unusable(f"{where}: touches with another ball than the plan's: the rig changes the stylus's length only")
    return plan.get("mounting") or next(iter(found), None)


def styli(plan):
    """How much longer than the plan's the stylus is, from stop to stop, mm."""
    own, found = plan.get("tool_length_mm", 0.0), []
    for t in plan.get("touches", []):
        longer = t.get("tool_length_mm", own) - own
        if not found or found[-1] != longer:
            found.append(longer)
    return found


def find_mounting(machine, plan, named):
    mountings = machine.data.get("mounting", [])
    if named is not None:
        return next((m for m in mountings if m["name"] == named), None)
    wanted = {(b["name"], b["carrier"]) for b in plan["blocks"]}
    for m in mountings:
        if wanted <= {(b["name"], b.get("carrier", m["carrier"])) for b in m.get("block", [])}:
            return m
    return None


def slug(text):
    return re.sub(r"[^\w+.-]+", "_", text)[:60] or "_"


def row(*values):
    return " ".join(v if isinstance(v, str) else repr(float(v)) for v in values)


def text_of(machine, plan, scenario, *, latch, report, solids=True, where="plan"):
    """The whole world file."""
    if plan.get("format") != "axiscal-plan/1":
        raise Unusable(f"{where}: format is {plan.get('format')!r}, not axiscal-plan/1")
    if plan.get("machine", machine.name) != machine.name:
        raise Unusable(f"{where}: made for machine {plan['machine']}, not {machine.name}")
    data = machine.data
    named = one_mounting(plan, where)
    mounting = find_mounting(machine, plan, named)
    probe, tool = data.get("probe", {}), data["tool"]
    length = float(plan.get("tool_length_mm", tool["length"]))
    up = tool.get("direction", [0.0, 0.0, 1.0])
    norm = math.hypot(*up)
    up = [u / norm for u in up]
    ball = [p - length * u for p, u in zip(tool.get("pivot", [0.0, 0.0, 0.0]), up)]
    reference = data.get("reference", {}).get("pivot", [0.0, 0.0, 0.0])

    out = ["# written by the rig for probe.c"]
    for letter in machine.letters:
        a = machine.axes[letter]
        out.append(row("axis", letter, a["kind"], a["parent"], machine.side(letter), *a["direction"],
                       *a.get("point", [0.0, 0.0, 0.0]), a.get("sense", 1), machine.origin(letter)))
    out.append(row("reference", *reference))
    for letter in machine.letters:
        out.append(row("before", letter, *scenario.before[letter]))
        out.append(row("after", letter, *scenario.after[letter]))
    for axis, value in scenario.scales.items():
        out.append(f"scale {axis} {value!r}")
    for axis, of, dof, k, c, s in scenario.harmonics:
        out.append(f"harmonic {axis} {of} {dof} {k} {c!r} {s!r}")
    out.append(row("tool", tool["parent"], *ball, *up))
    out.append(row("ball_radius", plan.get("ball_radius_mm", probe.get("ball_radius"))))
    if "stem_radius" in probe:
        stem, body = probe["stem_length"], probe.get("body_length", 0.0)
        out.append(row("stem", probe["stem_radius"], stem))
        if "body_radius" in probe:
            out.append(row("body", stem, stem + body, probe["body_radius"]))
        if "head_radius" in probe and length > stem + body:
            out.append(row("body", stem + body, length, probe["head_radius"]))
    out.append(row("pretravel", scenario.pretravel))
    out.append(row("noise", scenario.touch_mm, scenario.visit_mm))
    out.append(f"seed {scenario.seed}")
    out.append(f"latch {latch}")

    displaced = {}
    names = {b["name"] for b in plan["blocks"]}
    for b in scenario.blocks:
        ours = mounting["name"] if mounting else named
        if b["mounting"] is not None and ours is not None and b["mounting"] != ours:
            continue                            # a block of another mounting: not on the machine in this run
        if b["name"] not in names:
            raise Unusable(f"scenario: block '{b['name']}' is not in the plan (there are: {', '.join(sorted(names))})")
        displaced[b["name"]] = (b["shift"], [math.radians(t) for t in b["tilt"]])
    still = ([0.0] * 3, [0.0] * 3)
    for b in plan["blocks"]:
        carrier = machine.carrier(b["carrier"], f"{where}: block {b['name']}")
        shift, tilt = displaced.get(b["name"], still)
        form = b.get("form", "box")
        if form == "sphere":
            stands = [c + s for c, s in zip(b["centre"], shift)]
            out.append(row("sphere", slug(b["name"]), "block", carrier, *stands, b["diameter"] / 2))
        elif form == "box":
            out.append(row("box", slug(b["name"]), "block", carrier, *b["centre"], *b["size"], *b["centre"], *shift, *tilt))
        else:
            raise Unusable(f"{where}: block {b['name']}: the rig has boxes and spheres, no {form}")
        described = next((d for d in (mounting or {}).get("block", []) if d["name"] == b["name"]), {})
        riser = described.get("riser", (mounting or {}).get("riser"))
        if riser and solids:                    # stands under its block and is displaced with it
            foot = [b["centre"][0], b["centre"][1], b["centre"][2] - (b["size"][2] + riser["height"]) / 2]
            if "diameter" in riser:             # a stem: it is displaced with its sphere and does not tilt
                low = [f + s for f, s in zip([*foot[:2], foot[2] - riser["height"] / 2], shift)]
                out.append(row("cylinder", slug("stem " + b["name"]), "solid", carrier, *low, 0, 0, 1,
                               riser["diameter"] / 2, riser["height"]))
                continue
            out.append(row("box", slug("riser " + b["name"]), "solid", carrier, *foot, *riser["size"], riser["height"],
                           *b["centre"], *shift, *tilt))
    if solids:
        for s in [*data.get("solid", []), *(mounting or {}).get("solid", [])]:
            carrier = machine.carrier(s["carrier"], f"{machine.name}: solid {s['name']}")
            if box := s.get("box"):
                out.append(row("box", slug(s["name"]), "solid", carrier, *box["centre"], *box["size"], *box["centre"], *still[0], *still[1]))
            elif c := s.get("cylinder"):
                out.append(row("cylinder", slug(s["name"]), "solid", carrier, *c["foot"], *c["direction"], c["radius"], c["height"]))
            else:
                raise Unusable(f"{machine.name}: solid {s['name']} is neither a box nor a cylinder")
    if report:
        out.append(f"report {report}")
    return "\n".join(out) + "\n"
