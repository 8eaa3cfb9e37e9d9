"""Robots as benchmarks draw them: the links and joints of a URDF, and arms of links in a row."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import jointplay as jp
from jointplay.model.urdf import Description, parse

BODY = """
  <link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
    <inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """
  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>
    <limit lower="-{limit}" upper="{limit}" effort="1e6" velocity="{speed}"/></joint>"""

Link = tuple[str, str, Sequence[float], float, Sequence[float]]
"""A joint's name, its axis, its place in the link before, and mass and mass centre of its link."""


FREE = {"drive": jp.loads.Free(), "joint_friction": {}, "start": "centred"}
"""Options of what moves by itself."""
UR5_WAYPOINTS = (
    (0.0, -1.4, 1.2, -0.6, -1.57, 0.0),
    (0.8, -0.7, 0.6, -1.2, -1.0, 0.5),
    (0.2, -1.9, 1.9, 0.3, -1.57, 1.0),
)
"""At rest at 0, 1 and 2 s; the elbow turns back at the second [rad]."""


def body(name: str, mass: float = 2.0, com: str = "0 0 0", inertia=1e-2) -> str:
    """A link; `inertia` is one moment or three principal ones about its centre [kg m^2]."""
    ixx, iyy, izz = (inertia,) * 3 if isinstance(inertia, float) else inertia
    return BODY.format(name=name, mass=mass, com=com, ixx=ixx, iyy=iyy, izz=izz)


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    axis: str = "0 0 1",
    at: str = "0 0 0",
    rpy: str = "0 0 0",
    limit: float = 99,
    speed: float = 1e6,
) -> str:
    """A joint, with the largest of its positions and speeds [rad or m, a second]."""
    return JOINT.format(**locals())


def urdf(*elements: str, base: str = "base") -> Description:
    """The robot that these elements and a base make."""
    text = f'<robot name="r"><link name="{base}"/>{"".join(elements)}</robot>'
    return parse(text, Path("robot.urdf"))


def flying(
    bearing: jp.RevoluteClearance, mass: float, away: float, speed: float, inertia=1e-2, **options
) -> jp.Run:
    """A free body whose journal flies at its bore, from so far `away` [m]; options of the run."""
    path = urdf(body("arm", mass, inertia=inertia), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0, 0, 0))
    run = jp.Run(jp.Simulation(robot, **FREE, **options))
    run.workspace.q[0], run.workspace.v[0] = bearing.cr - away, speed
    return run


def serial(
    links: Sequence[Link], tip: Sequence[float], *given, about: float = 0.03, **options
) -> jp.Mechanism:
    """A mechanism whose tool is at `tip` in the last link; inertia across the links `about`."""
    parts, parent = ['<link name="tool"/>'], "base"
    for name, axis, at, mass, centre in links:
        link = f"{name} link"
        parts.append(body(link, mass, _text(centre), (0.01, about, about)))
        parts.append(joint(name, parent, link, axis=axis, at=_text(at)))
        parent = link
    parts.append(joint("tip", parent, "tool", "fixed", at=_text(tip)))
    return jp.Mechanism(urdf(*parts), *given, tool="tool", **options)


def _text(vector: Sequence[float]) -> str:
    return " ".join(f"{x:.17g}" for x in vector)


def loosened(
    name: str, joints: Sequence[str], allowed: Sequence[str] = (), play: float = 1e-4, **options
) -> jp.Mechanism:
    """A robot of example-robot-data, gravity on, some of its joints loose."""
    size = {"radial_clearance": play, "axial_clearance": play}
    bearing = jp.RevoluteClearance(**size, bearing_radius=30e-3, bearing_length=60e-3)
    return jp.Mechanism(name, dict.fromkeys(joints, bearing), allow_unphysical=allowed, **options)
