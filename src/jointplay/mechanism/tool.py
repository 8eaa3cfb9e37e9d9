"""Which frame of a robot is its tool, where nobody said so.

The last frame of a URDF may be a camera, an IMU or a finger's tip. The tool of an arm is the end of
its driven chain, before fingers begin.
"""

from __future__ import annotations

import re
from collections import defaultdict

from jointplay.mechanism.urdf import Description, JointEntry

_NAMED = re.compile(
    r"(^|_)(tool0|tool|tcp|tool_?frame|ee_link|ee|eef|end_?effector|flange|gripper_frame_link|foot|suction_?\w*|vacuum_?\w*|nozzle|spindle|torch|needle|pen)$",
    re.IGNORECASE,
)
"""Frames that are called what a tool is called."""
_FINGER = re.compile(r"finger|gripper|jaw|knuckle|thumb|claw", re.IGNORECASE)
_OTHER = re.compile(
    r"imu|camera|optical|sensor|laser|lidar|depth|gps|finger|jaw|knuckle|thumb|inertia|collision",
    re.IGNORECASE,
)
_ARM = 3
"""From so many moving joints on, a fork into shorter branches is a hand."""


def choose_tool(description: Description) -> tuple[str, str]:
    """Name of the frame that serves as the tool, and the reason in words.

    The longest chain of moving joints from the base, up to where it forks into shorter branches or
    a joint is called a finger's; of what is fixed to its last link, a frame with a tool's name, or
    else the last link itself.
    """
    children: dict[str, list[JointEntry]] = defaultdict(list)
    for joint in description.joints.values():
        children[joint.parent].append(joint)
    heads = {joint.child for joint in description.joints.values()}
    root = next(link for link in description.links if link not in heads)
    for fingers in (False, True):
        link, last = _chain(root, children, fingers)
        if last:
            break
    named = [frame for frame in _fixed(link, children) if _NAMED.search(frame)]
    named = [frame for frame in named if not _OTHER.search(frame)]
    end = f"the end of the chain of moving joints, after {last!r}" if last else "the base"
    if named:
        best = min(named, key=lambda frame: (_rank(frame), named.index(frame)))
        return best, f"named like a tool, at {end}"
    return link, end


def _chain(root: str, children: dict[str, list[JointEntry]], fingers: bool) -> tuple[str, str]:
    """Last link of the longest chain of moving joints, and its joint ("": none)."""

    def moving(link: str) -> list[tuple[str, str]]:
        """Moving joints next to a link, and the links they move, with all that is fixed to it."""
        joints = (joint for one in _fixed(link, children) for joint in children[one])
        return [
            (joint.name, joint.child)
            for joint in joints
            if joint.kind != "fixed" and (fingers or not _FINGER.search(joint.name))
        ]

    def depth(link: str) -> int:
        """Moving joints in series behind a link, at most."""
        deepest, level = -1, [link]
        while level:
            deepest, level = deepest + 1, [child for one in level for _, child in moving(one)]
        return deepest

    link, passed, last = root, 0, ""
    while branches := moving(link):
        longest = max(branches, key=lambda branch: depth(branch[1]))
        if len(branches) > 1 and passed >= _ARM and 1 + depth(longest[1]) < passed:
            break
        last, link = longest
        passed += 1
    return link, last


def _fixed(link: str, children: dict[str, list[JointEntry]]) -> list[str]:
    """A link, and all that is fixed to it."""
    links, open_ones = [], [link]
    while open_ones:  # as deep as the URDF is, which may be deeper than Python's stack
        here = open_ones.pop()
        links.append(here)
        fixed = [joint.child for joint in children[here] if joint.kind == "fixed"]
        open_ones += reversed(fixed)
    return links


def _rank(frame: str) -> int:
    """Order of tools' names, the most telling first."""
    for rank, word in enumerate(("tcp", "tool0", "tool", "ee", "flange")):
        if word in frame.lower():
            return rank
    return 9
