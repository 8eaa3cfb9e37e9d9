"""What a run comes to, in a few lines: tool error, at stops too, forces, rattle."""

from __future__ import annotations

import math
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted, few
from jointplay.base.units import readable
from jointplay.simulation.analysis import twins
from jointplay.simulation.analysis.bearings import bearing_life, rolling_bearings
from jointplay.simulation.analysis.tool_error import deviation, error_at, error_statistics, stops
from jointplay.simulation.analysis.vibration import Rattle, rattle
from jointplay.simulation.motion.reference import GOES_ON
from jointplay.simulation.result.certificate import alone, shown
from jointplay.simulation.result.result import Result

if TYPE_CHECKING:
    import xarray as xr

HISTORIES = (
    *(*twins.COMPARED, "joint_force_peak", "normal_force_peak"),
    *("q", "v", "cage_angle", "normal_dissipation"),
)
"""What `headline` looks at, in the run and in the ideal mechanism's."""

MOST_STOPS = 6
"""Stops that are listed one by one."""


def reference(result: Result, progress: bool = False) -> Result | None:
    """The ideal mechanism's run against which the tool's error is measured, simulated now.

    None where the result has no play; with a warning, where the ideal mechanism cannot be
    simulated.
    """
    if not twins.has_play(result) or len(result.time) < 2:
        return None
    try:
        return twins.tool_motion(twins.ideal_simulation(result), progress)
    except JointplayError as error:
        text = f"the tool error is unknown: the ideal mechanism cannot be simulated ({error})"
        warnings.warn(text, RuntimeWarning, stacklevel=2)
        return None


def headline(result: Result, ideal: Result | None, detail: bool = False) -> list[str]:
    """Lines that say what came out of a run from `Result.judge_from` on.

    Args:
        result: the run.
        ideal: see `reference`; without it nothing is said of the tool.
        detail: whether its acceleration in bands of frequency, and what the run cost, are said too.
    """
    finite = np.isfinite(result["tool_position"].values).all(axis=1)
    if not finite.all():  # where the run stopped
        result = Result(result.dataset.isel(time=finite))
    start = result.judge_from
    since = _since(result)
    lines = []
    if ideal is not None and twins.has_play(result):
        lines += _tool(result, ideal)
    if result.joints:
        hinged = twins.hinges(result)  # they hold bodies by more than the force of their springs
        if bearings := [joint for joint in result.joints if joint not in hinged]:
            lines.append(_forces(result, bearings, start, since))
        lines += _bearings(result, since)
        with suppress(JointplayError):  # too few records
            found = rattle(result, ideal)
            lines.append(f"{found if detail else found.impacts_words}{since}")
    simulated = float(result.time[-1]) if len(result.time) else 0.0
    wall = float(result.dataset.attrs.get("wall_time_s", 0.0))
    if detail and wall > 0.0:
        lines.append(f"cost {wall:.2f} s for {simulated:.4g} s simulated")
    return lines


def headline_texts(result: Result, ideal: Result | None) -> dict[str, str]:
    """The figures of `headline` by name, as a table of several runs shows them."""
    found: dict[str, str] = {}
    if ideal is not None and twins.has_play(result):
        with suppress(JointplayError):  # no records
            found = ToolError(result, ideal)._texts()
            del found["RMS tool turn"]
    if loose := [joint for joint in result.joints if joint not in twins.hinges(result)]:
        forces = result.forces.sel(joint=loose)
        sizes = forces.sel(time=forces["time"] >= result.judge_from).max("time").values
        worst = int(sizes.argmax())
        found["peak force"] = peak_force(result, loose[worst], float(sizes[worst]))
        with suppress(JointplayError):
            found["impacts a second"] = alone(rattle(result, ideal).rate)
    return found


class ToolError:
    """How far the tool is from that of the ideal mechanism, from `Result.judge_from` on.

    `print` shows it in a sentence.

    Attributes:
        vector: error along x, y, z over time (time, axis) [m].
        distance: its size over time (time,) [m].
        turn: angle between the two tools over time (time,) [rad].
        ideal: the ideal mechanism's run.
    """

    def __init__(self, result: Result, ideal: Result) -> None:
        self._result, self.ideal = result, ideal
        self.vector = deviation(result, ideal)
        about = "distance of the tool from the ideal one"
        self.distance = self._size(self.vector, "tool_error", about)
        turn = deviation(result, ideal, "tool_orientation")
        self.turn = self._size(turn, "tool_turn", "angle between the tool and the ideal one")
        self._off = error_statistics(self.vector)
        self._turned = error_statistics(turn)

    @staticmethod
    def _size(vectors: xr.DataArray, name: str, about: str) -> xr.DataArray:
        size = vectors.reduce(np.linalg.norm, "axis").rename(name)
        size.attrs = {"units": vectors.attrs["units"], "long_name": about}
        return size

    @property
    def peak(self) -> float:
        """Largest distance [m]."""
        return float(self._off.peak[-1])

    @property
    def rms(self) -> float:
        """RMS distance [m]."""
        return float(self._off.rms[-1])

    @property
    def peak_turn(self) -> float:
        """Largest angle [rad]."""
        return float(self._turned.peak[-1])

    @property
    def rms_turn(self) -> float:
        """RMS angle [rad]."""
        return float(self._turned.rms[-1])

    @property
    def time_of_peak(self) -> float:
        """When the distance is largest [s]."""
        judged = self.distance.sel(time=self.distance["time"] >= self._result.judge_from)
        return float(judged["time"][int(judged.values.argmax())])

    @property
    def numerical_errors(self) -> dict[str, float]:
        """Of ``peak`` and ``rms`` [m], ``peak_turn`` and ``rms_turn`` [rad], as far as known."""
        certificate = self._result.certificate
        known = {one.name: one.error for one in (certificate.headline if certificate else ())}
        return {name: known[of] for name, of in _OF_TOOL.items() if of in known}

    def _texts(self) -> dict[str, str]:
        """Its figures by what certificates call them, with their errors."""
        units = zip(_OF_TOOL.items(), ("m", "m", "rad", "rad"), strict=True)
        certificate = self._result.certificate
        return {of: shown(certificate, of, getattr(self, name), u) for (name, of), u in units}

    def __str__(self) -> str:
        tool = self._result.simulation.mechanism.tool
        peak, rms, peak_turn, rms_turn = self._texts().values()
        return (
            f"{_cause(self._result)} puts the tool {tool!r} up to {peak} "
            f"off{_since(self._result)} (at t = {self.time_of_peak:.4g} s), RMS {rms}, "
            f"and turns it by up to {peak_turn}, RMS {rms_turn}, against the "
            f"ideal mechanism{_ended(self._result, self.distance)}"
        )

    __repr__ = __str__


_OF_TOOL = {
    "peak": "peak tool error",
    "rms": "RMS tool error",
    "peak_turn": "peak tool turn",
    "rms_turn": "RMS tool turn",
}
"""Figures of `ToolError`, and what certificates call them."""


def tool_error(result: Result) -> ToolError:
    """The tool's error against the ideal mechanism, which is simulated for it.

    Raises:
        JointplayError: the result has no play, or its ideal mechanism cannot be simulated.
    """
    if not twins.has_play(result):
        raise JointplayError("no joint has play: the tool has no error")
    return ToolError(result, twins.tool_motion(twins.ideal_simulation(result)))


def summary(result: Result) -> str:
    """What `jointplay run` prints of a result: tool error, forces, rattle, warnings."""
    lines, ideal = [], None
    if twins.has_play(result):
        try:
            ideal = result.tool_error.ideal
        except JointplayError as error:
            lines.append(f"the tool error is unknown: {error}")
    lines = [*headline(result, ideal), *lines] or [result.message]
    return "\n".join([*lines, *(f"warning: {text}" for text in result.audit.warnings)])


def rattle_of(result: Result) -> Rattle:
    """Its impacts, and the tool's vibration against the ideal mechanism's where there is play."""
    return rattle(result, result.tool_error.ideal if twins.has_play(result) else None)


def _since(result: Result) -> str:
    return f" from {result.judge_from:g} s on" if result.judge_from > 0.0 else ""


def _ended(result: Result, error: xr.DataArray) -> str:
    """Where the ideal mechanism's run is shorter; records of another step may end earlier."""
    last = float(error["time"][-1])
    return f", whose run ends at {last:.4g} s" if last < 0.999 * result.time[-1] else ""


def _tool(result: Result, ideal: Result) -> list[str]:
    until = deviation(result, ideal)
    if not len(until) or float(until["time"][-1]) < result.judge_from:
        since, ended = _since(result), _ended(result, until)
        return [f"the tool error{since} against the ideal mechanism is unknown{ended}"]
    error = ToolError(result, ideal)
    return [str(error), *_from_base(result, ideal), *_at_stops(result, error.vector)]


def _from_base(result: Result, ideal: Result) -> list[str]:
    mechanism = result.simulation.mechanism
    if mechanism.free_base is None:
        return []
    base = mechanism.description.root
    found = error_statistics(deviation(result, ideal, relative_to=base))
    return [
        f"seen from the free base {base!r}, whose own motion differs as well: up to "
        f"{_mm(found.peak[-1])} off{_since(result)}, RMS {_mm(found.rms[-1])}"
    ]


def _cause(result: Result) -> str:
    mechanism = result.simulation.mechanism
    joints, gears = mechanism.clearance, mechanism.gears
    hinged = twins.hinges(result)
    bearings = {name: joint for name, joint in joints.items() if name not in hinged}
    loose = {name: joint for name, joint in bearings.items() if joint.has_play}
    soft = [name for name in bearings if name not in loose]
    soft += [f"link {name}" for name in mechanism.hinges]
    # Each gear gives way; its play, where it has some, is what parts the two.
    stiff = [name for name, gear in gears.items() if gear.play == 0.0]
    if stiff:
        soft.append(f"the gear{'s' if len(stiff) > 1 else ''} of {few(stiff)}")
    elasticity = f"lasticity of {few(soft)}" if soft else ""
    sizes = {name: joint.play_words for name, joint in loose.items()}
    sizes |= {
        f"the gear of {name}": readable(gear.play, mechanism.description.joints[name].unit)
        for name, gear in gears.items()
        if gear.play > 0.0
    }
    if not sizes:
        return f"E{elasticity}"
    more = f", and e{elasticity}," if soft else ""
    if len(set(sizes.values())) == 1:
        return f"Play of {next(iter(sizes.values()))} in {few(list(sizes))}{more}"
    return f"Play in {few([f'{name} ({size})' for name, size in sizes.items()])}{more}"


def _at_stops(result: Result, error: xr.DataArray) -> list[str]:
    motion = result.simulation.motion
    if motion is None or motion.interpolation in GOES_ON:
        return []
    every = stops(motion, float(error["time"][-1]))
    times = [
        stop.end
        for stop in every
        if stop.at_rest and stop.end >= result.judge_from and stop.end > 0.0
    ]
    if not times:
        return []
    sizes = [float(error_at(error, time)[-1]) for time in times]
    known = result.certificate.headline if result.certificate else ()
    of_tool = [one.error for one in known if one.name in ("peak tool error", "RMS tool error")]
    off = max(of_tool, default=0.0)
    if len(times) > MOST_STOPS:
        worst = int(np.argmax(sizes))
        return [
            f"at its {counted(len(times), 'stop')}: worst {_mm(sizes[worst], off)} at "
            f"t = {times[worst]:.4g} s, mean {_mm(float(np.mean(sizes)), off)}"
        ]
    each = ", ".join(f"{_mm(s, off)} (t = {t:.4g} s)" for t, s in zip(times, sizes, strict=True))
    return [f"at its stops: {each}"]


def _forces(result: Result, joints: list[str], start: float, since: str) -> str:
    forces = result.forces
    forces = forces.sel(time=forces["time"] >= start)
    words: list[str] = []
    for joint in joints:
        sizes = forces.sel(joint=joint).values
        at = float(forces["time"][int(sizes.argmax())])
        told = peak_force(result, joint, float(sizes.max()))
        words.append(f"in {joint}{'' if words else since} {told} at t = {at:.4g} s")
    return f"peak force {few(words)}"


def peak_force(result: Result, joint: str, largest: float) -> str:
    """The largest force in a joint, `largest` [N] by its histories, with its error if known."""
    name = f"peak joint force{twins.at_joint(result, joint)}"
    return shown(result.certificate, name, largest, "N")


def _bearings(result: Result, since: str) -> list[str]:
    if np.count_nonzero(result.time >= result.judge_from) < 2:
        return []
    lines = []
    for joint in rolling_bearings(result):
        life = bearing_life(result, joint)
        lines.append(f"{joint}{since}: {life}")
        if life.oscillates and math.isfinite(life.revolutions):
            lines.append(
                f"  it swings by {math.degrees(life.swing):.3g} deg, less than its elements are "
                f"apart ({math.degrees(life.spacing):.3g} deg): L10 is meant for rings that turn"
            )
    return lines


def _mm(metres: float, uncertain: float = 0.0) -> str:
    return f"{alone(1e3 * metres, 1e3 * uncertain)} mm"
