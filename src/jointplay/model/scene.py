"""The scene of a mechanism: shapes on links, joints to mark, and the links' poses.

Pictures, the player and the live page show it, each in its own way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from jointplay.model.frames import WORLD_FRAME, carried
from jointplay.model.mechanism import Mechanism
from jointplay.model.visuals import Look, look


@dataclass(frozen=True)
class MarkedJoint:
    """A joint with clearance, or an ideal one that closes a loop."""

    name: str
    link: int
    """Index in `Scene.links` of the link that carries the bearing."""
    place: pin.SE3
    """Pose of the bearing's frame in the link's frame; z is the joint's axis."""
    label: str
    """The joint's play, or that it closes a loop, in words."""
    play: bool
    """Whether the joint has clearance; else it closes a loop."""
    hinge: bool
    """Whether the joint is a hinge of a flexible link, which has nothing to mark."""


class Scene:
    """The scene of a mechanism; meshes may be in `folders`, too."""

    def __init__(self, mechanism: Mechanism, folders: Sequence[str | Path] = ()) -> None:
        self.mechanism, self.folders = mechanism, folders
        bodies = [frame for frame in mechanism.model.frames if frame.type == pin.FrameType.BODY]
        self.links = [frame.name for frame in bodies]
        self._frames = [(int(frame.parentJoint), frame.placement) for frame in bodies]

    @cached_property
    def look(self) -> Look:
        """Shapes of the links, and the robot's size.

        Raises:
            JointplayError: a given folder does not exist.
        """
        return look(self.mechanism, self.folders)

    @cached_property
    def joints(self) -> list[MarkedJoint]:
        """Joints with clearance, then those that close loops, on the links that carry them."""
        mechanism, marked = self.mechanism, []
        hinges = {name for names in mechanism.hinges.values() for name in names}
        loops = [name for name in mechanism.loops if name not in mechanism.clearance]
        carriers = {index: link for link, (index, _) in reversed([*enumerate(self._frames)])}
        for name in (*mechanism.clearance, *loops):
            joint, text = mechanism.clearance.get(name), "closes a loop"
            if joint is not None:
                play = joint.play_words
                text = play if joint.springs is not None else f"play {play}"
            (index, placement), _ = mechanism.frames(name)
            link = carriers[index]
            place = self._frames[link][1].actInv(placement)
            marked.append(MarkedJoint(name, link, place, text, joint is not None, name in hinges))
        return marked

    def poses(self, q: np.ndarray) -> np.ndarray:
        """World poses of the links' frames at configurations q (n, nq), shape (n, links, 7).

        Position [m] and quaternion (x, y, z, w), whose sign does not jump.
        """
        pairs = [(WORLD_FRAME, frame) for frame in self._frames]
        motion = self.mechanism.tree.motion(q, pairs=pairs)
        poses = np.empty((len(q), len(self.links), 7))
        for k, places in enumerate(motion.poses):
            poses[:, k, :3] = places[:, :3]
            poses[:, k, 3:] = quaternions(places[:, 3:].reshape(-1, 3, 3))
        return poses


def tool_places(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Positions of the tool at configurations q (n, nq), world axes (n, 3) [m]."""
    tool = carried(mechanism.model, mechanism.tool_frame)
    return mechanism.tree.motion(q, tool=tool).tool[:, :3]


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Quaternions (x, y, z, w) of rotation matrices (n, 3, 3), without jumps in sign, (n, 4)."""
    from scipy.spatial.transform import Rotation  # takes long to import

    turns: np.ndarray = Rotation.from_matrix(matrices).as_quat()
    flips = np.sum(turns[1:] * turns[:-1], axis=1) < 0.0
    turns[1:] *= np.where(np.cumsum(flips) % 2, -1.0, 1.0)[:, None]
    return turns
