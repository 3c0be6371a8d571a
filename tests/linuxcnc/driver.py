#!/usr/bin/python3
"""The rig's operator: LinuxCNC starts it in place of a display.

It homes the machine, runs one program in automatic mode, listens to the error channel, and leaves
`driver.json` in the run directory. rig.py writes what it needs to `driver-in.json`. It runs with Debian's
own Python, which has the `linuxcnc` module; nothing of rig.py is imported here.
"""
import json
import os
import re
import signal
import subprocess
import sys
import time

import linuxcnc

RUN = os.environ["AXISCAL_RIG_RUN"]
ERRORS = (linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR)


class Stopped(Exception):
    pass


def stop(signum, _frame):
    raise Stopped(f"stopped by signal {signum}")


class Operator:
    def __init__(self, task):
        self.task = task
        self.errors, self.messages = [], []
        self.stat = self.command = self.channel = None

    def connect(self):
        # the NML buffers appear a moment after task has started
        end = time.monotonic() + 30
        while True:
            try:
                self.stat, self.command, self.channel = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()
                self.stat.poll()
                return
            except linuxcnc.error:
                if time.monotonic() > end:
                    raise
                time.sleep(0.02)

    def listen(self):
        if not os.path.exists(f"/proc/{self.task['rig_pid']}"):
            raise Stopped("the rig is gone")    # killed: nobody waits for an answer, LinuxCNC must not stay
        while (report := self.channel.poll()) is not None:
            kind, text = report
            (self.errors if kind in ERRORS else self.messages).append(text.strip())

    def until(self, what, true, seconds):
        end = time.monotonic() + seconds
        while True:
            self.stat.poll()
            self.listen()
            if true():
                return
            if time.monotonic() > end:
                raise TimeoutError(f"{what}: not within {seconds:g} s")
            time.sleep(0.002)

    def mode(self, mode):
        self.command.mode(mode)
        self.command.wait_complete(5)

    def modal(self):
        self.stat.poll()
        s = self.stat
        # the first of either list is a line number
        return {"gcodes": [g / 10 for g in s.gcodes[1:] if g >= 0], "mcodes": [m for m in s.mcodes[1:] if m >= 0],
                "feed_and_speed": list(s.settings)[1:3], "g5x_index": s.g5x_index, "g5x_offset": list(s.g5x_offset),
                "g92_offset": list(s.g92_offset), "rotation_xy": s.rotation_xy, "tool_offset": list(s.tool_offset),
                "tool_in_spindle": s.tool_in_spindle, "joints": [round(p, 6) for p in s.joint_actual_position[:s.joints]]}

    def home(self):
        c, s = self.command, self.stat
        c.state(linuxcnc.STATE_ESTOP_RESET)
        c.wait_complete(5)
        c.state(linuxcnc.STATE_ON)
        self.until("machine on", lambda: s.task_state == linuxcnc.STATE_ON, 10)
        self.mode(linuxcnc.MODE_MANUAL)
        c.teleop_enable(0)
        c.wait_complete(5)
        c.home(-1)
        joints = range(s.joints)
        self.until("homing", lambda: all(s.homed[j] for j in joints) and all(s.joint[j]["inpos"] for j in joints), 60)
        c.teleop_enable(1)
        c.wait_complete(5)

    def cycle_start(self, *words):
        """Not wait_complete: that waits for the end of the program, or of the next pause."""
        self.command.auto(*words)
        self.until("cycle start", lambda: self.stat.echo_serial_number >= self.command.serial, 5)
        time.sleep(0.01)

    def prelude(self):
        """Commands a user may have given before: the state that a program must cope with."""
        c, s = self.command, self.stat
        if not self.task["mdi"]:
            return
        self.mode(linuxcnc.MODE_MDI)
        for line in self.task["mdi"]:
            c.mdi(line)
            c.wait_complete(30)
            self.until(f"'{line}'", lambda: s.interp_state == linuxcnc.INTERP_IDLE and s.exec_state in (linuxcnc.EXEC_DONE, linuxcnc.EXEC_ERROR), 30)
        if self.errors:
            raise Stopped("a command before the program failed")

    def change_stylus(self, stop):
        """What the person does at the n-th stop."""
        styli = self.task.get("styli", [])
        if stop < len(styli):
            subprocess.run(["halcmd", "setp", "probe.longer", repr(styli[stop])], check=True, timeout=20)

    def run(self):
        c, s, task = self.command, self.stat, self.task
        self.mode(linuxcnc.MODE_AUTO)
        c.program_open(task["program"])
        c.wait_complete(10)
        before = self.modal()
        started = time.monotonic()
        self.cycle_start(linuxcnc.AUTO_RUN, 0)
        pauses, idle, line, answered = [], 0, 0, (None, 0.0)
        end = started + task["timeout_s"]
        while idle < 5:                         # idle in five looks running: between two states it may seem idle once
            s.poll()
            self.listen()
            line = max(line, s.motion_line, s.read_line)
            idle = idle + 1 if s.interp_state == linuxcnc.INTERP_IDLE and s.exec_state in (linuxcnc.EXEC_DONE, linuxcnc.EXEC_ERROR) else 0
            if s.interp_state == linuxcnc.INTERP_PAUSED and s.exec_state != linuxcnc.EXEC_ERROR:
                # M0: a person would read the message and press start. The same line again so soon is the same pause.
                at = s.read_line
                if answered[0] != at or time.monotonic() - answered[1] > 2:
                    pauses.append(at)
                    self.change_stylus(len(pauses))
                    answered = (at, time.monotonic())
                if len(pauses) > task["resume"]:
                    raise TimeoutError(f"paused at line {at} (M0?): more than {task['resume']} pauses")
                self.cycle_start(linuxcnc.AUTO_RESUME)
            if time.monotonic() > end:
                c.abort()
                c.wait_complete(5)
                raise TimeoutError(f"the program did not end within {task['timeout_s']:g} s (line {s.motion_line})")
            time.sleep(0.004)
        seconds = time.monotonic() - started
        time.sleep(0.05)
        self.listen()
        after = self.modal()
        return {"before": before, "after": after, "seconds": round(seconds, 3), "pauses": pauses, "last_line": line,
                "read_m2": any(m in (2, 30) for m in after["mcodes"])}


def pins():
    out = subprocess.run(["halcmd", "-s", "show", "pin", "probe."], capture_output=True, text=True, timeout=20).stdout
    found = {}
    for line in out.splitlines():
        words = line.split()
        if len(words) >= 5 and (m := re.fullmatch(r"probe\.([a-z][a-z-]*)", words[4])):
            found[m[1]] = {"TRUE": True, "FALSE": False}.get(words[3], words[3])
    return found


def main():
    with open(os.path.join(RUN, "driver-in.json")) as f:
        operator = Operator(json.load(f))
    answer = {"failure": None}
    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
    with open(os.path.join(RUN, "driver.pid"), "w") as f:
        f.write(str(os.getpid()))
    try:
        operator.connect()
        operator.home()
        operator.prelude()
        answer |= operator.run()
    except (Stopped, TimeoutError, linuxcnc.error) as e:
        answer["failure"] = str(e) or type(e).__name__
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        try:
            if operator.channel:
                operator.listen()
            answer["pins"] = pins()
            if answer["failure"] and operator.command:
                operator.command.abort()
        except (subprocess.SubprocessError, OSError, linuxcnc.error) as e:
            answer["failure"] = answer["failure"] or str(e)
        answer["errors"], answer["messages"] = operator.errors, operator.messages
        path = os.path.join(RUN, "driver.json")
        with open(path + ".part", "w") as f:
            json.dump(answer, f)
        os.replace(path + ".part", path)
    return 1 if answer["failure"] else 0


if __name__ == "__main__":
    sys.exit(main())
