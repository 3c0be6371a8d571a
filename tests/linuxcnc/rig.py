#!/usr/bin/env python3
"""Runs one NC program on a real LinuxCNC over a virtual machine and collects what the program logged.

    rig.py --machines machines.toml --machine swivel-head --plan head.plan.json --program head.ngc \\
           --scenario scenario.toml --out DIR

Exit code: 0 the program ended at its M2, 1 it did not, 2 an input is unusable, 3 LinuxCNC or the rig failed.
README.md beside this file says what is modelled and what is not.
"""
import argparse
import csv
import errno
import fcntl
import hashlib
import json
import os
import pwd
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True                   # nothing is left beside the sources
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import config  # noqa: E402
import world  # noqa: E402
from world import Unusable  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
MODULES = "/usr/lib/linuxcnc/modules"
REALTIME = "/usr/lib/linuxcnc/realtime"
LINUXCNC_LOCK = "/tmp/linuxcnc.lock"             # LinuxCNC's own
MARK = "AXISCAL_RIG_RUN"                         # in the environment of everything that the rig starts
G54 = {"X": 12.345, "Y": -6.789, "Z": 3.21, "A": 1.25, "B": 0.75, "C": -2.5}
G54_ROTATION = 3.0
SHIMS = ("clockshim", "taskshim")                # preloaded where LinuxCNC runs faster than real time


class RigFailed(Exception):
    """LinuxCNC did not do what the rig needs of it."""


class Stopped(Exception):
    pass


# ------------------------------------------------------------------------------------- one at a time, cleanly

def take_turn():
    """LinuxCNC has fixed shared-memory keys: one per computer. Others wait here."""
    path = os.path.join(tempfile.gettempdir(), "axiscal-linuxcnc-rig.lock")
    old = os.umask(0)
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except PermissionError:
        # a sticky directory may refuse O_CREAT on another user's file
        handle = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    finally:
        os.umask(old)
    fcntl.flock(handle, fcntl.LOCK_EX)
    return handle


def processes(run=None):
    """Ids of living processes that a rig started: they carry its mark in their environment."""
    wanted = f"{MARK}={run}\0".encode() if run else f"{MARK}=".encode()
    found = []
    for entry in os.listdir("/proc"):
        if not entry.isdigit() or int(entry) == os.getpid():
            continue
        try:
            with open(f"/proc/{entry}/environ", "rb") as f:
                marked = any((x + b"\0").startswith(wanted) for x in f.read().split(b"\0"))
            with open(f"/proc/{entry}/stat") as f:
                alive = f.read().rpartition(")")[2].split()[0] not in "ZX"
        except OSError:
            continue
        if marked and alive:
            found.append(int(entry))
    return found


def end_processes(ids_of, grace):
    """TERM, wait, KILL; by id, and only what `ids_of` still names."""
    for sig, seconds in ((signal.SIGTERM, grace), (signal.SIGKILL, 5)):
        for pid in ids_of():
            try:
                os.kill(pid, sig)
            except ProcessLookupError:
                pass
            except PermissionError as e:
                raise RigFailed(f"process {pid} of an older rig belongs to someone else: end it by hand") from e
        end = time.monotonic() + seconds
        while ids_of() and time.monotonic() < end:
            time.sleep(0.05)
        if not ids_of():
            return


def linuxcnc_of_others():
    names = {"rtapi_app", "milltask", "linuxcncsvr", "rtapi_app:T#0"}
    found = []
    for entry in os.listdir("/proc"):
        try:
            with open(f"/proc/{entry}/comm") as f:
                name = f.read().strip()
            with open(f"/proc/{entry}/stat") as f:
                alive = f.read().rpartition(")")[2].split()[0] not in "ZX"
        except (OSError, IndexError):
            continue
        if name in names and alive:
            found.append(f"{name} {entry}")
    return found


def clear_remains(environment):
    """What a killed run left: marked processes, shared memory, LinuxCNC's lock."""
    remains = processes()
    if remains:
        end_processes(processes, 15)
    if others := linuxcnc_of_others():
        raise RigFailed(f"a LinuxCNC that the rig did not start is running ({', '.join(others)}): end it first")
    if remains or os.path.exists(LINUXCNC_LOCK):
        # a KILLed rtapi_app leaves its shared memory; its own stop command removes it
        subprocess.run([REALTIME, "stop"], env=environment, stdin=subprocess.DEVNULL, capture_output=True, timeout=60)
        try:
            os.remove(LINUXCNC_LOCK)
        except FileNotFoundError:
            pass
        except PermissionError as e:
            raise RigFailed(f"{LINUXCNC_LOCK} of another user is in the way") from e


# ----------------------------------------------------------------------------------------------- building

def digest(path):
    with open(path, "rb") as f:
        return hashlib.sha256(f.read()).hexdigest()


def install_component(source):
    """halcompile --install, unless exactly this source is installed already. LinuxCNC loads from one directory only."""
    name = os.path.splitext(os.path.basename(source))[0]
    target, stamp = os.path.join(MODULES, name + ".so"), os.path.join(MODULES, f".{name}.axiscal-rig")
    try:
        wanted = digest(source)
    except OSError as e:
        raise Unusable(f"{source}: {e.strerror}") from e
    try:
        with open(stamp) as f:
            if f.read().split() == [wanted, digest(target)]:
                return
    except OSError:
        pass
    if os.path.exists(target) and not os.path.exists(stamp):
        if subprocess.run(["dpkg", "-S", target], capture_output=True).returncode == 0:
            raise Unusable(f"{source}: {name} is a module of LinuxCNC itself; the rig does not overwrite it")
    if shutil.which("halcompile") is None:
        raise RigFailed("halcompile is missing: run install.sh")
    if not os.access(MODULES, os.W_OK):
        raise RigFailed(f"{name} must be installed into {MODULES}: run once as root")
    with tempfile.TemporaryDirectory(prefix="axiscal-rig-build-") as build:
        shutil.copy(source, build)
        done = subprocess.run(["halcompile", "--install", os.path.basename(source)], cwd=build, stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=120)
    if done.returncode or not os.path.exists(target):
        raise Unusable(f"{source}: halcompile failed\n{done.stdout}{done.stderr}")
    with open(stamp, "w") as f:
        f.write(f"{wanted} {digest(target)}\n")


def build_shims(run):
    with open(os.path.join(run, "hold"), "wb") as f:
        f.write(bytes(4096))
    for name in SHIMS:
        source, out = os.path.join(HERE, f"{name}.c"), os.path.join(run, f"{name}.so")
        done = subprocess.run(["gcc", "-shared", "-fPIC", "-O2", "-o", out, source, "-ldl"], capture_output=True, text=True, timeout=120)
        if done.returncode:
            raise RigFailed(f"{name}.c does not compile\n{done.stderr}")


def environment_of(run, warp):
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "LD_PRELOAD", "PYTHONPATH", "PYTHONHOME")}
    # HOME: LinuxCNC drops its debug files there. RUNTESTS: it writes to our pipe instead of to files of its own
    env |= {MARK: run, "HOME": run, "RUNTESTS": "yes", "LC_ALL": "C.UTF-8",
            "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
    if os.geteuid() == 0:
        # rtapi_app wants to drop root to someone
        env |= {"RTAPI_UID": str(pwd.getpwnam("nobody").pw_uid), "RTAPI_FIFO_PATH": os.path.join(run, "rt", "socket")}
        if warp > 1:
            env |= {"LD_PRELOAD": " ".join(os.path.join(run, f"{name}.so") for name in SHIMS), "CLOCKSHIM_WARP": str(warp),
                    "TASKSHIM_HOLD": os.path.join(run, "hold")}
    return env


# ---------------------------------------------------------------------------------------------- one run

def read_to_percent(program, last_line, logs):
    """A program may end with % instead of M2 (which would reset the user's modal state): was its end executed?

    Either its last word was seen in execution, which lasts some milliseconds only and may fall between two looks, or the
    last line that it logs is the last line of a log.
    """
    with open(program, errors="replace") as f:
        lines = [line.strip() for line in f]
    while lines and not lines[-1]:
        lines.pop()
    if len(lines) < 2 or lines[0] != "%" or lines[-1] != "%":
        return False
    words = [n for n, line in enumerate(lines, 1) if line and line[0] not in "%o(;#"]
    if words and last_line and last_line >= words[-1]:
        return True
    logged = [line[5:-1].strip() for line in lines if re.fullmatch(r"\(LOG,[^()]*\)", line)]
    return bool(logged) and "#" not in logged[-1] and any(last_line_of(log) == logged[-1] for log in logs)


def last_line_of(path):
    with open(path, errors="replace") as f:
        return next((line.strip() for line in reversed(f.readlines()) if line.strip()), None)


def parse_g54(text):
    pairs = re.findall(r"([XYZABCR])\s*([-+]?\d*\.?\d+)", text.upper())
    if not pairs or re.sub(r"[XYZABCR]\s*[-+]?\d*\.?\d+|\s", "", text.upper()):
        raise Unusable(f"--g54: '{text}' is not like X12.5Y-3Z4R2")
    return {k: float(v) for k, v in pairs}


def prepare(args, run):
    """Everything LinuxCNC needs, in the run directory."""
    machine = world.load_machine(args.machines, args.machine)
    plan = world.load_json(args.plan)
    scenario = world.Scenario(world.load_toml(args.scenario) if args.scenario else {}, machine, args.scenario or "no scenario")
    os.mkdir(os.path.join(run, "rt"))
    os.chmod(os.path.join(run, "rt"), 0o777)    # rtapi_app works there as another user
    kins, kins_args = args.kins, args.kins_args
    if args.kins_c:
        install_component(args.kins_c)
        kins = os.path.splitext(os.path.basename(args.kins_c))[0]
        with open(args.kins_c, encoding="utf-8", errors="replace") as f:
            takes = re.search(r"RTAPI_MP_STRING\s*\(\s*coordinates\b", f.read())
        if kins_args is None:
            kins_args = "coordinates=" + "".join(machine.letters) if takes else ""
    elif kins_args is None:
        kins_args = "coordinates=" + "".join(machine.letters)
    # switchkins of the stock modules: type 0, in which they start, is their transformation (TCP)
    try:
        text = world.text_of(machine, plan, scenario, latch=args.latch, report=os.path.join(run, "rt", "touches.csv"),
                             solids=not args.no_solids, where=args.plan)
    except (KeyError, TypeError, IndexError) as e:
        raise Unusable(f"{args.plan} or {args.machines}: {type(e).__name__} {e}") from e
    install_component(os.path.join(HERE, "probe.c"))

    def put(name, content):
        with open(os.path.join(run, name), "w", encoding="utf-8") as f:
            f.write(content)

    user_hal = ""
    for path in args.hal:
        try:
            with open(path, encoding="utf-8") as f:
                user_hal += f.read() + "\n"
        except OSError as e:
            raise Unusable(f"{path}: {e.strerror}") from e
    put("world.txt", text)
    # the display's path may hold blanks, which the INI cannot say: a small wrapper can
    driver = os.path.join(run, "operator")
    put("operator", f"#!/bin/sh\nexec /usr/bin/python3 '{os.path.join(HERE, 'driver.py').replace(chr(39), chr(39) + chr(92) + chr(39) + chr(39))}'\n")
    os.chmod(driver, 0o755)
    sections = config.ini_sections(machine, kins=kins, kins_args=kins_args, servo_us=args.servo_us, display=driver)
    for path in args.ini_extra:
        config.merge_fragment(sections, path, run)
    put("rig.ini", config.ini_text(sections))
    put("rig.hal", config.hal_text(machine, kins=kins, kins_args=kins_args, servo_us=args.servo_us,
                                   world=os.path.join(run, "world.txt"), user_hal=user_hal))
    offsets = parse_g54(args.g54) if args.g54 else {**{k: v for k, v in G54.items() if k in machine.letters}, "R": G54_ROTATION}
    put("rig.var", config.var_text(offsets, offsets.get("R", 0.0)))
    # a tool with a length and a diameter of its own: a program that relies on "no tool offset" must say G49
    put("rig.tbl", "T1 P1 Z25.0 D6.0 ;probe\n")
    program = os.path.join(run, os.path.basename(args.program))
    if os.path.exists(program):
        raise Unusable(f"{args.program}: the rig has a file of that name, call the program otherwise")
    try:
        shutil.copyfile(args.program, program)
    except OSError as e:
        raise Unusable(f"{args.program}: {e.strerror}") from e
    put("driver-in.json", json.dumps({"program": program, "timeout_s": args.timeout, "resume": args.resume, "mdi": args.mdi,
                                      "styli": world.styli(plan), "rig_pid": os.getpid()}))
    if args.warp > 1:
        build_shims(run)
    return machine, {f for f in os.listdir(run)}


def end_in_order(process, run):
    """The operator first: when it leaves, the `linuxcnc` script shuts everything down in order. Then the whole group,
    for the script itself acts on no signal before its display has ended."""
    def operator():
        with open(os.path.join(run, "driver.pid")) as f:
            os.kill(int(f.read()), signal.SIGTERM)

    for ask in (operator, lambda: os.killpg(process.pid, signal.SIGTERM)):
        try:
            ask()
            process.wait(10)
            return
        except (OSError, ValueError, subprocess.TimeoutExpired):
            pass


def run_linuxcnc(args, run):
    env = environment_of(run, args.warp)
    with open(os.path.join(run, "linuxcnc.out"), "wb") as out:
        # a session of its own: the whole group can be told to end
        process = subprocess.Popen(["linuxcnc", os.path.join(run, "rig.ini")], cwd=run, env=env, stdin=subprocess.DEVNULL,
                                   stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            # start and stop take seconds; homing has a limit of its own in the driver
            process.wait(args.timeout + 180)
        except subprocess.TimeoutExpired as e:
            raise RigFailed("LinuxCNC did not end") from e
        finally:
            if process.poll() is None:
                end_in_order(process, run)
            end_processes(lambda: processes(run), 5)
            if process.poll() is None:
                process.wait(5)
            clear_remains(env)


def last_words(path, lines=6):
    """What LinuxCNC said before it gave up, without the lines that it always says."""
    noise = re.compile(r"fallback_uid|non-realtime|terminated with an error|linuxcnc_(debug|print)\.txt|^and$|as well as in the output|"
                       r"Shutting down|^Found file|Setup:|==>|^\s*$|Recommend|cannot gain I/O|cycles, min=|latency excursions")
    try:
        with open(path, encoding="utf-8", errors="replace") as f:
            said = [line.strip() for line in f if not noise.search(line)]
    except OSError:
        return "nothing"
    return " | ".join(said[-lines:]) or "nothing"


def collect(args, run, own, machine):
    """Files of the program, and result.json."""
    os.makedirs(args.out, exist_ok=True)
    ours = own | {"linuxcnc.out", "driver.json", "driver.pid", "rig.var.bak", "rig.var.new", "linuxcnc_debug.txt", "linuxcnc_print.txt", "rt"}
    logs = []
    for folder, folders, files in os.walk(run):
        here = os.path.relpath(folder, run)
        folders[:] = [d for d in folders if not (here == "." and (d in ours or d.startswith(".")))]
        for name in files:
            path = name if here == "." else os.path.join(here, name)
            if (here == "." and name in ours) or name.startswith("."):
                continue
            target = os.path.join(args.out, path)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            shutil.copyfile(os.path.join(folder, name), target)
            logs.append(path)
    answer = {}
    try:
        with open(os.path.join(run, "driver.json")) as f:
            answer = json.load(f)
    except (OSError, ValueError):
        answer = {"failure": "LinuxCNC did not come up (rig-linuxcnc.out): " + last_words(os.path.join(run, "linuxcnc.out")),
                  "errors": [], "messages": []}
    for name in ("rt/touches.csv", "linuxcnc.out"):
        if os.path.exists(os.path.join(run, name)):
            shutil.copyfile(os.path.join(run, name), os.path.join(args.out, "rig-" + os.path.basename(name)))
    pins = answer.get("pins", {})
    touches = []
    try:
        with open(os.path.join(run, "rt", "touches.csv"), newline="") as f:
            touches = list(csv.DictReader(f))
    except OSError:
        pass
    allowed = machine.data.get("probe", {}).get("overtravel")
    overtravel = float(pins.get("overtravel-max", "nan"))
    offsets = config.read_var(os.path.join(run, "rig.var"))
    seeded = parse_g54(args.g54) if args.g54 else {**{k: v for k, v in G54.items() if k in machine.letters}, "R": G54_ROTATION}
    # the interpreter reads ahead: that it saw M2 means an end there only if nothing stopped the machine before
    logs_written = [os.path.join(args.out, log) for log in logs]
    at_the_end = bool(answer.get("read_m2")) or read_to_percent(args.program, answer.get("last_line"), logs_written)
    ended = at_the_end and not answer.get("errors") and not answer.get("failure")
    def count(pin): return int(pins[pin]) if pin in pins else None
    result = {
        "format": "axiscal-rig/1", "ok": ended, "machine": machine.name, "program": os.path.basename(args.program),
        "failure": answer.get("failure"), "errors": answer.get("errors", []), "messages": answer.get("messages", []),
        "last_line": answer.get("last_line"), "pauses": answer.get("pauses", []),
        "logs": sorted(logs), "latch": args.latch, "servo_us": args.servo_us, "warp": args.warp,
        "seconds": answer.get("seconds"),
        "machine_seconds": round(answer["seconds"] * args.warp, 3) if answer.get("seconds") is not None else None,
        "touches": count("touches"), "block_touches": count("block-touches"), "solid_touches": count("solid-touches"),
        "stem_touches": count("stem-touches"), "collisions": count("collisions"), "index_visits": count("visits"),
        "stem_touched": pins.get("stem-touched"),
        "touched": sorted({t["what"] for t in touches}),
        "max_overtravel_mm": None if overtravel != overtravel else overtravel, "overtravel_allowed_mm": allowed,
        "work_offsets_after": offsets,
        "g54_unchanged": offsets is not None and offsets["G54"] == {k: v for k, v in seeded.items() if v},
        "before": answer.get("before"), "after": answer.get("after"),
    }
    with open(os.path.join(args.out, "result.json"), "w") as f:
        json.dump(result, f, indent=1)
        f.write("\n")
    return result


def arguments(argv):
    p = argparse.ArgumentParser(description="Runs one NC program on LinuxCNC over a virtual machine with planted errors.")
    p.add_argument("--machines", required=True, help="machine descriptions (TOML)")
    p.add_argument("--machine", required=True, help="which of them")
    p.add_argument("--plan", required=True, help="plan (JSON): its blocks are put on the machine")
    p.add_argument("--program", required=True, help="the NC program, run as it is")
    p.add_argument("--scenario", help="what is wrong with the machine (TOML); without it nothing is")
    p.add_argument("--out", required=True, help="directory for logs and result.json")
    p.add_argument("--latch", choices=("edge", "servo"), default="edge", help="edge: crossing interpolated in the cycle; servo: plain LinuxCNC")
    p.add_argument("--servo-us", type=int, default=1000, help="servo period in machine time (default 1000)")
    p.add_argument("--warp", type=int, default=1, help="this many times faster than real time (root only)")
    p.add_argument("--kins", default="trivkins", choices=("trivkins", *config.STOCK_TCP), help="stock kinematics module")
    p.add_argument("--kins-c", metavar="FILE.c", help="kinematics component of one's own: compiled, installed, loaded")
    p.add_argument("--kins-args", help="module parameters of the kinematics (default coordinates=..., where the module takes it)")
    p.add_argument("--hal", action="append", default=[], metavar="FILE", help="HAL lines (setp ...) to load after the rig's own; repeatable")
    p.add_argument("--ini-extra", action="append", default=[], metavar="FILE", help="INI fragment to merge (COMP_FILE, HOME_OFFSET ...); repeatable")
    p.add_argument("--g54", help="the user's G54 that must survive, e.g. X12.5Y-3R2")
    p.add_argument("--mdi", action="append", default=[], metavar="LINE", help="a command given by hand before the program, e.g. G91; repeatable")
    p.add_argument("--no-solids", action="store_true", help="leave out table, plates and risers: blocks only")
    p.add_argument("--resume", type=int, default=20, help="how many pauses (M0) are answered with cycle start (default 20)")
    p.add_argument("--timeout", type=float, default=1800, help="seconds of real time for the program (default 1800)")
    p.add_argument("--keep", action="store_true", help="copy INI, HAL and world file into the output directory too")
    args = p.parse_args(argv)
    if args.kins_c and args.kins != "trivkins":
        p.error("--kins and --kins-c exclude each other")
    if args.warp > 1 and os.geteuid() != 0:
        p.error("--warp works as root only (rtapi_app is setuid and ignores the shim otherwise)")
    if args.warp < 1 or args.servo_us < 1:
        p.error("--warp and --servo-us are whole numbers from 1")
    if args.servo_us / args.warp < 25:
        p.error(f"servo period / warp = {args.servo_us / args.warp:g} us: task loses the race below 25 us")
    return args


def stop(signum, _frame):
    raise Stopped(f"stopped by signal {signum}")


def main(argv=None):
    args = arguments(argv)
    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
    run = None
    try:
        if shutil.which("linuxcnc") is None:
            raise RigFailed("LinuxCNC is missing: run install.sh")
        turn = take_turn()
        run = tempfile.mkdtemp(prefix="axiscal-rig-")
        os.chmod(run, 0o755)
        clear_remains(environment_of(run, 1))
        for name in os.listdir(tempfile.gettempdir()):      # ours is the only run now: the others were killed
            old = os.path.join(tempfile.gettempdir(), name)
            if name.startswith("axiscal-rig-") and old != run:
                shutil.rmtree(old, ignore_errors=True)
        machine, own = prepare(args, run)
        try:
            run_linuxcnc(args, run)
        finally:
            result = collect(args, run, own, machine)
            if args.keep:
                for name in sorted(own - {"rt"}):
                    shutil.copyfile(os.path.join(run, name), os.path.join(args.out, "rig-" + name))
        os.close(turn)
    except Unusable as e:
        print(f"rig: {e}", file=sys.stderr)
        return 2
    except (RigFailed, Stopped) as e:
        print(f"rig: {e}", file=sys.stderr)
        return 3
    except OSError as e:
        if e.errno == errno.EPIPE:
            return 3
        print(f"rig: {e}", file=sys.stderr)
        return 3
    finally:
        if run:
            shutil.rmtree(run, ignore_errors=True)
    for text in [result["failure"], *result["errors"]]:
        if text:
            print(f"rig: {text}", file=sys.stderr)
    print(f"{result['program']}: {'ended normally' if result['ok'] else 'DID NOT END NORMALLY'}, {result['touches']} contacts, "
          f"overtravel {result['max_overtravel_mm'] or 0:.4f} mm, {result['seconds'] or 0:.2f} s")
    if result["ok"]:
        return 0
    return 3 if result["failure"] else 1


if __name__ == "__main__":
    sys.exit(main())
