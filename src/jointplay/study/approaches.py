"""Approaches to a stop: cycles of an arm with play in its gears, its stops reached in three ways.

What differs from cycle to cycle is drawn from the cycle's seed: the sides from which joints arrive,
the flank on which teeth lie at the start, dry friction, and the reading of encoders within a count.
Dead bands and friction do the rest; as in reality, friction holds a joint where it stops. A stop is
reached from any side, always from the same side, or from any side by a motion that
`accuracy.compensate` has corrected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.accuracy.compensation import compensate
from jointplay.base.errors import JointplayError
from jointplay.base.tables import few
from jointplay.model.mechanism import loaded
from jointplay.simulation.analysis.tool_error import Stop, stops
from jointplay.simulation.loads import JointFriction, Servo
from jointplay.simulation.loads.drive import assign
from jointplay.simulation.motion.reference import GOES_ON, Motion
from jointplay.simulation.prepare import joint_friction
from jointplay.simulation.simulation import Simulation

FRICTION = 0.2
"""Relative variation of dry friction from cycle to cycle, either way (judged)."""

PRESLIDING, RIGID_PRESLIDING = 0.02, 1e-4
"""Presliding displacement of known friction, by which it holds a joint at rest: in plays, and for a
joint without play in rad or m (judged: small against the error that friction leaves)."""

APPROACH_FACTOR = 3.0
"""Distance from a stop at which a joint turns round to approach it, as a multiple of the error that
play, dead band and friction may leave (judged)."""
LEAST_APPROACH = 2e-3
"""Least such distance [rad or m]."""

APPROACH_S, DWELL_S = 0.25, 0.5
"""Duration of the approach to a stop (judged), and of the stop, as in `cube_motion` [s]."""

REST_S = 1.0
"""Rest before a path, in which teeth fall to one side and come to rest (judged: those of an AR4
need 0.6 s) [s]."""

NO_WEIGHT = 1e-3
"""Torque of gravity, relative to the largest of all joints, below which it presses no teeth
(judged)."""

ANY_SIDE, ONE_SIDE, COMPENSATED = "from any side", "from one side", "compensated"
APPROACHES = (ANY_SIDE, ONE_SIDE, COMPENSATED)


@dataclass(frozen=True)
class Approaches:
    """Makes the cycles of an arm: motions that reach its stops by given approaches."""

    simulation: Simulation
    """The cycle as the user gave it."""

    @property
    def _stops(self) -> list[Stop]:
        """Rests of the motion, that at its start first."""
        return [stop for stop in stops(self._motion, self._motion.duration) if stop.at_rest]

    @property
    def targets(self) -> np.ndarray:
        """Positions of the joints at the stops after the start (stops, joints) [rad or m]."""
        return self._motion(np.array([stop.end for stop in self._stops[1:]]))[0]

    @property
    def _motion(self) -> Motion:
        assert self.simulation.motion is not None
        return self.simulation.motion

    @property
    def _times(self) -> np.ndarray:
        """Times at which the approach to each stop begins and ends, and the stop ends, shape
        (stops, 3) [s]; the moves before them take as long as in the user's motion.
        """
        durations = [after.start - before.end for before, after in pairwise(self._stops)]
        ends = np.cumsum([duration + APPROACH_S + DWELL_S for duration in durations])
        return ends[:, None] - np.array([APPROACH_S + DWELL_S, DWELL_S, 0.0])

    @property
    def stop_ends(self) -> np.ndarray:
        """Times at which stops end (stops,) [s]."""
        return self._times[:, 2]

    @property
    def _drives(self) -> dict[str, Any]:
        return dict(assign(self.simulation.mechanism, self._motion, self.simulation.drive))

    def _approach_distances(self) -> np.ndarray:
        """Distance from its stop at which each joint turns round (joints,) [rad or m].

        Lost motion is twice the servo's dead band and the error at which its torque overcomes
        friction, plus the gear's play.
        """
        gears, distances = self.simulation.mechanism.gears, []
        for name in self._motion.joints:
            drive, lost_motion = self._drives[name], 0.0
            if isinstance(drive, Servo):
                lost_motion = 2.0 * (drive.band + drive.friction / (drive.p_gain * drive.stall))
            lost_motion += gears[name].play if name in gears else 0.0
            distances.append(max(APPROACH_FACTOR * lost_motion, LEAST_APPROACH))
        return np.array(distances)

    def _motion_from(self, sides: np.ndarray) -> Motion:
        """The motion through all stops, each approached from these sides, +-1 (stops, joints)."""
        motion, targets = self._motion, self.targets
        reversals = targets + sides * self._approach_distances()
        for k, name in enumerate(motion.joints):
            # Where the joint would turn round beyond its limits, it comes from the other side.
            joint = self.simulation.mechanism.description.joints.get(name)
            low, high = (joint.lower, joint.upper) if joint else (None, None)
            outside = np.zeros(len(targets), bool)
            outside |= False if low is None else reversals[:, k] < low
            outside |= False if high is None else reversals[:, k] > high
            reversals[outside, k] = (2.0 * targets - reversals)[outside, k]
        times, rows = [0.0], [motion(np.zeros(1))[0][0]]
        for instants, target, reversal in zip(self._times, targets, reversals, strict=True):
            times += instants.tolist()
            rows += [reversal, target, target]
        return Motion(motion.joints, times, np.array(rows), "rest-to-rest")

    def rested(self) -> Simulation:
        """The user's cycle, for its path; delayed by a rest if it moves from rest to rest."""
        motion, duration = self._motion, self.simulation.duration
        if motion.interpolation != "rest-to-rest":
            return self.simulation
        times = np.concatenate([[0.0], np.add(motion.times, REST_S)])
        rows = np.concatenate([motion.positions[:1], motion.positions])
        delayed = Motion(motion.joints, times, rows, motion.interpolation)
        duration = None if duration is None else duration + REST_S
        return replace(self.simulation, motion=delayed, duration=duration, judge_from=REST_S)

    def reference(self) -> Simulation:
        """The cycle with which others are compared, once its machine is made ideal."""
        return self._with_motion(self._motion_from(np.ones_like(self.targets)))

    def _with_motion(self, motion: Motion, **changes: Any) -> Simulation:
        return replace(self.simulation, motion=motion, duration=None, **changes)

    def cycle(self, seed: int, approach: str) -> Simulation:
        """The cycle of a seed, its stops reached by one of `APPROACHES`.

        Raises:
            JointplayError: the motion cannot be compensated, or not within limits.
        """
        # The draws do not depend on the approach: cycles of one seed differ in it alone.
        random, joints, drives = np.random.default_rng(seed), self._motion.joints, self._drives
        sides = random.choice([-1.0, 1.0], self.targets.shape)
        motion = self._motion_from(sides if approach != ONE_SIDE else np.ones_like(sides))
        if approach == COMPENSATED:
            motion = compensate(self._with_motion(motion)).motion
        offsets = random.uniform(-0.5, 0.5, len(joints))
        factors = 1.0 + FRICTION * random.uniform(-1.0, 1.0, len(joints))
        # Friction of joints and motors is scaled, and given bristles, by which it holds at rest.
        losses, shift = dict(joint_friction(self.simulation)), np.zeros(len(joints))
        for k, name in enumerate(joints):
            gear = self.simulation.mechanism.gears.get(name)
            play = gear.play if gear is not None else 0.0
            bend = PRESLIDING * play or RIGID_PRESLIDING
            if (loss := losses.get(name, JointFriction())).coulomb:
                losses[name] = replace(
                    loss,
                    coulomb=factors[k] * loss.coulomb,
                    static=None if loss.static is None else factors[k] * loss.static,
                    presliding=loss.presliding or bend,
                )
            if isinstance(servo := drives[name], Servo):
                friction = factors[k] * servo.friction
                presliding = servo.presliding or (bend if friction else 0.0)
                drives[name] = replace(servo, friction=friction, presliding=presliding)
                shift[k] = offsets[k] * servo.resolution
        # An encoder that reads an offset within a count: the whole motion is shifted by it.
        times, rows = motion.waypoints
        shifted = Motion(joints, times, rows + shift, motion.interpolation)
        return self._with_motion(shifted, drive=drives, joint_friction=losses, seed=seed)

    @property
    def _pressed(self) -> list[str]:
        """Joints whose teeth gravity presses to the same side at all stops, against friction."""
        robot, joints = self.simulation.mechanism, self._motion.joints
        bodies = loaded(robot.model, self.simulation.payloads, 0.0)
        data, columns = bodies.createData(), [robot.coordinate(name) for name in joints]
        q = [robot.configuration(dict(zip(joints, t.tolist(), strict=True))) for t in self.targets]
        torques = np.array([pin.computeGeneralizedGravity(bodies, data, x)[columns] for x in q])
        losses, pressed = joint_friction(self.simulation), []
        for name, torque in zip(joints, torques.T, strict=True):
            loss, gear = losses.get(name, JointFriction()), robot.gears.get(name)
            resistance = max(loss.coulomb + loss.excess, NO_WEIGHT * float(np.abs(torques).max()))
            one_sided = (torque > resistance).all() or (torque < -resistance).all()
            if one_sided and gear is not None and gear.play:
                pressed.append(name)
        return pressed

    @property
    def causes(self) -> list[str]:
        """Notes on what differs from cycle to cycle, and on what is unknown of the machine."""
        drives, losses = self._drives, joint_friction(self.simulation)
        loose = [n for n, gear in self.simulation.mechanism.gears.items() if gear.play]
        joints_by_cause: Mapping[str, Sequence[str]] = {
            "dry friction": [
                n for n in self._motion.joints
                if losses.get(n, JointFriction()).coulomb or getattr(drives[n], "friction", 0.0)
            ],
            "dead band": [n for n in drives if getattr(drives[n], "band", 0.0)],
            "counts": [n for n in drives if getattr(drives[n], "resolution", 0.0)],
        }  # fmt: skip
        drawn = [
            f"{cause} of {'them' if list(names) == loose else few(list(names))}"
            for cause, names in joints_by_cause.items()
            if names
        ]
        missing = [cause for cause, names in joints_by_cause.items() if not names]
        lines = [
            "drawn anew in each cycle: the side from which joints arrive and where the teeth of "
            f"{few(loose)} lie at the start"
            + (f"; {', '.join(drawn)} (friction +-{100 * FRICTION:g} %, judged)" if drawn else "")
        ]
        pressed = self._pressed
        if pressed:
            lines.append(
                f"weight presses the teeth of {few(pressed)} to one side at every stop, whichever "
                "way they arrive"
            )
        if floating := [n for n in loose if n not in {*pressed, *joints_by_cause["dry friction"]}]:
            lines.append(
                f"neither weight nor friction that is known holds the teeth of {few(floating)} at "
                "stops: give --joint-friction"
            )
        if missing:
            lines.append(
                f"not known, so left out: {', '.join(missing)}; --joint-friction, --preset or "
                "servos by --set give them"
            )
        return lines


def applies(simulation: Simulation) -> bool:
    """Whether these cycles can be made: an arm with play in gears that stops on its way, without
    loops, payloads that change, or a motion that does not end.
    """
    motion, mechanism = simulation.motion, simulation.mechanism
    if motion is None or motion.interpolation in GOES_ON or mechanism.loops:
        return False
    if not any(gear.play > 0.0 for gear in mechanism.gears.values()):
        return False
    if set(motion.joints) - set(mechanism.description.joints):
        return False
    if any(payload.pick or payload.release for payload in simulation.payloads):
        return False
    return len(Approaches(simulation)._stops) > 1


def planned(
    simulation: Simulation, cycles: int
) -> tuple[Approaches, dict[str, list[Simulation]], list[str]]:
    """The arm, its cycles by approach, and notes on them.

    Compensated cycles are left out, with a note, where the motion cannot be compensated.
    """
    arm, first = Approaches(simulation), 1 if simulation.seed is None else simulation.seed
    seeds, notes = range(first, first + cycles), arm.causes
    plans = {side: [arm.cycle(seed, side) for seed in seeds] for side in (ANY_SIDE, ONE_SIDE)}
    try:
        if simulation.mechanism.clearance:
            raise JointplayError("for journals see jointplay compensate")
        plans[COMPENSATED] = [arm.cycle(seed, COMPENSATED) for seed in seeds]
        undecided = compensate(arm.reference()).undecided_stops
    except JointplayError as error:
        return arm, plans, [*notes, f"not {COMPENSATED}: {error}"]
    if loose := list(dict.fromkeys(name for _, names in undecided for name in names)):
        notes.append(
            f"no torque decides at stops on which side the teeth of {few(loose)} lie: compensated "
            "motion takes their last one, and may repeat worse"
        )
    return arm, plans, notes
