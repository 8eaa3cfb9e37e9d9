"""Small mechanisms of the cases."""

from __future__ import annotations

import tempfile
from pathlib import Path

import jointplay as jp
from jointplay.base.files import temporary

FREE = {"drive": jp.loads.Free(), "joint_friction": {}, "start": "centred"}

_folder = temporary("validation")

BODY = """
  <link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
    <inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """
  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>
    <limit lower="-99" upper="99" effort="1e6" velocity="1e6"/></joint>"""


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
) -> str:
    """A joint of a URDF."""
    return JOINT.format(name=name, parent=parent, child=child, kind=kind, axis=axis, at=at, rpy=rpy)


def urdf(*elements: str, base: str = '<link name="base"/>') -> Path:
    """A file with a robot of these elements."""
    with tempfile.NamedTemporaryFile(
        "w", suffix=".urdf", dir=_folder.name, delete=False, encoding="utf-8"
    ) as file:
        file.write(f'<robot name="r">{base}{"".join(elements)}</robot>')
    return Path(file.name)
