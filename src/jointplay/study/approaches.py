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
from typing import Any

import numpy as np

from jointplay.accuracy.compensation import compensate
from jointplay.base.errors import JointplayError
from jointplay.base.tables import few
from jointplay.simulation.analysis.tool_error import stops
from jointplay.simulation.checks import joint_friction
from jointplay.simulation.loads import JointFriction, Servo
from jointplay.simulation.loads.drive import assign
from jointplay.simulation.motion.reference import GOES_ON, Motion
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

ANY, ONE, CORRECTED = "from any side", "from one side", "compensated"
WAYS = (ANY, ONE, CORRECTED)


@dataclass(frozen=True)
class Approaches:
    """Where an arm stops, and what its cycles are run with."""

    simulation: Simulation
    """The cycle that is asked about."""

    @property
    def places(self) -> np.ndarray:
        """Where its joints stop, after its start, (stops, joints) [rad or m]."""
        motion = self._motion
        found = [one for one in stops(motion, motion.duration) if one.at_rest and one.end > 0.0]
        return motion(np.array([one.end for one in found]))[0]

    @property
    def _motion(self) -> Motion:
        assert self.simulation.motion is not None
        return self.simulation.motion

    @property
    def _times(self) -> np.ndarray:
        """When the last way to each stop begins, ends, and the stop (stops, 3) [s]."""
        motion = self._motion
        found = [one for one in stops(motion, motion.duration) if one.at_rest]
        ways = [b.start - a.end for a, b in zip(found, found[1:], strict=False)]
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
        there = [f"{what} of {few(list(names))}" for what, names in known.items() if names]
        missing = [what for what, names in known.items() if not names]
        lines = [
            "drawn anew in each cycle: the side from which joints arrive and where the teeth of "
            f"{few(loose)} lie at the start"
            + (f"; {', '.join(there)} (friction +-{100 * FRICTION:g} %, judged)" if there else "")
        ]
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
    return len(Approaches(simulation).places) > 0


def planned(
    simulation: Simulation, cycles: int
) -> tuple[Approaches, dict[str, list[Simulation]], str]:
    """Cycles by the way in which they reach places; why there are no corrected ones."""
    arm, first = Approaches(simulation), simulation.seed or 1
    seeds = range(first, first + cycles)
    plans = {way: [arm.cycle(seed, way) for seed in seeds] for way in (ANY, ONE)}
    if simulation.mechanism.clearance:
        return arm, plans, "journals: see jointplay compensate"
    try:
        plans[CORRECTED] = [arm.cycle(seed, CORRECTED) for seed in seeds]
    except JointplayError as error:
        return arm, plans, str(error)
    return arm, plans, ""
