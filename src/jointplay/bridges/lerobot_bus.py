"""Plays a motion on the servos of a LeRobot arm, and logs their goals and positions.

    python THIS_FILE PORT [--motion wiggle.csv] [--log wiggle_log.csv]

Needs lerobot, of whose buses it uses what github.com/huggingface/lerobot has in commit 7427f31
(`lerobot.motors.feetech`, `.dynamixel`), and the calibration that LeRobot has written to the
servos; not jointplay. Gains are read and not changed, and stand in the log's first lines.

The torque is switched off if an encoder is further than `TRIP` from its goal (beyond what it was
off when it stood), if anything fails, and on Ctrl-C: hold the arm. The log grows line by line.
Degrees and seconds.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import math
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

TURN = 4096
"""Counts of an encoder in a turn."""
TRIP, TRIP_MOVING = 5.0, 20.0
"""Deviations from the goal at which the torque is switched off: in a test, and on the way [deg]."""
SPEED = 15.0
"""Of the way to the first pose and back [deg/s]."""
RATE, ENOUGH = 200.0, 100.0
"""Records that are tried for, and that are enough [1/s]."""
TIMEOUT_MS, MISSED = 50, 3
"""Of an answer of the bus, and answers one after the other that may fail."""
REGISTERS = {
    "feetech": (
        *("P_Coefficient", "I_Coefficient", "D_Coefficient", "CW_Dead_Zone", "CCW_Dead_Zone"),
        *("Acceleration", "Goal_Velocity", "Present_Voltage"),
    ),
    "dynamixel": (
        *("Position_P_Gain", "Position_I_Gain", "Position_D_Gain", "Feedforward_1st_Gain"),
        *("Profile_Velocity", "Profile_Acceleration", "Present_Input_Voltage"),
    ),
}
"""What is recorded of each servo before it moves."""

Motors = Mapping[str, tuple[int, str, int, float]]
"""By joint: number on the bus, model, 1 or -1 for its direction, and the joint's angle in the
robot's description where LeRobot has its zero [deg]."""
Steps = Sequence[tuple[str, float, float]]
"""Tests: joint, begin and end [s]."""
Motion = tuple[list[float], list[dict[str, float]]]
"""Times [s], and angles by joint [deg]."""
Log = Callable[[float, dict[str, float], dict[str, float]], None]


class Stopped(Exception):
    """Why the torque was switched off."""


class Arm:
    """Servos of a bus, in angles of the robot's description."""

    def __init__(self, bus: Any, motors: Motors) -> None:
        self.bus, self.motors = bus, motors
        self.held = bus.read_calibration()

    def count(self, joint: str, angle: float) -> int:
        _, _, way, zero = self.motors[joint]
        held = self.held[joint]
        return round((held.range_min + held.range_max) / 2 + way * (angle - zero) * TURN / 360)

    def angle(self, joint: str, count: int) -> float:
        _, _, way, zero = self.motors[joint]
        held = self.held[joint]
        return zero + way * (count - (held.range_min + held.range_max) / 2) * 360 / TURN

    def read(self) -> tuple[float, dict[str, float]]:
        """The time at the middle of a reading, and the angles."""
        begin = time.perf_counter()
        counts = self.bus.sync_read("Present_Position", normalize=False)
        middle = (begin + time.perf_counter()) / 2
        return middle, {joint: self.angle(joint, counts[joint]) for joint in self.motors}

    def send(self, goal: Mapping[str, float]) -> dict[str, float]:
        """Goals as they are after rounding to whole counts."""
        counts = {joint: self.count(joint, goal[joint]) for joint in self.motors}
        self.bus.sync_write("Goal_Position", counts, normalize=False)
        return {joint: self.angle(joint, count) for joint, count in counts.items()}

    def check(self, motion: Motion) -> None:
        """Refuse a motion that leaves the range of LeRobot's calibration."""
        for joint in self.motors:
            held, angles = self.held[joint], [row[joint] for row in motion[1]]
            for angle in (min(angles), max(angles)):
                if not held.range_min <= self.count(joint, angle) <= held.range_max:
                    low, high = sorted(
                        self.angle(joint, k) for k in (held.range_min, held.range_max)
                    )
                    words = f"{joint} would go to {angle:.1f} deg, and its calibration has "
                    raise Stopped(f"{words}{low:.1f} to {high:.1f} deg: are MOTORS right?")

    def hold(self) -> dict[str, float]:
        """Switch the torque on where the joints are; their angles."""
        _, seen = self.read()
        self.send(seen)
        self.bus.enable_torque()
        return seen

    def release(self) -> None:
        """Switch the torque off, whatever it takes."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for _ in range(5):
            with suppress(Exception):
                self.bus.disable_torque(num_retry=5)
                break
        else:
            print("THE TORQUE MAY STILL BE ON: cut the supply", file=sys.stderr)
        with suppress(Exception):
            self.bus.disconnect(disable_torque=False)


def play(arm: Arm, motion: Motion, steps: Steps = (), log: Log | None = None) -> int:
    """Play a motion, and return how many records there are.

    Raises:
        Stopped: an encoder is too far from its goal, or the bus does not answer.
    """
    times, rows = motion
    begin, k, records, missed = time.perf_counter(), 0, 0, 0
    step: object = ()
    off: dict[str, float] = {}
    while (now := time.perf_counter() - begin) < times[-1]:
        while times[k + 1] <= now:
            k += 1
        part = (now - times[k]) / (times[k + 1] - times[k])
        goal = {j: a + part * (rows[k + 1][j] - a) for j, a in rows[k].items()}
        try:
            goal = arm.send(goal)
            stamp, seen = arm.read()
            missed = 0
        except Exception as error:
            missed += 1
            if missed >= MISSED:
                raise Stopped(f"the bus failed: {error}") from error
            continue
        if log is not None:
            log(stamp - begin, goal, seen)
        records += 1
        now_in = next((one for one in steps if one[1] <= now < one[2]), None)
        if now_in != step:
            step, off = now_in, {joint: seen[joint] - goal[joint] for joint in goal}
        most = TRIP_MOVING if step is None else TRIP
        for joint, angle in seen.items():
            if abs(away := angle - goal[joint] - off[joint]) > most:
                raise Stopped(f"{joint} was {away:+.1f} deg from its goal at {now:.2f} s")
        time.sleep(max(0.0, begin + now + 1.0 / RATE - time.perf_counter()))
    return records


def way(begin: Mapping[str, float], end: Mapping[str, float]) -> Motion:
    """From rest to rest."""
    long = max(1.5 * max(abs(end[j] - begin[j]) for j in begin) / SPEED, 1.0)
    parts = [k / 50 for k in range(51)]
    smooth = [3 * part**2 - 2 * part**3 for part in parts]
    rows = [{j: begin[j] + s * (end[j] - begin[j]) for j in begin} for s in smooth]
    return [long * part for part in parts], rows


def read_motion(path: Path, joints: Sequence[str]) -> Motion:
    """A CSV of ``time_s`` and joints in rad, as jointplay writes it."""
    with path.open(newline="") as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    rows = [{joint: math.degrees(float(row[joint])) for joint in joints} for row in table]
    return [float(row["time_s"]) for row in table], rows


def connect(kind: str, port: str, motors: Motors) -> Any:
    """A bus of ``lerobot.motors``, open."""
    lerobot = importlib.import_module("lerobot.motors")
    makers = {"feetech": "FeetechMotorsBus", "dynamixel": "DynamixelMotorsBus"}
    maker = getattr(importlib.import_module(f"lerobot.motors.{kind}"), makers[kind])
    degrees = lerobot.MotorNormMode.DEGREES
    servos = {name: lerobot.Motor(*one[:2], degrees) for name, one in motors.items()}
    bus = maker(port, servos)
    bus.connect()
    bus.set_timeout(TIMEOUT_MS)
    return bus


def head(file: TextIO, arm: Arm, kind: str) -> None:
    """Gains of each servo as they are, and the columns."""
    for joint in arm.motors:
        known = {one: arm.bus.read(one, joint, normalize=False) for one in REGISTERS[kind]}
        words = ", ".join(f"{one} {value}" for one, value in known.items())
        file.write(f"# {joint}: {words}\n")
        print(f"{joint}: {words}")
    names = [f"{joint} {what} [deg]" for joint in arm.motors for what in ("goal", "position")]
    file.write(",".join(["time [s]", *names]) + "\n")


def logger(file: TextIO) -> Log:
    """What writes a line into a file for each record."""

    def log(stamp: float, goal: dict[str, float], seen: dict[str, float]) -> None:
        cells = [f"{x:.6f}" for joint in goal for x in (goal[joint], seen[joint])]
        file.write(",".join([f"{stamp:.6f}", *cells]) + "\n")

    return log


def perform(arm: Arm, kind: str, motion: Motion, steps: Steps, log: Path, ask: bool) -> None:
    """Go there, test joint by joint, and come back.

    Raises:
        Stopped: see `play` and `Arm.check`; the log exists, or nobody said yes.
    """
    arm.check(motion)
    _, seen = arm.read()
    first = motion[1][0]
    for joint, angle in seen.items():
        print(f"{joint}: at {angle:.1f} deg, goes to {first[joint]:.1f} deg")
    print(
        "Are these the angles of the arm in its description? Stay clear of it, hand on the supply."
    )
    if ask and input("Move? [y/N] ").strip().lower() != "y":
        raise Stopped("nothing was moved")
    try:
        file = log.open("x", buffering=1)
    except FileExistsError:
        raise Stopped(f"{log} exists") from None
    with file:
        head(file, arm, kind)
        began = arm.hold()
        play(arm, way(began, first))
        records = play(arm, motion, steps, logger(file))
    play(arm, way(motion[1][-1], began))
    rate = records / motion[0][-1]
    print(f"{log}: {records} records, {rate:.0f} a second")
    if rate < ENOUGH:
        print(f"fewer than {ENOUGH:.0f} a second: the bus is slow (Return_Delay_Time, baud rate)")


def main(kind: str, motors: Motors, steps: Steps) -> int:
    """The command; its exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("port", help="such as /dev/ttyACM0")
    beside = Path(__file__).parent
    parser.add_argument("--motion", type=Path, default=beside / "wiggle.csv")
    parser.add_argument("--log", type=Path, default=Path("wiggle_log.csv"))
    parser.add_argument("--yes", action="store_true", help="do not ask before it moves")
    options = parser.parse_args()
    motion = read_motion(options.motion, list(motors))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    arm = Arm(connect(kind, options.port, motors), motors)
    try:
        perform(arm, kind, motion, steps, options.log, not options.yes)
    except Stopped as reason:
        print(f"stopped: {reason}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("stopped by Ctrl-C", file=sys.stderr)
        return 130
    finally:
        arm.release()
    return 0
