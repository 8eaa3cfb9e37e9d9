"""The bodies of a Pinocchio model at many states at once: motion, energies, forces in the joints.

Pinocchio does one state per call, and what it leaves must be fetched array by array: microseconds,
of which the arithmetic is a few tenths. Here all states of a run are one call of a compiled loop.
Every joint is split into joints of one coordinate, with bodies of no mass between them; everything
is in world axes. tests/test_tree.py holds it against Pinocchio.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.mechanism.body_forces import react
from jointplay.mechanism.body_motion import move
from jointplay.mechanism.model import z_to

Frame = tuple[int, pin.SE3]
"""A Pinocchio joint, and a frame's placement in it."""


class Bodies(NamedTuple):
    """Bodies by number, parents first; 0 is the ground. Body b is moved by coordinate b - 1.

    Each body turns about its own z, or slides along it.
    """

    parents: np.ndarray
    """(nb,)."""
    slides: np.ndarray
    """Whether it slides (nb,)."""
    turns: np.ndarray
    """Orientation in the parent at coordinate zero, row by row (nb, 9)."""
    shifts: np.ndarray
    """Origin in the parent at coordinate zero (nb, 3) [m]."""
    inertias: np.ndarray
    """Mass [kg], its centre (3) [m], xx, xy, yy, xz, yz, zz about that [kg m^2]: (nb, 10)."""
    gravity: np.ndarray
    """World axes (3,) [m/s^2]."""


class Motion(NamedTuple):
    """What the bodies do, by record; filled stretch by stretch."""

    tool: np.ndarray
    """Position [m] and velocity [m/s] of the tool, world axes (n, 6)."""
    orientation: np.ndarray
    """Of the tool in the world: quaternion w, x, y, z (n, 4), without jumps in sign."""
    spin: np.ndarray
    """Angular velocity of the tool, world axes (n, 3) [rad/s]."""
    energy: np.ndarray
    """Kinetic and potential (n, 2) [J]."""
    bearings: np.ndarray
    """Orientation of each pair's first frame in the world, row by row (pairs, n, 9)."""
    poses: np.ndarray
    """Its second frame in the first: origin [m], orientation row by row (pairs, n, 12)."""

    @classmethod
    def of(cls, n: int, pairs: int) -> Motion:
        """Room for n records and `pairs` pairs of frames."""
        tool = np.empty((n, 6)), np.empty((n, 4)), np.empty((n, 3))
        return cls(*tool, np.empty((n, 2)), np.empty((pairs, n, 9)), np.empty((pairs, n, 12)))


class Tree:
    """The bodies of a model whose joints turn about axes, slide along them, or both in turn.

    Args:
        model: of `model.build`, without armature.
    """

    def __init__(self, model: pin.Model) -> None:
        """Split the joints of `model`."""
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        parents, slides, placements, inertias = [0], [False], [pin.SE3.Identity()], [np.zeros(10)]
        self._bodies = [0]
        self._turned = [pin.SE3.Identity()]  # a joint's frame as seen from its last body
        for index in range(1, model.njoints):
            joint, before = model.joints[index], model.parents[index]
            local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
            columns = local.reshape(6, model.nv)[:, joint.idx_v : joint.idx_v + joint.nv].T
            body, start = self._bodies[before], self._turned[before] * model.jointPlacements[index]
            for column in columns:
                straight = bool(column[:3].any())
                turn = pin.SE3(z_to(column[:3] if straight else column[3:]), np.zeros(3))
                parents.append(body)
                slides.append(straight)
                placements.append(start * turn)
                inertias.append(np.zeros(10))
                body, start = len(parents) - 1, turn.inverse()
            held = start.act(model.inertias[index])
            xx, xy, yy, xz, yz, zz = held.inertia[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
            inertias[body] = np.array([held.mass, *held.lever, xx, xy, yy, xz, yz, zz])
            self._bodies.append(body)
            self._turned.append(start)
        self._data = Bodies(
            np.array(parents),
            np.array(slides),
            np.array([placement.rotation.ravel() for placement in placements]),
            np.array([placement.translation for placement in placements]),
            np.array(inertias),
            np.array(model.gravity.linear),
        )

    @property
    def bodies(self) -> Bodies:
        """All bodies, at coordinate zero."""
        return self._data

    def frames(self, frames: Sequence[Frame]) -> tuple[np.ndarray, np.ndarray]:
        """Bodies that carry the frames (nf,), and rotation and origin of each in them (nf, 12)."""
        carriers = np.array([self._bodies[index] for index, _ in frames], dtype=np.int64)
        places = np.empty((len(frames), 12))
        for row, (index, placement) in zip(places, frames, strict=True):
            place = self._turned[index] * placement
            row[:9], row[9:] = place.rotation.ravel(), place.translation
        return carriers, places

    def move(
        self,
        motion: Motion,
        first: int,
        end: int,
        q: np.ndarray,
        v: np.ndarray,
        tool: Frame,
        pairs: Sequence[tuple[Frame, Frame]],
    ) -> None:
        """Fill the records `first` to `end` of `motion`.

        Args:
            motion: to be filled.
            first, end: records in which the bodies have these inertias.
            q, v: states of all records, C-contiguous, shape (n, nv).
            tool: frame whose motion is wanted.
            pairs: frames whose poses are wanted, the second in the first.
        """
        carriers, places = self.frames([tool, *(frame for pair in pairs for frame in pair)])
        move(self._data, q, v, first, end, carriers, places, *motion)

    def reactions(
        self,
        first: int,
        end: int,
        q: np.ndarray,
        v: np.ndarray,
        effort: np.ndarray,
        joints: Sequence[int],
        constraints: Sequence[pin.RigidConstraintModel],
        pushed: Sequence[int] = (),
        wrenches: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Forces that the joints transmit while the bodies move freely under `effort`.

        Args:
            first, end: records that are wanted.
            q, v, effort: of all records, C-contiguous, shape (n, nv).
            joints: Pinocchio joints whose forces are wanted.
            constraints: points held together, of the kind CONTACT_3D, not stabilised; of those
                that may be redundant, the smallest forces that do it.
            pushed: Pinocchio joints on whose bodies given wrenches act.
            wrenches: these: force [N], moment about the world's origin [N m], world axes, shape
                (n, pushed, 6).

        Returns:
            Force of the parent on the child by joint (end - first, joints, 3), and that of the
            second body on the first by constraint (end - first, constraints, 3); world axes [N].
        """
        frames = [
            frame
            for held in constraints
            for frame in (
                (held.joint1_id, held.joint1_placement),
                (held.joint2_id, held.joint2_placement),
            )
        ]
        carriers, places = self.frames(frames)
        wanted = np.array([self._bodies[index] for index in joints], dtype=np.int64)
        forces = np.empty((end - first, len(wanted), 3))
        holds = np.empty((end - first, len(constraints), 3))
        acted = np.array([self._bodies[index] for index in pushed], dtype=np.int64)
        given = np.zeros((len(q), 0, 6)) if wrenches is None else np.ascontiguousarray(wrenches)
        points = carriers, places
        react(self._data, q, v, effort, first, end, wanted, *points, acted, given, forces, holds)
        return forces, holds
