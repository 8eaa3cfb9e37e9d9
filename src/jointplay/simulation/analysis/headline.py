"""What a run comes to, in a few lines: tool error, at stops too, forces, rattle, cost."""

from __future__ import annotations

import math
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import few
from jointplay.base.units import readable
from jointplay.simulation.analysis import twins
from jointplay.simulation.analysis.bearings import bearing_life, rolling_bearings
from jointplay.simulation.analysis.tool_error import deviation, error_at, error_statistics, stops
from jointplay.simulation.analysis.vibration import rattle
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


def headline(result: Result, ideal: Result | None) -> list[str]:
    """Lines that say what came out of a run from `Result.judge_from` on.

    `ideal`: see `reference`; without it nothing is said of the tool.
    """
    finite = np.isfinite(result["tool_position"].values).all(axis=1)
    if not finite.all():  # where the run stopped
        result = Result(result.dataset.isel(time=finite))
    start = result.judge_from
    since = f" from {start:g} s on" if start > 0.0 else ""
    lines = []
    if ideal is not None and twins.has_play(result):
        lines += _tool(result, ideal, deviation(result, ideal), start, since)
    if result.joints:
        hinged = twins.hinges(result)  # they hold bodies by more than the force of their springs
        lines += [
            _force(result, joint, start, since) for joint in result.joints if joint not in hinged
        ]
        lines += _bearings(result, since)
        with suppress(JointplayError):  # too few records
            lines.append(f"{rattle(result, ideal)}{since}")
    simulated = float(result.time[-1]) if len(result.time) else 0.0
    wall = float(result.dataset.attrs.get("wall_time_s", 0.0))
    if wall > 0.0:
        lines.append(f"cost {wall:.2f} s for {simulated:.4g} s simulated")
    return lines


def _tool(
    result: Result, ideal: Result, error: xr.DataArray, start: float, since: str
) -> list[str]:
    judged = error.sel(time=error["time"] >= start)
    last = float(error["time"][-1])
    # Records of another step may end a little earlier.
    early = last < 0.999 * result.time[-1]
    ended = f", whose run ends at {last:.4g} s" if early else ""
    if not len(judged):
        return [f"the tool error{since} against the ideal mechanism is unknown{ended}"]
    sizes = np.linalg.norm(judged.values, axis=1)
    at = float(judged["time"][int(sizes.argmax())])
    rms = error_statistics(error, start).rms[-1]
    tool = result.simulation.mechanism.tool
    turns = error_statistics(deviation(result, ideal, "tool_orientation"), start)
    told = {
        name: shown(result.certificate, name, float(value), unit)
        for name, value, unit in (
            ("peak tool error", sizes.max(), "m"),
            ("RMS tool error", rms, "m"),
            ("peak tool turn", turns.peak[-1], "rad"),
            ("RMS tool turn", turns.rms[-1], "rad"),
        )
    }
    answer = (
        f"{_cause(result)} puts the tool {tool!r} up to {told['peak tool error']} off{since} "
        f"(at t = {at:.4g} s), RMS {told['RMS tool error']}, and turns it by up to "
        f"{told['peak tool turn']}, RMS {told['RMS tool turn']}, against the ideal "
        f"mechanism{ended}"
    )
    return [answer, *_from_base(result, ideal, since), *_at_stops(result, error, start)]


def _from_base(result: Result, ideal: Result, since: str) -> list[str]:
    mechanism = result.simulation.mechanism
    if mechanism.free_base is None:
        return []
    base = mechanism.description.root
    found = error_statistics(deviation(result, ideal, relative_to=base))
    return [
        f"seen from the free base {base!r}, whose own motion differs as well: up to "
        f"{_mm(found.peak[-1])} off{since}, RMS {_mm(found.rms[-1])}"
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
        f"the gear of {name}": readable(gear.play, "rad")
        for name, gear in gears.items()
        if gear.play > 0.0
    }
    if not sizes:
        return f"E{elasticity}"
    more = f", and e{elasticity}," if soft else ""
    if len(set(sizes.values())) == 1:
        return f"Play of {next(iter(sizes.values()))} in {few(list(sizes))}{more}"
    return f"Play in {few([f'{name} ({size})' for name, size in sizes.items()])}{more}"


def _at_stops(result: Result, error: xr.DataArray, start: float) -> list[str]:
    motion = result.simulation.motion
    if motion is None or motion.interpolation in GOES_ON:
        return []
    every = stops(motion, float(error["time"][-1]))
    times = [stop.end for stop in every if stop.at_rest and stop.end >= start and stop.end > 0.0]
    if not times:
        return []
    sizes = [float(error_at(error, time)[-1]) for time in times]
    known = result.certificate.headline if result.certificate else ()
    of_tool = [one.error for one in known if one.name in ("peak tool error", "RMS tool error")]
    off = max(of_tool, default=0.0)
    if len(times) > MOST_STOPS:
        worst = int(np.argmax(sizes))
        return [
            f"at its {len(times)} stops: worst {_mm(sizes[worst], off)} at "
            f"t = {times[worst]:.4g} s, mean {_mm(float(np.mean(sizes)), off)}"
        ]
    each = ", ".join(f"{_mm(s, off)} (t = {t:.4g} s)" for t, s in zip(times, sizes, strict=True))
    return [f"at its stops: {each}"]


def _force(result: Result, joint: str, start: float, since: str) -> str:
    judged = result.time >= start
    forces = result["joint_force_peak"].sel(joint=joint).values[judged]
    sizes = np.linalg.norm(forces, axis=1)
    at = float(result.time[judged][int(sizes.argmax())])
    told = peak_force(result, joint, float(sizes.max()))
    return f"peak force in {joint}{since} {told} at t = {at:.4g} s"


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
