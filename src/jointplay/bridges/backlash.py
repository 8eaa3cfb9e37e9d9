"""Backlash compensation in firmware: lost motion as a table or a number for each joint.

All firmwares compensate by the sign of the commanded speed; none knows payload, acceleration, or
the side on which a joint rests. So a joint whose teeth never change sides gets no entry: the rule
would only move it. Sources: LinuxCNC, docs/src/config/ini-config.adoc at commit 0052c79; Marlin,
Marlin/src/gcode/calibrate/M425.cpp at commit 00ebfe5; Klipper,
klippy/extras/backlash_compensation.py at commit 8503b63 of pull request 7259, a draft; grblHAL,
settings.h of grblHAL/core at commit f80fc34 ($160 and following, where config.h has
ENABLE_BACKLASH_COMPENSATION on, which is off by default); Smoothieware, pull request 1543, open
(built with BACKLASH=1). FluidNC has none ("can make things worse", issue 756). In a CoreXY machine
both motors turn for X and for Y, while Marlin, Klipper and Smoothieware have numbers of axes: none
of these files is right there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.accuracy.compensator import STILL
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.files import names_for
from jointplay.estimate.lost_motion import axis_letters

if TYPE_CHECKING:
    from jointplay.accuracy.compensation import Compensation
    from jointplay.model.mechanism import Mechanism

LINES = 65
"""Lines of a table; LinuxCNC takes at most 256 for a joint."""
FILES = ("yaml", "mcap", "table")
"""Files of a corrected motion: two for ROS 2, and the correction by joint, direction and load."""
_LETTERS = "axes X, Y and Z that slide"
_LOST = "the side a joint rests on, payload and acceleration"


@dataclass(frozen=True)
class Reversals:
    """Lost motion of joints at reversals."""

    joints: tuple[str, ...]
    """All moving joints, in their order."""
    sliding: tuple[str, ...]
    """Those of them that slide."""
    lost: Mapping[str, float]
    """Lost motion of the joints whose teeth change sides, from flank to flank [rad or m]."""
    tables: Mapping[str, np.ndarray] = field(default_factory=dict)
    """By joint, for a corrected motion: position, and the shift that corrects the link's lag there
    when moving upwards and downwards, (n, 3) [rad or m]."""

    @classmethod
    def of(cls, mechanism: Mechanism, lost: Mapping[str, float]) -> Reversals:
        """Reversals of a mechanism with measured lost motion [rad or m]."""
        joints, entries = tuple(mechanism.joints), mechanism.description.joints
        return cls(joints, tuple(name for name in joints if entries[name].slides), lost)

    @property
    def by_letter(self) -> list[tuple[str, float]]:
        """Axis letter and lost motion of the sliding joints that lose some [mm]."""
        letters = axis_letters(self.sliding).items()
        return [(axis, self._size(name)) for name, axis in letters if name in self.lost]

    @property
    def by_number(self) -> list[tuple[int, float]]:
        """Axis number and lost motion of the joints that lose some [mm or degrees]; numbers are 0
        to 2 for X to Z, else by the joints' order.
        """
        numbers = {name: "XYZ".index(axis) for name, axis in axis_letters(self.sliding).items()}
        return [(numbers.get(n, self.joints.index(n)), self._size(n)) for n in self.lost]

    def _size(self, joint: str) -> float:
        return _in_unit(self.lost[joint], joint in self.sliding)


@dataclass(frozen=True)
class Format:
    """The compensation that one firmware knows."""

    write: Callable[[Reversals], dict[str, str]]
    """Function that returns the texts of its files by name."""
    lost: str
    """What it cannot represent."""
    axes: str = ""
    """The axes that it knows, if not all."""


def corrected(compensation: Compensation) -> Reversals:
    """Lost motion of the gears that change sides in a corrected motion, with their tables."""
    mechanism = compensation.simulation.mechanism
    motion = compensation.simulation.motion
    assert motion is not None
    position, speed, _ = motion(compensation.times)
    crossing = zip(compensation.gears, compensation.crossings, strict=True)
    lost = {name: mechanism.gears[name].play for name, number in crossing if number}
    tables = {}
    for name in lost:
        k = motion.joints.index(name)
        q, v, shift = position[:, k], speed[:, k], compensation.shift[:, k]
        nominal = np.linspace(q.min(), q.max(), LINES)
        columns = [_mean(nominal, q[sign * v > STILL], shift[sign * v > STILL]) for sign in (1, -1)]
        tables[name] = np.column_stack([nominal, *columns])
    return replace(Reversals.of(mechanism, lost), tables=tables)


def tables(reversals: Reversals, name: str) -> dict[str, str]:
    """Files for a firmware of `FORMATS`, by name.

    Raises:
        JointplayError: the firmware has no compensation, or no joint that it knows changes sides.
    """
    if name == "fluidnc":
        raise JointplayError(
            "FluidNC has no backlash compensation: give it the corrected motion as a program"
        )
    if not reversals.lost:
        raise JointplayError(f"{name} compensates at reversals, and no gear's teeth change sides")
    files = FORMATS[name].write(reversals)
    if not files:
        raise JointplayError(f"{name} knows {FORMATS[name].axes}, and none changes sides")
    return files


def refuse_unwritten(names: Collection[str], known: Collection[str], folder: str | None) -> None:
    """Raise a JointplayError for an unknown format, or if there is no folder for the files."""
    for name in names:
        require_known("format", name, known)
    if names and not folder:
        raise JointplayError("--formats are written into a folder: give --out DIR, too")


def tables_of(reversals: Reversals, names: Iterable[str]) -> tuple[dict[str, str], list[str]]:
    """Files for several firmwares by name, and notes on what each cannot say or why it has none."""
    contents: dict[str, str] = {}
    notes = []
    for name in names:
        try:
            contents |= tables(reversals, name)
            notes.append(f"note: {name} cannot say {FORMATS[name].lost}")
        except JointplayError as error:
            notes.append(f"warning: no file for {name}: {error}")
    return contents, notes


def corrected_files(
    compensation: Compensation, names: Collection[str]
) -> tuple[dict[str, Any], list[str]]:
    """Files of a corrected motion beside its CSV, by name, and notes on what they cannot say.

    `names`: some of `FILES` and `FORMATS`.
    """
    from jointplay.accuracy.compensation import table_for_controllers
    from jointplay.bridges import bag
    from jointplay.bridges.trajectory import content, of_motion

    contents: dict[str, Any] = {}
    if "yaml" in names:
        contents["motion.yaml"] = content(of_motion(compensation.motion), ".yaml")
    if "mcap" in names:
        contents["motion.mcap"] = bag.of_trajectory(of_motion(compensation.motion))
    if "table" in names:
        contents["table.csv"] = table_for_controllers(compensation).csv()
    firmwares = [name for name in names if name in FORMATS]
    further, notes = tables_of(corrected(compensation), firmwares) if firmwares else ({}, [])
    return contents | further, notes


def _in_unit(value: float, slides: bool) -> float:
    """A value in mm or degrees, as firmware counts [m or rad]."""
    return 1e3 * value if slides else float(np.degrees(value))


def _linuxcnc(reversals: Reversals) -> dict[str, str]:
    """Tables for a corrected motion; for measured lost motion, lines of the INI file."""
    if not reversals.tables:
        lines = [f"[JOINT_{number}]\nBACKLASH = {x:.4f}" for number, x in reversals.by_number]
        return _file("linuxcnc.ini", [], lines)
    files = names_for(list(reversals.tables), ".comp")
    contents = {}
    for (name, table), file in zip(reversals.tables.items(), files, strict=True):
        slides = name in reversals.sliding
        rows = np.column_stack([table[:, 0], table[:, :1] - table[:, 1:]])
        lines = [" ".join(f"{_in_unit(x, slides):.6f}" for x in row) for row in rows]
        contents[file] = "\n".join(lines) + "\n"
    return contents


def _mean(grid: np.ndarray, q: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Mean shift at each place of the grid over the visits near it, or those nearest to it; 0
    without any.
    """
    if not len(q):
        return np.zeros_like(grid)
    width = max(grid[1] - grid[0], 1e-12)
    means = np.empty_like(grid)
    for i, x in enumerate(grid):
        distance = np.abs(q - x)
        means[i] = shift[distance <= max(width, distance.min())].mean()
    return means


def _file(name: str, head: list[str], lines: list[str], *end: str) -> dict[str, str]:
    """A file by its name, if it has a line for any joint."""
    return {name: "\n".join([*head, *lines, *end]) + "\n"} if lines else {}


def _marlin(reversals: Reversals) -> dict[str, str]:
    axes = " ".join(f"{letter}{x:.4f}" for letter, x in reversals.by_letter)
    lines = [f"M425 F1.0 {axes}"] if axes else []
    return _file("marlin.gcode", ["; play by axis, full correction"], lines)


def _klipper(reversals: Reversals) -> dict[str, str]:
    head = ["# For pull request 7259, a draft: Klipper without it refuses this section."]
    lines = [f"{letter.lower()}_backlash: {x:.4f}" for letter, x in reversals.by_letter]
    return _file("klipper.cfg", [*head, "[backlash_compensation]"], lines)


def _grblhal(reversals: Reversals) -> dict[str, str]:
    lines = [f"$16{number}={x:.4f}" for number, x in reversals.by_number if number < 6]
    return _file("grblhal.txt", [], lines)


def _smoothieware(reversals: Reversals) -> dict[str, str]:
    greek = {"X": "alpha", "Y": "beta", "Z": "gamma"}
    head = ["# For pull request 1543, built with BACKLASH=1."]
    lines = [f"{greek[letter]}_backlash_mm {x:.4f}" for letter, x in reversals.by_letter]
    return _file("smoothieware.txt", head, lines, "backlash_enable true")


FORMATS = {
    "linuxcnc": Format(_linuxcnc, f"{_LOST}; goes by position and commanded direction"),
    "marlin": Format(_marlin, f"{_LOST}, wind-up; one number for each of X, Y, Z", _LETTERS),
    "klipper": Format(
        _klipper,
        f"{_LOST}, wind-up; one number for each of X, Y, Z; needs a draft, pull request 7259",
        _LETTERS,
    ),
    "grblhal": Format(
        _grblhal, f"{_LOST}, wind-up; one number for each of six axes", "the first six axes"
    ),
    "smoothieware": Format(
        _smoothieware, f"{_LOST}, wind-up; one number for each of X, Y, Z", _LETTERS
    ),
    "fluidnc": Format(lambda _: {}, "everything"),
}
"""Formats by firmware."""
