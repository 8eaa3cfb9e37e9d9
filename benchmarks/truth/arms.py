"""Robots of links in a row, as benchmarks draw them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import jointplay as jp
from jointplay.base.files import temporary

LINK = """
  <link name="{joint} link"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>
    <inertia ixx="0.01" iyy="{about}" izz="{about}" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{joint} link"/>
    <origin xyz="{at}"/><axis xyz="{axis}"/>
    <limit lower="-9" upper="9" effort="1e4" velocity="1e3"/></joint>"""
TOOL = """<link name="tool"/><joint name="tip" type="fixed"><parent link="{parent}"/>
  <child link="tool"/><origin xyz="{at}"/></joint>"""

Link = tuple[str, str, Sequence[float], float, Sequence[float]]
"""A joint's name, its axis, its place in the link before, and mass and mass centre of its link."""


def serial(
    links: Sequence[Link], tip: Sequence[float], *given, about: float = 0.03, **options
) -> jp.Mechanism:
    """A mechanism whose tool is at `tip` in the last link; inertia across the links `about`."""
    parts, parent = ['<link name="base"/>'], "base"
    for joint, axis, at, mass, centre in links:
        places = {"at": _text(at), "centre": _text(centre)}
        parts.append(
            LINK.format(joint=joint, axis=axis, mass=mass, parent=parent, about=about, **places)
        )
        parent = f"{joint} link"
    parts.append(TOOL.format(parent=parent, at=_text(tip)))
    with temporary("arm") as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
        return jp.Mechanism(path, *given, tool="tool", **options)


def _text(vector: Sequence[float]) -> str:
    return " ".join(f"{x:.17g}" for x in vector)
