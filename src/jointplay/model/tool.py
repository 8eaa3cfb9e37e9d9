"""Choice of the frame that is a robot's tool, where none is named.

The last frame of a URDF may be a camera, an IMU or a finger's tip. The tool of an arm is the end of
its driven chain, before fingers begin.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection

from jointplay.base.tables import few
from jointplay.model.urdf import Description, JointEntry

_NAMED = re.compile(
    r"(^|_)(tool0|tool|tcp|tool_?frame|ee_link|ee|eef|end_?effector|flange|gripper_frame_link|foot|suction_?\w*|vacuum_?\w*|nozzle|spindle|torch|needle|pen|tip|probe)$",
    re.IGNORECASE,
)
"""Usual names of tool frames."""
_TELLING = ("tcp", "tool0", "tool", "ee", "flange")
"""Parts of such names, the most telling first."""
_FINGER = re.compile(r"finger|gripper|jaw|knuckle|thumb|claw", re.IGNORECASE)
"""Names of joints that move fingers."""
_OTHER = re.compile(
    r"imu|camera|optical|sensor|laser|lidar|depth|gps|finger|jaw|knuckle|thumb|inertia|collision",
    re.IGNORECASE,
)
"""Names of frames that are no tool, although a part of the name says so."""
_ARM = 3
"""Moving joints before a fork into shorter branches, from which on the branches are a hand's."""


def choose_tool(description: Description, play: Collection[str] = ()) -> tuple[str, str]:
    """Name of the frame that serves as the tool, and the reason in words.

    The chain of moving joints is the one from the base with most of the joints in `play`, and the
    longest of several. Without `play` it ends where it forks into shorter branches, or before a
    joint with a finger's name. The tool is a frame with a tool's name that is fixed to the last
    link, or else the last link itself.
    """
    children: dict[str, list[JointEntry]] = defaultdict(list)
    for joint in description.joints.values():
        children[joint.parent].append(joint)
    for fingers in (False, True):  # a robot that is nothing but fingers has a tool, too
        link, last = _chain(description.root, children, frozenset(play), fingers)
        if last:
            break
    named = [frame for frame in _fixed(link, children) if _NAMED.search(frame)]
    named = [frame for frame in named if not _OTHER.search(frame)]
    end = "the base"
    if last:
        on_way = {n.name for n in description.above(link)}
        loose = [repr(name) for name in description.joints if name in on_way.intersection(play)]
        with_play = f" with play in {few(loose)}" if loose else ""
        end = f"the end of the chain of moving joints{with_play}, after {last!r}"
    if named:
        telling = [n for word in _TELLING for n in named if word in n.lower()]
        return (telling or named)[0], f"named like a tool, at {end}"
    return link, end


def _chain(
    root: str, children: dict[str, list[JointEntry]], play: frozenset[str], fingers: bool
) -> tuple[str, str]:
    """Last link of the chain of moving joints, and its joint ("": none).

    From the tips to the base each link gets the worth of its best branch; from the base to the tip
    the chain then follows the best. `fingers`: whether fingers count.
    """
    best: dict[str, tuple[int, int]] = {}
    """Most joints with play in series behind each link, and moving joints with them."""
    order = [root]
    for link in order:  # as deep as the URDF is, which may be deeper than Python's stack
        order += [joint.child for joint in children[link]]

    def worth(joint: JointEntry) -> tuple[int, int]:
        """Joints with play, and moving joints, from this one on."""
        loose, moving = best[joint.child]
        finger = joint.kind != "fixed" and _FINGER.search(joint.name) is not None
        if finger and not fingers and not loose and joint.name not in play:
            return 0, 0
        return loose + (joint.name in play), moving + (joint.kind != "fixed")

    for link in reversed(order):
        best[link] = max(map(worth, children[link]), default=(0, 0))
    link, passed, last = root, 0, ""
    while True:
        branches = [
            joint
            for fixed in _fixed(link, children, play)
            for joint in children[fixed]
            if (joint.kind != "fixed" or joint.name in play) and worth(joint) > (0, 0)
        ]
        if not branches:
            return link, last
        chosen = max(branches, key=worth)
        loose, moving = worth(chosen)
        if len(branches) > 1 and not loose and passed >= _ARM and moving < passed:
            return link, last
        link, last = chosen.child, chosen.name
        passed += 1


def _fixed(
    link: str, children: dict[str, list[JointEntry]], play: Collection[str] = ()
) -> list[str]:
    """A link, and all links fixed to it by joints without `play`."""
    links, open_ones = [], [link]
    while open_ones:  # as deep as the URDF is, which may be deeper than Python's stack
        frame = open_ones.pop()
        links.append(frame)
        fixed = [
            joint.child
            for joint in children[frame]
            if joint.kind == "fixed" and joint.name not in play
        ]
        open_ones += reversed(fixed)
    return links
