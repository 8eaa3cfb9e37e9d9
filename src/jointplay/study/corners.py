"""A corrected motion judged by the engine, as it is modelled and where the model may be wrong.

Both motions are run with each trusted quantity at both ends of its interval, one at a time, and
then at that combination of ends at which the errors found, added up, are largest: 2 n + 2 pairs of
runs for n quantities, where all combinations would be 2^n. The tool is compared with the ideal twin
of the *original* motion, so a servo's own error counts for neither.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

import numpy as np

from jointplay.accuracy.compensation import (
    Compensation,
    corrected_motion,
    firmware_rule,
    through_jacobian,
    with_shift,
)
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.tables import Column, Table
from jointplay.base.units import readable
from jointplay.model.gear import Gearing, GearTrain
from jointplay.simulation.analysis.tool_error import difference, stops
from jointplay.simulation.analysis.twins import COMPARED, ideal_simulation, tool_motion
from jointplay.simulation.checks import joint_friction
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study

QUANTITIES = ("play", "friction", "payload", "stiffness")
"""What may be trusted to a part only."""
WHEN = ("before", "after")
_RECORD_S = 1e-3
"""Least width of what a node's error is the mean of, either way [s]."""
_STIFFNESSES = ("stiffness", "stiffness_1", "stiffness_2", "stiffness_3")


def trust_of(text: str) -> dict[str, float]:
    """Parts by which quantities may be off, of text such as ``play 30 %, friction 50 %``.

    Raises:
        JointplayError: a quantity of no such name, or a part that is not between 0 and 100 %.
    """
    found: dict[str, float] = {}
    for part in filter(None, (one.strip() for one in text.split(","))):
        name, _, number = part.partition(" ")
        if name not in QUANTITIES:
            raise MissingName("trusted quantity", name, QUANTITIES)
        try:
            value = float(number.strip().removesuffix("%")) / 100.0
        except ValueError:
            value = np.nan
        if not 0.0 < value < 1.0 or not number.strip().endswith("%"):
            raise JointplayError(f"--trust {name!r} must be above 0 % and below 100 %, as in "
                                 f"'play 30 %', got {part!r}")  # fmt: skip
        found[name] = value
    return found


@dataclass(frozen=True)
class ToolErrors:
    """Distance of the tool from the ideal one [m]."""

    rms: float
    on_the_way: float
    at_stops: float
    """RMS at the ends of stops, the start left out; NaN without any."""
    largest: float
    times: np.ndarray
    values: np.ndarray
    """World axes, (n, 3)."""


@dataclass(frozen=True)
class Corner:
    """Both motions run with one set of factors."""

    factors: Mapping[str, float]
    before: ToolErrors
    after: ToolErrors

    @property
    def words(self) -> str:
        told = [f"{name} {100 * (x - 1):+.0f} %" for name, x in self.factors.items() if x != 1.0]
        return ", ".join(told) or "as modelled"


@dataclass(frozen=True)
class Judgement:
    """What a corrected motion is worth."""

    compensation: Compensation
    corners: tuple[Corner, ...]
    """As modelled first."""
    firmware: ToolErrors | None
    """By the firmware's rule; None where no gear has play."""
    left_out: tuple[str, ...]
    """Quantities that were trusted in part and that nothing of the machine has."""
    complete: bool = True

    @property
    def nominal(self) -> Corner:
        return self.corners[0]

    @property
    def worst(self) -> Corner:
        """The corner in which most is left of the error."""
        return max(self.corners, key=lambda one: one.after.rms / one.before.rms)

    @property
    def worse(self) -> list[Corner]:
        """Corners in which the RMS error grows."""
        return [one for one in self.corners if one.after.rms >= one.before.rms]

    @property
    def sentence(self) -> str:
        was, now = self.nominal.before, self.nominal.after
        tool = self.compensation.simulation.mechanism.tool
        verb = "takes" if now.rms < was.rms else "makes it worse: it takes"
        words = (
            f"In simulation the corrected motion {verb} the RMS error of the tool {tool!r} from "
            f"{_mm(was.rms)} to {_mm(now.rms)} ({was.rms / now.rms:.2g} times)"
        )
        if len(self.corners) > 1:
            worst = self.worst
            ratio = worst.before.rms / worst.after.rms
            words += (
                f", in the worst corner ({worst.words}) from {_mm(worst.before.rms)} to "
                f"{_mm(worst.after.rms)} ({ratio:.2g} times)"
            )
        return words + "; hardware may differ"

    @property
    def notes(self) -> list[str]:
        lines = []
        for one in self.worse:
            lines.append(f"warning: it makes the RMS error worse where {one.words}")
        peaks = [one for one in self.corners if one.after.largest > one.before.largest]
        for one in peaks:
            lines.append(
                f"warning: the largest error grows from {_mm(one.before.largest)} to "
                f"{_mm(one.after.largest)} ({one.words})"
            )
        if self.firmware is not None:
            rule, was = self.firmware.rms, self.nominal.before.rms
            verdict = "better than nothing" if rule < was else "no better than nothing"
            lines.append(
                f"the firmware's rule, half the play by the sign of the commanded speed, would "
                f"leave {_mm(rule)} ({verdict}), at stops {_mm(self.firmware.at_stops)}"
            )
        if self.left_out:
            lines.append(f"note: the machine has no {', '.join(self.left_out)}: not varied")
        if len(self.corners) > 1:
            lines.append(
                "corners: each quantity alone at both ends, then the combination that is worst if "
                "errors add up"
            )
        if not self.complete:
            lines.append("warning: interrupted: not all corners were run")
        return lines

    def table(self) -> Table:
        """A row for each corner: errors before and after."""
        columns = [Column("corner", [one.words for one in self.corners])]
        for name in ("rms", "on_the_way", "at_stops", "largest"):
            for when in ("before", "after"):
                values = [getattr(getattr(one, when), name) for one in self.corners]
                columns.append(Column(f"{name.replace('_', ' ')} {when}", values, "m"))
        return Table(columns)


def judge(
    compensation: Compensation,
    trust: Mapping[str, float] | None = None,
    *,
    jobs: int | None = None,
    progress: bool = False,
) -> Judgement:
    """Run both motions through the engine, at the corners of what is trusted.

    Args:
        trust: by `QUANTITIES`, the part by which it may be off either way; None or empty: only as
            modelled.
        jobs: processes; None: one for each core.
        progress: show a bar on standard error.

    Raises:
        JointplayError: what a run refuses.
    """
    simulation, trust = compensation.simulation, trust or {}
    has = _varied(simulation)
    left_out = tuple(name for name in trust if name not in has)
    ways = {n: (1.0 - part, 1.0 + part) for n, part in trust.items() if n in has}
    singles: list[Mapping[str, float]] = [
        {},
        *({name: end} for name, ends in ways.items() for end in ends),
    ]
    rule = bool(firmware_rule(simulation, compensation.times).any())
    found: dict[int, ToolErrors] = {}
    plan: list[Item] = [(compensation, one, when) for one in singles for when in WHEN]
    plan += [(compensation, {}, "firmware")] * rule
    complete = _run(plan, found, jobs, progress)
    corners = _corners(singles, found)
    if complete and len(ways) > 1:
        worst, last = _worst_by_superposition(corners, ways), dict[int, ToolErrors]()
        complete = _run([(compensation, worst, when) for when in WHEN], last, jobs, progress)
        corners += _corners([worst], last)
    if not corners:
        raise KeyboardInterrupt
    firmware = found.get(2 * len(singles))
    return Judgement(compensation, tuple(corners), firmware, left_out, complete)


def learn(
    compensation: Compensation, passes: int, *, progress: bool = False
) -> tuple[Compensation, list[float]]:
    """Correct further by what own runs leave, pass by pass, as long as that improves.

    Returns:
        The best one, and the RMS error left by each pass that was tried, the first without [m].
    """
    left = _errors((compensation, {}, "after"))
    tried = [left.rms]
    for _ in range(passes):
        nodes = compensation.times
        half = max(0.5 * (nodes[1] - nodes[0]), _RECORD_S)
        means = [left.values[np.abs(left.times - t) <= half].mean(axis=0) for t in nodes]
        displacement = np.hstack([np.array(means), np.zeros((len(nodes), 3))])
        more = -through_jacobian(compensation.simulation, nodes, displacement)
        further = with_shift(compensation, more)
        now = _errors((further, {}, "after"))
        tried.append(now.rms)
        if now.rms >= left.rms:
            break
        compensation, left = further, now
    return compensation, tried


Item = tuple[Compensation, Mapping[str, float], str]
"""What is run: with which factors; `before`, `after`, or by the `firmware` rule."""


def _run(plan: list[Item], found: dict[int, ToolErrors], jobs: int | None, progress: bool) -> bool:
    """Run what is planned into `found`, by place; whether it was not interrupted."""
    try:
        for key, errors in Study(plan, _errors).outcomes(jobs, progress, desc="both motions"):
            found[key] = errors
    except KeyboardInterrupt:
        return False
    return True


def _worst_by_superposition(
    corners: Sequence[Corner], ways: Mapping[str, Sequence[float]]
) -> dict[str, float]:
    """Of all combinations of ends that whose error is largest if those of single ends add up."""
    left = {tuple(one.factors.items()): one.after.values for one in corners}
    base = left.pop(())

    def size(ends: Sequence[float]) -> float:
        return _rms(base + sum(left[(one,)] - base for one in zip(ways, ends, strict=True)))

    worst = max(product(*ways.values()), key=size)
    return dict(zip(ways, worst, strict=True))


def _corners(
    factors: Iterable[Mapping[str, float]], found: Mapping[int, ToolErrors]
) -> list[Corner]:
    return [
        Corner(one, found[2 * k], found[2 * k + 1])
        for k, one in enumerate(factors)
        if 2 * k in found and 2 * k + 1 in found
    ]


def _errors(item: Item) -> ToolErrors:
    """Run one motion on the machine with factors; the error from the original motion's twin."""
    compensation, factors, when = item
    plant = varied(compensation.simulation, factors)
    motion = plant.motion
    assert motion is not None
    if when == "after":
        moved = compensation.motion
    elif when == "firmware":
        shift = firmware_rule(compensation.simulation, compensation.times)
        moved, _ = corrected_motion(compensation.simulation, compensation.times, shift)
    else:
        moved = motion
    return tool_errors(replace(plant, motion=moved), plant)


def tool_errors(run: Simulation, original: Simulation) -> ToolErrors:
    """The tool's error in a run, from the ideal twin of another motion of the same machine."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = run.run(check_step=False, estimate=False, only=list(COMPARED))
        error = difference(result, tool_motion(ideal_simulation(original)))
    motion = original.motion
    assert motion is not None
    times, values = error["time"].values, error.values
    size = np.linalg.norm(values, axis=1)
    halts = [one for one in stops(motion, float(times[-1])) if one.at_rest and one.end > 0.0]
    speed = np.abs(motion(times)[1]).max(axis=1)
    way = speed > 1e-3 * speed.max()
    at = size[np.searchsorted(times, [one.end for one in halts]).clip(0, len(size) - 1)]
    return ToolErrors(
        _rms(size), _rms(size[way]), _rms(at), float(size.max()), times, values
    )  # fmt: skip


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _varied(simulation: Simulation) -> set[str]:
    """Quantities that the machine has."""
    mechanism = simulation.mechanism
    friction = joint_friction(simulation).values()
    has = {
        "play": True,
        "friction": any(one.coulomb or one.viscous for one in friction),
        "payload": bool(simulation.payloads),
        "stiffness": bool(mechanism.gears),
    }
    return {name for name, there in has.items() if there}


def varied(simulation: Simulation, factors: Mapping[str, float]) -> Simulation:
    """The same with quantities of `QUANTITIES` multiplied.

    Play is all clearances and gears' play, friction that of joints, payload its mass and inertia,
    stiffness that of gears.
    """
    changes: dict[str, Any] = {}
    play, stiffness = factors.get("play", 1.0), factors.get("stiffness", 1.0)
    mechanism = simulation.mechanism
    if play != 1.0 or stiffness != 1.0:
        clearance = {
            n: one.scaled(play) if one.clearances else one for n, one in mechanism.clearance.items()
        }
        gears = {n: _gear(one, play, stiffness) for n, one in mechanism.gears.items()}
        changes["mechanism"] = mechanism.with_clearance(clearance, gears)
    if (x := factors.get("friction", 1.0)) != 1.0:
        changes["joint_friction"] = {
            n: replace(one, coulomb=x * one.coulomb, viscous=x * one.viscous,
                       static=None if one.static is None else x * one.static)
            for n, one in joint_friction(simulation).items()
        }  # fmt: skip
    if (x := factors.get("payload", 1.0)) != 1.0:
        changes["payloads"] = tuple(
            replace(one, mass=x * one.mass, inertia=(x * a, x * b, x * c))
            for one in simulation.payloads
            for a, b, c in [one.inertia]
        )
    return replace(simulation, **changes)


def _gear(gear: Gearing, play: float, stiffness: float) -> Gearing:
    own = {one.name for one in fields(gear)}  # type: ignore[arg-type]
    changes: dict[str, Any] = {
        name: stiffness * getattr(gear, name)
        for name in _STIFFNESSES
        if name in own and getattr(gear, name) is not None
    }
    if isinstance(gear, GearTrain):
        changes["stages"] = tuple(replace(s, backlash=play * s.backlash) for s in gear.stages)
    elif "play" in own and gear.play is not None:
        changes["play"] = play * gear.play
    return replace(gear, **changes)  # type: ignore[type-var]


def _mm(value: float) -> str:
    return readable(value, "m", 3) if np.isfinite(value) else "nothing"
