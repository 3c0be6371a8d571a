"""LinuxCNC configuration for a machine: INI, HAL, tool table and parameter file, as text.

Joints stand in LinuxCNC's standard order of letters (X Y Z A B C ...), one joint per letter.
"""
import os
import re
import shutil

from world import Unusable

STOCK_TCP = ("xyzac-trt-kins", "xyzbc-trt-kins")
# Fast axes: what is tested is where the machine triggers, not how long a real one would take to get there.
VELOCITY = {"linear": 500.0, "rotary": 720.0}           # mm/s, deg/s
ACCELERATION = {"linear": 10000.0, "rotary": 7200.0}    # mm/s2, deg/s2
FAR = 1e4                                               # Cartesian limit where the joints' limits decide
LETTERS = "XYZABCUVW"


# ------------------------------------------------------------------------------------------ INI fragments

def read_fragment(path):
    """`[SECTION]` -> {KEY: value} of an INI fragment; `#` and `;` comments."""
    found, section = {}, None
    try:
        with open(path, encoding="utf-8") as f:
            lines = f.read().splitlines()
    except OSError as e:
        raise Unusable(f"{path}: {e.strerror}") from e
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text[0] in "#;":
            continue
        if m := re.fullmatch(r"\[(\w+)\]", text):
            section = found.setdefault(m[1], {})
        elif (m := re.fullmatch(r"(\w+)\s*=\s*(.*?)\s*", text)) and section is not None:
            section[m[1]] = re.split(r"\s[#;]", m[2])[0].strip()
        else:
            raise Unusable(f"{path}:{number}: not a line of an INI file: {line}")
    return found


def merge_fragment(sections, path, run):
    """Merges a fragment. Tables of an axis are copied into the run directory: LinuxCNC looks for them there."""
    folder = os.path.dirname(os.path.abspath(path))
    for section, values in read_fragment(path).items():
        if section not in sections:
            raise Unusable(f"{path}: this machine has no section [{section}]")
        for key, value in values.items():
            if key == "COMP_FILE":
                source = os.path.join(folder, value)
                if not os.path.isfile(source):
                    raise Unusable(f"{path}: [{section}] COMP_FILE: {source} does not exist")
                value = f"{section.lower()}_comp.txt"
                shutil.copyfile(source, os.path.join(run, value))
            sections[section][key] = value


def ini_text(sections):
    out = []
    for name, values in sections.items():
        out.append(f"[{name}]")
        for key, value in values.items():
            out += [f"{key} = {v}" for v in (value if isinstance(value, list) else [value])]
        out.append("")
    return "\n".join(out)


def ini_sections(machine, *, kins, kins_args, servo_us, display):
    letters = machine.letters
    identity = kins == "trivkins"
    sections = {
        # without VERSION LinuxCNC asks, in a window, whether it may update the file
        "EMC": {"VERSION": "1.1", "MACHINE": machine.name, "DEBUG": "0"},
        "DISPLAY": {"DISPLAY": display, "INTRO_TIME": "0"},
        "TASK": {"TASK": "milltask", "CYCLE_TIME": "0.0003"},    # of real time, which does not run faster
        "RS274NGC": {"PARAMETER_FILE": "rig.var"},
        "EMCMOT": {"EMCMOT": "motmod", "COMM_TIMEOUT": "1.0", "SERVO_PERIOD": str(servo_us * 1000)},
        "EMCIO": {"EMCIO": "io", "CYCLE_TIME": "0.05", "TOOL_TABLE": "rig.tbl"},
        "HAL": {"HALFILE": ["rig.hal"]},
        "KINS": {"KINEMATICS": f"{kins} {kins_args}".rstrip(), "JOINTS": str(len(letters))},
        "TRAJ": {"COORDINATES": " ".join(letters), "LINEAR_UNITS": "mm", "ANGULAR_UNITS": "degree", "SPINDLES": "1",
                 "DEFAULT_LINEAR_VELOCITY": VELOCITY["linear"], "MAX_LINEAR_VELOCITY": VELOCITY["linear"],
                 "DEFAULT_LINEAR_ACCELERATION": ACCELERATION["linear"], "MAX_LINEAR_ACCELERATION": ACCELERATION["linear"],
                 "DEFAULT_ANGULAR_VELOCITY": VELOCITY["rotary"], "MAX_ANGULAR_VELOCITY": VELOCITY["rotary"]},
    }
    for joint, letter in enumerate(letters):
        kind = machine.axes[letter]["kind"]
        low, high = machine.limits(letter)
        speed = {"MAX_VELOCITY": VELOCITY[kind], "MAX_ACCELERATION": ACCELERATION[kind]}
        # under a transformation the Cartesian place says nothing about an axis's travel: the joints decide
        wide = not identity and kind == "linear"
        sections[f"AXIS_{letter}"] = {"MIN_LIMIT": -FAR if wide else low, "MAX_LIMIT": FAR if wide else high, **speed}
        sections[f"JOINT_{joint}"] = {
            "TYPE": "ANGULAR" if kind == "rotary" else "LINEAR", **speed,
            "MIN_LIMIT": low, "MAX_LIMIT": high,
            # the feedback of the latch cycle lies a whole step behind the command: no following error of it
            "FERROR": 1000.0, "MIN_FERROR": 1000.0,
            # homing on the spot: the position at start is HOME_OFFSET, then the joint goes to HOME
            "HOME": min(max(0.0, low), high), "HOME_OFFSET": 0.0, "HOME_SEARCH_VEL": 0.0, "HOME_LATCH_VEL": 0.0,
            "HOME_FINAL_VEL": VELOCITY[kind] / 10, "HOME_SEQUENCE": 0,
        }
    return sections


def hal_text(machine, *, kins, kins_args, servo_us, world, user_hal):
    n = len(machine.letters)
    out = [
        f"loadrt {kins} {kins_args}".rstrip(),
        f"loadrt motmod servo_period_nsec={servo_us * 1000} num_joints={n} num_spindles=1",
        f"loadrt probe world={world}",
        # the probe first: its bit and its feedback belong to the cycle in which motion reads them
        "addf probe servo-thread",
        "addf motion-command-handler servo-thread",
        "addf motion-controller servo-thread",
        "net rig-contact probe.contact => motion.probe-input",
        "net rig-estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in",
        # whoever asks for a tool or an oriented spindle gets it at once
        "net rig-prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared",
        "net rig-change iocontrol.0.tool-change => iocontrol.0.tool-changed",
        "net rig-orient spindle.0.orient => spindle.0.is-oriented",
    ]
    for j in range(n):
        out.append(f"net rig-cmd-{j} joint.{j}.motor-pos-cmd => probe.{j}.motor-pos-cmd")
        out.append(f"net rig-fb-{j} probe.{j}.motor-pos-fb => joint.{j}.motor-pos-fb")
    return "\n".join(out) + "\n" + ("\n# --- the user's file\n" + user_hal + "\n" if user_hal else "")


def var_text(g54, rotation):
    """Parameter file: G54 (5221..5230) holds a user's own offsets, which a program must not touch."""
    rows = {5220: 1.0, 5230: rotation}
    rows |= {5221 + i: g54.get(letter, 0.0) for i, letter in enumerate(LETTERS)}
    return "".join(f"{k}\t{v:.6f}\n" for k, v in sorted(rows.items()))


def read_var(path):
    """Work offsets as the parameter file holds them: G54..G59.3 that are not zero, and G92."""
    values = {}
    try:
        with open(path) as f:
            for line in f:
                k, v = line.split()
                values[int(k)] = float(v)
    except (OSError, ValueError):
        return None
    names = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"]
    found = {"active": int(values.get(5220, 0))}
    for i, name in enumerate(names):
        offsets = {key: values.get(5221 + 20 * i + n, 0.0) for n, key in enumerate([*LETTERS, "R"])}
        if name == "G54" or any(offsets.values()):
            found[name] = {k: v for k, v in offsets.items() if v}
    g92 = {key: values.get(5211 + n, 0.0) for n, key in enumerate(LETTERS)}
    found["G92"] = {"on": bool(values.get(5210, 0.0)), **{k: v for k, v in g92.items() if v}}
    return found
