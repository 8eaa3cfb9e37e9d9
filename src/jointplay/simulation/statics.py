"""Where a machine stands: the equilibrium of all journals under gravity and drives.

The potential energy of gravity, drives (springs about their reference), gears, loads and contacts
is made as small as can be by Newton's method in a trust region; docs/statics.md says what is
solved, and what rest means where the start moves.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.joints import VIRTUAL_LINK, Clearance
from jointplay.kernel.workspace import Workspace
from jointplay.loads.drive import Drive, JointFriction
from jointplay.mechanism.loop import ANGLE_ARM_M, closing_rows, misfit
from jointplay.mechanism.mechanism import Mechanism
from jointplay.simulation.descent import Place, step_within
from jointplay.simulation.elastic import ElasticJoint
from jointplay.simulation.standing import StandingLoads, relative_motion, relative_pose

TOLERANCE = 1e-4
"""Unbalanced force, relative to the largest force of a joint, below which a state is at rest."""

SOLVED = 1e-10
"""The same at which the search ends."""

MOST_TRIALS = 100
"""States tried of all joints together, before the search goes on joint by joint or is given up."""

MOST_LOCAL = 150
"""States tried of one joint."""

_ANGLE = 1e-3
"""Displacement by which a joint is asked what its ideal twin would follow [m or rad]."""


@dataclass(frozen=True)
class Rest:
    """An equilibrium, or where the search for it ended."""

    q: np.ndarray
    """Configuration, shape (nq,)."""
    residual: float
    """Largest unbalanced force: work per way, for ways as long as the clearance [N]."""
    load: float
    """Largest elastic force of a joint, or the weight if none is pressed [N]."""
    trials: int
    """States tried."""
    inside: bool
    """Whether all journals are in their bearings still."""

    @property
    def solved(self) -> bool:
        """Whether what is left unbalanced is little beside the load, less than friction holds."""
        return bool(self.inside and self.residual <= TOLERANCE * self.load)


def limited(joint: Clearance) -> list[str]:
    """Those of a joint's freedoms that nothing but its clearance limits, of `VIRTUAL_LINK`."""
    freedoms = []
    for axis, part in enumerate(VIRTUAL_LINK[:3]):
        centre = _ANGLE * np.eye(3)[axis]
        if part in joint.freedoms and joint.room_to_start.get(part, 0.0) > 0.0:
            _, follows = joint.ideal_part(np.eye(3), centre)
            freedoms += [part] if abs(follows[axis]) < 0.5 * _ANGLE else []
    for axis, part in zip((2, 1, 0), VIRTUAL_LINK[3:], strict=True):
        turn = pin.exp3(_ANGLE * np.eye(3)[axis])
        if part in joint.freedoms:
            follows, _ = joint.ideal_part(turn, np.zeros(3))
            freedoms += [part] if np.linalg.norm(pin.log3(follows)) < 0.5 * _ANGLE else []
    return freedoms


class Balance:
    """Potential energy of a machine that stands, and its slopes.

    Args:
        mechanism: with clearance, or gears with play.
        bodies: its model, payloads in hand.
        workspace: has drives, gears and the state that the search begins with.
        drives: of every moving joint.
        friction: by joint.
        loads: what else acts.
        acceleration: of the reference, journals at rest in their bearings, shape (nv,).
        given: coordinates that stay where they are.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        bodies: pin.Model,
        workspace: Workspace,
        drives: Mapping[str, Drive],
        friction: Mapping[str, JointFriction],
        loads: StandingLoads,
        acceleration: np.ndarray,
        given: Collection[int] = (),
    ) -> None:
        """Find what may move, and what acts on it."""
        self._mechanism, self._model, self._data = mechanism, bodies, bodies.createData()
        self._start, self._speed = workspace.q.copy(), workspace.v.copy()
        self._acceleration, self._loads = acceleration, loads
        nv = bodies.nv
        self._elastic = {name: ElasticJoint(one) for name, one in mechanism.clearance.items()}
        self._frames = {
            name: (mechanism.bearing_frame(name), mechanism.journal_frame(name))
            for name in mechanism.clearance
        }
        self._signs = {name: mechanism.signs(name) for name in mechanism.clearance}
        self._springs, self._constant = np.zeros(nv), np.zeros(nv)
        self._rest = self._start.copy()
        self._gears = list(workspace.gears)
        self._trailing: dict[int, int] = {}  # motors whose encoder sees the link
        sprung = self._drives(workspace, drives)
        for name, losses in friction.items():
            at = mechanism.coordinate(name)
            self._constant[at] -= float(losses.torque(self._speed[at : at + 1])[0])
        self._ideal = sorted(set(mechanism.loops) - set(mechanism.clearance))
        self._inertia, self._given = np.zeros(nv), np.zeros(nv)
        self.refresh(self._start)
        self.basis = self._find_basis(sprung, drives, set(given))
        self.scale, self._room = self._scales()

    def _drives(self, workspace: Workspace, drives: Mapping[str, Drive]) -> set[int]:
        """Make springs of the drives; returns the coordinates that they hold."""
        mechanism, reference = self._mechanism, workspace.reference[0]
        nu = len(reference) // 3
        sprung: set[int] = set()
        followed = {mechanism.motor(n): n for n, one in drives.items() if one.follows}
        for row in workspace.drives:
            at, seen = int(row["coordinate"]), int(row["seen"])
            if at not in followed or row["armature"] > 0.0:
                continue
            # A motor whose encoder sits behind the play holds the link, and trails behind it.
            if seen != at:
                self._trailing[at] = seen
            u = int(row["column"])
            ahead = row["kd"] * (reference[nu + u] - self._speed[seen])
            self._springs[seen] += row["kp"]
            self._rest[seen] = reference[u]
            self._constant[seen] += reference[2 * nu + u] + ahead
            sprung |= {seen, mechanism.coordinate(followed[at])}
        geared = {mechanism.motor(name) for name in mechanism.gears}
        # Links hang on the teeth of prescribed motors too.
        for at in geared & set(followed) - set(self._trailing):
            sprung.add(mechanism.coordinate(followed[at]))
        return sprung

    def _find_basis(
        self, sprung: set[int], drives: Mapping[str, Drive], given: set[int]
    ) -> np.ndarray:
        """Directions in which the machine can come to rest, shape (nv, n)."""
        mechanism = self._mechanism
        nv = self._model.nv
        play, own = set(), set()
        blocks: dict[str, set[int]] = {}
        for name, joint in mechanism.clearance.items():
            if name in mechanism.loops:
                continue
            members = {
                part: mechanism.coordinates.index(f"{name}.{part}") for part in joint.freedoms
            }
            own |= set(members.values())
            film = joint.film is not None and not joint.film[0].hybrid
            if not film and not given & set(members.values()):
                blocks[name] = {members[part] for part in limited(joint)}
                play |= blocks[name]
        own -= {mechanism.coordinate(n) for n in mechanism.clearance if n not in mechanism.loops}
        every = np.eye(nv)
        columns = [every[:, sorted((play | sprung) - given)]]
        # What moves one journal only, unless it has to close an ideal loop.
        self._blocks = {} if self._ideal else {n: sorted(at) for n, at in blocks.items() if at}
        # Joints that no drive holds are held where they are, as far as loops leave them free.
        held = {mechanism.motor(n) for n, one in drives.items() if one.follows}
        held |= {mechanism.coordinate(n) for n, one in drives.items() if one.follows}
        held |= own | play | sprung | given | set(map(int, self._trailing))
        held |= {mechanism.motor(n) for n in mechanism.gears}
        rest = np.array([i for i in range(nv) if i not in held], int)
        if mechanism.loops and len(rest):
            rows = closing_rows(mechanism, self._start)[:, rest]
            _, sizes, right = np.linalg.svd(rows, full_matrices=False)
            kept = right[sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-9)]
            columns.append(every[:, rest] @ kept.T)
        basis = np.hstack(columns)
        self._movable = basis
        if self._ideal and basis.shape[1]:
            rows = closing_rows(mechanism, self._start, self._ideal) @ basis
            _, sizes, right = np.linalg.svd(rows)
            rank = int(np.sum(sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-9)))
            basis = basis @ right[rank:].T
        return basis

    def _scales(self) -> tuple[np.ndarray, float]:
        """How far each direction moves until a journal has crossed its clearance, and that [m]."""
        joints = self._mechanism.clearance
        pin.computeJointJacobians(self._model, self._data, self._start)
        scale = np.full(self.basis.shape[1], np.inf)
        for name, joint in joints.items():
            moves = self._jacobian(name) @ self.basis
            way = np.linalg.norm(moves[:3], axis=0)
            way += self._elastic[name].reach * np.linalg.norm(moves[3:], axis=0)
            with np.errstate(divide="ignore"):
                scale = np.minimum(scale, joint.radial_room / way)
        rooms = [joint.radial_room for joint in joints.values()]
        plays = [float(row["half_play"]) for row in self._gears]
        room = min(rooms, default=min(plays, default=1e-4) or 1e-4)
        return np.where(np.isfinite(scale), scale, room), room

    def refresh(self, q: np.ndarray) -> None:
        """Reckon inertia forces of a moving start and given loads anew, in configuration q."""
        if self._speed.any() or self._acceleration.any():
            whole = pin.rnea(self._model, self._data, q, self._speed, self._acceleration)
            weight = pin.computeGeneralizedGravity(self._model, self._data, q)
            self._inertia = whole - weight
        self._given = self._loads.given(self._model, self._data, q, self._speed)

    def _pose(self, name: str) -> np.ndarray:
        return relative_pose(self._data, self._frames[name])

    def _jacobian(self, name: str) -> np.ndarray:
        return relative_motion(self._data, self._frames[name], self._signs[name])

    def energy(self, q: np.ndarray, names: Collection[str]) -> float:
        """Potential energy [J], of contacts of the joints `names`; infinite where a law fails."""
        away = q - self._start
        pin.forwardKinematics(self._model, self._data, q)
        total = pin.computePotentialEnergy(self._model, self._data, q)
        pull = self._rest - q
        total += 0.5 * float(self._springs @ pull**2) - float(self._constant @ away)
        total += float((self._inertia - self._given) @ away) + self._loads.energy(self._data, q)
        for name in names:
            total += self._elastic[name].energy(self._pose(name))
        for row in self._gears:
            if int(row["motor"]) not in self._trailing:
                depth = abs(q[row["motor"]] - q[row["link"]]) - row["half_play"]
                total += 0.5 * row["stiffness"] * max(depth, 0.0) ** 2
        return float(total) if np.isfinite(total) else np.inf

    def slopes(self, q: np.ndarray, names: Collection[str]) -> tuple[np.ndarray, np.ndarray, float]:
        """Gradient (nv,) and curvature (nv, nv) of the energy, and the largest joint force [N]."""
        curvature = pin.computeGeneralizedGravityDerivatives(self._model, self._data, q)
        curvature = np.array(curvature).reshape(len(q), len(q)) + np.diag(self._springs)
        gradient = pin.computeGeneralizedGravity(self._model, self._data, q).copy()
        gradient += self._inertia - self._constant - self._springs * (self._rest - q)
        pin.computeJointJacobians(self._model, self._data, q)
        slope, bend = self._loads.slopes(self._data, q)
        gradient, curvature = gradient + (slope - self._given), curvature + bend
        load = 0.0
        for name in names:
            one = self._elastic[name]
            pose, moves = self._pose(name), self._jacobian(name)
            wrench = one.wrench(pose)
            gradient -= moves.T @ wrench
            curvature += moves.T @ one.stiffness(pose) @ moves
            load = max(load, float(np.linalg.norm(wrench[:3])))
        for row in self._gears:
            m, k = int(row["motor"]), int(row["link"])
            twist = q[m] - q[k]
            depth = abs(twist) - row["half_play"]
            if depth > 0.0 and m not in self._trailing:
                torque = np.sign(twist) * row["stiffness"] * depth
                gradient[m] += torque
                gradient[k] -= torque
                curvature[[m, k], [m, k]] += row["stiffness"]
                curvature[[m, k], [k, m]] -= row["stiffness"]
        return gradient, curvature, load

    def close(self, q: np.ndarray) -> np.ndarray:
        """q with its ideal loops closed again, which displacements open a little."""
        for _ in range(2 if self._ideal else 0):
            parts = misfit(self._mechanism, q)
            rows = []
            for name in self._ideal:
                moves = self._mechanism.relative_jacobian(name, q)
                # The tips of the axes; a ball has none.
                tips = ANGLE_ARM_M * np.array([moves[4], -moves[3]])
                rows.append(np.concatenate([moves[:3], tips])[: len(parts[name])])
            gap = np.concatenate([parts[name] for name in self._ideal])
            jacobian = np.concatenate(rows) @ self._movable
            q = q - self._movable @ np.linalg.lstsq(jacobian, gap, rcond=1e-10)[0]
        return q

    def trail(self, q: np.ndarray) -> np.ndarray:
        """q with those motors behind their teeth whose encoders see the link."""
        q = q.copy()
        for row in self._gears:
            m, k = int(row["motor"]), int(row["link"])
            if m in self._trailing:
                torque = self._springs[k] * (self._rest[k] - q[k]) + self._constant[k]
                side = np.sign(torque)
                q[m] = q[k] + side * (row["half_play"] + abs(torque) / row["stiffness"])
        return q

    def weight(self) -> float:
        """Weight of all bodies [N]."""
        gravity = float(np.linalg.norm(self._model.gravity.linear))
        return gravity * float(pin.computeTotalMass(self._model))

    def settle(self) -> Rest:
        """Search for the equilibrium next to the start, downhill."""
        q, trials, residual, load = self._start.copy(), 0, 0.0, 0.0
        moving = self._speed.any() or self._acceleration.any()
        for _ in range(3 if moving else 2):
            self.refresh(q)
            # Joint by joint first: what the others do to its load is of second order.
            for name, at in self._blocks.items():
                q, *_ = self._descend(q, MOST_LOCAL, {name}, at)
            q, residual, load, tried = self._descend(q, MOST_TRIALS)
            trials += tried
            if residual <= SOLVED * load and not moving:
                break
        q = self.close(q)
        return Rest(self.trail(q), residual, load or self.weight(), trials, self._inside(q))

    def _inside(self, q: np.ndarray) -> bool:
        pin.forwardKinematics(self._model, self._data, q)
        return all(
            self._elastic[name].smallest_gap(self._pose(name)) > -joint.depth_limit
            for name, joint in self._mechanism.clearance.items()
        )

    def _descend(
        self,
        q: np.ndarray,
        most: int,
        names: Collection[str] | None = None,
        at: Collection[int] = (),
    ) -> tuple[np.ndarray, float, float, int]:
        """Newton's method in a trust region; returns q, residual [N], load [N] and trials."""
        names = self._elastic if names is None else names
        ways = self.basis * self.scale
        if at:
            ways = ways[:, np.abs(ways[list(at)]).any(axis=0)]
        radius, trials = 1.0, 0
        here = self._look(q, ways, names)
        while True:
            residual = float(np.abs(here.slope).max(initial=0.0)) / self._room
            load = here.load
            if residual <= SOLVED * (load or self.weight()) or trials >= most or radius < 1e-12:
                return here.q, residual, load, trials
            step, expected = step_within(here.slope, here.bend, radius)
            size = float(np.linalg.norm(step))
            there = self._look(self.close(here.q + ways @ step), ways, names)
            trials += 1
            straight = here.gain(there, expected)
            if straight <= 0.1 and trials < most:
                # Along curved walls, and where a wall is met: a second step leads back to it.
                step, _ = step_within(there.slope, there.bend, size)
                there = self._look(self.close(there.q + ways @ step), ways, names)
                trials += 1
            gain = here.gain(there, expected)
            if not gain > 0.1:
                radius = 0.25 * size
                continue
            if gain > 0.5 or straight <= 0.1:
                radius = max(radius, 2.0 * size)
            here = there

    def _look(self, q: np.ndarray, ways: np.ndarray, names: Collection[str]) -> Place:
        gradient, curvature, load = self.slopes(q, names)
        height = self.energy(q, names)
        return Place(q, height, ways.T @ gradient, ways.T @ curvature @ ways, load)
