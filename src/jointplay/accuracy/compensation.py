"""Motions that take the play out: commands so shifted that the tool is where it should be.

A controller that adds a number at each reversal does not know on which side a joint rests. Inverse
dynamics do: a gear's teeth lie on the side to which their torque presses them, and wind up by it,

    command = reference + sign(tau) play / 2 + tau / K,    tau = rnea(q, q', q'') + friction,

and journals rest where the load of the ideal motion presses them (`simulation.statics`, inertia
forces included), which displaces the tool; the joints take that back through the Jacobian, its
position before its turn unless the tool's size weighs both.
Where friction can hold a gear's teeth on either side, its last side is kept; or stops are reached
by a slow last way that is always made towards the same side, whose friction presses the teeth. What
is found is a model's answer: `study.corners` has the engine judge it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import pinocchio as pin

from jointplay.accuracy.compensator import STILL
from jointplay.accuracy.jacobians import static_loads, taken_up, tool_place, with_force
from jointplay.base.errors import JointplayError, require_a, require_positive
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Column, Table, counted, few
from jointplay.model.mechanism import Coordinate, Mechanism, loaded
from jointplay.physics.joints import Clearance
from jointplay.simulation.analysis.tool_error import stops
from jointplay.simulation.loads import limits
from jointplay.simulation.loads.drive import (
    BANDWIDTH,
    ComputedTorque,
    JointFriction,
    Prescribed,
    Servo,
    assign,
)
from jointplay.simulation.motion.reference import GOES_ON, Motion
from jointplay.simulation.prepare import joint_friction
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.statics import StaticEquilibrium

NODE_S = 0.02
"""Interval at which sides are found, and at every other places of rest [s]; commands change so."""
SAMPLE_S = 0.01
"""Interval of the corrected motion's points [s]."""
EASE_S = 0.25
"""Time in which shifts begin and end, lest the corrected motion begin at a speed [s]: of 0.1 s its
spline keeps some acceleration (judged by a UR5 with six journals)."""
STANDS_S = 1.0
"""How long a machine is taken to stand before its motion and after it [s]."""
NEAR = 0.05
"""Way without torque of the teeth, relative to their play, that is no error to speak of: what play
is known to, or better (judged)."""
CROSSING = 4
"""Most nodes by which the command crosses the play sooner and later than the torque does."""
UNPRESSED = 1e-6
"""Torque relative to the joint's largest one that presses no teeth: far above rounding, far below
any friction (judged)."""
APPROACH_S = 0.24
"""Least time of an approach from one side [s]: a dozen of `NODE_S`."""
OVERSHOOT = 1.25
"""Way of an approach relative to the play: more than what an unknown side may be off by."""
BRAKING = 0.5
"""Largest torque that brakes an approach, relative to the friction that presses the teeth, which
it must leave pressed: half is kept in case friction is less than known (judged)."""
_BRAKES = 10.0 / np.sqrt(3.0)
"""Largest acceleration of a smooth step of fifth order of size 1 in time 1."""
_REGULATED = "; encoders on the links see the play of their gears (--encoder motor changes that)"
_SMOOTHINGS = 40
"""How often a correction is smoothed that is beyond speed or effort limits: in the end over
about a tenth of a second."""


@dataclass(frozen=True)
class Compensation:
    """A motion corrected for play, at n nodes, for j joints and g gears."""

    simulation: Simulation
    """What was compensated, with its motion as it was."""
    times: np.ndarray
    """Of the nodes, (n,) [s]."""
    shift: np.ndarray
    """What is added to the command of each joint of the motion, (n, j) [rad or m]."""
    gears: tuple[str, ...]
    torque: np.ndarray
    """Of the teeth of each gear, friction included, (n, g) [N m or N]."""
    side: np.ndarray
    """On which they lie: 1, -1, or 0 before anything has pressed them, (n, g)."""
    undecided: np.ndarray
    """Whether friction, or no torque, lets them lie on either, (n, g)."""
    displacement: np.ndarray
    """Of the tool by the journals at rest, world axes, (n, 6) [m, rad]."""
    smoothed: int = 0
    """How often the correction had to be smoothed for limits of speed and effort."""
    clipped: tuple[str, ...] = ()
    """Joints held at their limits of position."""
    approached: tuple[tuple[float, str], ...] = ()
    """Stops that are approached from one side: from when on [s], and by which gear."""
    learned: int = 0
    """Passes learned from own runs."""
    size: float | None = None
    """Length by which turns of the tool are weighed [m]; None: its position comes first."""

    @cached_property
    def motion(self) -> Motion:
        """The corrected motion, a spline through points of `SAMPLE_S`."""
        return corrected_motion(self.simulation, self.times, self.shift)[0]

    @property
    def crossings(self) -> np.ndarray:
        """How often the teeth of each gear change sides, (g,)."""
        return np.asarray((self.side[1:] * self.side[:-1] < 0).sum(axis=0))

    @property
    def undecided_stops(self) -> list[tuple[float, tuple[str, ...]]]:
        """Stops that leave a side open, not approached: from when on [s], and of which gears."""
        by_time: dict[float, list[str]] = {}
        for time, name in _open_stops(self.simulation, self.times, self.gears, self.undecided):
            if (time, name) not in self.approached:
                by_time.setdefault(time, []).append(name)
        return [(time, tuple(names)) for time, names in by_time.items()]

    @property
    def notes(self) -> list[str]:
        lines = []
        if self.gears:
            parts = 100.0 * self.undecided.mean(axis=0)
            shares = [f"{g} {p:.0f} %" for g, p in zip(self.gears, parts, strict=True) if p >= 0.5]
            lines.append(
                "time in which friction leaves open on which side teeth lie, the last one is kept: "
                + (", ".join(shares) or "none")
            )
        if open_ := self.undecided_stops:
            lines.append(f"note: stops with an undecided side: {_stops_text(open_)}")
        if self.approached:
            approached_stops = [(time, (name,)) for time, name in self.approached]
            lines.append(f"stops approached from one side: {_stops_text(approached_stops)}")
        if self.smoothed:
            times = counted(self.smoothed, "time")
            lines.append(f"note: smoothed {times} to stay within limits of speed and effort")
        if self.clipped:
            lines.append(f"note: held at limits of position: {', '.join(self.clipped)}")
        return lines

    def table(self) -> Table:
        """A row for each joint of the motion."""
        names, mechanism = _motion(self.simulation).joints, self.simulation.mechanism
        units = {n: "m" if mechanism.description.joints[n].slides else "rad" for n in names}
        rows = {name: k for k, name in enumerate(self.gears)}

        def of(values: np.ndarray) -> list[float | None]:
            return [float(values[rows[n]]) if n in rows else None for n in names]

        return Table([
            Column("joint", names),
            Column("shift least", [f"{1e3 * x:.4g} m{units[n]}" for n, x in
                                   zip(names, self.shift.min(axis=0), strict=True)]),
            Column("largest", [f"{1e3 * x:.4g} m{units[n]}" for n, x in
                               zip(names, self.shift.max(axis=0), strict=True)]),
            Column("crossings", of(self.crossings)),
            Column("undecided", of(self.undecided.mean(axis=0)), "1", digits=3),
        ])  # fmt: skip

    def data(self) -> Table:
        """A row for each node: shift of each joint; torque and side of each gear."""
        columns = [Column("time", self.times, "s")]
        shifts = zip(_motion(self.simulation).joints, self.shift.T, strict=True)
        columns += [Column(f"shift {name}", values) for name, values in shifts]
        for k, name in enumerate(self.gears):
            columns += [Column(f"torque {name}", self.torque[:, k])]
            columns += [Column(f"side {name}", np.where(self.undecided, 0, self.side)[:, k])]
        return Table(columns)


def _stops_text(open_stops: Sequence[tuple[float, tuple[str, ...]]]) -> str:
    parts = [f"{time:.4g} s ({few(list(names))})" for time, names in open_stops[:8]]
    return ", ".join(parts) + (f" and {len(open_stops) - 8} more" if len(open_stops) > 8 else "")


@known_keywords
def compensate(
    simulation: Simulation,
    *,
    approach: bool = False,
    size: float | None = None,
    progress: bool = False,
) -> Compensation:
    """The motion of a simulation, corrected for the play, wind-up and deflection of its joints.

    Args:
        simulation: a robot without loops on a base that is held, its motion, drives, payloads,
            friction of joints.
        approach: reach stops at which friction leaves a gear's side open from one side: the tool
            arrives aside, by somewhat more than the play, and creeps to its place.
        size: of the tool, or of what it holds: a turn counts as much as the displacement of what is
            so far from it [m]. None: the tool's position comes first, and its turn is taken back as
            far as that leaves joints free.
        progress: show a bar on standard error.

    Raises:
        JointplayError: no motion, or one that goes on after its end; loops, a free base; no play;
            no joint whose side is ever decided; a motion outside limits, or a correction that
            cannot be made within them.
    """
    require_a("simulation", simulation, "Simulation")
    mechanism, motion = compensable(simulation)
    if size is not None:
        require_positive("size of the tool", size, "m")
    count = 2 * max(round(0.5 * motion.duration / NODE_S), 2) + 1
    times = np.linspace(0.0, motion.duration, count)
    gears = tuple(n for n in mechanism.gears if n in motion.joints and _is_behind(simulation, n))
    displacement, rubbing = np.zeros((count, 6)), dict[str, np.ndarray]()
    if mechanism.clearance:
        moved, rubs = _journals(simulation, times[::2], progress)
        displacement = _smooth(times[::2], moved, times)
        rubbing = {name: _smooth(times[::2], rub.T, times).T for name, rub in rubs.items()}
    lag = _lag(simulation, times, rubbing)
    torque, held, inertia = _torques(simulation, times, gears, rubbing)
    play = np.array([max(mechanism.gears[name].play, 1e-12) for name in gears])
    fall = times[1] ** 2 * np.abs(torque) / (inertia * play)
    side, undecided = _sides(torque, held, fall, STANDS_S / times[1])
    if not (gears or mechanism.clearance or lag.any()):
        raise JointplayError(
            "there is nothing to compensate: give joints with clearance, gears with play, such as "
            '--clearance "0.1 mm" or --gear NAME="2 arcmin", or servos, which sag'
            + _REGULATED
            * bool(mechanism.gears)
        )
    if gears and not (mechanism.clearance or lag.any()) and undecided.all():
        raise JointplayError(
            f"no torque decides on which side the teeth of {few(list(gears))} lie, at any time: "
            "nothing can be compensated"
        )
    shift = lag
    for k, name in enumerate(gears):
        twist = mechanism.gears[name].wound_up(side[:, k] * np.abs(torque[:, k]))
        free = _crossing(side[:, k], np.where(undecided[:, k], np.inf, fall[:, k]))
        twist = _carried(twist, undecided[:, k])[~free]
        shift[:, motion.joints.index(name)] += _smooth(times[~free], twist, times)
    approaches = []
    if approach:
        approaches = _approaches(simulation, times, gears, undecided, torque, inertia)
    for final in {(a.k, a.arrival): a for a in approaches}.values():
        final.apply(simulation, times, shift, side, undecided)
    if mechanism.clearance:
        shift -= through_jacobian(simulation, times, displacement, size)
    shift, smoothed, clipped = _within_limits(simulation, times, shift)
    return Compensation(
        simulation, times, shift, gears, torque, side, undecided, displacement, smoothed, clipped,
        tuple((a.stop, a.gear) for a in approaches), size=size,
    )  # fmt: skip


def corrected_motion(
    simulation: Simulation, times: np.ndarray, shift: np.ndarray
) -> tuple[Motion, tuple[str, ...]]:
    """The motion with shifts (n, j) at nodes added, and joints that were held at their limits."""
    motion = _motion(simulation)
    count = max(round(motion.duration / SAMPLE_S), 12) + 1
    dense = np.linspace(0.0, motion.duration, count)
    reference = motion(dense)[0]
    moved = reference + _smooth(times, shift, _eased(dense))
    clipped = []
    entries = simulation.mechanism.description.joints
    for k, name in enumerate(motion.joints):
        entry = entries[name]
        if simulation.limits == "ignore" or entry.lower is None or entry.upper is None:
            continue
        inside = np.clip(moved[:, k], entry.lower, entry.upper)
        if np.abs(inside - moved[:, k]).max() > limits.MARGIN:
            clipped.append(name)
        moved[:, k] = inside
    return Motion(motion.joints, dense, moved, "spline"), tuple(clipped)


def _eased(times: np.ndarray) -> np.ndarray:
    """Times at which shifts are taken that neither begin nor end at speed, as spline ends may."""
    ease = min(EASE_S, 0.5 * times[-1])

    def late(x: np.ndarray) -> np.ndarray:
        """x from 1 on, and from 0 to 1 a curve that begins at rest and joins it smoothly."""
        return np.where(x < 1.0, x**3 * (6.0 - 8.0 * x + 3.0 * x**2), x)

    first = ease * late(times / ease)
    return np.asarray(times[-1] - ease * late((times[-1] - first) / ease))


def through_jacobian(
    simulation: Simulation, times: np.ndarray, displacement: np.ndarray, size: float | None
) -> np.ndarray:
    """Displacements of the joints of the motion, (n, j), that move the ideal tool so (n, 6)."""
    ideal, motion = simulation.mechanism.ideal(), _motion(simulation)
    shifts = np.zeros((len(times), len(motion.joints)))
    for k, position in enumerate(motion(times)[0]):
        at = dict(zip(motion.joints, position.tolist(), strict=True))
        shifts[k], _ = taken_up(ideal, at, displacement[k], size)
    return shifts


def firmware_rule(simulation: Simulation, times: np.ndarray) -> np.ndarray:
    """Shifts (n, j) by the rule of firmware: half the play towards the sign of the last speed."""
    mechanism, motion = simulation.mechanism, _motion(simulation)
    shift = np.zeros((len(times), len(motion.joints)))
    speed = motion(times)[1]
    for k, name in enumerate(motion.joints):
        if name in mechanism.gears and _is_behind(simulation, name):
            shift[:, k] = 0.5 * mechanism.gears[name].play * _way_to(speed[:, k])
    return shift


def compensable(simulation: Simulation) -> tuple[Mechanism, Motion]:
    """Its mechanism and motion.

    Raises:
        JointplayError: no motion that ends, loops, a free base, or a motion outside limits.
    """
    mechanism, motion = simulation.mechanism, simulation.motion
    if motion is None:
        raise JointplayError("a motion is needed to be compensated: give one", ("motion",))
    if motion.interpolation in GOES_ON:
        text = f"a motion that goes on after its end ({motion.interpolation}) is not compensated"
        raise JointplayError(text, ("motion", "interpolation"))
    if mechanism.loops or mechanism.free_base is not None:
        text = "closed loops" if mechanism.loops else "a free base"
        raise JointplayError(f"only robots without loops on a base that is held, not with {text}")
    if simulation.limits != "ignore":
        limits.check_motion(mechanism, motion, motion.joints)
    return mechanism, motion


def _motion(simulation: Simulation) -> Motion:
    """Of a simulation that is `compensable`."""
    assert simulation.motion is not None
    return simulation.motion


def _is_behind(simulation: Simulation, joint: str) -> bool:
    """Whether a gear's play lies behind what the joint's encoder sees."""
    drives = assign(simulation.mechanism, simulation.motion, simulation.drive)
    return getattr(drives[joint], "encoder", "motor") == "motor"


def _lag(
    simulation: Simulation, times: np.ndarray, rubbing: Mapping[str, np.ndarray]
) -> np.ndarray:
    """How far drives are behind what they are commanded to, e, (n, j) [rad or m].

    Computed torque by what it does not know, payloads, loads and the friction of journals, over the
    stiffness omega^2 I that it gives the joint. A servo by the voltage V that its motor needs,

        V = tau / stall + k qd,    P de/dt + I e = dV/dt    (without I term e = V / P),

    and its dead band; where it stands its friction holds it as it came.
    """
    mechanism, motion = simulation.mechanism, _motion(simulation)
    drives, friction = assign(mechanism, motion, simulation.drive), joint_friction(simulation)
    efforts, _ = _efforts(simulation, motion, times)
    known, inertia = _efforts(replace(simulation, payloads=(), loads={}), motion, times)
    _, speeds, accelerations = motion(times)
    lag = np.zeros_like(efforts)
    for k, name in enumerate(motion.joints):
        drive, speed, gear = drives[name], speeds[:, k], mechanism.gears.get(name)
        rotor = 0.0 if gear is None else gear.rotor_inertia
        journal = np.where(np.abs(speed) < STILL, 0.0, rubbing.get(name, np.zeros((1, 1)))[0])
        if isinstance(drive, ComputedTorque):
            bandwidth = drive.through_teeth(inertia[0, k], gear).bandwidth or BANDWIDTH
            stiffness = bandwidth**2 * (inertia[0, k] + rotor)
            lag[:, k] = (efforts[:, k] + journal - known[:, k]) / stiffness
        elif isinstance(drive, Servo):
            losses = drive.with_friction(friction.get(name, JointFriction()))
            effort = efforts[:, k] + journal + rotor * accelerations[:, k]
            effort += losses.coulomb * _way_to(speed) + losses.viscous * speed
            volts = effort / drive.stall + drive.torque_constant * speed
            error = volts / drive.p_gain
            fades = np.exp(-drive.i_gain / drive.p_gain * times[1])
            for node in range(1, len(times) if drive.i_gain else 0):
                rise = (volts[node] - volts[node - 1]) / drive.p_gain
                error[node] = fades * error[node - 1] + rise
            lag[:, k] = error + drive.band * np.sign(error)
    return lag


def _efforts(
    simulation: Simulation, motion: Motion, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Efforts of the joints of a motion of the ideal robot [N m or N], and inertias, (n, j).

    Loads are as at time 0.
    """
    ideal = simulation.mechanism.ideal()
    acting = static_loads(ideal, with_force(ideal, (0.0, 0.0, 0.0), simulation.loads))
    at = [ideal.coordinate(name) for name in motion.joints]
    states = np.zeros((3, len(times), ideal.model.nv))
    states[:, :, at] = motion(times)
    efforts, inertia = np.zeros((2, len(times), len(at)))
    for k, state in enumerate(states.transpose(1, 0, 2)):
        bodies = loaded(ideal.model, simulation.payloads, times[k])
        data = bodies.createData()
        q, v, _ = state
        inertia[k] = pin.crba(bodies, data, q).diagonal()[at]
        efforts[k] = pin.rnea(bodies, data, *state)[at]
        if simulation.loads:
            pushed = acting.nonpotential_forces(bodies, data, q, v) - acting.slopes(data, q)[0]
            efforts[k] -= pushed[at]
    return efforts, inertia


def _torques(
    simulation: Simulation,
    times: np.ndarray,
    gears: Sequence[str],
    rubbing: Mapping[str, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Torque of the teeth of gears, what leaves their side open [N m or N], inertias: (n, g) each.

    A side is left open by friction of a joint that stands, which may have either sign. That of
    journals is `rubbing`, as `_journals` has it.
    """
    motion = _motion(simulation)
    columns = [motion.joints.index(name) for name in gears]
    tau, inertia = (values[:, columns] for values in _efforts(simulation, motion, times))
    speeds, held = motion(times)[1][:, columns], np.zeros_like(tau)
    friction = joint_friction(simulation)
    for k, name in enumerate(gears):
        losses, speed = friction.get(name, JointFriction()), speeds[:, k]
        still = np.abs(speed) < STILL
        journal = rubbing.get(name, np.zeros((2, len(times))))
        tau[:, k] += np.where(still, 0.0, losses.torque(speed) + journal[0])
        held[still, k] = losses.coulomb + losses.excess + journal[1, still]
    return tau, held, inertia


def _sides(
    torque: np.ndarray, held: np.ndarray, fall: np.ndarray, stands: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Sides (n, g), the last one kept where it is not decided, and where that is so (n, g).

    Nor do torques decide that cease before they have brought what they turn across `NEAR` of the
    play; `fall` is their acceleration as a part of the play in a node's time squared, (n, g), and
    the machine `stands` so many nodes' times before and after.
    """
    least = UNPRESSED * np.abs(torque).max(axis=0, initial=0.0)
    undecided = np.abs(torque) <= np.maximum(held, least)
    sides = np.where(undecided, 0.0, np.sign(torque))
    for k, column in enumerate(sides.T):
        edges = np.flatnonzero(np.diff(column, prepend=np.nan, append=np.nan))
        for begin, end in pairwise(edges):
            travel = np.cumsum(fall[begin:end, k]).sum()
            if begin == 0 or end == len(column):
                travel += 0.5 * stands**2 * fall[begin if begin == 0 else end - 1, k]
            if travel < NEAR:
                undecided[begin:end, k], column[begin:end] = True, 0.0
    last = np.array([_carried(column, column == 0.0) for column in sides.T]).T.reshape(sides.shape)
    return last, undecided


def _crossing(side: np.ndarray, fall: np.ndarray) -> np.ndarray:
    """Nodes (n,) at which the command of a gear may be between both sides of its play.

    It crosses as slowly as can be: a drive that leaps across strikes the other flank. Until teeth
    have left by `NEAR` of the play for want of their torque; never while the joint stands, where
    `fall` is infinite.
    """
    free, last = np.zeros(len(side), bool), len(side) - 1
    for k in np.flatnonzero(side[1:] * side[:-1] < 0):
        for step, node in ((-1, k), (1, k + 1)):
            speed = separation = 0.0
            for at in range(node, node + step * CROSSING, step):
                speed += fall[at] if 0 < at < last else np.inf
                separation += speed
                if separation > NEAR or side[at] != side[node]:
                    break
                free[at] = True
    return free


def _open_stops(
    simulation: Simulation, times: np.ndarray, gears: Sequence[str], undecided: np.ndarray
) -> list[tuple[float, str]]:
    """Stops at whose end a side is not decided: from when on [s], and of which gear."""
    motion = _motion(simulation)
    open_stops = []
    for stop in stops(motion, motion.duration):
        if stop.at_rest:
            row = undecided[_node(times, stop.end)]
            open_stops += [(stop.start, n) for n, free in zip(gears, row, strict=True) if free]
    return open_stops


@dataclass(frozen=True)
class _Approach:
    """A stop that a joint reaches from one side: it arrives aside, and creeps while it stands."""

    gear: str
    k: int
    """Of the gear."""
    stop: float
    arrival: float
    """When it begins to creep [s]."""
    window: float
    """How long it creeps [s]."""
    torque: float
    """Of its teeth, and of friction, at the end [N m or N]."""

    def apply(
        self,
        simulation: Simulation,
        times: np.ndarray,
        shift: np.ndarray,
        side: np.ndarray,
        undecided: np.ndarray,
    ) -> None:
        """Change shifts (n, j) and sides (n, g) from the way to the stop on."""
        gear, motion = simulation.mechanism.gears[self.gear], _motion(simulation)
        aside = np.copysign(OVERSHOOT * gear.play, self.torque)
        command = shift[:, motion.joints.index(self.gear)]
        first = np.searchsorted(times, self.arrival)
        until = next((k for k in range(first, len(times)) if not undecided[k, self.k]), len(times))
        leaves = _step((times - self.arrival) / self.window + 1.0) * (times < self.arrival)
        command -= aside * leaves
        creeps = _step((times[first:until] - self.arrival) / self.window)
        begin = command[first] - aside
        command[first:until] = begin + creeps * (gear.wound_up(self.torque) - begin)
        side[first:until, self.k] = np.sign(self.torque)


def _step(part: np.ndarray) -> np.ndarray:
    """A smooth step of fifth order from 0 at 0 to 1 at 1."""
    x = part.clip(0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))


def _approaches(
    simulation: Simulation,
    times: np.ndarray,
    gears: Sequence[str],
    undecided: np.ndarray,
    torque: np.ndarray,
    inertia: np.ndarray,
) -> list[_Approach]:
    """Stops that can be approached from one side, that to which loads press the joint at them.

    So slowly that braking does not lift the teeth: a stop is left as it is where there is no
    friction, the joint stands too short, or it would have to go aside at the stop before.
    """
    motion, friction = _motion(simulation), joint_friction(simulation)
    still = np.abs(motion(times)[1]) < STILL
    ends = {stop.start: stop.end for stop in stops(motion, motion.duration)}
    open_stops = _open_stops(simulation, times, gears, undecided)
    approaches = []
    for k, name in enumerate(gears):
        at = {time: _node(times, ends[time]) for time, gear in open_stops if gear == name}
        dry = friction.get(name, JointFriction()).coulomb
        direction = np.sign(sum(torque[node, k] for node in at.values())) or 1.0
        for time, node in at.items():
            moving = np.flatnonzero(~still[:node, motion.joints.index(name)])
            brakes = _BRAKES * OVERSHOOT * simulation.mechanism.gears[name].play * inertia[node, k]
            window = max(APPROACH_S, np.sqrt(brakes / (BRAKING * dry)) if dry else np.inf)
            arrival = max(times[moving[-1] + 1] if len(moving) else 0.0, window)
            before = max((end for end in ends.values() if end < arrival), default=0.0)
            if before <= arrival - window and arrival + window <= ends[time]:
                pressed = direction * dry + torque[node, k]
                approaches.append(_Approach(name, k, time, arrival, window, pressed))
    return sorted(approaches, key=lambda approach: approach.stop)


def _node(times: np.ndarray, time: float) -> int:
    """The last node that is not after a time [s]."""
    return int(np.searchsorted(times, time, side="right")) - 1


def _way_to(speed: np.ndarray) -> np.ndarray:
    """Sign of speeds (n,); of a joint that stands the last one, before it has moved the next."""
    return _carried(np.sign(speed), np.abs(speed) < STILL)


def _smooth(nodes: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values at nodes at further times, without overshoot."""
    from scipy.interpolate import PchipInterpolator  # takes long to import

    return np.asarray(PchipInterpolator(nodes, values)(times))


def _carried(values: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Values with unknown ones replaced by the last that is known; at the start by the first."""
    good = np.flatnonzero(~unknown)
    if not len(good):
        return np.zeros_like(values)
    last = good[np.maximum(np.searchsorted(good, np.arange(len(values)), side="right") - 1, 0)]
    return np.asarray(values[last])


def _journals(
    simulation: Simulation, times: np.ndarray, progress: bool
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The tool's displacements (n, 6) by journals that rest under the ideal motion's load.

    Each search begins where the last one ended, displaced as much. Friction turns the force of a
    contact aside by atan(mu), and so the place of contact against the way that the journal turns.

    Returns:
        And the friction of journals about their axes by joint, (2, n) [N m]: as they turn, and what
        may hold those that stand.
    """
    mechanism = simulation.mechanism.with_clearance(simulation.mechanism.clearance, {})
    motion = _motion(simulation)
    at = [mechanism.coordinate(name) for name in motion.joints]
    states = np.zeros((3, len(times), mechanism.model.nv))
    states[:, :, at] = motion(times)
    drives = assign(mechanism, motion, Prescribed())
    mu = {
        name: _friction_of(joint, states[1, :, mechanism.coordinate(name)])
        for name, joint in mechanism.clearance.items()
        if joint.hinge is not None
    }
    torque = {name: np.zeros((2, len(times))) for name in mu}
    pushing = static_loads(mechanism, with_force(mechanism, (0.0, 0.0, 0.0), simulation.loads))
    friction = joint_friction(simulation)
    displacements, aside = np.zeros((len(times), 6)), np.zeros(mechanism.model.nv)
    steps = ProgressBar(
        range(len(times)), "places of rest", disable=not progress, delay=2.0, leave=False
    )
    for k in steps:
        q, v, a = states[:, k]
        balance = StaticEquilibrium(
            mechanism, loaded(mechanism.model, simulation.payloads, times[k]), q, v, drives, [], [],
            np.zeros(0), friction, pushing, a,
        )  # fmt: skip
        rest = balance.settle(q + aside if k else None)
        if not rest.solved:
            rest = balance.settle()
        if not rest.solved:
            raise JointplayError(
                f"no place of rest was found at t = {times[k]:.3g} s: {rest.residual:.3g} N of "
                f"{rest.load:.3g} N are not balanced"
            )
        aside = rest.q - q
        for name, wrench in balance.wrenches(rest.q).items():
            if name in mu:
                signed, largest = mu[name]
                pressing = _pressing(mechanism.clearance[name], wrench)
                torque[name][:, k] = signed[k] * pressing, largest * pressing
        angles = {name: -float(np.arctan(signed[k])) for name, (signed, _) in mu.items()}
        climbed = _climbed(mechanism, rest.q, angles)
        ideal, moved = tool_place(mechanism, q), tool_place(mechanism, climbed)
        turn = ideal.rotation @ pin.log3(ideal.rotation.T @ moved.rotation)
        displacements[k] = np.concatenate([moved.translation - ideal.translation, turn])
    return displacements, torque


def _climbed(mechanism: Mechanism, q: np.ndarray, angles: Mapping[str, float]) -> np.ndarray:
    """Where journals rest that climb aside in their bearings by angles [rad], as they turn."""
    q = q.copy()
    for name, angle in angles.items():
        cos, sin = np.cos(angle), np.sin(angle)
        for parts in (("x", "y"), ("roll", "pitch")):
            names = [Coordinate(name, part) for part in parts]
            if all(part in mechanism.coordinates for part in names):
                at = [mechanism.coordinates.index(part) for part in names]
                q[at] = np.array([[cos, -sin], [sin, cos]]) @ q[at]
    return q


def _friction_of(joint: Clearance, speed: np.ndarray) -> tuple[np.ndarray, float]:
    """Friction coefficient of a journal that turns at speeds (n,) [rad/s], signed, and the largest.

    One that stands keeps its last sign where bristles hold it.
    """
    assert joint.hinge is not None
    law, radius = joint.friction, joint.hinge.radius
    largest = max(law.coefficients.values(), default=0.0)
    if law.state == ("speed",):
        mu = [law.function(abs(x) * radius, *law.parameters()) for x in speed.tolist()]
        return np.sign(speed) * mu, largest
    return _way_to(speed) * law.coefficients.get("mu_d", 0.0), largest


def _pressing(joint: Clearance, wrench: np.ndarray) -> float:
    """Friction torque of a journal about its axis by friction coefficient [N m].

    Of the forces at its two ends that make up a force and a moment across the axis, and of the
    force along it.
    """
    assert joint.hinge is not None
    force, moment = wrench[:2], np.array([wrench[4], -wrench[3]]) / joint.hinge.length
    ends = [np.linalg.norm(0.5 * force + side * moment) for side in (-1.0, 1.0)]
    return joint.hinge.radius * float(sum(ends) + abs(wrench[2]))


def _within_limits(
    simulation: Simulation, times: np.ndarray, shift: np.ndarray
) -> tuple[np.ndarray, int, tuple[str, ...]]:
    """Shifts, smoothed until motions with them are within limits that the motion itself keeps.

    Returns:
        And how often they were smoothed, and joints that are held at limits of position.
    """
    before = _beyond(simulation, _motion(simulation))
    for smoothed in range(_SMOOTHINGS + 1):
        motion, clipped = corrected_motion(simulation, times, shift)
        beyond = _beyond(simulation, motion)
        if simulation.limits == "ignore" or beyond.keys() <= before.keys():
            return shift, smoothed, clipped
        shift = np.concatenate([
            shift[:1], 0.25 * shift[:-2] + 0.5 * shift[1:-1] + 0.25 * shift[2:], shift[-1:]
        ])  # fmt: skip
    new = next(text for key, text in beyond.items() if key not in before)
    raise JointplayError(f"corrected, {new}, even smoothed; slow the motion down")


def _beyond(simulation: Simulation, motion: Motion) -> dict[tuple[str, str], str]:
    """Limits of speed and effort that a motion exceeds: joint and what, in words."""
    mechanism, friction = simulation.mechanism, joint_friction(simulation)
    times = np.linspace(0.0, motion.duration, max(round(motion.duration / SAMPLE_S), 12) + 1)
    _, speed, acceleration = motion(times)
    bounded = bool(limits.bounds(mechanism))
    efforts = _efforts(simulation, motion, times)[0] if bounded else np.zeros_like(speed)
    exceeded: dict[tuple[str, str], str] = {}
    for k, name in enumerate(motion.joints):
        gear, entry = mechanism.gears.get(name), mechanism.description.joints[name]
        effort = efforts[:, k] + friction.get(name, JointFriction()).torque(speed[:, k])
        effort += 0.0 if gear is None else gear.rotor_inertia * acceleration[:, k]
        for quantity, values in (("speed", speed[:, k]), ("effort", effort)):
            most, limit = np.abs(values).max(), getattr(entry, quantity)
            if limit is not None and most > limit * (1.0 + limits.MARGIN):
                text = f"the {quantity} of joint {name!r} is {most:.4g}, above {limit:g}"
                exceeded[name, quantity] = text
    return exceeded


def table_for_controllers(compensation: Compensation, parts: int = 9) -> Table:
    """Shift of each gear by direction of motion and load, to the largest load of the motion."""
    mechanism, rows = compensation.simulation.mechanism, []
    friction = joint_friction(compensation.simulation)
    for k, name in enumerate(compensation.gears):
        dry = friction.get(name, JointFriction()).coulomb
        most = float(np.abs(compensation.torque[:, k]).max())
        for direction in (-1, 1):
            for load in np.linspace(-most, most, parts).tolist():
                torque = load + direction * dry
                shift = float(mechanism.gears[name].wound_up(torque))
                rows.append((name, direction, load, shift))
    names = ("joint", "direction", "load", "shift")
    columns = zip(names, zip(*rows, strict=True), strict=True)
    return Table([Column(name, values) for name, values in columns])


def with_shift(compensation: Compensation, more: np.ndarray) -> Compensation:
    """The same with further shifts (n, j), learned from a run, within limits."""
    shift, smoothed, clipped = _within_limits(
        compensation.simulation, compensation.times, compensation.shift + more
    )
    return replace(
        compensation, shift=shift, smoothed=smoothed, clipped=clipped,
        learned=compensation.learned + 1,
    )  # fmt: skip
