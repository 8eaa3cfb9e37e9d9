"""Verification of a corrected motion by the engine, with the model as it is and at its corners.

Where quantities of the model are uncertain, both motions are run at every combination of the ends
of their intervals, the corners: 2^n pairs of runs for n quantities, four at most. The tool's error
is its distance from where the ideal robot has it, with joints exactly where the *original* motion
puts them.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.accuracy.compensation import (
    Compensation,
    corrected_motion,
    firmware_rule,
    through_jacobian,
    with_shift,
)
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.tables import Column, Table, few
from jointplay.base.units import readable
from jointplay.model.gear import Gearing
from jointplay.simulation.analysis.tool_error import (
    difference,
    error_statistics,
    stops,
    time_weights,
)
from jointplay.simulation.analysis.twins import TOOL_MOTIONS, ideal_simulation, tool_motion
from jointplay.simulation.loads.drive import JointFriction, Prescribed, assign
from jointplay.simulation.prepare import joint_friction
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Memory, Study

if TYPE_CHECKING:
    from jointplay.accuracy.allocation import Correction
    from jointplay.scenario.presets import Preset

QUANTITIES = ("play", "friction", "payload", "stiffness")
"""Quantities of the model that may be uncertain."""
IDENTIFIED, EXACT = "identified", "exact"
"""Words for `trust_of`: trust a preset up to its intervals; trust the model without limit."""
_NUMBERS = {
    "gear.play": "play",
    "bearing.radial_clearance": "play",
    "bearing.axial_clearance": "play",
    "friction.coulomb": "friction",
    "gear.stiffness": "stiffness",
}
"""Quantity to which a number of a preset belongs, by its part and name."""
Interval = tuple[float, float]
Trust = Mapping[str, float | Mapping[str, Interval]]
"""Uncertainty of each of `QUANTITIES`: relative, either way; or intervals [SI] of its numbers, by
their keys in a preset, such as ``elbow.gear.play``."""
MOTIONS = ("before", "after")
"""The original motion and the corrected one."""
_RECORD_S = 1e-3
"""Least half width of the window over which the error at a node is averaged [s]."""
_STIFFNESSES = ("stiffness", "stiffness_1", "stiffness_2", "stiffness_3")


def trust_of(text: str, preset: Preset | None = None) -> Trust:
    """Read uncertainties of the model from text such as ``play 30 %, friction 50 %``.

    Args:
        text: ``identified`` among the entries takes the preset's intervals, which percentages of
            the same quantity override; ``exact`` alone trusts everything.
        preset: preset with measured joints.

    Raises:
        JointplayError: an unknown quantity, a percentage not between 0 and 100 %, no intervals.
    """
    measured: dict[str, dict[str, Interval]] = {}
    parts: dict[str, float] = {}
    entries = [part.strip() for part in text.split(",") if part.strip()]
    if entries == [EXACT]:
        return {}
    if IDENTIFIED in entries:
        for origin in () if preset is None else preset.origins:
            quantity = _NUMBERS.get(".".join(_split_key(origin.key)[1:]))
            if quantity and len(origin.interval) == 2:
                low, high = origin.interval
                measured.setdefault(quantity, {})[origin.key] = low, high
        if not measured:
            raise JointplayError(
                "--trust identified: there are no intervals; give --preset FILE that identify or "
                "calibrate wrote (--write-preset FILE)"
            )
        entries.remove(IDENTIFIED)
    for part in entries:
        name, _, number = part.partition(" ")
        if name not in QUANTITIES:
            raise MissingName("trusted quantity", name, (*QUANTITIES, IDENTIFIED, EXACT))
        try:
            value = float(number.strip().removesuffix("%")) / 100.0
        except ValueError:
            value = np.nan
        if not 0.0 < value < 1.0 or not number.strip().endswith("%"):
            raise JointplayError(f"--trust {name!r} must be above 0 % and below 100 %, as in "
                                 f"'play 30 %', got {part!r}")  # fmt: skip
        parts[name] = value
    return {**measured, **parts}


def correction(price: float, trust: str) -> Correction:
    """A corrected motion as an option of `allocate`: its price, and the model's uncertainty.

    `trust`: see `trust_of`; at rest only play and friction may be uncertain.
    """
    from jointplay.accuracy.allocation import Correction

    parts = trust_of(trust)
    if extra := [name for name in parts if name not in ("play", "friction")]:
        raise JointplayError(f"--trust {extra[0]!r}: at rest only play and friction may be off")
    return Correction(price, **{k: part for k, part in parts.items() if isinstance(part, float)})


def _split_key(key: str) -> tuple[str, str, str]:
    """Joint, part and number of a preset's key."""
    path, _, number = key.rpartition(".")
    joint, _, part = path.rpartition(".")
    return joint, part, number


@dataclass(frozen=True)
class ToolErrors:
    """Error of the tool in one run, against the ideal one's pose [m]."""

    rms: float
    """RMS over the run."""
    on_the_way: float
    """RMS while joints move; NaN if none does."""
    at_stops: float
    """RMS at the ends of stops, the start left out; NaN without any."""
    largest: float
    turn: float
    """RMS angle by which the tool is turned [rad]."""
    times: np.ndarray
    values: np.ndarray
    """Error of position and orientation at `times` in world axes, (n, 6) [m, rad]."""


@dataclass(frozen=True)
class Corner:
    """The errors of both motions on a machine that differs from the model."""

    label: str
    changes: Mapping[str, float]
    """Changes of the machine, as `varied` takes them."""
    before: ToolErrors
    after: ToolErrors


@dataclass(frozen=True)
class Judgement:
    """What a corrected motion gains, as modelled and at the corners."""

    compensation: Compensation
    corners: tuple[Corner, ...]
    """The corners, that of the unchanged model first."""
    firmware: ToolErrors | None
    """Errors with the firmware's rule in place of the correction; None: no gear has play."""
    left_out: tuple[str, ...]
    """Uncertain quantities that the machine does not have."""
    complete: bool
    """Whether all corners were run."""

    @property
    def nominal(self) -> Corner:
        return self.corners[0]

    @property
    def least_gain(self) -> Corner:
        """The corner in which the largest part of the original error is left."""
        return max(self.corners, key=lambda corner: corner.after.rms / corner.before.rms)

    @property
    def most_left(self) -> Corner:
        """The corner in which the error that is left is largest."""
        return max(self.corners, key=lambda corner: corner.after.rms)

    @property
    def worse(self) -> list[Corner]:
        """Corners in which the RMS error grows."""
        return [corner for corner in self.corners if corner.after.rms >= corner.before.rms]

    @property
    def sentence(self) -> str:
        original, corrected = self.nominal.before, self.nominal.after
        tool = self.compensation.simulation.mechanism.tool
        verb = "takes" if corrected.rms < original.rms else "makes it worse: it takes"
        text = (
            f"In simulation the corrected motion {verb} the RMS error of the tool {tool!r} from "
            f"{_mm(original.rms)} to {_mm(corrected.rms)} "
            f"({_times(original, corrected)} times)"
        )
        if len(self.corners) > 1:
            least_gain, worst = self.least_gain, self.most_left
            text += (
                f", where it gains least ({least_gain.label}) from {_mm(least_gain.before.rms)} to "
                f"{_mm(least_gain.after.rms)} "
                f"({_times(least_gain.before, least_gain.after)} times)"
            )
            if worst is not least_gain:
                text += f", where most is left ({worst.label}) to {_mm(worst.after.rms)}"
        return text + "; hardware may differ"

    @property
    def _coasting(self) -> str:
        """Remark on joints without friction, whose teeth change sides when the motor brakes."""
        simulation = self.compensation.simulation
        friction = joint_friction(simulation)
        names = [n for n in self.compensation.gears if not friction.get(n, JointFriction()).coulomb]
        if not names:
            return ""
        return f"; that is without dry friction in {few(names)} (--joint-friction gives it)"

    @property
    def notes(self) -> list[str]:
        lines = []
        for corner in self.worse:
            lines.append(f"warning: it makes the RMS error worse where {corner.label}")
        peaks = [corner for corner in self.corners if corner.after.largest > corner.before.largest]
        for corner in peaks:
            lines.append(
                f"warning: the largest error grows from {_mm(corner.before.largest)} to "
                f"{_mm(corner.after.largest)} ({corner.label})"
            )
        original, corrected = self.nominal.before.turn, self.nominal.after.turn
        if corrected > original and self.compensation.size is None:
            lines.append(
                f"warning: the tool's RMS turn grows from {1e3 * original:.3g} to "
                f"{1e3 * corrected:.3g} mrad: --tool-size weighs it against the position"
            )
        if self.firmware is not None:
            rule, original = self.firmware.rms, self.nominal.before.rms
            verdict = "better than nothing" if rule < original else "no better than nothing"
            stops = self.firmware.at_stops  # NaN where the motion has none
            at_stops = f", at stops {_mm(stops)}" if np.isfinite(stops) else ""
            lines.append(
                f"the firmware's rule, half the play by the sign of the commanded speed, would "
                f"leave {_mm(rule)} ({verdict}){at_stops}{self._coasting}"
            )
        if self.left_out:
            lines.append(f"note: the machine has no {', '.join(self.left_out)}: not varied")
        if not self.complete:
            lines.append("warning: interrupted: not all corners were run")
        return lines

    def table(self) -> Table:
        """Table with a row for each corner: errors before and after."""
        columns = [Column("corner", [corner.label for corner in self.corners])]
        for name in ("rms", "on_the_way", "at_stops", "largest", "turn"):
            for motion in ("before", "after"):
                values = [getattr(getattr(corner, motion), name) for corner in self.corners]
                unit = "rad" if name == "turn" else "m"
                columns.append(Column(f"{name.replace('_', ' ')} {motion}", values, unit))
        return Table(columns)


def judge(
    compensation: Compensation,
    trust: Trust | None = None,
    *,
    jobs: int | None = None,
    progress: bool = False,
) -> Judgement:
    """Run the original and the corrected motion through the engine, at all corners of the model.

    Args:
        compensation: the correction.
        trust: uncertainties of the model; None or empty: only the model as it is.
        jobs: processes; None: one for each core.
        progress: show a bar on standard error.

    Raises:
        JointplayError: a run that is refused.
    """
    simulation, trust = compensation.simulation, trust or {}
    quantities = _quantities_of(simulation)
    left_out = tuple(name for name in trust if name not in quantities)
    choices = [_limits(name, limit) for name, limit in trust.items() if name in quantities]
    variants: list[Variant] = [("as modelled", {})]
    for limits in product(*choices) if choices else ():
        changes = {key: value for _, limit in limits for key, value in limit.items()}
        variants.append((", ".join(label for label, _ in limits), changes))
    plan: dict[tuple[str, str], Trial] = {
        (label, motion): (compensation, changes, motion)
        for label, changes in variants
        for motion in MOTIONS
    }
    if firmware_rule(simulation, compensation.times).any():
        plan["", "firmware"] = compensation, {}, "firmware"
    errors, complete = Memory[ToolErrors](), True
    try:
        Study(plan, _errors, errors).run(jobs, progress, desc="both motions")
    except KeyboardInterrupt:
        complete = False
    corners = [
        Corner(label, changes, *(errors[label, motion] for motion in MOTIONS))
        for label, changes in variants
        if all((label, motion) in errors for motion in MOTIONS)
    ]
    if not corners:
        raise KeyboardInterrupt
    firmware = errors.get(("", "firmware"))
    return Judgement(compensation, tuple(corners), firmware, left_out, complete)


def learn(compensation: Compensation, passes: int) -> tuple[Compensation, list[float]]:
    """Iterative learning: correct further by the error left in a run, as long as that improves.

    Returns:
        The best correction, and the RMS error left by each pass that was tried, beginning with
        that of the given one [m].
    """
    errors = _errors((compensation, {}, "after"))
    rms_errors = [errors.rms]
    for _ in range(passes):
        # The error around each node goes through the Jacobian into a shift of the joints there.
        nodes = compensation.times
        half = max(0.5 * (nodes[1] - nodes[0]), _RECORD_S)
        means = [errors.values[np.abs(errors.times - t) <= half].mean(axis=0) for t in nodes]
        shift = -through_jacobian(
            compensation.simulation, nodes, np.array(means), compensation.size
        )
        further = with_shift(compensation, shift)
        further_errors = _errors((further, {}, "after"))
        rms_errors.append(further_errors.rms)
        if further_errors.rms >= errors.rms:
            break
        compensation, errors = further, further_errors
    return compensation, rms_errors


Trial = tuple[Compensation, Mapping[str, float], str]
"""One run: of which correction, with which changes of the machine, and which motion: `before`,
`after`, or by the `firmware` rule."""
Variant = tuple[str, Mapping[str, float]]
"""A changed machine: label and changes."""


def _limits(name: str, trust: float | Mapping[str, Interval]) -> tuple[Variant, Variant]:
    """The machine with a quantity at the lower and at the upper end of its interval."""
    if not isinstance(trust, Mapping):
        low, high = ((f"{name} {100 * x:+.0f} %", {name: 1.0 + x}) for x in (-trust, trust))
        return low, high
    low, high = (
        (f"{name} at its {side} ends", {key: interval[k] for key, interval in trust.items()})
        for k, side in enumerate(("lower", "upper"))
    )
    return low, high


def _errors(item: Trial) -> ToolErrors:
    """Run one motion on the changed machine; its error is against the original motion's twin."""
    compensation, changes, motion_name = item
    plant = varied(compensation.simulation, changes)
    motion = plant.motion
    assert motion is not None
    if motion_name == "after":
        sent = compensation.motion
    elif motion_name == "firmware":
        shift = firmware_rule(compensation.simulation, compensation.times)
        sent, _ = corrected_motion(compensation.simulation, compensation.times, shift)
    else:
        sent = motion
    return tool_errors(replace(plant, motion=sent), plant)


def tool_errors(run: Simulation, original: Simulation) -> ToolErrors:
    """The tool's error in a run against the ideal robot in the motion of `original`."""
    motion = original.motion
    assert motion is not None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = run.run(check_step=False, estimate=False, only=list(TOOL_MOTIONS))
        # The ideal robot has each joint exactly where the original motion has it.
        twin = ideal_simulation(original)
        drives = assign(twin.mechanism, motion, original.drive)
        exact = {name: Prescribed() if drive.follows else drive for name, drive in drives.items()}
        ideal = tool_motion(replace(twin, drive=exact))
        shift, turn = (difference(result, ideal, f"tool_{x}") for x in ("position", "orientation"))
    times, values = shift["time"].values, np.hstack([shift.values, turn.values])
    size = np.linalg.norm(shift.values, axis=1)
    halts = [halt for halt in stops(motion, float(times[-1])) if halt.at_rest and halt.end > 0.0]
    speed = np.abs(motion(times)[1]).max(axis=1)
    moving = speed > 1e-3 * speed.max()
    stop_errors = size[np.searchsorted(times, [halt.end for halt in halts]).clip(0, len(size) - 1)]
    shifts, turns = (error_statistics(error, 0.0) for error in (shift, turn))
    weights = time_weights(times)
    square = np.average(size[moving] ** 2, weights=weights[moving]) if moving.any() else np.nan
    underway = np.sqrt(square)
    halted = np.sqrt(np.mean(stop_errors**2)) if len(stop_errors) else np.nan
    return ToolErrors(
        float(shifts.rms[-1]), float(underway), float(halted), float(shifts.peak[-1]),
        float(turns.rms[-1]), times, values
    )  # fmt: skip


def _quantities_of(simulation: Simulation) -> set[str]:
    """Those of `QUANTITIES` that the machine has."""
    mechanism = simulation.mechanism
    friction = joint_friction(simulation).values()
    presence = {
        "play": True,
        "friction": any(loss.coulomb or loss.viscous for loss in friction)
        or any(any(c.friction.coefficients.values()) for c in mechanism.clearance.values()),
        "payload": bool(simulation.payloads),
        "stiffness": bool(mechanism.gears),
    }
    return {name for name, present in presence.items() if present}


def varied(simulation: Simulation, changes: Mapping[str, float]) -> Simulation:
    """The simulation with some of `QUANTITIES` multiplied, or numbers of a preset set [SI].

    Play scales all clearances and the gears' play, friction that of joints and journals, payload
    its mass and inertia, stiffness that of gears.
    """
    fields: dict[str, Any] = {}
    # Factors of whole quantities first, then single numbers by their keys.
    play, stiffness = changes.get("play", 1.0), changes.get("stiffness", 1.0)
    mechanism, losses = simulation.mechanism, joint_friction(simulation)
    x = changes.get("friction", 1.0)
    clearance = {
        n: (c.scaled(play) if c.clearances else c).with_friction(c.friction.scaled(x))
        for n, c in mechanism.clearance.items()
    }
    gears = {n: _gear(gear, play, stiffness) for n, gear in mechanism.gears.items()}
    friction = {
        n: replace(loss, coulomb=x * loss.coulomb, viscous=x * loss.viscous,
                   static=None if loss.static is None else x * loss.static)
        for n, loss in losses.items()
    }  # fmt: skip
    for key, value in changes.items():
        joint, part, number = _split_key(key)
        tables: dict[str, Any] = {"gear": gears, "bearing": clearance, "friction": friction}
        if joint not in tables.get(part, ()):
            continue
        element = tables[part][joint]
        if number in getattr(element, "clearances", ()):
            tables[part][joint] = element.with_clearances({number: value})
        elif number == "play":
            tables[part][joint] = element.with_play(value)
        else:
            # A bearing's clearance class would contradict the number that is set.
            classless = {"clearance_class": None} if hasattr(element, "clearance_class") else {}
            tables[part][joint] = replace(element, **{number: value}, **classless)
    if clearance != mechanism.clearance or gears != mechanism.gears:
        fields["mechanism"] = mechanism.with_clearance(clearance, gears)
    if friction != losses:
        fields["joint_friction"] = friction
    if (x := changes.get("payload", 1.0)) != 1.0:
        fields["payloads"] = tuple(
            replace(payload, mass=x * payload.mass, inertia=(x * a, x * b, x * c))
            for payload in simulation.payloads
            for a, b, c in [payload.inertia]
        )
    return replace(simulation, **fields)


def _gear(gear: Gearing, play: float, stiffness: float) -> Gearing:
    numbers = {name: getattr(gear, name, None) for name in _STIFFNESSES}
    changes: dict[str, Any] = {n: stiffness * x for n, x in numbers.items() if x is not None}
    return replace(gear.with_play(play * gear.play), **changes)  # type: ignore[type-var]


def _times(before: ToolErrors, after: ToolErrors) -> str:
    """Factor by which the RMS error shrinks, to two digits."""
    return readable(before.rms / after.rms, "", 2)


def _mm(value: float) -> str:
    return readable(value, "m", 3) if np.isfinite(value) else "nothing"
