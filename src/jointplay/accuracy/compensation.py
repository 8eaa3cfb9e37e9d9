"""Compensation of play: a motion whose commands are shifted so that the tool is where it should be.

A controller that adds a constant at each reversal does not know on which side a joint rests.
Inverse dynamics do: a gear's teeth lie on the side to which their torque presses them, and wind up
by it,

    command = reference + sign(tau) play / 2 + tau / K,    tau = rnea(q, q', q'') + friction,

and journals rest where the load of the ideal motion presses them (`simulation.statics`, inertia
forces included), which displaces the tool. So `compensate`

1. finds where journals rest, and how far drives lag behind their commands;
2. finds the torque of each gear's teeth, and from it their side and wind-up; where friction can
   hold the teeth on either side, the last side is kept, or (`approach`) the stop is reached by a
   slow last move always towards the same side, whose friction presses the teeth;
3. takes the journals' displacement of the tool back through the Jacobian, its position before its
   turn unless the tool's size weighs both;
4. smooths the shifts until the motion is within the robot's limits.

The result is a model's answer: `study.corners` has the engine judge it.
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
"""Interval of the nodes at which commands change and sides are found; positions of rest are found
at every other node [s]."""
SAMPLE_S = 0.01
"""Interval of the corrected motion's points [s]."""
EASE_S = 0.25
"""Time in which shifts set in and fade out, lest the corrected motion begin at a speed [s]: with
0.1 s its spline keeps some acceleration (judged by a UR5 with six journals)."""
STANDS_S = 1.0
"""Time for which a machine is taken to stand before its motion and after it [s]."""
NEAR = 0.05
"""Travel of unloaded teeth, relative to their play, that is a negligible error: play is known no
better than that (judged)."""
CROSSING = 4
"""Most nodes by which the command crosses the play before and after the torque changes sign."""
UNPRESSED = 1e-6
"""Torque, relative to the joint's largest one, that presses no teeth: far above rounding, far below
any friction (judged)."""
APPROACH_S = 0.24
"""Least time of an approach from one side [s]: a dozen of `NODE_S`."""
OVERSHOOT = 1.25
"""Length of an approach relative to the play: more than the error of an unknown side."""
BRAKING = 0.5
"""Largest torque that brakes an approach, relative to the friction that keeps the teeth pressed:
half is left in case friction is less than known (judged)."""
_BRAKES = 10.0 / np.sqrt(3.0)
"""Largest acceleration of a smooth step of fifth order of size 1 in time 1."""
_SMOOTHINGS = 40
"""Most smoothings of a correction that exceeds limits of speed or effort: in the end over about a
tenth of a second."""


@dataclass(frozen=True)
class Compensation:
    """A motion corrected for play, at n nodes, for j joints and g gears."""

    simulation: Simulation
    """The simulation that was compensated, with its original motion."""
    times: np.ndarray
    """Times of the nodes, (n,) [s]."""
    shift: np.ndarray
    """Shift added to the command of each joint of the motion, (n, j) [rad or m]."""
    gears: tuple[str, ...]
    """Joints whose gears have play behind their encoder."""
    torque: np.ndarray
    """Torque of each gear's teeth, friction included, (n, g) [N m or N]."""
    side: np.ndarray
    """Side on which the teeth lie: 1, -1, or 0 before anything has pressed them, (n, g)."""
    undecided: np.ndarray
    """Whether friction, or no torque, lets the teeth lie on either side, (n, g)."""
    displacement: np.ndarray
    """Displacement of the tool by the journals at rest, world axes, (n, 6) [m, rad]."""
    smoothed: int = 0
    """Number of smoothings that limits of speed and effort required."""
    clipped: tuple[str, ...] = ()
    """Joints held at their limits of position."""
    approached: tuple[tuple[float, str], ...] = ()
    """Stops that are approached from one side: begin of the stop [s], and gear."""
    learned: int = 0
    """Number of runs of this motion from which further shifts were learned."""
    size: float | None = None
    """Length by which turns of the tool are weighed [m]; None: its position comes first."""

    @cached_property
    def motion(self) -> Motion:
        """The corrected motion, a spline through points of `SAMPLE_S`."""
        return corrected_motion(self.simulation, self.times, self.shift)[0]

    @property
    def crossings(self) -> np.ndarray:
        """Number of times that the teeth of each gear change sides, (g,)."""
        return np.asarray((self.side[1:] * self.side[:-1] < 0).sum(axis=0))

    @property
    def undecided_stops(self) -> list[tuple[float, tuple[str, ...]]]:
        """Stops with an undecided side that are not approached: begin [s], and gears."""
        by_time: dict[float, list[str]] = {}
        for time, name in _open_stops(self.simulation, self.times, self.gears, self.undecided):
            if (time, name) not in self.approached:
                by_time.setdefault(time, []).append(name)
        return [(time, tuple(names)) for time, names in by_time.items()]

    @property
    def notes(self) -> list[str]:
        """Notes on what the correction leaves open or had to give up, lines of text."""
        lines = []
        if self.gears:
            parts = 100.0 * self.undecided.mean(axis=0)
            shares = [f"{g} {p:.0f} %" for g, p in zip(self.gears, parts, strict=True) if p >= 0.5]
            lines.append(
                "part of the time in which friction leaves the side of the teeth open (the last "
                f"one is kept): {', '.join(shares) or 'none'}"
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
        """A row for each node: shift of each joint; torque and side (0: undecided) of each gear."""
        columns = [Column("time", self.times, "s")]
        shifts = zip(_motion(self.simulation).joints, self.shift.T, strict=True)
        columns += [Column(f"shift {name}", values) for name, values in shifts]
        for k, name in enumerate(self.gears):
            columns += [Column(f"torque {name}", self.torque[:, k])]
            columns += [Column(f"side {name}", np.where(self.undecided, 0, self.side)[:, k])]
        return Table(columns)


def _stops_text(open_stops: Sequence[tuple[float, tuple[str, ...]]]) -> str:
    """The first eight stops, each with its time and gears, in words."""
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
        simulation: a robot without loops on a base that is held, with its motion, drives, payloads
            and friction of joints.
        approach: reach stops at which friction leaves a gear's side undecided from one side: the
            tool arrives aside, by somewhat more than the play, and creeps to its place.
        size: size of the tool or of what it holds: a turn counts as the displacement at this
            distance from the tool [m]. None: the tool's position comes first, and its turn is taken
            back as far as that leaves joints free.
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
    # Nodes, and the displacement of the tool by journals at rest.
    count = 2 * max(round(0.5 * motion.duration / NODE_S), 2) + 1
    times = np.linspace(0.0, motion.duration, count)
    gears = tuple(n for n in mechanism.gears if n in motion.joints and _is_behind(simulation, n))
    displacement, journal_friction = np.zeros((count, 6)), dict[str, np.ndarray]()
    if mechanism.clearance:
        moved, torques = _journals(simulation, times[::2], progress)
        displacement = _interpolated(times[::2], moved, times)
        for name, values in torques.items():
            journal_friction[name] = _interpolated(times[::2], values.T, times).T
    # The lag of drives, and the side of each gear's teeth by their torque.
    lag = _lag(simulation, times, journal_friction)
    torque, held, inertia = _torques(simulation, times, gears, journal_friction)
    play = np.array([max(mechanism.gears[name].play, 1e-12) for name in gears])
    # Acceleration of unloaded teeth, in plays per node interval squared.
    fall = times[1] ** 2 * np.abs(torque) / (inertia * play)
    side, undecided = _sides(torque, held, fall, STANDS_S / times[1])
    if not (gears or mechanism.clearance or lag.any()):
        text = (
            "there is nothing to compensate: give joints with clearance, gears with play, such as "
            '--clearance "0.1 mm" or --gear NAME="2 arcmin", or servos, which sag'
        )
        if mechanism.gears:
            text += "; encoders on the links see the play of their gears"
            text += " (--encoder motor changes that)"
        raise JointplayError(text)
    if gears and not (mechanism.clearance or lag.any()) and undecided.all():
        raise JointplayError(
            f"no torque decides on which side the teeth of {few(list(gears))} lie, at any time: "
            "nothing can be compensated"
        )
    # The shift: lag, play and wind-up of gears, approaches, and the journals' displacement.
    shift = lag
    for k, name in enumerate(gears):
        twist = mechanism.gears[name].wound_up(side[:, k] * np.abs(torque[:, k]))
        free = _crossing(side[:, k], np.where(undecided[:, k], np.inf, fall[:, k]))
        twist = _hold_last(twist, undecided[:, k])[~free]
        shift[:, motion.joints.index(name)] += _interpolated(times[~free], twist, times)
    approaches = []
    if approach:
        approaches = _approaches(simulation, times, gears, undecided, torque, inertia)
    # Stops at which a joint stands on share its approach: that to the last one.
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
    """The motion with shifts (n, j) at nodes added, and the joints held at their limits."""
    motion = _motion(simulation)
    count = max(round(motion.duration / SAMPLE_S), 12) + 1
    dense = np.linspace(0.0, motion.duration, count)
    reference = motion(dense)[0]
    moved = reference + _interpolated(times, shift, _eased(dense))
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
    """Times slowed down to a stop at both ends: shifts taken at them begin and end at rest."""
    ease = min(EASE_S, 0.5 * times[-1])

    def late(x: np.ndarray) -> np.ndarray:
        """x from 1 on; between 0 and 1 a curve that begins at rest and joins it smoothly."""
        return np.where(x < 1.0, x**3 * (6.0 - 8.0 * x + 3.0 * x**2), x)

    first = ease * late(times / ease)
    return np.asarray(times[-1] - ease * late((times[-1] - first) / ease))


def through_jacobian(
    simulation: Simulation, times: np.ndarray, displacement: np.ndarray, size: float | None
) -> np.ndarray:
    """Displacements of the motion's joints, (n, j), that displace the ideal tool by (n, 6)."""
    ideal, motion = simulation.mechanism.ideal(), _motion(simulation)
    shifts = np.zeros((len(times), len(motion.joints)))
    for k, position in enumerate(motion(times)[0]):
        at = dict(zip(motion.joints, position.tolist(), strict=True))
        shifts[k], _ = taken_up(ideal, at, displacement[k], size)
    return shifts


def firmware_rule(simulation: Simulation, times: np.ndarray) -> np.ndarray:
    """Shifts (n, j) by the rule that firmware uses: half the play in the direction of motion."""
    mechanism, motion = simulation.mechanism, _motion(simulation)
    shift = np.zeros((len(times), len(motion.joints)))
    speed = motion(times)[1]
    for k, name in enumerate(motion.joints):
        if name in mechanism.gears and _is_behind(simulation, name):
            shift[:, k] = 0.5 * mechanism.gears[name].play * _direction(speed[:, k])
    return shift


def compensable(simulation: Simulation) -> tuple[Mechanism, Motion]:
    """The mechanism and motion of a simulation, refused unless the motion can be compensated.

    Raises:
        JointplayError: no motion that ends, loops, a free base, or a motion outside limits.
    """
    mechanism, motion = simulation.mechanism, simulation.motion
    if motion is None:
        raise JointplayError("a motion is needed that can be compensated: give one", ("motion",))
    if motion.interpolation in GOES_ON:
        text = f"a motion that goes on after its end ({motion.interpolation}) is not compensated"
        raise JointplayError(text, ("motion", "interpolation"))
    if mechanism.loops or mechanism.free_base is not None:
        text = "closed loops" if mechanism.loops else "a free base"
        raise JointplayError(f"a robot with {text} cannot be compensated")
    if simulation.limits != "ignore":
        limits.check_motion(mechanism, motion, motion.joints)
    return mechanism, motion


def _motion(simulation: Simulation) -> Motion:
    """The motion of a simulation that is `compensable`."""
    assert simulation.motion is not None
    return simulation.motion


def _is_behind(simulation: Simulation, joint: str) -> bool:
    """Whether the play of a joint's gear lies behind its encoder, which is on the motor."""
    drives = assign(simulation.mechanism, simulation.motion, simulation.drive)
    return getattr(drives[joint], "encoder", "motor") == "motor"


def _lag(
    simulation: Simulation, times: np.ndarray, journal_friction: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Lag of drives behind their commands, e, (n, j) [rad or m].

    Computed torque lags by the efforts that it does not know (payloads, loads, the friction of
    journals) over the stiffness omega^2 I that it gives the joint. A servo lags by the voltage V
    that its motor needs, and by its dead band:

        V = tau / stall + k qd,    P de/dt + I e = dV/dt    (without I term e = V / P).

    Where it stands, its friction keeps the sign that it had in motion.
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
        journal = np.where(
            np.abs(speed) < STILL, 0.0, journal_friction.get(name, np.zeros((1, 1)))[0]
        )
        if isinstance(drive, ComputedTorque):
            bandwidth = drive.through_teeth(inertia[0, k], gear).bandwidth or BANDWIDTH
            stiffness = bandwidth**2 * (inertia[0, k] + rotor)
            lag[:, k] = (efforts[:, k] + journal - known[:, k]) / stiffness
        elif isinstance(drive, Servo):
            losses = drive.with_friction(friction.get(name, JointFriction()))
            effort = efforts[:, k] + journal + rotor * accelerations[:, k]
            effort += losses.coulomb * _direction(speed) + losses.viscous * speed
            volts = effort / drive.stall + drive.torque_constant * speed
            error = volts / drive.p_gain
            decay = np.exp(-drive.i_gain / drive.p_gain * times[1])  # of an error, by the I term
            for node in range(1, len(times) if drive.i_gain else 0):
                rise = (volts[node] - volts[node - 1]) / drive.p_gain
                error[node] = decay * error[node - 1] + rise
            lag[:, k] = error + drive.band * np.sign(error)
    return lag


def _efforts(
    simulation: Simulation, motion: Motion, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Efforts of the joints in a motion of the ideal robot [N m or N], and inertias, (n, j).

    Loads act as at time 0.
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
    journal_friction: Mapping[str, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Torque of gears' teeth, friction that can hold them [N m or N], and inertias: (n, g) each.

    The friction of a joint that stands may have either sign: it can hold the teeth on either side
    against a smaller torque. `journal_friction` is that of `_journals`.
    """
    motion = _motion(simulation)
    columns = [motion.joints.index(name) for name in gears]
    tau, inertia = (values[:, columns] for values in _efforts(simulation, motion, times))
    speeds, held = motion(times)[1][:, columns], np.zeros_like(tau)
    friction = joint_friction(simulation)
    for k, name in enumerate(gears):
        losses, speed = friction.get(name, JointFriction()), speeds[:, k]
        still = np.abs(speed) < STILL
        journal = journal_friction.get(name, np.zeros((2, len(times))))
        tau[:, k] += np.where(still, 0.0, losses.torque(speed) + journal[0])
        held[still, k] = losses.coulomb + losses.excess + journal[1, still]
    return tau, held, inertia


def _sides(
    torque: np.ndarray, held: np.ndarray, fall: np.ndarray, stands: float
) -> tuple[np.ndarray, np.ndarray]:
    """Side of the teeth (n, g), the last one where it is undecided, and whether it is, (n, g).

    A side is undecided where friction can hold the torque, and where the torque ceases before it
    has moved the teeth by `NEAR` of the play. `fall` is their acceleration, in plays per node
    interval squared, (n, g); `stands` is the time, in node intervals, for which the machine stands
    before and after its motion.
    """
    least = UNPRESSED * np.abs(torque).max(axis=0, initial=0.0)
    undecided = np.abs(torque) <= np.maximum(held, least)
    sides = np.where(undecided, 0.0, np.sign(torque))
    for k, column in enumerate(sides.T):
        edges = np.flatnonzero(np.diff(column, prepend=np.nan, append=np.nan))
        for begin, end in pairwise(edges):  # intervals in which the side stays the same
            travel = np.cumsum(fall[begin:end, k]).sum()
            if begin == 0 or end == len(column):
                travel += 0.5 * stands**2 * fall[begin if begin == 0 else end - 1, k]
            if travel < NEAR:
                undecided[begin:end, k], column[begin:end] = True, 0.0
    last = np.array([_hold_last(column, column == 0.0) for column in sides.T]).T.reshape(
        sides.shape
    )
    return last, undecided


def _crossing(side: np.ndarray, fall: np.ndarray) -> np.ndarray:
    """Nodes (n,) at which the command of a gear may be between both sides of its play.

    The command crosses as slowly as possible, as a drive that leaps across strikes the other flank:
    it may lie in between as long as the weak torque there moves unloaded teeth by no more than
    `NEAR` of the play. It never crosses while the joint stands, where `fall` is infinite.
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
    """Stops at whose end a side is undecided: begin of the stop [s], and gear."""
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
    """Index of the gear."""
    stop: float
    """Begin of the stop in the motion [s]."""
    arrival: float
    """Time at which it begins to creep [s]."""
    window: float
    """Duration of the creep [s]."""
    torque: float
    """Torque of the teeth at the end, with the friction that presses them [N m or N]."""

    def apply(
        self,
        simulation: Simulation,
        times: np.ndarray,
        shift: np.ndarray,
        side: np.ndarray,
        undecided: np.ndarray,
    ) -> None:
        """Change shifts (n, j) and sides (n, g) in place, from the move to the stop on."""
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
    """Approaches of stops with an undecided side, from the side to which loads press the joint.

    They are so slow that braking does not lift the teeth. A stop is left as it is if there is no
    friction, if the joint stands too short, or if it would have to go aside at the stop before.
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


def _direction(speed: np.ndarray) -> np.ndarray:
    """Sign of speeds (n,); while the joint stands, the last one (at the start, the next)."""
    return _hold_last(np.sign(speed), np.abs(speed) < STILL)


def _interpolated(nodes: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values at nodes interpolated at other times without overshoot (PCHIP)."""
    from scipy.interpolate import PchipInterpolator  # takes long to import

    return np.asarray(PchipInterpolator(nodes, values)(times))


def _hold_last(values: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Values with unknown ones replaced by the last known one; at the start by the first."""
    good = np.flatnonzero(~unknown)
    if not len(good):
        return np.zeros_like(values)
    last = good[np.maximum(np.searchsorted(good, np.arange(len(values)), side="right") - 1, 0)]
    return np.asarray(values[last])


def _journals(
    simulation: Simulation, times: np.ndarray, progress: bool
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Displacements of the tool by journals at rest under the ideal motion's load, and friction.

    Each search begins from the displacement of the last one. Friction turns the force of a contact
    aside by atan(mu), and so moves the contact around the bearing, against the journal's rotation.

    Returns:
        The tool's displacement and rotation, (n, 6) [m, rad]; by joint, the friction torque of its
        journal about the axis, (2, n) [N m]: with the sign of its rotation, and the largest that
        can hold it while it stands.
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
    """The configuration with journals climbed aside in their bearings by angles [rad]."""
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
    """Friction coefficients of a journal at speeds (n,) [rad/s], signed, and the largest one.

    Where a law with bristles holds a standing journal, the sign is the last one.
    """
    assert joint.hinge is not None
    law, radius = joint.friction, joint.hinge.radius
    largest = max(law.coefficients.values(), default=0.0)
    if law.state == ("speed",):
        mu = [law.function(abs(x) * radius, *law.parameters()) for x in speed.tolist()]
        return np.sign(speed) * mu, largest
    return _direction(speed) * law.coefficients.get("mu_d", 0.0), largest


def _pressing(joint: Clearance, wrench: np.ndarray) -> float:
    """Friction torque of a journal about its axis per coefficient of friction [N m].

    The normal forces are those at its two ends, which balance the force and the moment across the
    axis, and the one along the axis; the arm is the radius.
    """
    assert joint.hinge is not None
    force, moment = wrench[:2], np.array([wrench[4], -wrench[3]]) / joint.hinge.length
    ends = [np.linalg.norm(0.5 * force + side * moment) for side in (-1.0, 1.0)]
    return joint.hinge.radius * float(sum(ends) + abs(wrench[2]))


def _within_limits(
    simulation: Simulation, times: np.ndarray, shift: np.ndarray
) -> tuple[np.ndarray, int, tuple[str, ...]]:
    """Shifts smoothed until the corrected motion is within all limits that the motion itself keeps.

    Returns:
        The shifts, the number of smoothings, and the joints held at limits of position.
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
    raise JointplayError(f"in the corrected motion {new}, even smoothed; slow it down")


def _beyond(simulation: Simulation, motion: Motion) -> dict[tuple[str, str], str]:
    """Limits of speed and effort that a motion exceeds, in words, by joint and quantity."""
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
    """Shift of each gear by direction of motion and load, up to the largest load of the motion."""
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
    """The compensation with further shifts (n, j), learned from a run, within limits."""
    shift, smoothed, clipped = _within_limits(
        compensation.simulation, compensation.times, compensation.shift + more
    )
    return replace(
        compensation, shift=shift, smoothed=smoothed, clipped=clipped,
        learned=compensation.learned + 1,
    )  # fmt: skip
