"""What firmware can take of a compensation: a table or a number for each joint.

All of it goes by the sign of the commanded speed: none can say payload, acceleration, or on which
side a joint rests. So a joint whose teeth never change sides gets nothing: the rule would only
move it. Seen: LinuxCNC, docs/src/config/ini-config.adoc at commit 0052c79; Marlin,
Marlin/src/gcode/calibrate/M425.cpp at commit 00ebfe5; Klipper,
klippy/extras/backlash_compensation.py at commit 8503b63 of pull request 7259, a draft; grblHAL,
settings.h of grblHAL/core at commit f80fc34 ($160 and following, where config.h has
ENABLE_BACKLASH_COMPENSATION on, which is off by default). FluidNC has none ("can make things
worse", issue 756).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jointplay.accuracy.compensation import Compensation
from jointplay.accuracy.compensator import STILL
from jointplay.base.errors import JointplayError
from jointplay.base.files import names_for

LINES = 65
"""Lines of a table; LinuxCNC takes at most 256 a joint."""
_LETTERS = "axes X, Y and Z that slide"
_LOST = "the side a joint rests on, payload and acceleration"


@dataclass(frozen=True)
class Format:
    """One firmware's, by its word."""

    write: Callable[[Compensation], dict[str, str]]
    """Texts by name of the file."""
    lost: str
    """What it cannot say."""
    axes: str = ""
    """Which it knows, if not all."""


def tables(compensation: Compensation, name: str) -> dict[str, str]:
    """Files for a firmware of `FORMATS`, by name.

    Raises:
        JointplayError: it has no compensation; no joint that it knows changes sides.
    """
    if name == "fluidnc":
        raise JointplayError(
            "FluidNC has no backlash compensation: give it the corrected motion as a program"
        )
    if not (compensation.gears and compensation.crossings.any()):
        raise JointplayError(
            f"nothing to tell {name}: no gear's teeth change sides, and its rule goes by reversals"
        )
    found = FORMATS[name].write(compensation)
    if not found:
        raise JointplayError(
            f"nothing to tell {name}, which knows {FORMATS[name].axes}: none of them changes sides"
        )
    return found


def _crossing(compensation: Compensation) -> list[tuple[str, bool, float]]:
    """Gears whose teeth change sides: joint, whether it slides, play [rad or m]."""
    mechanism = compensation.simulation.mechanism
    return [
        (name, mechanism.description.joints[name].slides, mechanism.gears[name].play)
        for name, number in zip(compensation.gears, compensation.crossings, strict=True)
        if number
    ]


def _in_unit(value: float, slides: bool) -> float:
    """In mm or degrees, as firmware counts."""
    return 1e3 * value if slides else float(np.degrees(value))


def _linuxcnc(compensation: Compensation) -> dict[str, str]:
    motion = compensation.simulation.motion
    assert motion is not None
    position, speed, _ = motion(compensation.times)
    found, crossing = {}, _crossing(compensation)
    files = names_for([name for name, *_ in crossing], ".comp")
    for (name, slides, _), file in zip(crossing, files, strict=True):
        k = motion.joints.index(name)
        q, v, shift = position[:, k], speed[:, k], compensation.shift[:, k]
        nominal = np.linspace(q.min(), q.max(), LINES)
        ways = [_at(nominal, q[sign * v > STILL], shift[sign * v > STILL]) for sign in (1, -1)]
        rows = np.column_stack([nominal, *(nominal - way for way in ways)])
        lines = [" ".join(f"{_in_unit(x, slides):.6f}" for x in row) for row in rows]
        found[file] = "\n".join(lines) + "\n"
    return found


def _at(places: np.ndarray, q: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Mean shift of the visits nearest to each place; none where there are no visits."""
    if not len(q):
        return np.zeros_like(places)
    width = max(places[1] - places[0], 1e-12)
    found = np.empty_like(places)
    for i, place in enumerate(places):
        away = np.abs(q - place)
        found[i] = shift[away <= max(width, away.min())].mean()
    return found


def _letters(compensation: Compensation) -> list[tuple[str, str, float]]:
    """Joint, letter and play [mm] of those of X, Y and Z that slide and change sides."""
    mechanism = compensation.simulation.mechanism
    sliding = [name for name in mechanism.joints if mechanism.description.joints[name].slides]
    letters = dict(zip(sliding, "XYZ", strict=False))
    return [(n, letters[n], 1e3 * p) for n, _, p in _crossing(compensation) if n in letters]


def _marlin(compensation: Compensation) -> dict[str, str]:
    words = " ".join(f"{letter}{play:.4f}" for _, letter, play in _letters(compensation))
    if not words:
        return {}
    return {"marlin.gcode": f"; play by axis, full correction\nM425 F1.0 {words}\n"}


def _klipper(compensation: Compensation) -> dict[str, str]:
    lines = [f"{one.lower()}_backlash: {play:.4f}" for _, one, play in _letters(compensation)]
    return {"klipper.cfg": "\n".join(["[backlash_compensation]", *lines]) + "\n"} if lines else {}


def _grblhal(compensation: Compensation) -> dict[str, str]:
    joints = list(compensation.simulation.mechanism.joints)
    lines = [
        f"$16{joints.index(name)}={_in_unit(play, slides):.4f}"
        for name, slides, play in _crossing(compensation)
        if joints.index(name) < 6
    ]
    return {"grblhal.txt": "\n".join(lines) + "\n"} if lines else {}


FORMATS = {
    "linuxcnc": Format(_linuxcnc, f"{_LOST}; goes by position and commanded direction"),
    "marlin": Format(_marlin, f"{_LOST}, wind-up; one number for each of X, Y, Z", _LETTERS),
    "klipper": Format(_klipper, f"{_LOST}, wind-up; one number for each of X, Y, Z", _LETTERS),
    "grblhal": Format(
        _grblhal, f"{_LOST}, wind-up; one number for each of six axes", "the first six axes"
    ),
    "fluidnc": Format(lambda _: {}, "everything"),
}
"""By firmware."""
