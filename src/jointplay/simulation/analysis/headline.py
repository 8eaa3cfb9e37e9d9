"""What a run comes to, in a few lines: tool error, at stops too, forces, rattle."""

from __future__ import annotations

import math
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError, nothing_has_play
from jointplay.base.tables import counted, few
from jointplay.physics.kernel import Status
from jointplay.simulation.analysis import twins
from jointplay.simulation.analysis.bearings import bearing_life, rolling_bearings
from jointplay.simulation.analysis.parts import (
    ToolError,
    drives_alone,
    ended_words,
    since_words,
    sizes_are_given,
)
from jointplay.simulation.analysis.tool_error import deviation, error_at, error_statistics, stops
from jointplay.simulation.analysis.vibration import Rattle, rattle
from jointplay.simulation.motion.reference import GOES_ON
from jointplay.simulation.result.certificate import alone, shown
from jointplay.simulation.result.result import Result

if TYPE_CHECKING:
    import xarray as xr

HISTORIES = (
    *(*twins.TOOL_MOTIONS, "joint_force_peak", "normal_force_peak"),
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
    since = since_words(result)
    lines: list[str] = []
    failed = result.status not in (Status.COMPLETED, Status.INTERRUPTED)
    if failed:
        lines.append(result.message)
    # Of what diverged, how far it came says nothing of the machine.
    if ideal is not None and twins.has_play(result) and result.status != Status.RUN_AWAY:
        lines += _tool(result, ideal, detail)
    elif not (failed or twins.has_play(result)):
        lines += drives_alone(result)
    if result.joints:
        hinged = twins.hinges(result)  # they hold bodies by more than the force of their springs
        if bearings := [joint for joint in result.joints if joint not in hinged]:
            fall = result.audit.start == "centred" and not start
            words = ", judged from the start, with the fall of the journals" if fall else ""
            lines.append(_forces(result, bearings, since, detail) + words)
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
    if ideal is not None and twins.has_play(result) and result.status != Status.RUN_AWAY:
        with suppress(JointplayError):  # no records
            found = ToolError(result, ideal).columns()
    if loose := [joint for joint in result.joints if joint not in twins.hinges(result)]:
        forces = result.forces.sel(joint=loose)
        sizes = forces.sel(time=forces["time"] >= result.judge_from).max("time").values
        worst = int(sizes.argmax())
        found["peak force"] = peak_force(result, loose[worst], float(sizes[worst]))
        with suppress(JointplayError):
            found["impacts a second"] = alone(rattle(result, ideal).rate)
    return found


def tool_error(result: Result) -> ToolError:
    """The tool's error against the ideal mechanism, which is simulated for it.

    Raises:
        JointplayError: the result has no play, or its ideal mechanism cannot be simulated.
    """
    if not twins.has_play(result):
        raise nothing_has_play(result.simulation.mechanism.joints)
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


def _tool(result: Result, ideal: Result, detail: bool) -> list[str]:
    until = deviation(result, ideal)
    if not len(until) or float(until["time"][-1]) < result.judge_from:
        since, ended = since_words(result), ended_words(result, until)
        return [f"the tool error{since} is unknown{ended}"]
    error = ToolError(result, ideal)
    lines = [error.sentence(detail), *error.further()]
    mechanism = result.simulation.mechanism
    if mechanism.free_base is not None:
        base = mechanism.description.root
        seen = error_statistics(deviation(result, ideal, relative_to=base))
        lines.append(
            f"seen from the free base {base!r}, whose own motion differs as well: up to "
            f"{_mm(seen.peak[-1])} off{since_words(result)}, RMS {_mm(seen.rms[-1])}"
        )
    return [*lines, *_at_stops(result, error.told)]


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
    sizes = [float(error_at(error, time)[-1]) for time in times]
    if not any(sizes):
        return []
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


def _forces(result: Result, joints: list[str], since: str, detail: bool) -> str:
    forces = result.forces
    forces = forces.sel(time=forces["time"] >= result.judge_from)
    words: list[str] = []
    for joint in joints:
        sizes = forces.sel(joint=joint).values
        at = float(forces["time"][int(sizes.argmax())])
        told = peak_force(result, joint, float(sizes.max()), detail)
        words.append(f"in {joint}{'' if words else since} {told} at t = {at:.4g} s")
    return f"peak force {few(words)}"


def peak_force(result: Result, joint: str, largest: float, detail: bool = False) -> str:
    """The largest force in a joint, `largest` [N] by its histories.

    With its numerical error if that is known, and if all sizes were given or `detail` is asked for.
    """
    name = f"peak joint force{twins.at_joint(result, joint)}"
    exact = detail or sizes_are_given(result)
    return shown(result.certificate if exact else None, name, largest, "N")


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
