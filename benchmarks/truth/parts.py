"""Arms with rolling bearings, seats and gears, pushed and moved slowly: a separate static solver.

Positions, loads and displacements are found in numpy in the displaced position, by repeated
substitution (an arm is statically determinate). Each bearing rests by its own law, each gear
follows its loads from record to record as the kernel has it (`Gearing.torsion`), from a history
that nobody knows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import jointplay as jp
from jointplay.model.gear import Gearing

KINDS = (
    *("ball", "crossed roller", "pair", "ball in a seat", "crossed roller in a seat"),
    *("strain-wave", "strain-wave and ball", "strain-wave, each piece"),
)
GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class Joint:
    """A joint of an arm and the link that it carries; SI units."""

    axis: tuple[float, float, float]
    at: float
    """Place along x of the link before [m]."""
    mass: float
    centre: float
    """Of the link's mass, along its x [m]."""
    soft: np.ndarray
    """Compliance along and about the axes of the bearing (6,), about z of the link alone."""
    bearing: jp.BallBearing | jp.CrossedRollerBearing | None = None
    gear: Gearing | None = None

    @property
    def axes(self) -> np.ndarray:
        """Of the bearing in the link before, z along the joint's axis."""
        z = np.array(self.axis)
        x = np.array([1.0, 0.0, 0.0])
        return np.column_stack([x, np.cross(z, x), z])


def statics(
    joints: list[Joint],
    reach: float,
    tool: np.ndarray,
    motor: np.ndarray,
    force: np.ndarray,
    time: np.ndarray,
    before: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Tool (n, 3) [m] and twist of gears (n, j) [rad] along a slow motion.

    Args:
        joints: from the base on; the tool is at `reach` along the last link's x, and the structure
            there gives way by `tool` (3, 3) [m/N].
        motor: positions (n, j) [rad] at times (n,) [s].
        force: on the tool, world axes, (n, 3) [N].
        before: loads of the gears before the first record, over the first load's size, (k,).
    """
    n, j = motor.shape
    moved, twist, geared = np.zeros((n, j, 6)), np.zeros((n, j)), np.zeros((n, j))
    for last in (False, False, False, True):
        turn, at = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
        centres, frames, masses = [], [], []
        for k, one in enumerate(joints):
            at = at + turn @ np.array([one.at, 0.0, 0.0])
            frame = turn @ one.axes
            at = at + np.einsum("nab,nb->na", frame, moved[:, k, :3])
            lean = np.einsum("nab,nb->na", frame, moved[:, k, 3:])
            turn = Rotation.from_rotvec(lean).as_matrix() @ turn
            about = (motor[:, k] + twist[:, k])[:, None] * np.array(one.axis)
            turn = turn @ Rotation.from_rotvec(about).as_matrix()
            centres.append(at)
            frames.append(frame)
            masses.append(at + turn @ np.array([one.centre, 0.0, 0.0]))
        tip = at + turn @ np.array([reach, 0.0, 0.0])
        place = tip + np.einsum("nab,bc,ndc,nd->na", turn, tool, turn, force)
        if not moved.any():  # pushes come slowly: inertia is that of the undeformed arm
            loads = [
                one.mass * (GRAVITY - np.gradient(np.gradient(mass, time, axis=0), time, axis=0))
                for one, mass in zip(joints, masses, strict=True)
            ]
        for k, one in enumerate(joints):
            push = force + sum(loads[k:])
            moment = np.cross(tip - centres[k], force)
            for load, mass in zip(loads[k:], masses[k:], strict=True):
                moment = moment + np.cross(mass - centres[k], load)
            own = np.concatenate(
                [np.einsum("nba,nb->na", frames[k], one) for one in (push, moment)], axis=1
            )
            moved[:, k] = own * np.array([*one.soft[:5], 0.0])
            if one.bearing is not None:
                cage = one.bearing.cage_angle + one.bearing.cage_ratio * motor[:, k]
                seat = None if last else one.bearing.seat  # in series to first order, at first
                if seat is not None:
                    moved[:, k] += seat.displacements(own)
                own_bearing = one.bearing if last else replace(one.bearing, seat=None)
                moved[:, k] += own_bearing.rests(own, cage)[0]
            if one.gear is not None:
                history = before * np.abs(own[:, 5]).max()
                geared[:, k] = one.gear.torsion([*history, *own[:, 5]])[len(history) :]
            twist[:, k] = geared[:, k] + one.soft[5] * own[:, 5]
    return place, geared


def log(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def elements(random: np.random.Generator, kind: str) -> tuple:
    """A rolling bearing as it is, as it is believed to be, and what is sought of it."""
    truth = {}
    seat = believed = None
    if "seat" in kind:
        size = {"radial": log(random, 2e7, 2e8), "axial": log(random, 2e7, 2e8)}
        size["tilt"] = log(random, 1e4, 2e5)
        seat = jp.Elasticity(**size)
        believed = jp.Elasticity(**{k: x * random.uniform(0.4, 2.5) for k, x in size.items()})
        truth = {f"{way} compliance": 1.0 / x for way, x in size.items()}
    factor = float(np.exp(0.1 * random.standard_normal()))
    if kind == "pair":
        drawn = jp.BallBearing(designation="7206 B", arrangement="DB", preload=200.0)
        preload = log(random, 30.0, 800.0)
        real, truth["preload"] = replace(drawn, preload=preload), preload
    else:
        drawn = (
            jp.CrossedRollerBearing(designation="RB5013")
            if kind.startswith("crossed")
            else jp.BallBearing(designation=str(random.choice(["6204", "6206", "6010/C3"])))
        )
        least = -4e-6 if random.random() < 0.3 else 2e-6
        clearance = random.uniform(least, 25e-6)
        real, truth["radial clearance"] = replace(drawn, radial_clearance=clearance), clearance
    truth["stiffness factor"] = factor
    real = replace(
        real,
        element_stiffness=factor * drawn.stiffness_of_element,
        cage_angle=random.uniform(0.0, 2.0 * np.pi),
        seat=seat,
    )
    return real, replace(drawn, seat=believed), truth


def strain_wave(random: np.random.Generator, each: bool) -> tuple:
    """A strain-wave gear as it is, as it is believed to be, and what is sought of it."""
    first = log(random, 1e4, 6e4)
    drawn = jp.StrainWaveGear(
        ratio=100.0, stiffness_1=first, stiffness_2=1.36 * first, stiffness_3=1.6 * first,
        torque_1=random.uniform(4.0, 15.0), torque_2=random.uniform(25.0, 50.0), rotor_inertia=0.1,
        hysteresis=log(random, 1e-4, 8e-4), rated_torque=200.0,
    )  # fmt: skip
    off = random.uniform(0.5, 2.0) * (1.0 + (0.3 if each else 0.03) * random.uniform(-1.0, 1.0, 3))
    believed = replace(
        drawn,
        stiffness_1=drawn.stiffness_1 * off[0],
        stiffness_2=drawn.stiffness_2 * off[1],
        stiffness_3=drawn.stiffness_3 * off[2],
        hysteresis=drawn.hysteresis * random.uniform(0.4, 2.5),
    )
    truth = {"gear compliance": 1.0 / drawn.stiffness_1, "hysteresis": drawn.hysteresis}
    truth["gear compliance 2"] = 1.0 / drawn.stiffness_2
    truth["gear compliance 3"] = 1.0 / drawn.stiffness_3
    return drawn, believed, truth


def arm(random: np.random.Generator, kind: str) -> tuple:
    """Joints of an arm, its reach, what is believed of its parts, and the truth by label."""
    upright = kind.startswith("crossed") or kind == "pair"
    axes = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)) if upright else ((0.0, 1.0, 0.0),) * 2
    bearings, gears, truth, joints, reach = {}, {}, {}, [], 0.0
    place = int(random.integers(2)) if not upright else 0
    for k, name in enumerate(("shoulder", "elbow")):
        length = random.uniform(0.3, 0.5)
        bearing = gear = None
        if k == place and ("ball" in kind or upright):
            bearing, bearings[name], own = elements(random, kind)
            truth |= {f"{name} {label}": x for label, x in own.items()}
        if kind.startswith("strain") and (k == 0 or random.random() < 0.5):
            gear, gears[name], own = strain_wave(random, kind.endswith("piece"))
            truth |= {f"{name} {label}": x for label, x in own.items()}
        across, along, tilt = (
            log(random, *ends) for ends in ((1e-10, 1e-8),) * 2 + ((1e-7, 1e-5),)
        )
        soft = np.array([across, across, along, tilt, tilt, log(random, 1e-7, 2e-5)])
        if gear is not None:  # links bend less than gears
            soft[5] = log(random, 0.01, 0.3) / gear.stiffness_1
        if bearing is not None and bearing.seat is not None:  # the seat is how it gives way
            soft[:5] = 0.0
        joints.append(
            Joint(
                axes[k], reach, random.uniform(2.0, 8.0), random.uniform(0.3, 0.6) * length, soft,
                bearing, gear,
            )
        )  # fmt: skip
        reach = length
    return joints, reach, bearings, gears, truth
