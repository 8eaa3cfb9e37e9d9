"""Cycles of an arm with play in its gears, whose places are reached anew in three ways.

What differs from cycle to cycle is drawn from its seed: the sides from which joints arrive, on
which flank teeth lie at the start, dry friction, and the reading of encoders within a count; dead
bands and friction do the rest, and hold where the joint stops, as real friction does. A stop is
reached from any side, always from one, or from any side by a motion that `accuracy.compensate`
corrected.
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
"""Part by which dry friction differs from cycle to cycle, either way (judged)."""

HOLDS, HOLDS_LEAST = 0.02, 1e-4
"""Bend of the bristles by which known friction holds, in plays, and of a joint without play in rad
or m (judged: small against what friction leaves)."""

BEYOND = 3.0
"""How far aside a joint turns round, in all that play, dead band and friction may leave (judged);
at least `LEAST` [rad or m]."""
LEAST = 2e-3

APPROACH_S, DWELL_S = 0.25, 0.5
"""Time of the last way to a stop, and of the stop, as in `cube_motion` [s]."""

REST_S = 1.0
"""Rest before a path, in which teeth fall to their sides and come to rest (judged: those of an AR4
have in 0.6 s) [s]."""

NO_WEIGHT = 1e-3
"""Torque of weight, relative to the largest of all joints, that presses nothing (judged)."""

ANY, ONE, CORRECTED = "from any side", "from one side", "compensated"
WAYS = (ANY, ONE, CORRECTED)


@dataclass(frozen=True)
class Approaches:
    """Where an arm stops, and what its cycles are run with."""

    simulation: Simulation
    """The cycle that is asked about."""

    @property
    def _stops(self) -> list[Stop]:
        """Rests, that at its start first."""
        return [one for one in stops(self._motion, self._motion.duration) if one.at_rest]

    @property
    def places(self) -> np.ndarray:
        """Where its joints stop, after its start (stops, joints) [rad or m]."""
        return self._motion(np.array([one.end for one in self._stops[1:]]))[0]

    @property
    def _motion(self) -> Motion:
        assert self.simulation.motion is not None
        return self.simulation.motion

    @property
    def _times(self) -> np.ndarray:
        """When the last way to each stop begins, ends, and the stop (stops, 3) [s]."""
        ways = [after.start - before.end for before, after in pairwise(self._stops)]
        ends = np.cumsum([way + APPROACH_S + DWELL_S for way in ways])
        return ends[:, None] - np.array([APPROACH_S + DWELL_S, DWELL_S, 0.0])

    @property
    def looked_at(self) -> np.ndarray:
        """When stops end (stops,) [s]."""
        return self._times[:, 2]

    @property
    def _drives(self) -> dict[str, Any]:
        return dict(assign(self.simulation.mechanism, self._motion, self.simulation.drive))

    def _aside(self) -> np.ndarray:
        """How far aside joints turn round (joints,) [rad or m]."""
        gears, ways = self.simulation.mechanism.gears, []
        for name in self._motion.joints:
            drive, loose = self._drives[name], 0.0
            if isinstance(drive, Servo):
                loose = 2.0 * (drive.band + drive.friction / (drive.p_gain * drive.stall))
            loose += gears[name].play if name in gears else 0.0
            ways.append(max(BEYOND * loose, LEAST))
        return np.array(ways)

    def _moved(self, sides: np.ndarray) -> Motion:
        """The way through all stops, each reached from these sides (stops, joints)."""
        motion, places, entries = self._motion, self.places, self.simulation.mechanism.description
        away = places + sides * self._aside()
        for k, name in enumerate(motion.joints):
            joint = entries.joints.get(name)
            low, high = (joint.lower, joint.upper) if joint else (None, None)
            out = np.zeros(len(places), bool)
            out |= False if low is None else away[:, k] < low
            out |= False if high is None else away[:, k] > high
            away[out, k] = (2.0 * places - away)[out, k]
        times, rows = [0.0], [motion(np.zeros(1))[0][0]]
        for at, place, beside in zip(self._times, places, away, strict=True):
            times += at.tolist()
            rows += [beside, place, place]
        return Motion(motion.joints, times, np.array(rows), "rest-to-rest")

    def rested(self) -> Simulation:
        """The cycle itself, after a rest if it moves from rest to rest."""
        motion, lasts = self._motion, self.simulation.duration
        if motion.interpolation != "rest-to-rest":
            return self.simulation
        times = np.concatenate([[0.0], np.add(motion.times, REST_S)])
        rows = np.concatenate([motion.positions[:1], motion.positions])
        later = Motion(motion.joints, times, rows, motion.interpolation)
        lasts = None if lasts is None else lasts + REST_S
        return replace(self.simulation, motion=later, duration=lasts, judge_from=REST_S)

    def reference(self) -> Simulation:
        """A cycle by which others are judged, its machine to be made ideal."""
        return self._with(self._moved(np.ones_like(self.places)))

    def _with(self, motion: Motion, **more: Any) -> Simulation:
        return replace(self.simulation, motion=motion, duration=None, **more)

    def cycle(self, seed: int, way: str) -> Simulation:
        """One of them, of `WAYS`.

        Raises:
            JointplayError: of a corrected one: nothing can be compensated, or not within limits.
        """
        random, joints, drives = np.random.default_rng(seed), self._motion.joints, self._drives
        sides = random.choice([-1.0, 1.0], self.places.shape)
        motion = self._moved(sides if way != ONE else np.ones_like(sides))
        if way == CORRECTED:
            motion = compensate(self._with(motion)).motion
        counts = random.uniform(-0.5, 0.5, len(joints))
        rubs = 1.0 + FRICTION * random.uniform(-1.0, 1.0, len(joints))
        losses, shift = dict(joint_friction(self.simulation)), np.zeros(len(joints))
        for k, name in enumerate(joints):
            gear = self.simulation.mechanism.gears.get(name)
            bend = HOLDS * gear.play if gear is not None and gear.play else HOLDS_LEAST
            if (loss := losses.get(name, JointFriction())).coulomb:
                losses[name] = replace(
                    loss,
                    coulomb=rubs[k] * loss.coulomb,
                    static=None if loss.static is None else rubs[k] * loss.static,
                    presliding=loss.presliding or bend,
                )
            if isinstance(servo := drives[name], Servo):
                held = (servo.presliding or bend) if servo.friction else servo.presliding
                drives[name] = replace(servo, friction=rubs[k] * servo.friction, presliding=held)
                shift[k] = counts[k] * servo.resolution
        times, rows = motion.waypoints
        moved = Motion(joints, times, rows + shift, motion.interpolation)
        return self._with(moved, drive=drives, joint_friction=losses, seed=seed)

    @property
    def _pressed(self) -> list[str]:
        """Joints whose teeth weight presses to the same side at all stops, against friction."""
        robot, joints = self.simulation.mechanism, self._motion.joints
        bodies = loaded(robot.model, self.simulation.payloads, 0.0)
        data, at = bodies.createData(), [robot.coordinate(name) for name in joints]
        q = [
            robot.configuration(dict(zip(joints, one.tolist(), strict=True))) for one in self.places
        ]
        weights = np.array([pin.computeGeneralizedGravity(bodies, data, one)[at] for one in q])
        losses, found = joint_friction(self.simulation), []
        for name, weight in zip(joints, weights.T, strict=True):
            loss, gear = losses.get(name, JointFriction()), robot.gears.get(name)
            holds = max(loss.coulomb + loss.excess, NO_WEIGHT * float(np.abs(weights).max()))
            same = (weight > holds).all() or (weight < -holds).all()
            if same and gear is not None and gear.play:
                found.append(name)
        return found

    @property
    def causes(self) -> list[str]:
        """What differs from cycle to cycle, and what is not known of the machine, in words."""
        drives, losses = self._drives, joint_friction(self.simulation)
        loose = [n for n, gear in self.simulation.mechanism.gears.items() if gear.play]
        known: Mapping[str, Sequence[str]] = {
            "dry friction": [
                n for n in self._motion.joints
                if losses.get(n, JointFriction()).coulomb or getattr(drives[n], "friction", 0.0)
            ],
            "dead band": [n for n in drives if getattr(drives[n], "band", 0.0)],
            "counts": [n for n in drives if getattr(drives[n], "resolution", 0.0)],
        }  # fmt: skip
        there = [
            f"{what} of {'them' if list(names) == loose else few(list(names))}"
            for what, names in known.items()
            if names
        ]
        missing = [what for what, names in known.items() if not names]
        lines = [
            "drawn anew in each cycle: the side from which joints arrive and where the teeth of "
            f"{few(loose)} lie at the start"
            + (f"; {', '.join(there)} (friction +-{100 * FRICTION:g} %, judged)" if there else "")
        ]
        pressed = self._pressed
        if pressed:
            lines.append(
                f"weight presses the teeth of {few(pressed)} to one side at every stop, whichever "
                "way they arrive"
            )
        if floating := [n for n in loose if n not in {*pressed, *known["dry friction"]}]:
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
    """Whether it is an arm with play in gears that stops somewhere, and can be led there anew."""
    motion, mechanism = simulation.motion, simulation.mechanism
    if motion is None or motion.interpolation in GOES_ON or mechanism.loops:
        return False
    if not any(gear.play > 0.0 for gear in mechanism.gears.values()):
        return False
    if set(motion.joints) - set(mechanism.description.joints):
        return False
    if any(one.pick or one.release for one in simulation.payloads):
        return False
    return len(Approaches(simulation)._stops) > 1


def planned(
    simulation: Simulation, cycles: int
) -> tuple[Approaches, dict[str, list[Simulation]], list[str]]:
    """Cycles by the way in which they reach places, and what is to be said of them."""
    arm, first = Approaches(simulation), 1 if simulation.seed is None else simulation.seed
    seeds, said = range(first, first + cycles), arm.causes
    plans = {way: [arm.cycle(seed, way) for seed in seeds] for way in (ANY, ONE)}
    try:
        if simulation.mechanism.clearance:
            raise JointplayError("of journals see jointplay compensate")
        plans[CORRECTED] = [arm.cycle(seed, CORRECTED) for seed in seeds]
        left = compensate(arm.reference()).undecided_stops
    except JointplayError as error:
        return arm, plans, [*said, f"not {CORRECTED}: {error}"]
    if loose := list(dict.fromkeys(name for _, names in left for name in names)):
        said.append(
            f"no torque decides at stops on which side the teeth of {few(loose)} lie: compensated "
            "motion takes their last one, and may repeat worse"
        )
    return arm, plans, said
