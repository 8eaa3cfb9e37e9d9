"""Answers of the live page: error budget and one cycle of a machine whose numbers were changed.

A question is answered in four steps of rising accuracy: the budget at one pose, a run with long
steps, the budget along the whole motion, and the run as `jointplay run` makes it.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from jointplay.accuracy.error_budget import PlayBudget, budget
from jointplay.accuracy.poses import Poses, poses_of
from jointplay.base.errors import JointplayError
from jointplay.base.origins import to_text
from jointplay.base.units import readable
from jointplay.model.scene import tool_places
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.show.live.state import WHOLE, State
from jointplay.show.player import playback
from jointplay.show.player.tracks import Packer
from jointplay.show.plots.chart import Axis, Curve, Panel
from jointplay.show.plots.result import TIME
from jointplay.simulation.analysis.tool_error import deviation, error_statistics, measured_against
from jointplay.simulation.analysis.twins import has_play, ideal_simulation, tool_motion
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.variables import TERMS
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.values import values

Message = tuple[dict[str, Any], bytes]  # plain data, and the block of bytes to which it refers

QUICK = (0.1, 1e-3)  # tolerance and macro step [s] of a quick run
QUICK_LOOPS = (1e-2, 2e-4)
"""The same with closed loops, whose contacts press against each other: with longer steps journals
break out of their bearings."""
SOON_S = 0.05
"""Processor time of a quick run after which the part done so far is shown [s]."""
WORTH = 0.25
"""Part of the motion up to which the part done is shown: of more, the whole follows soon enough."""
QUICK_RECORDS = 2000
"""Approximate number of a quick run's records; its macro step is no longer than their interval."""
SHOWN = 1500  # approximate number of records sent; peaks between them are kept
QUICK_MOMENTS, MOMENTS = 120, 600
"""Moments of the picture in a quick and in the full run; the page interpolates between them."""


class Superseded(Exception):
    """A newer question has been asked."""


class Machine:
    """One case of a scenario, which answers questions on changed numbers.

    What one answer found (the worst pose, places of rest) speeds up the next. A run ends as soon as
    `superseded` returns that there is a newer question.
    """

    def __init__(self, state: State) -> None:
        self.state = state
        self.superseded: Callable[[], bool] = lambda: False
        self._worst: Poses | None = None  # the worst pose at the first question
        self._rested: tuple[Mapping[str, float], Mapping[str, np.ndarray]] = {}, {}
        """Values of the last quick run, and its journals' places of rest at the start."""

    def simulation(self, values: Mapping[str, float]) -> Simulation:
        """The case with these values of controls; errors are those of `jointplay run`."""
        state = self.state
        return state.scenario.simulation(state.case, state.changes(values))

    def quick(self, values: Mapping[str, float]) -> Iterator[Message]:
        """Answer quickly: the budget at one pose, and a run with long steps."""
        simulation = self.simulation(values)
        yield self._budget(simulation, whole=False)
        self._continue()
        coarse = quick_simulation(simulation)
        if coarse is None:
            return
        try:
            run = Run(coarse, places=self._places(values))
            self._rested = values, run.rest.places if run.rest and run.rest.solved else {}
            yield from self._cycle(run, QUICK_MOMENTS, quick=True)
        except JointplayError:  # the full run need not fail, too
            return

    def _places(self, values: Mapping[str, float]) -> Mapping[str, np.ndarray]:
        """Places of rest in the last quick run, for joints of which no control has changed."""
        before, places = self._rested
        changed = {
            control.group
            for name, control in self.state.controls.items()
            if values.get(name, control.value) != before.get(name, control.value)
        }
        return {} if WHOLE in changed else {n: q for n, q in places.items() if n not in changed}

    def fine(self, values: Mapping[str, float]) -> Iterator[Message]:
        """Answer in full: the budget along the motion, and the run of `jointplay run`."""
        simulation = self.simulation(values)
        yield self._budget(simulation, whole=True)
        self._continue()
        yield from self._cycle(Run(simulation), MOMENTS, quick=False)

    def _continue(self) -> None:
        if self.superseded():
            raise Superseded

    def _budget(self, simulation: Simulation, whole: bool) -> Message:
        """The static budget of `jointplay budget FILE`, or unless `whole` that at one pose; or the
        reason why it fails, on which the run does not depend."""
        try:
            if whole or self._worst is None:
                poses = poses_of(simulation)
            else:
                held = replace(simulation, mechanism=simulation.mechanism.bolted())
                poses = replace(self._worst, machine=held)
            errors = budget(poses.mechanism, poses.q, **poses.holding)
        except JointplayError as error:
            return {"kind": "budget", "error": str(error)}, b""
        at = errors.worst_pose
        if not whole and len(poses.q) > 1:  # later quick answers take this pose alone
            self._worst = replace(poses, q=poses.q[at : at + 1])
        return budget_message(errors, whole, simulation.motion is not None), b""

    def _to_end(self, run: Run, within: float = math.inf) -> Status:
        """Run on to the end, or for a processor time `within` [s], and return the status.

        Raises:
            Superseded: a newer question has been asked.
        """
        self._continue()
        deadline = time.thread_time() + within
        run.stop_checks[:] = [self.superseded, lambda: time.thread_time() > deadline]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the page has the message
            status = run.run_to_end()
        self._continue()
        return status

    def _cycle(self, run: Run, moments: int, quick: bool) -> Iterator[Message]:
        """Run, and yield what the page shows; if a quick run takes long, its first part before."""
        status = self._to_end(run, SOON_S if quick else math.inf)
        if status == Status.INTERRUPTED:
            done = run.workspace.steps / run.total_steps
            if done < WORTH:
                yield from self._shown(run, max(round(moments * done), 2), quick)
            status = self._to_end(run)
        if status != Status.COMPLETED and quick:
            return  # the steps were too long for this machine; the full run follows
        yield from self._shown(run, moments, quick)

    def _shown(self, run: Run, moments: int, quick: bool) -> Iterator[Message]:
        """What the page shows of a run, with the tool error against its ideal twin."""
        simulation, result = run.simulation, run.result()
        result.simulation = simulation  # else it would be built again from the result's inputs
        origins = self.state.scenario.origins(self.state.case)
        result.dataset.attrs["values"] = to_text(values(simulation, origins))
        self._continue()
        twin, reason = None, ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # the page has the message
                ideal = ideal_simulation(simulation)
                moved = tool_motion(ideal, stop=self.superseded, also=["q"])
            self._continue()
            twin = moved.completed()
        except JointplayError as error:
            reason = f"no ideal twin: {error}"
        self._continue()
        steps = ""
        if quick:
            macro = readable(float(simulation.macro_step or 0.0), "s")
            steps = f"tolerance {simulation.tolerance:g}, macro steps of {macro}"
        yield from cycle_messages(result, twin, moments, steps, reason)


def quick_simulation(simulation: Simulation) -> Simulation | None:
    """The simulation with longer steps and fewer records, for a first look; None if that fails."""
    duration = simulation.duration or (simulation.motion.duration if simulation.motion else None)
    if duration is None:
        return None
    interval = float(duration) / QUICK_RECORDS
    tolerance, macro = QUICK_LOOPS if simulation.mechanism.loops else QUICK
    try:
        return replace(
            simulation,
            integrator=DEFAULT,
            tolerance=max(tolerance, simulation.tolerance or 0.0),
            macro_step=max(min(macro, interval), simulation.step),
            record_every=max(round(interval / simulation.step), simulation.record_every),
        )
    except JointplayError:
        return None


def budget_message(errors: PlayBudget, whole: bool, moves: bool) -> dict[str, Any]:
    """A budget as plain data for the page [m, rad]."""
    at = errors.worst_pose
    total = float(errors.worst_parts[at].sum())
    where = "the worst of the poses along the motion" if moves else "one pose"
    return {
        "kind": "budget",
        "whole": whole,
        "where": where if whole or not moves else "the pose that was the worst to begin with",
        "poses": len(errors.worst),
        "tool": errors.tool,
        "unit": errors.unit,
        "worst": float(errors.worst[at]),
        "rms": float(errors.rms[at]),
        "turn": float(errors.worst_turn[at]),
        "second_order": float(errors.second_order[at]),
        "parts": [
            {
                "name": name,
                "worst": float(errors.worst_parts[at, j]),
                "share": float(errors.worst_parts[at, j]) / total if total else 0.0,
                "rms": float(errors.rms_parts[at, j]),
                "turn": float(errors.turns.parts[j, at]),
            }
            for j, name in enumerate(errors.joints)
        ],
    }


def _chart(packer: Packer, panel: Panel) -> dict[str, Any]:
    """The description of a chart for `chart.js`, in SI, with its series packed as 32-bit floats;
    the script chooses units' prefixes."""

    def packed(values: Any) -> dict[str, Any]:
        return packer.raw(np.ascontiguousarray(values, "<f4").tobytes())

    return {
        "x": {"label": panel.x.name, "unit": panel.x.unit},
        "y": {"label": panel.y.name, "unit": panel.y.unit},
        "equal": bool(panel.equal),
        "marks": [
            {"name": curve.name, "frame": curve.frame, "x": packed(curve.x), "y": packed(curve.y)}
            for curve in panel.marks
            if isinstance(curve, Curve)
        ],
    }


def cycle_messages(
    result: Result, twin: Result | None, moments: int, steps: str = "", reason: str = ""
) -> Iterator[Message]:
    """The messages on a run: figures of all its records with curves of some, then its picture.

    `steps` tells the lengths of a quick run's steps in words, `reason` why there is no twin.
    """
    if twin is not None:
        result = measured_against(result, twin)
    few = result.thinned(max(-(-len(result.time) // SHOWN), 1))
    few.simulation = result.simulation  # else it would be built again
    kept = np.searchsorted(result.time, few.time)
    packer, error = Packer(), None
    chart = partial(_chart, packer)
    joints: dict[str, Any] = {}
    figures: list[dict[str, Any]] = []

    def figure(name: str, value: float, unit: str) -> None:
        figures.append({"name": name, "value": float(value), "unit": unit})

    # Tool errors; the curve shows the largest one between the records that are kept.
    judged = result.time >= result.judge_from
    begin = np.append(0, kept[:-1] + 1)
    for what, of, unit in (("error", "tool_position", "m"), ("turn", "tool_orientation", "rad")):
        if twin is None:
            break
        difference = deviation(result, of)
        sizes = np.linalg.norm(difference.values, axis=1)
        if what == "error":
            largest = np.maximum.reduceat(sizes, np.minimum(begin, len(sizes) - 1))
            error = chart(Panel(TIME, Axis("error", "m"), [Curve(few.time, largest)]))
        statistics = error_statistics(difference)
        figure(f"largest tool {what}", statistics.peak[-1], unit)
        figure(f"RMS tool {what}", statistics.rms[-1], unit)
    # Orbit and force of each joint.
    peaks = result["joint_force_peak"].values[judged] if result.joints else np.empty((0, 0, 3))
    for name, forces in zip(result.joints, np.linalg.norm(peaks, axis=2).T, strict=True):
        shown = {"orbit": ("orbit", name), "force": ("forces", "total", name)}
        joints[name] = {key: chart(few.plot.panel(*asked)) for key, asked in shown.items()}
        figure(f"peak force, {name}", forces.max(initial=0.0), "N")
    # Largest penetration over the clearance: a journal that penetrates so far has that much more
    # play than the budget reckons with. None for compliant joints and rolling bearings.
    sunk: dict[str, float | None] = {}
    for name, joint in result.simulation.mechanism.clearance.items():
        sunk[name] = None
        if joint.springs is None and joint.resultant is None:
            gaps = result["gap_min"].sel(joint=name, contact=list(joint.contacts)).values[judged]
            depths = zip(
                -np.nanmin(gaps, axis=0, initial=0.0), joint.contact_clearances, strict=False
            )
            sunk[name] = float(max((deep / room for deep, room in depths), default=0.0))
    drives = _drive_deflection(result, twin) if twin is not None else None
    # Energies since the start: what is stored, and the terms that are not zero throughout.
    stored = few["kinetic_energy"].values + few["potential_energy"].values
    terms = [(term.label, few[term.variable].values) for term in TERMS]
    shown_terms = [("stored", stored - stored[0]), *(term for term in terms if np.any(term[1]))]
    energies = [Curve(few.time, values, name) for name, values in shown_terms]
    energy = chart(Panel(TIME, Axis("energy", "J"), energies))
    charts = {"error": error, "energy": energy, "joints": joints}
    lost = sum(float(result[term.variable].values[-1]) for term in TERMS if term.lost)
    figure("energy lost", lost, "J")
    part = bool(steps) and result.status == Status.INTERRUPTED
    answer = ""
    if twin is not None and not steps and result.status == Status.COMPLETED and has_play(result):
        answer = f"{result.tool_error.sentence()}."
    head = {
        "kind": "cycle",
        "answer": answer,
        "quick": bool(steps),
        "part": part,
        "steps": steps,
        "message": result.message
        if not part
        else f"so far {readable(float(result.time[-1]), 's')}",
        "completed": result.status == Status.COMPLETED,
        "reason": reason,
        "judged_from": result.judge_from,
        "joints": list(result.joints),
        "sunk": sunk,
        "drives": None if drives is None else float(drives[judged].max(initial=0.0)),
        "figures": figures,
        "charts": charts,
        "pictured": twin is not None and len(few.time) > 1,
    }
    yield head, packer.block
    if twin is not None and head["pictured"]:
        moving = playback.motion("", few, twin, moments)
        yield {"kind": "picture", "picture": moving.contents}, moving.block


def _drive_deflection(result: Result, twin: Result) -> np.ndarray | None:
    """Distance of the tool from the ideal machine's by the drives alone, over time [m].

    The journals are put back to the middle. None where more than play and drives moves the tool
    (closed loops, gears, a free base), or where the twin has fewer records.
    """
    mechanism = result.simulation.mechanism
    moved = mechanism.loops or mechanism.gears or mechanism.free_base is not None
    if moved or len(twin.time) < len(result.time):
        return None
    places = tool_places(mechanism, playback.centred(mechanism, np.array(result.q, float)))
    distance = places - twin["tool_position"].values[: len(places)]
    return np.asarray(np.linalg.norm(distance, axis=1))
