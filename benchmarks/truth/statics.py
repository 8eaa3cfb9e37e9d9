"""Journals at rest: peak forces, whether budget and run agree, and where friction can hold them.

    python benchmarks statics
    python benchmarks statics --parts runs --robots ur5 --poses 5
    python benchmarks statics --parts search --cases "ur5 elbow" --states 20000 --friction 0.1

`peaks`. UR5: play in the shoulder lift joint; UR5 and Panda: in every revolute joint; the shipped
slider-crank at 5000 rpm, the shipped four-bar at 600 rpm, and the SCARA with its weight.

`runs`. Random poses of UR5, Panda and SCARA, 0.1 mm of play in bearings of 60 x 50 mm, in one joint
and in all: where `budget` says that they rest, where a run with start="rest" begins, and whether
that lies where the budget says that friction can hold them; and where runs with friction end whose
journals are released from random places. The last line has the largest disagreement.

`search`. Where friction can hold loose joints: a brute-force search beside the budget's interval.
It shares nothing with `jointplay.accuracy.rest`. A journal is put in random places where
some of its rims and end faces touch; of each it is asked whether contact forces within their
cones of friction balance gravity there (non-negative least squares, exactly: to 1e-8 of the load).
Gravity and levers are Pinocchio's of the displaced machine. From states that balance it goes on
in steps of all sizes, from those that put the tool farthest most often, so that it creeps along
what is flat to its ends. Without friction: states of least potential energy, and as far as the
energy stays within rounding.

Two loose joints at once: each journal is balanced where the other is as well, for the load on it
is that of the machine as both have moved. From states of each alone, put together, the search
climbs towards both ends of every axis, by steps of one journal or both that both survive.

Printed: the search's interval and the budget's, along world x, y, z; which part of the search's
the budget's covers, and by which part of it the budget's goes beyond. Contacts are rigid here,
and in the mechanism that the budget is asked about 1e14 N/m^1.5.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from common import command
from scipy.optimize import minimize, nnls

import jointplay as jp
from jointplay.accuracy import poses
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.rest import AGREES_M
from jointplay.base.errors import require_known
from jointplay.base.tables import Table
from jointplay.model.robots import robot_urdf

BEARING = {
    "bearing_radius": 25e-3, "bearing_length": 50e-3,
    "radial_clearance": 5e-5, "axial_clearance": 5e-5,
}  # fmt: skip
POSES = {
    "ur5": [0.0, -1.2, 1.4, -0.2, 0.3, 0.0],
    "panda": [0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.7, 0.02, 0.02],
}
TURN, LASTS = 0.3, 0.5
"""Every revolute joint turns by so much [rad] in so long [s], from rest to rest."""


def arm(name: str, *joints: str) -> jp.Simulation:
    """A robot that moves all its joints, with play in some of them; none named: in all."""
    robot = jp.Mechanism(robot_urdf(name))
    turning = [j for j in robot.joints if robot.description.joints[j].kind != "prismatic"]
    start = np.array(POSES[name])
    end = start + TURN * np.array([joint in turning for joint in robot.joints])
    motion = jp.Motion(list(robot.joints), [0.0, LASTS], np.array([start, end]))
    play = {joint: jp.RevoluteClearance(**BEARING) for joint in joints or turning}
    return jp.Simulation(robot.with_clearance(play), motion, step=1e-5 if joints else 2e-6)


def simulations() -> dict[str, jp.Simulation]:
    found = {
        "UR5, shoulder lift": arm("ur5", "shoulder_lift_joint"),
        "UR5, all six": arm("ur5"),
        "Panda, all seven": arm("panda"),
    }
    for name, file, changes in (
        ("slider-crank, 0.2 mm", "slider_crank", {}),
        ("four-bar, 0.2 mm", "four_bar", {}),
        ("SCARA with its weight, 0.2 mm", "scara", {"robot": {"gravity": "loaded"}}),
    ):
        found[name] = jp.Scenario.load(f"jointplay:{file}.toml").simulation("0.2 mm", changes)
    return found


def peaks(lasts: float) -> Table:
    """Peak joint forces of runs from both starts, and what the search for rest costs."""
    heads = [
        *(("run", ""), ("centred: first 50 ms", "N"), ("then", "N"), ("at rest: first 50 ms", "N")),
        *(("then", "N"), ("pressed at rest", "N"), ("unbalanced", "N"), ("states tried", "")),
        ("time of the search", "s"),
    ]
    rows = []
    for name, simulation in simulations().items():
        duration = min(lasts, simulation.duration or lasts)
        jp.Run(replace(simulation, duration=duration))
        spent, forces = [], []
        for start in ("centred", "rest"):
            begun = replace(simulation, duration=duration, start=start, judge_from=0.0)
            began = time.process_time()
            rest = jp.Run(begun).rest
            spent.append(time.process_time() - began)
            result = begun.run(progress=True)
            force = np.linalg.norm(result["joint_force_peak"].values, axis=2).max(axis=1)
            early = result.time < min(0.05, 0.5 * duration)
            forces += [float(force[early].max()), float(force[~early].max())]
        found = rest.load, rest.residual, rest.trials, spent[1] - spent[0]
        rows.append((name, *forces, *found))
    return Table.of(heads, rows)


JOINTS = {
    "ur5": ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
            "wrist_2_joint", "wrist_3_joint"],
    "panda": [f"panda_joint{i}" for i in range(1, 8)],
    "scara": ["joint_a", "joint_b"],
}  # fmt: skip
FRICTION = 0.1


def standing(robot: jp.Mechanism, row: np.ndarray, **options: object) -> jp.Simulation:
    at = row[[robot.coordinate(name) for name in robot.joints]]
    motion = jp.Motion(list(robot.joints), [0.0, 1.0], np.array([at, at]))
    return jp.Simulation(robot, motion, limits="ignore", step=2e-6, **options)


def tool(robot: jp.Mechanism, q: np.ndarray) -> np.ndarray:
    pin.framesForwardKinematics(robot.model, robot.data, q)
    return robot.data.oMf[robot.tool_frame].translation.copy()


def agree(name: str, count: int, seed: int, released: int) -> tuple[float, int, int, int]:
    """Largest disagreement [m]; starts, starts outside the interval, and ends of runs outside."""
    random = np.random.default_rng(seed)
    worst, looked, outside, away = 0.0, 0, 0, 0
    for k in range(count):
        names = JOINTS[name] if k % 2 else [str(random.choice(JOINTS[name]))]
        case = Case(name, tuple(names), int(random.integers(2**31)), None)
        robot, pose = case.build()
        q = pose[None]
        places = [budget(robot, q, friction=mu) for mu in (0.0, FRICTION)]
        run = jp.Run(standing(robot, q[0], duration=1e-3, start="rest"))
        there = tool(robot, run.rest.q) - places[0].positions[0]
        differ = max(np.linalg.norm(there - one.rest_tool[0, :3]) for one in places)
        looked += 1
        ends = places[1].rest_interval[0, :3]
        out = np.maximum(ends[:, 0] - there, there - ends[:, 1]).max()
        outside += out > AGREES_M
        worst = max(worst, float(differ))
        print(f"{name} {k} {len(names)} loose: differ {1e6 * differ:.3g} µm", flush=True)
        if len(names) == 1 and released > 0:
            released -= 1
            fall = standing(robot, q[0], duration=0.3, start="centred", seed=k).run()
            last = fall["q"].values[fall.time > 0.28].mean(axis=0)
            end = tool(robot, last) - places[0].positions[0]
            out = np.maximum(ends[:, 0] - end, end - ends[:, 1]).max()
            away += out > AGREES_M
            print(f"{name} {k}: released, ends {1e6 * out:.3g} µm beyond the interval "
                  f"(negative: inside)", flush=True)  # fmt: skip
    return worst, looked, outside, away


# The search.


RIGID = 1e14
"""Stiffness of contacts [N/m^1.5]."""
CORNERS = 24
"""Of the polygon inside each cone of friction: it leaves out at most 0.9 %."""
BALANCED = 1e-8
"""Part of the load that a state may leave unbalanced."""
FLAT = 1e-7
"""Energy that counts as rounding, relative to what the load gains by falling through the play."""
STRATA = [
    rims + walls
    for rims in ((), ("A",), ("B",), ("A", "B"))
    for walls in ((), ("up",), ("down",), ("up", "down"))
    if rims + walls
]
"""Contacts: rims A, B at the upper and the lower end on the bore, and their faces on the walls."""


State = tuple[np.ndarray, tuple[str, ...]]
"""Of a journal: what `Journal.put` takes."""


@dataclass(frozen=True)
class Case:
    """Loose joints of a machine: one, or two at once."""

    robot: str
    joints: tuple[str, ...]
    seed: int
    """Of the pose."""
    stiffness: float | None = RIGID
    """Of contacts [N/m^1.5]; None: that of the bearing's dimensions."""

    def build(self) -> tuple[jp.Mechanism, np.ndarray]:
        path = jp.shipped("scara.urdf") if self.robot == "scara" else robot_urdf(self.robot)
        tools = {"ur5": {"tool": "tool0"}, "panda": {"tool": "panda_hand_tcp"}}
        loose = jp.RevoluteClearance(
            bearing_radius=30e-3, bearing_length=50e-3, radial_clearance=1e-4,
            axial_clearance=1e-4, stiffness=self.stiffness
        )  # fmt: skip
        mechanism = jp.Mechanism(
            path,
            dict.fromkeys(self.joints, loose),
            gravity=(0.0, 0.0, -9.81),
            **tools.get(self.robot, {}),
        )
        return mechanism, poses.over_workspace(mechanism, 1, seed=self.seed)[0]


CASES = {
    "ur5 elbow": Case("ur5", ("elbow_joint",), 3),
    "ur5 pan, vertical axis": Case("ur5", ("shoulder_pan_joint",), 5),
    "ur5 lift": Case("ur5", ("shoulder_lift_joint",), 2),
    "ur5 wrist 1": Case("ur5", ("wrist_1_joint",), 4),
    "ur5 wrist 2": Case("ur5", ("wrist_2_joint",), 6),
    "panda 2": Case("panda", ("panda_joint2",), 7),
    "panda 4": Case("panda", ("panda_joint4",), 8),
    "scara a, vertical axis": Case("scara", ("joint_a",), 9),
    "scara b, vertical axis": Case("scara", ("joint_b",), 10),
}
PAIRS = {
    "ur5 lift and elbow": Case("ur5", ("shoulder_lift_joint", "elbow_joint"), 2),
    "ur5 pan and lift": Case("ur5", ("shoulder_pan_joint", "shoulder_lift_joint"), 5),
    "ur5 elbow and wrist 1": Case("ur5", ("elbow_joint", "wrist_1_joint"), 3),
    "ur5 pan and wrist 2": Case("ur5", ("shoulder_pan_joint", "wrist_2_joint"), 6),
    "scara a and b, vertical axes": Case("scara", ("joint_a", "joint_b"), 9),
}


class Journal:
    """One loose journal of a machine that stands: places, loads and contacts, all rigid."""

    def __init__(self, mechanism: jp.Mechanism, q: np.ndarray, name: str) -> None:
        joint = mechanism.clearance[name]
        self.radial, self.axial = joint.cr, joint.ca
        self.radius, self.length = joint.rj, joint.lj
        self.model, self.q = mechanism.model, q
        self.data = self.model.createData()
        self.first = mechanism.virtual_link(name)
        self.coordinates = self.first + np.array([0, 1, 2, 4, 5])
        self.frame = mechanism.tool_frame
        self.ideal = self.place(np.zeros(5))

    def configuration(self, xi: np.ndarray) -> np.ndarray:
        q = self.q.copy()
        q[self.coordinates] = xi
        return q

    def place(self, xi: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, self.configuration(xi))
        return self.data.oMf[self.frame].translation.copy()

    def error(self, xi: np.ndarray) -> np.ndarray:
        return self.place(xi) - self.ideal

    def load(self, xi: np.ndarray) -> np.ndarray:
        """Gravity's force on x, y, z, pitch, roll [N, N m]."""
        weight = -pin.computeGeneralizedGravity(self.model, self.data, self.configuration(xi))
        return weight[self.coordinates]

    def axes(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """About which pitch and roll turn, in the bearing (2, 3); and the journal's axis there."""
        yaw, pitch, roll = self.q[self.first + 3], xi[3], xi[4]
        z = pin.utils.rotate("z", yaw)
        y = z @ pin.utils.rotate("y", pitch)
        return np.array([z[:, 1], y[:, 0]]), (y @ pin.utils.rotate("x", roll))[:, 2]

    def rims(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Centres of both rims across the bore, and the lean, each (2,)."""
        _, axis = self.axes(xi)
        lean = axis[:2]
        return xi[:2] + 0.5 * self.length * lean, xi[:2] - 0.5 * self.length * lean, lean

    def bore(self, rim: np.ndarray, lean: np.ndarray) -> float:
        """How far from the axis a rim may be, a circle that leans (2,) [m]."""
        along = rim @ lean / max(np.linalg.norm(rim), 1e-300)
        return self.radial + 0.5 * self.radius * float(along) ** 2

    def way(self, lean: np.ndarray) -> float:
        """How far up or down the centre may be of a journal that leans [m]."""
        steep = float(np.linalg.norm(lean))
        return self.axial + 0.25 * self.length * steep**2 - self.radius * steep

    @property
    def widest(self) -> float:
        """Distance of the rims' centres across the bore at which both faces touch [m]."""
        root = np.sqrt(self.radius**2 - self.length * self.axial)
        return float(2.0 * (self.radius - root))

    def room(self, xi: np.ndarray) -> np.ndarray:
        """What is left of the clearance at A, B, up, down, to the second order [m]."""
        p, q, lean = self.rims(xi)
        way = self.way(lean)
        return np.array([
            self.bore(p, lean) - np.linalg.norm(p), self.bore(q, lean) - np.linalg.norm(q),
            way - xi[2], way + xi[2]
        ])  # fmt: skip

    def leaning(self, p: np.ndarray, q: np.ndarray, z: float) -> np.ndarray:
        """The place of the journal with rims at p and q."""
        lean = (p - q) / self.length
        yaw = self.q[self.first + 3]
        along, across = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        # The axis is Rz(yaw) (sin pitch cos roll, -sin roll, cos pitch cos roll).
        roll = -np.arcsin(across @ lean)
        pitch = np.arcsin(along @ lean / np.cos(roll))
        return np.array([*(0.5 * (p + q)), z, pitch, roll])

    def columns(self, xi: np.ndarray, touching: tuple[str, ...], mu: float) -> np.ndarray:
        """Forces on x, y, z, pitch, roll by the edges of each touching contact's cone, (5, k)."""
        p, q, lean = self.rims(xi)
        turns, axis = self.axes(xi)
        e_z = np.array([0.0, 0.0, 1.0])
        flat = np.linalg.norm(lean) * self.radius < 1e-9 * self.axial
        places = []
        for name, rim, side in (("A", p, 1.0), ("B", q, -1.0)):
            if name in touching:
                out = np.array([*(rim / np.linalg.norm(rim)), 0.0])
                arm = side * 0.5 * self.length * axis + self.radius * out
                places.append((arm, -out, np.cross(e_z, out), e_z))
        for name, side in (("up", 1.0), ("down", -1.0)):
            if name in touching:
                if flat:
                    angles = np.arange(16) * np.pi / 8.0
                    outs = np.column_stack([np.cos(angles), np.sin(angles)])
                else:
                    outs = -side * lean[None] / np.linalg.norm(lean)
                for out in outs:
                    arm = side * 0.5 * self.length * axis
                    arm = arm + self.radius * np.array([*out, 0.0])
                    places.append((arm, -side * e_z, np.eye(3)[0], np.eye(3)[1]))
        angles = np.arange(CORNERS) * 2.0 * np.pi / CORNERS
        columns = []
        for arm, normal, one, other in places:
            if mu > 0.0:
                across = np.outer(np.cos(angles), one) + np.outer(np.sin(angles), other)
                forces = normal + mu * across
            else:
                forces = normal[None]
            turned = np.cross(arm, forces) @ turns.T
            columns.append(np.hstack([forces, turned]))
        return np.concatenate(columns).T

    def balanced(self, xi: np.ndarray, touching: tuple[str, ...], mu: float) -> bool:
        """Whether contacts within their cones balance gravity."""
        weight = np.array([1.0, 1.0, 1.0, 1.0 / self.radius, 1.0 / self.radius])
        right = -self.load(xi) * weight
        matrix = self.columns(xi, touching, mu) * weight[:, None]
        # One contact that presses balances what the sum of columns does not: columns are scaled.
        return bool(nnls(matrix, right)[1] <= BALANCED * np.linalg.norm(right))

    def put(self, u: np.ndarray, touching: tuple[str, ...]) -> np.ndarray | None:
        """The place of parameters u: p, q in the bore and z in the way, put on what touches."""
        p, q, z = self.radial * u[:2], self.radial * u[2:4], self.axial * u[4]
        if np.isnan(u[5]):  # upright: rims one above the other
            q = p.copy()
        for _ in range(4):  # room grows with the lean, and this is of the room
            lean = (p - q) / self.length
            if "A" in touching:
                p = self.bore(p, lean) * p / max(np.linalg.norm(p), 1e-300)
            if "B" in touching:
                q = self.bore(q, lean) * q / max(np.linalg.norm(q), 1e-300)
            if "up" in touching and "down" in touching:
                held = self.held_apart(p, q, touching)
                if held is None:
                    return None
                p, q = held
        way = self.way((p - q) / self.length)
        if "up" in touching:
            z = 0.0 if "down" in touching else way
        elif "down" in touching:
            z = -way
        xi = self.leaning(p, q, z)
        return xi if (self.room(xi) >= -1e-10).all() else None

    def held_apart(
        self, p: np.ndarray, q: np.ndarray, touching: tuple[str, ...]
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Rims moved to be as far apart as both walls let them."""
        apart, widest = np.linalg.norm(p - q), self.widest
        if apart < 1e-12:
            return None
        if "A" not in touching:
            return q + widest * (p - q) / apart, q
        if "B" not in touching:
            return p, p + widest * (q - p) / apart
        radius = 0.5 * (np.linalg.norm(p) + np.linalg.norm(q))
        if widest > 2.0 * radius:
            return None
        half, mid = np.arcsin(0.5 * widest / radius), np.arctan2(*(p + q)[::-1])
        side = np.sign(p[0] * q[1] - p[1] * q[0]) or 1.0
        first, second = (
            radius * np.array([np.cos(mid + k), np.sin(mid + k)])
            for k in (-side * half, side * half)
        )
        return first, second


def search(
    journal: Journal,
    mu: float,
    states: int,
    seed: int = 0,
    tries: int = 400_000,
    patience: int = 4000,
) -> tuple[np.ndarray, list[State]]:
    """The tool's errors in states that friction holds, of every kind of contact, (m, 3) [m]."""
    random = np.random.default_rng(seed)
    found: dict[tuple, list[np.ndarray]] = {}
    errors: dict[tuple, list[np.ndarray]] = {}
    kinds = [(one, upright) for one in STRATA for upright in (False, True)]
    # Upright rims touch together, and on the same side.
    kinds = [
        (one, upright) for one, upright in kinds
        if not (upright and (("A" in one) != ("B" in one) or {"up", "down"} <= set(one)))
    ]  # fmt: skip
    # A frictionless place of rest, from which to begin as well.
    begun = [parameters(journal, xi) for xi in lowest(journal, random)]
    tried = {kind: 0 for kind in kinds}
    total = 0
    while total < tries and sum(map(len, found.values())) < states:
        for kind in kinds:
            touching, upright = kind
            held = found.get(kind, [])
            if tried[kind] > patience and not held:
                continue
            for _ in range(20):
                tried[kind] += 1
                total += 1
                if held and random.random() < 0.95:
                    if random.random() < 0.6:  # from the ends outwards
                        way = random.normal(size=3)
                        some = random.integers(0, len(held), min(len(held), 60))
                        here = max(some, key=lambda i: errors[kind][i] @ way)
                    else:
                        here = random.integers(len(held))
                    u = held[here] + 10.0 ** random.uniform(-4.0, 0.0) * random.normal(size=6)
                elif random.random() < 0.7 and begun:
                    u = begun[random.integers(len(begun))]
                    u = u + 10.0 ** random.uniform(-5.0, 0.0) * random.normal(size=6)
                else:
                    u = random.uniform(-1.0, 1.0, 6)
                u[5] = np.nan if upright else 0.0
                xi = journal.put(u, touching)
                if xi is None or not journal.balanced(xi, touching, mu):
                    continue
                found.setdefault(kind, []).append(parameters(journal, xi))
                errors.setdefault(kind, []).append(journal.error(xi))
                held = found[kind]
    for kind, some in errors.items():
        label = "+".join(kind[0]) + (" upright" if kind[1] else "")
        print(f"    {label}: {len(some)} states of {tried[kind]} tried")
    every = np.array([one for some in errors.values() for one in some]).reshape(-1, 3)
    return every, [
        (np.array([*one[:5], np.nan if upright else 0.0]), touching)
        for (touching, upright), some in found.items() for one in some
    ]  # fmt: skip


def together(
    journals: list[Journal], xis: list[np.ndarray], states: list[State], mu: float
) -> bool:
    """Whether friction holds all journals, each under the load that it has with all displaced."""
    for journal, xi in zip(journals, xis, strict=True):
        for other in journals:
            other.q = other.q.copy()
            other.q[journal.coordinates] = xi
    return all(
        journal.balanced(xi, touching, mu)
        for journal, xi, (_, touching) in zip(journals, xis, states, strict=True)
    )


def search_together(
    journals: list[Journal], mu: float, states: int, climbs: int = 2, steps: int = 1500
) -> np.ndarray:
    """The tool's errors at the ends of what friction holds of several journals at once, (m, 3)."""
    random = np.random.default_rng(1)
    alone = [search(journal, mu, states, patience=1000) for journal in journals]
    ends, tried, held = [], 0, 0

    def moved(xis: list[np.ndarray]) -> np.ndarray:
        q = journals[0].q.copy()
        for journal, xi in zip(journals, xis, strict=True):
            q[journal.coordinates] = xi
        journals[0].q = q
        return journals[0].error(xis[0])

    for axis in range(3):
        for sign in (1.0, -1.0):
            order = [np.argsort(-sign * errors[:, axis]) for errors, _ in alone]
            for _ in range(climbs):
                now: list[State] | None = None
                best, rank = -np.inf, 1
                for _ in range(steps):
                    tried += 1
                    if now is None or random.random() < 0.1:  # of each alone, from the ends
                        rank = min(rank + 1 if now is None else 30, *map(len, order))
                        chosen = [
                            some[one[int(rank * random.random() ** 2)]]
                            for one, (_, some) in zip(order, alone, strict=True)
                        ]
                        if now is not None:
                            kept = random.integers(len(journals))
                            chosen[kept] = now[kept]
                    else:
                        chosen = list(now)
                        change = random.integers(1, 2 ** len(journals))
                        size = 10.0 ** random.uniform(-4.5, 0.0)
                        for j, (u, touching) in enumerate(now):
                            if change >> j & 1:
                                chosen[j] = (u + size * random.normal(size=6), touching)
                                if np.isnan(u[5]):
                                    chosen[j][0][5] = np.nan
                    put = [j.put(u, on) for j, (u, on) in zip(journals, chosen, strict=True)]
                    there = [xi for xi in put if xi is not None]
                    if len(there) < len(journals):
                        continue
                    error = moved(there)
                    if sign * error[axis] <= best or not together(journals, there, chosen, mu):
                        continue
                    held += 1
                    now, best = chosen, sign * error[axis]
                    ends.append(error)
    print(f"    together: {held} steps of {tried} tried")
    return np.array(ends)


def parameters(journal: Journal, xi: np.ndarray) -> np.ndarray:
    """What `Journal.put` takes."""
    p, q, _ = journal.rims(xi)
    return np.array([*(p / journal.radial), *(q / journal.radial), xi[2] / journal.axial, 0.0])


BOUNDS = [(-2.5, 2.5)] * 5


def problem(journal: Journal):
    """What makes displacements of size one, their energy, and that they stay in the bearing."""
    scale = np.array([journal.radial] * 2 + [journal.axial] + [journal.radial / journal.length] * 2)
    load = np.abs(journal.load(np.zeros(5)) * scale).sum() or 1.0

    def energy(y: np.ndarray) -> float:  # midpoint rule: quadratic in small displacements
        return -(journal.load(0.5 * y * scale) @ (y * scale)) / load

    room = {"type": "ineq", "fun": lambda y: journal.room(y * scale) / journal.radial}
    return scale, energy, room


def lowest(journal: Journal, random: np.random.Generator, starts: int = 12) -> list[np.ndarray]:
    """Places of least energy, from several starts."""
    scale, energy, inside = problem(journal)
    results = []
    for k in range(starts):
        y = 0.3 * random.normal(size=5) if k else np.zeros(5)
        options = {"ftol": 1e-14, "maxiter": 300}
        found = minimize(energy, y, constraints=[inside], bounds=BOUNDS, options=options)
        if journal.room(found.x * scale).min() > -1e-9:
            results.append((found.fun, found.x * scale))
    least = min((value for value, _ in results), default=0.0)
    return [xi for value, xi in results if value <= least + FLAT]


def flat(journal: Journal, seed: int = 0) -> np.ndarray:
    """Errors at the ends of the set of least energy, (m, 3) [m]."""
    random = np.random.default_rng(seed)
    scale, energy, inside = problem(journal)
    begun = lowest(journal, random, 24)
    least = min(energy(xi / scale) for xi in begun)
    low = {"type": "ineq", "fun": lambda y: 1e6 * (least + FLAT - energy(y))}
    ends = [journal.error(xi) for xi in begun]
    size = max(np.linalg.norm(one) for one in ends) or journal.radial
    for axis in range(3):
        for sign in (1.0, -1.0):
            for xi in begun[:8]:
                found = minimize(
                    lambda y, a=axis, s=sign: -s * journal.error(y * scale)[a] / size,
                    xi / scale, constraints=[inside, low], bounds=BOUNDS,
                    options={"ftol": 1e-10, "maxiter": 300}
                )  # fmt: skip
                good = journal.room(found.x * scale).min() > -1e-9
                if good and energy(found.x) <= least + 1.1 * FLAT:
                    ends.append(journal.error(found.x * scale))
    return np.array(ends)


def compare(name: str, case: Case, mu: float, states: int) -> tuple[float, float]:
    mechanism, q = case.build()
    journals = [Journal(mechanism, q, joint) for joint in case.joints]
    begun = time.process_time()
    print(f"{name}, friction {mu:g}")
    if len(journals) > 1:
        errors = search_together(journals, mu, states)
    else:
        errors = search(journals[0], mu, states)[0] if mu > 0.0 else flat(journals[0])
    spent = time.process_time() - begun
    begun = time.process_time()
    found = budget(mechanism, q[None], friction=mu, drive=jp.loads.Prescribed())
    ends = found.rest_interval[0, :3]
    took = time.process_time() - begun
    rest = found.rest_tool[0, :3]
    covered, beyond = 1.0, 0.0
    play = found.axis_worst[0].sum(axis=0)[:3]
    for axis in range(3):
        low, high = errors[:, axis].min(), errors[:, axis].max()
        width = max(high - low, 0.02 * play[axis])
        part = 1.0 - (max(ends[axis, 0] - low, 0.0) + max(high - ends[axis, 1], 0.0)) / width
        over = (max(low - ends[axis, 0], 0.0) + max(ends[axis, 1] - high, 0.0)) / width
        covered, beyond = min(covered, part), max(beyond, over)
        print(
            f"  {'xyz'[axis]}: search {1e6 * low:9.2f} to {1e6 * high:9.2f}, budget "
            f"{1e6 * ends[axis, 0]:9.2f} to {1e6 * ends[axis, 1]:9.2f} µm (rest "
            f"{1e6 * rest[axis]:.2f}, play {1e6 * play[axis]:.0f}): covers {100 * part:.1f} %, "
            f"beyond by {100 * over:.1f} %"
        )
    print(
        f"  {len(errors)} states in {spent:.1f} s, budget {took:.2f} s; second order "
        f"{1e6 * found.second_order[0]:.2g} µm", flush=True
    )  # fmt: skip
    return covered, beyond


def searched(options) -> None:
    """Search all cases that are chosen."""
    covered, beyond = [], []
    for name in options.cases.split(",,"):
        chosen = (CASES | PAIRS)[name]
        for mu in map(float, options.friction.split(",")):
            if mu == 0.0 and name in PAIRS:  # a place, and the sum of what each has flat
                continue
            for k in range(options.repeats):
                case = replace(chosen, seed=chosen.seed + 100 * k)
                one = compare(name, case, mu, options.states)
                covered.append(one[0])
                beyond.append(one[1])
    print(
        f"{len(covered)} cases: the budget covers at least {100 * min(covered):.1f} %, goes beyond "
        f"by at most {100 * max(beyond):.1f} % (of widths at least 2 % of the play)"
    )


def begun(options) -> None:
    """Compare budget and runs at random poses."""
    worst, looked, outside, away = 0.0, 0, 0, 0
    for name in options.robots.split(","):
        one = agree(name, options.poses, options.seed, options.released)
        worst, looked = max(worst, one[0]), looked + one[1]
        outside, away = outside + one[2], away + one[3]
    print(f"seed {options.seed}: worst disagreement of budget and start=\"rest\" {1e6 * worst:.3g} "
          f"µm at {looked} poses, stated {1e6 * AGREES_M:g} µm; {outside} starts, {away} ends of "
          f"runs with friction outside the interval")  # fmt: skip


PARTS = ("peaks", "search", "runs")


def main() -> None:
    options = command(
        __doc__,
        "one case with few states, two poses and a run of the SCARA",
        parts=(",".join(PARTS), "which, with commas between"),
        lasts=(0.3, "peaks: simulated time [s]"),
        poses=(30, "runs: random poses of each robot"),
        released=(3, "runs: of each robot that end"),
        robots=(",".join(JOINTS), "runs: which, with commas between"),
        seed=(1, "runs: of the poses"),
        cases=(",,".join(CASES | PAIRS), "search: names, with ,, between them"),
        states=(6000, "search: that balance, of each case"),
        friction=("0.1,0", "search: coefficients"),
        repeats=(1, "search: random poses of each case"),
    ).parse_args()
    if options.quick:
        options.parts, options.robots = "search,runs", "scara"
        options.poses, options.released = 2, 1
        options.cases, options.states, options.friction = "scara b, vertical axis", 500, "0.1"
    parts = options.parts.split(",")
    for part in parts:
        require_known("part", part, PARTS)
    if "peaks" in parts:
        print(peaks(options.lasts).markdown())
    if "search" in parts:
        searched(options)
    if "runs" in parts:
        begun(options)
