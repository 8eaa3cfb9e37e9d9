"""Reduced models of a joint's play for other simulators, fitted to the full model.

The model that a robot simulator can run is a hinge: a dead band between motor and link, stiffness
and damping of the teeth, and dry friction. The dead band about the joint's own axis is that of its
gear; the bearing's clearance adds none, as the drive turns the journal. The bearing adds friction
about the axis, in proportion to its load, and a dead band across the axis, as its journal can tilt.

`reduce` fits it in these steps:

1. The full model runs through two reversals of the one joint, the others standing.
2. Friction is fitted to the contacts' friction while they slide.
3. Stiffness and damping of the teeth are those of the gear; the damping, and the dead band of gears
   with hysteresis, are chosen from a few candidates: those with which the link comes closest to the
   full model's.
4. The stated error of the link's angle is `SAFETY` times the largest difference from the full
   model, together with what the longer steps of a simulator change.
5. Lateral and axial play and the tilt come from the bearing's geometry, stiffnesses from its
   contacts at the resting load.

For the tilt the reduced model has only a dead band: the axis tilts, as far as both rims on opposite
sides of the bore let it, to where the load's moment turns it. In the full model contacts give way,
walls hold the journal more upright, friction drags it aside, and a side force may press both rims
to one side; the error of the tilt says how much that is.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import nnls

from jointplay.accuracy.error_model import play_model, toward
from jointplay.accuracy.jacobians import place
from jointplay.accuracy.poses import moving
from jointplay.base.compiler import compiled
from jointplay.base.errors import (
    JointplayError,
    NothingHasPlay,
    require_a,
    require_known,
    require_positive,
)
from jointplay.base.files import is_file
from jointplay.base.progress import overall
from jointplay.base.schema import known_keywords, plain
from jointplay.base.tables import aligned
from jointplay.base.units import rounded
from jointplay.model.gear import Gear, Gearing
from jointplay.model.impact import LONGEST_STEP_S as OF_IMPACTS_S
from jointplay.model.impact import fitting_step, tooth_duration
from jointplay.model.mechanism import Mechanism
from jointplay.model.urdf import Description
from jointplay.physics.joints import JOINT_KINDS, Clearance, Coordinate, RollingBearing
from jointplay.physics.kernel import WELL_RESOLVED_STEPS
from jointplay.simulation.analysis.bearings import element_loads
from jointplay.simulation.loads.drive import JointFriction, Prescribed
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.prepare import MIN_CONTACT_STEPS
from jointplay.simulation.result.result import Result
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.statics import depths
from jointplay.study.runs import Arrays, Runs
from jointplay.study.study import Memory, Study

SAFETY = 3.0
"""Factor from the largest difference in the fit's own reversals to the stated error (judged);
MuJoCo's runs of the joints in docs/simulator.md differ by less than the errors so stated."""
AMPLITUDE, PERIOD = 0.1, 2.0
"""Amplitude and period of the reversals [rad, s] (judged: a robot's joint moving about a pose)."""
SETTLED = 0.1
"""Fraction of the run that is left out at the start, in which the journal falls onto its bore
(judged)."""
_MOVING = 0.05
"""Fraction of the largest speed above which a contact certainly slides (judged)."""
_DAMPINGS = (0.0, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5)
"""Damping of the candidates, relative to the gear's; theirs acts within the play, too."""
_DAMPED = 0.3
"""Damping ratio that stands for the gear's damping where the gear loses energy by friction
(judged)."""
_STEP_S = 2e-5
"""Longest step of the reduced model's own run [s]; shorter where teeth vibrate faster."""
LONGEST_STEP_S = 1e-3
"""Longest step of a simulator that runs the reduced model [s], as is usual for robots."""
RESOLVED = 0.2
"""Time step times angular frequency of the teeth: 30 steps in a period."""
_CHORD = 1e-3
"""Least tilt of a bearing's ring beyond its play, relative to the play, for a chord stiffness: with
less, it would be the quotient of differences of nearly equal angles."""
_COMPARED = 400
"""Most records whose tilts are compared: each takes a static analysis, and tilts change slowly."""


@dataclass(frozen=True)
class Reduction:
    """A joint with play as a hinge, with stated errors; angles in rad, torques in N m.

    `dead_band` is the whole angle by which the link turns freely while the motor stands. Without a
    gear, or without clearance in the bearing, the fields that belong to it are zero.
    """

    joint: str
    dead_band: float = 0.0
    stiffness: float = 0.0
    """Stiffness of the teeth in contact [N m/rad]."""
    damping: float = 0.0
    """Damping between motor and link [N m s/rad]."""
    rotor_inertia: float = 0.0
    """Inertia of the rotor on the joint's side [kg m^2]."""
    friction: float = 0.0
    """Dry friction of bearing and joint about the axis [N m]."""
    viscous: float = 0.0
    """Viscous friction of bearing and joint about the axis [N m s/rad]."""
    friction_error: float = 0.0
    """RMS difference of the bearing's friction from the full model's while it slides [N m]."""
    friction_range: tuple[float, float] = (0.0, 0.0)
    """5 % and 95 % quantiles of the full model's friction while it slides [N m]."""
    angle_error: float = 0.0
    """Stated error of the link's angle in reversals [rad]: `SAFETY` times the sum of the largest
    difference in the fit and of what steps of `timestep` add."""
    angle_rms: float = 0.0
    """RMS difference of the link's angle in the fit's reversals [rad]."""
    tilt: float = 0.0
    """Largest tilt of the axis within the play, either way [rad]."""
    tilt_stiffness: float = 0.0
    """Stiffness of the tilt beyond that, at the resting load [N m/rad]."""
    lateral: float = 0.0
    """Largest lateral displacement of the journal, either way [m]."""
    axial: float = 0.0
    """Largest axial displacement of the journal, either way [m]."""
    contact_stiffness: float = 0.0
    """Stiffness of a radial contact at the resting load [N/m]: chord of the law; for rolling
    bearings the mean stiffness across the axis."""
    load: tuple[float, ...] = (0.0,) * 6
    """Load of gravity on the bearing in its axes: force [N] and moment [N m]."""
    pose: Mapping[str, float] = field(default_factory=dict)
    """Joint positions about which it was fitted [rad or m]."""
    half_length: float = 0.0
    """Half of the journal's length; zero if it cannot tilt [m]."""
    tilt_error: float = 0.0
    """Stated error of the tilt, size and direction, in reversals: `SAFETY` times the largest
    difference [rad]."""
    tilt_rms: float = 0.0
    """RMS difference of the tilt in the fit's reversals [rad]."""
    history: Mapping[str, np.ndarray] = field(default_factory=dict, compare=False, repr=False)
    """Histories of the fit: `time` [s]; angles of the `motor`, the `full` model's link and the
    `reduced` model's link [rad]; if the journal tilts, the direction of the full model's axis less
    that of the bearing's, `tilt`, world axes (n, 3)."""

    @property
    def timestep(self) -> float:
        """Time step that resolves the rotor's vibration on the teeth, at most a millisecond [s]."""
        if self.stiffness <= 0.0:
            return LONGEST_STEP_S
        swing = math.sqrt(self.rotor_inertia / self.stiffness)
        return float(min(LONGEST_STEP_S, RESOLVED * swing))

    def describe(self) -> dict[str, Any]:
        return {name: plain(value) for name, value in vars(self).items() if name != "history"}

    def __str__(self) -> str:
        figures = [
            ("dead band about the axis (gear), whole", self.dead_band, "rad"),
            ("stiffness of the teeth", self.stiffness, "N*m/rad"),
            ("damping motor to link", self.damping, "N*m*s/rad"),
            ("dry friction about the axis", self.friction, "N*m"),
            ("viscous friction about the axis", self.viscous, "N*m*s/rad"),
            ("  friction, RMS difference", self.friction_error, "N*m"),
            ("dead band of the tilt (bearing), either way", self.tilt, "rad"),
            ("stiffness of the tilt beyond", self.tilt_stiffness, "N*m/rad"),
            ("  tilt, stated error of size and direction", self.tilt_error, "rad"),
            ("  tilt, RMS difference", self.tilt_rms, "rad"),
            ("lateral play (bearing), either way", self.lateral, "m"),
            ("axial play (bearing), either way", self.axial, "m"),
            ("link's angle, stated error", self.angle_error, "rad"),
            ("link's angle, RMS difference", self.angle_rms, "rad"),
        ]
        rows = [(name, rounded(value, unit, 5, fine=unit == "m")) for name, value, unit in figures]
        return "\n".join(aligned([("reduced joint", "value"), *rows]))


def from_mjcf_file(description: Description) -> bool:
    """Whether a robot was read from an MJCF file that still exists."""
    return (
        description.beyond.hinges is not None
        and not description.stored
        and is_file(description.path)
    )


@known_keywords
def reduce(
    mechanism: Mechanism,
    joint: str,
    pose: Mapping[str, float] | None = None,
    *,
    amplitude: float = AMPLITUDE,
    period: float = PERIOD,
    joint_friction: JointFriction | None = None,
    progress: bool = False,
) -> Reduction:
    """Fit the reduced model of a revolute joint with clearance, or a gear with play, or both.

    Args:
        pose: joint positions about which the joint reverses [rad or m]; the rest zero. It is moved
            away from a limit that is nearer than the amplitude.
        amplitude, period: amplitude and period of the reversals [rad, s].
        joint_friction: friction of the joint besides its bearing's; None: that of a URDF, but none
            for an MJCF, where it stays before the play.

    Raises:
        MissingName: no such joint with play.
        JointplayError: loops; a sliding joint or a ball joint; a run that failed.
    """
    require_a("mechanism", mechanism, "Mechanism")
    names = _joints_with_play(mechanism)
    require_known("joint with play", joint, names)
    if reason := _refusal(mechanism, joint):
        raise JointplayError(reason)
    clearance = mechanism.clearance.get(joint)
    require_positive("amplitude", amplitude, "rad")
    require_positive("period", period, "s")
    if joint_friction is None and from_mjcf_file(mechanism.description):
        joint_friction = JointFriction()
    bearings = {} if clearance is None else {joint: clearance}
    gears = {joint: mechanism.gears[joint]} if joint in mechanism.gears else {}
    isolated = mechanism.with_clearance(bearings, gears)
    entry, positions = mechanism.description.joints[joint], dict(pose or {})
    middle = positions.get(joint, 0.0)
    if entry.lower is not None and entry.upper is not None:  # reverse within the limits
        amplitude = min(amplitude, 0.5 * (entry.upper - entry.lower))
        middle = min(max(middle, entry.lower + amplitude), entry.upper - amplitude)
    positions[joint] = middle
    result = _full_run(isolated, joint, positions, amplitude, period, joint_friction, progress)
    friction = joint_friction or JointFriction(entry.friction, entry.damping)
    bearing = {} if clearance is None else _fit_friction(result, isolated, joint)
    fields: dict[str, Any] = {
        "friction": friction.coulomb + bearing.pop("dry", 0.0),
        "viscous": friction.viscous + bearing.pop("viscous", 0.0),
    }
    # The gear: the reduced model's link beside the full one's, its motor moving as there.
    link = _Link(isolated, joint, positions, **fields)
    settled = result.time >= SETTLED * result.time[-1]
    time, q, v = result.time[settled], result["q"].values[settled], result["v"].values[settled]
    motor, full = q[:, isolated.motor(joint)], q[:, isolated.coordinate(joint)]
    start = float(full[0]), float(v[0, isolated.coordinate(joint)])
    reduced, step_error = full, 0.0
    if gears:
        peak = float(np.abs(result["gear_torque"].sel(gear=joint).values).max())
        candidates = _equivalent_gears(gears[joint], peak, link.inertia)
        fitted, damping, reduced = link.fit(time, motor, candidates, start, full)
        fields |= {"dead_band": fitted.play, "stiffness": fitted.stiffness, "damping": damping}
        fields["rotor_inertia"] = fitted.rotor_inertia
        step = Reduction(joint, **fields).timestep
        # A simulator's longer step changes the link's angle: that is part of the error.
        coarse = link.run(time, motor, fitted, damping, start, step)
        step_error = float(np.abs(coarse - reduced).max())
    history = {"time": time, "motor": motor, "full": full, "reduced": reduced}
    if clearance is not None:
        fields |= bearing | _across_the_axis(isolated, clearance, positions)
        if clearance.hinge is not None and clearance.hinge.tilts:
            history["tilt"], largest, rms = _compare_tilts(isolated, joint, q)
            fields |= {"tilt_error": SAFETY * largest, "tilt_rms": rms}
    difference = np.abs(reduced - full)
    fields["angle_error"] = SAFETY * (float(difference.max()) + step_error)
    fields["angle_rms"] = float(np.sqrt(np.mean(difference**2)))
    return Reduction(joint, **fields, pose=positions, history=history)


def reduce_all(
    mechanism: Mechanism,
    pose: Mapping[str, float] | None = None,
    *,
    amplitude: float = AMPLITUDE,
    period: float = PERIOD,
    joint_friction: Mapping[str, JointFriction] | None = None,
    progress: bool = False,
    jobs: int | None = None,
    store: Path | None = None,
) -> tuple[list[Reduction], dict[str, str]]:
    """Reduce every joint that has play, each by itself, with `reduce`.

    Args:
        mechanism, pose, amplitude, period, progress: see `reduce`.
        joint_friction: friction by joint; see `reduce`.
        jobs: processes; None takes one for each core.
        store: file that keeps each reduced joint, for the next call with the same robot.

    Returns:
        The reductions, and by joint the reasons why other joints with play have none.

    Raises:
        KeyboardInterrupt: interrupted; says how many joints are kept.
    """
    names = _joints_with_play(mechanism)
    if not names:
        raise NothingHasPlay(mechanism.joints)
    # A study with a case for each joint; reductions and refusals alike are its values.
    refused = {name: reason for name in names if (reason := _refusal(mechanism, name))}
    reducible = {name: name for name in names if name not in refused}
    frictions = dict(joint_friction or {})
    task = partial(_packed, mechanism, dict(pose or {}), amplitude, period, frictions)
    with ExitStack() as stack:
        results: Memory = Memory()
        if store is not None:
            inputs = {
                "robot": mechanism.describe(),
                "pose": pose,
                "reversals": [amplitude, period],
                "joint_friction": plain(frictions),
                "version": version("jointplay"),
            }
            results = Runs(store, inputs)
            stack.callback(_remove_if_empty, store, results)
            stack.enter_context(closing(results))
        finished = len(results)
        try:
            with overall(2.0 * period * (len(reducible) - finished), progress):
                Study(reducible, task, results).run(jobs)
        except KeyboardInterrupt as error:
            if store is None or not results:
                raise
            count = f"{len(results)} of {len(reducible)} joints are kept in {str(store)!r}"
            raise KeyboardInterrupt(f"{count}; the same command does the others") from error
        reductions = []
        for name in reducible:
            result = results[name]
            if "message" in result:
                refused[name] = str(result["message"])
            else:
                reductions.append(_unpacked(result))
    if not reductions:
        raise JointplayError(f"no joint with play can be reduced: {'; '.join(refused.values())}")
    return reductions, refused


def _remove_if_empty(store: Path, results: Memory) -> None:
    if not any("numbers" in result for result in results.values()):
        store.unlink(missing_ok=True)


def _packed(
    mechanism: Mechanism,
    pose: Mapping[str, float],
    amplitude: float,
    period: float,
    frictions: Mapping[str, JointFriction],
    name: str,
) -> Arrays:
    """The reduction of a joint as a store keeps it, or the message of the error that refused it."""
    options: dict[str, Any] = {"amplitude": amplitude, "period": period, "progress": True}
    try:
        reduction = reduce(mechanism, name, pose, joint_friction=frictions.get(name), **options)
    except JointplayError as error:
        return {"message": np.array(f"joint {name!r}: {error}")}
    return {"numbers": np.array(json.dumps(reduction.describe())), **reduction.history}


def _unpacked(arrays: Arrays) -> Reduction:
    history = dict(arrays)
    numbers = json.loads(str(history.pop("numbers")))
    fields: dict[str, Any] = {
        name: tuple(x) if isinstance(x, list) else x for name, x in numbers.items()
    }
    return Reduction(**fields, history=history)


def _joints_with_play(mechanism: Mechanism) -> list[str]:
    if mechanism.loops:
        raise JointplayError(
            f"the mechanism has the loop {next(iter(mechanism.loops))!r}: a hinge is fitted to "
            "what it alone carries, but a loop has two ends; jointplay budget and allocate accept "
            "loops"
        )
    return list(dict.fromkeys([*mechanism.clearance, *mechanism.gears]))


def _refusal(mechanism: Mechanism, joint: str) -> str:
    """Reason why a joint with play cannot be reduced to a hinge; empty if it can."""
    clearance = mechanism.clearance.get(joint)
    if joint in mechanism.mounts:
        return f"joint {joint!r} is a mount, which does not turn"
    if clearance is None and mechanism.description.joints[joint].slides:
        return f"joint {joint!r} slides, which cannot be represented by a hinge"
    if clearance is None or clearance.hinge is not None:
        return ""
    kinds = [name for name, kind in JOINT_KINDS.items() if kind.hinge is not Clearance.hinge]
    return (
        f"joint {joint!r} is {clearance.kind}, which cannot be represented by a hinge; kinds "
        f"that can be reduced: {', '.join(kinds)}"
    )


def _equivalent_gears(gear: Gearing, peak: float, inertia: float) -> list[Gear]:
    """Candidates of linear gears, a dead band with one stiffness and a damper, for any gear.

    The stiffness is the chord up to the largest torque, `peak` [N m]. Hysteresis acts as a dead
    band where the load changes its sign, and as none where it does not: both are candidates; a
    damper stands for the energy that it loses.
    """
    if isinstance(gear, Gear):
        return [gear]
    windup = float(gear.wound_up(peak)) - gear.play / 2.0
    stiffness = peak / windup if windup > 0.0 else float(gear.curve().slopes[0])
    damping = gear.damping
    if gear.bristles[0] > 0.0:
        damping = max(damping, 2.0 * _DAMPED * math.sqrt(stiffness * inertia))
    bands = dict.fromkeys([gear.play, gear.unloaded_range])
    return [Gear(band, gear.rotor_inertia, stiffness, damping) for band in bands]


def _full_run(
    mechanism: Mechanism,
    joint: str,
    pose: Mapping[str, float],
    amplitude: float,
    period: float,
    friction: JointFriction | None,
    progress: bool,
) -> Result:
    """Run the full model through two periods of reversals of a joint, all others standing."""
    names = moving(mechanism)
    for name in pose:
        require_known("moving joint", name, names)
    entries = mechanism.description.joints
    times = period * np.array([0.0, 0.25, 0.75, 1.25, 1.75, 2.0])
    start = {name: pose.get(name, entries[name].neutral) for name in names}
    positions = np.tile(list(start.values()), (len(times), 1))
    positions[:, names.index(joint)] += amplitude * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    motion = Motion(names, times, positions, "rest-to-rest")
    step, q = OF_IMPACTS_S, mechanism.configuration(start)
    if mechanism.clearance:
        step = fitting_step(mechanism, q)
    teeth = [tooth_duration(mechanism, name, q) for name in mechanism.gears]
    if teeth and step > min(teeth) / MIN_CONTACT_STEPS:  # light links: the run would be refused
        step = min(teeth) / WELL_RESOLVED_STEPS
    simulation = Simulation(
        mechanism, motion, drive=Prescribed(), step=step, record_every=max(round(2e-4 / step), 1),
        joint_friction=None if friction is None else {joint: friction}, loads={},
    )  # fmt: skip
    # The step's error is not needed; nor are all histories, unless the bearing's loads are.
    only = None if mechanism.clearance else ("q", "v", "gear_torque")
    result = Run(simulation, progress).finish(progress, check_step=False, only=only)
    return result.completed("the run of the full model")


def _fit_friction(result: Result, mechanism: Mechanism, joint: str) -> dict[str, Any]:
    """Dry and viscous friction of the bearing, by non-negative least squares of its friction torque
    over the speed while it slides, with the fit's error and range; empty without sliding.
    """
    clearance = mechanism.clearance[joint]
    assert clearance.hinge is not None
    force = np.nan_to_num(result["friction_force"].sel(joint=joint).values)
    speed = np.abs(result["v"].values[:, mechanism.coordinate(joint)])
    settled = result.time >= SETTLED * result.time[-1]
    slides = settled & (speed > _MOVING * speed.max())
    if isinstance(clearance, RollingBearing):
        loads = element_loads(result, joint).values[slides].sum(axis=1)
        torque = clearance.drag + clearance.friction_lever * loads
    else:
        torque = clearance.hinge.radius * force.sum(axis=1)[slides]
    if not len(torque):
        return {}
    matrix = np.column_stack([np.ones(len(torque)), speed[slides]])
    (dry, viscous), _ = nnls(matrix, torque)
    rms = float(np.sqrt(np.mean((matrix @ [dry, viscous] - torque) ** 2)))
    low, high = np.quantile(torque, [0.05, 0.95])
    return {
        **{"dry": float(dry), "viscous": float(viscous), "friction_error": rms},
        "friction_range": (float(low), float(high)),
    }


class _Link:
    """The reduced model: one body about a fixed axis, driven through play, with friction."""

    def __init__(
        self, mechanism: Mechanism, joint: str, pose: Mapping[str, float], friction: float,
        viscous: float,
    ) -> None:  # fmt: skip
        ideal = mechanism.ideal()
        index = ideal.coordinate(joint)
        q = ideal.configuration(pose)
        mass = pin.crba(ideal.model, ideal.data, q).reshape(ideal.model.nv, -1)
        self.inertia = float(mass[index, index])
        torques = []
        for angle in (0.0, math.pi / 2.0, math.pi):
            q[index] = angle
            torques.append(-float(pin.computeGeneralizedGravity(ideal.model, ideal.data, q)[index]))
        # Torque of gravity about a fixed axis: mean + even cos(angle) + odd sin(angle).
        self.even = 0.5 * (torques[0] - torques[2])
        self.mean = 0.5 * (torques[0] + torques[2])
        self.odd = torques[1] - self.mean
        self.friction, self.viscous = friction, viscous

    def fit(
        self,
        time: np.ndarray,
        motor: np.ndarray,
        gears: Sequence[Gear],
        start: tuple[float, float],
        full: np.ndarray,
    ) -> tuple[Gear, float, np.ndarray]:
        """Gear and damping [N m s/rad] of the candidate whose link comes closest to `full` in the
        least-squares sense, and its link's angle.
        """
        angles = {}
        for gear in gears:
            for factor in _DAMPINGS:
                damping = factor * gear.damping
                angles[gear, damping] = self.run(time, motor, gear, damping, start)
        best = min(angles, key=lambda candidate: float(np.square(angles[candidate] - full).sum()))
        return *best, angles[best]

    def run(
        self,
        time: np.ndarray,
        motor: np.ndarray,
        gear: Gear,
        damping: float,
        start: tuple[float, float],
        step: float | None = None,
    ) -> np.ndarray:
        """Angle of the link at `time` (n,) while the motor turns as given, (n,) [rad].

        It begins at `start`, an angle [rad] and a speed [rad/s]; steps are at most `step` [s], or
        fine.
        """
        half, stiffness = gear.play / 2.0, gear.stiffness
        if step is None:
            step = min(_STEP_S, 0.05 * math.sqrt(self.inertia / stiffness))
        count = math.ceil((time[-1] - time[0]) / step)
        grid = np.linspace(time[0], time[-1], count + 1)
        step = float(grid[1] - grid[0])
        motor_angles = np.interp(grid, time, motor)
        angles, weight = np.empty(count + 1), (self.mean, self.even, self.odd)
        _follow(
            motor_angles, np.gradient(motor_angles, step), step, (half, stiffness, damping),
            (self.inertia, self.viscous, self.friction), weight, start, angles,
        )  # fmt: skip
        return np.interp(time, grid, angles)


@compiled
def _follow(
    lead: np.ndarray,
    speeds: np.ndarray,
    step: float,
    teeth: tuple[float, float, float],
    link: tuple[float, float, float],
    weight: tuple[float, float, float],
    start: tuple[float, float],
    angles: np.ndarray,
) -> None:
    """Fill in the angles of a link (n,) while the motor turns by its angles and speeds (n,).

    Semi-implicit Euler steps; dry friction is a shrinkage of the speed, so that the link sticks.

    Args:
        lead, speeds: angles and speeds of the motor.
        step: time step.
        teeth: half the play, stiffness and damping of the gear.
        link: inertia, viscous and dry friction.
        weight: mean, even and odd torque of gravity; see `_Link`.
        start: angle and speed of the link at the start.
        angles: output.
    """
    half, stiffness, damping = teeth
    inertia, viscous, friction = link
    mean, even, odd = weight
    angle, speed = start
    for i in range(len(angles)):
        angles[i] = angle
        twist = lead[i] - angle
        # Implicit in the teeth's stiffness: a link far lighter than its rotor stays stable.
        tooth = step * stiffness if abs(twist) > half else 0.0
        slowed = step / (inertia + step * (damping + viscous + tooth))
        torque = stiffness * (twist - min(max(twist, -half), half))
        torque += (damping + tooth) * speeds[i]
        torque += mean + even * math.cos(angle) + odd * math.sin(angle)
        free = slowed * (inertia / step * speed + torque)
        speed = math.copysign(max(abs(free) - slowed * friction, 0.0), free)
        angle += step * speed


def _across_the_axis(
    mechanism: Mechanism, clearance: Clearance, pose: Mapping[str, float]
) -> dict[str, Any]:
    """Play of the bearing across and along its axis, with stiffnesses at the resting load."""
    hinge = clearance.hinge
    assert hinge is not None
    load = play_model(mechanism, pose).load[0, 0]
    tilt = float(clearance.play(second_order=False).reach[1])
    arm = hinge.length / 2.0
    fields = {"lateral": hinge.lateral, "axial": hinge.axial, "load": tuple(load.tolist())}
    if isinstance(clearance, RollingBearing):
        deflection = clearance.deflection(load[:3], [load[3], load[4], 0.0])
        matrix = clearance.load(deflection).stiffness
        stiffness = float(np.linalg.eigvalsh(matrix[:2, :2]).mean())
        tilt_stiffness = float(np.linalg.eigvalsh(matrix[3:5, 3:5]).mean())
        moment, tilted = math.hypot(load[3], load[4]), math.hypot(deflection[3], deflection[4])
        if moment > 0.0 and tilted > (1.0 + _CHORD) * tilt:
            tilt_stiffness = moment / (tilted - tilt)  # the chord beyond the play
    else:
        # Load of a rim: half the force, and the moment over the length.
        push = math.hypot(load[0], load[1]) / 2.0
        push += math.hypot(load[3], load[4]) / hinge.length if hinge.tilts else push
        push = max(push, 1.0)
        stiffness = push / float(depths(clearance, 0, np.array(push)))
        tilt_stiffness = 2.0 * stiffness * arm**2
    fields["contact_stiffness"] = stiffness
    if hinge.tilts or isinstance(clearance, RollingBearing):
        fields |= {"tilt": tilt, "tilt_stiffness": tilt_stiffness, "half_length": arm}
    return fields


def _compare_tilts(
    mechanism: Mechanism, joint: str, q: np.ndarray
) -> tuple[np.ndarray, float, float]:
    """Compare a journal's tilt in the configurations q (n, nq) of a run with the reduced model's.

    Returns:
        Direction of the journal's axis less that of the bearing's, world axes, (n, 3) [rad]; and
        the largest and the RMS difference of the reduced model's tilt, a vector, from it [rad].
    """
    clearance = mechanism.clearance[joint]
    model, data = mechanism.model, mechanism.data
    full, axes = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for i, row in enumerate(q):
        pin.forwardKinematics(model, data, row)
        _, seat = place(mechanism, joint)
        (b, bearing), (j, journal) = mechanism.frames(joint)
        axis = (data.oMi[b] * bearing).rotation[:, 2]
        full[i] = (data.oMi[j] * journal).rotation[:, 2] - axis
        axes[i] = seat.rotation
    # The reduced model: the axis tilts to the end of the play, where the load's moment turns it.
    records = np.unique(np.linspace(0, len(q) - 1, min(_COMPARED, len(q))).astype(int))
    upright = q[records].copy()
    for part in clearance.freedoms:
        if part not in clearance.ideal_freedoms:
            upright[:, mechanism.coordinates.index(Coordinate(joint, part))] = 0.0
    plays = play_model(mechanism, upright)
    moment = plays.load[plays.names.index(joint), :, 3:5]
    unit = toward(moment, np.zeros_like(moment))
    _, tilt = clearance.play(second_order=False).reach
    # The body turns about the direction of the moment, so its axis moves perpendicular to that.
    sign = -1.0 if clearance.exchanged else 1.0
    tilts = sign * tilt * np.column_stack([unit[:, 1], -unit[:, 0], np.zeros(len(unit))])
    reduced = np.einsum("nij,nj->ni", axes[records], tilts)
    differences = np.linalg.norm(full[records] - reduced, axis=1)
    return full, float(differences.max()), float(np.sqrt(np.mean(differences**2)))
