"""What all engines are given.

The mechanism is read here from the URDF's text, and the contact forces are written down once more,
so that an engine and jointplay share numbers but not code. One exception: the gaps of the tilting
cylinder are those of `jointplay.physics.geometry` for all.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.physics.joints import VIRTUAL_LINK

ARMATURE = 1e8
"""Inertia that keeps a crank turning at constant speed where an engine cannot prescribe motion."""
MODULES = {"drake": "pydrake"}
"""Of engines that are not imported by their name."""


@dataclass(frozen=True)
class Link:
    """A moving body and the one coordinate by which it hangs on its parent."""

    name: str
    parent: int
    """Index of the parent, -1 for the ground."""
    slides: bool
    axis: tuple[float, float, float]
    offset: tuple[float, float, float]
    """Joint's origin in the parent's frame [m]."""
    mass: float = 0.0
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 6
    """About the centre of mass: xx, yy, zz, xy, xz, yz [kg m^2]."""

    @property
    def tensor(self) -> np.ndarray:
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_links(text: str, clearance: str = "") -> list[Link]:
    """Moving links of a URDF; the joint `clearance` becomes six coordinates.

    Only what the shipped mechanisms need: joints along x, y or z, no rotated frames.
    """
    robot = ElementTree.fromstring(text)
    bodies = {link.get("name"): link.find("inertial") for link in robot.iter("link")}
    found: list[Link] = []
    joints = [(j, j.find("parent").get("link"), j.find("child").get("link"))
              for j in robot.iter("joint")]  # fmt: skip
    index = {name: -1 for name in {p for _, p, _ in joints} - {c for _, _, c in joints}}
    for joint, parent, child in joints:
        if joint.get("type") == "fixed":
            continue
        origin = joint.find("origin")
        assert origin is None or origin.get("rpy") in (None, "0 0 0"), "rotated frames"
        offset, own = _place(origin), {}
        if (inertial := bodies[child]) is not None:
            tensor = inertial.find("inertia")
            parts = [float(tensor.get(f"i{part}")) for part in ("xx", "yy", "zz", "xy", "xz", "yz")]
            mass = float(inertial.find("mass").get("value"))
            own = {"mass": mass, "com": _place(inertial.find("origin")), "inertia": tuple(parts)}
        name, before = joint.get("name"), index[parent]
        if name == clearance:
            axes = np.vstack([np.eye(3), np.eye(3)[::-1]])
            for k, (part, axis) in enumerate(zip(VIRTUAL_LINK, axes, strict=True)):
                last = own if k == 5 else {}
                found.append(Link(f"{name}.{part}", before, k < 3, tuple(axis), offset, **last))
                before, offset = len(found) - 1, (0.0, 0.0, 0.0)
        else:
            slides, axis = joint.get("type") == "prismatic", _place(joint.find("axis"))
            found.append(Link(name, before, slides, axis, offset, **own))
        index[child] = len(found) - 1
    return found


def _place(element: ElementTree.Element | None) -> tuple[float, ...]:
    return tuple(map(float, ("0 0 0" if element is None else element.get("xyz")).split()))


@dataclass(frozen=True)
class Problem:
    """A mechanism with one joint with clearance, its contact law, its drives, its start."""

    simulation: jp.Simulation
    links: tuple[Link, ...]
    planar: bool
    """One contact of parallel axes in a loop, else the four of a virtual link."""
    sizes: np.ndarray
    """R_i, R_j, L_i/2, L_j/2 [m]."""
    law: np.ndarray
    """k [N/m^1.5] and a of F = k d^1.5 (1 + a d'/d'_0); mu, v0, v1 of the friction ramp; then
    0 if d'_0 is the largest speed since the onset, 1 if it is that at the onset (Exudyn's); the
    mass that damping at rest refers to [kg], infinite without (Exudyn's)."""
    bearing: tuple[int, tuple[float, float, float]]
    """Link of the bearing and the bearing's centre on it."""
    journal: tuple[int, tuple[float, float, float]]
    start: np.ndarray
    """q and v at the start, shape (2, nv)."""
    prescribed: int
    """Coordinate that turns at constant speed, or -1."""
    drive: tuple[np.ndarray, ...]
    """Table (nodes, 3 nu) of q, v, effort; driven column or -1, kp, kd by coordinate (nv,)."""

    @property
    def clearance(self) -> float:
        return float(self.sizes[0] - self.sizes[1])

    @property
    def driven(self) -> bool:
        table, _, kp, kd = self.drive
        torques = table[:, 2 * (table.shape[1] // 3) :]
        return bool(torques.any() or kp.any() or kd.any())

    def with_links(self, index: int, **changes: object) -> Problem:
        """The same with another link `index`: a deliberate mistake."""
        links = list(self.links)
        links[index] = dataclasses.replace(links[index], **changes)
        return dataclasses.replace(self, links=tuple(links))

    def with_onset_speed(self) -> Problem:
        return dataclasses.replace(self, law=np.array([*self.law[:5], 1.0, np.inf]))

    def with_start(self, q: np.ndarray, v: np.ndarray | None = None) -> Problem:
        start = np.array([q, self.start[1] if v is None else v], float)
        return dataclasses.replace(self, start=start)


def problem(simulation: jp.Simulation) -> Problem:
    """Everything an engine needs of a simulation with one joint with clearance."""
    mechanism = simulation.mechanism
    ((name, joint),) = mechanism.clearance.items()
    planar = name in mechanism.loops
    links = read_links(mechanism.description.text, "" if planar else name)
    assert [link.name for link in links] == list(mechanism.coordinates)
    run = jp.Run(simulation)
    by_coordinate = np.zeros((3, len(links)))
    by_coordinate[0] = -1.0
    for drive in run.workspace.drives:
        by_coordinate[:, drive["coordinate"]] = drive["column"], drive["kp"], drive["kd"]
    if planar:
        frames = mechanism.frames(name)
        sites = [(i - 1, tuple(placement.translation)) for i, placement in frames]
    else:
        first = mechanism.virtual_link(name)
        sites = [(links[first].parent, links[first].offset), (first + 5, (0.0, 0.0, 0.0))]
    normal = joint.normal.parameters(joint.contact_properties(0))
    friction = joint.friction.parameters()
    ramp = friction if len(friction) == 3 else (friction[0], 0.0, friction[1])  # Coulomb's
    prescribed = run.workspace.drives["coordinate"][run.workspace.drives["armature"] > 0.0]
    return Problem(
        simulation,
        tuple(links),
        planar,
        np.array([joint.ri, joint.rj, 0.5 * joint.li, 0.5 * joint.lj]),
        np.array([*normal, *ramp, 0.0, run.workspace.joints["rest_mass"][0]], float),
        sites[0],
        sites[1],
        np.array([run.workspace.q, run.workspace.v]),
        int(prescribed[0]) if prescribed.size else -1,
        (run.workspace.reference, *by_coordinate),
    )


def slider_crank(
    clearance: float = 0.2e-3, mu: float = 0.01, ramp: float = 0.01, **joint: object
) -> Problem:
    """The shipped slider-crank, its friction `mu` reached at the sliding speed `ramp` [m/s].

    `joint` are other fields of the joint.
    """
    shipped = _shipped("slider_crank")
    fields = {
        **{"radial_clearance": clearance, "restitution": 0.9, "bearing_radius": 0.01},
        **{"bearing_length": 0.02, "friction": jp.contact.Coulomb(mu, ramp)},
        **joint,
    }
    play, loops = {"piston_pin": jp.RevoluteClearance.planar(**fields)}, shipped.mechanism.loops
    mechanism = jp.Mechanism(jp.shipped("slider_crank.urdf"), play, loops=loops, gravity=(0, 0, 0))
    return problem(dataclasses.replace(shipped, mechanism=mechanism))


def scara(clearance: float = 0.2e-3, **options: object) -> Problem:
    """The shipped SCARA, weight balanced, C_r = C_a = `clearance`; `options` of the simulation."""
    joint = jp.RevoluteClearance(
        radial_clearance=clearance, axial_clearance=clearance, friction=jp.contact.Ambrosio(0.1)
    )
    mechanism = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": joint}, gravity=(0, 0, 0))
    return problem(dataclasses.replace(_shipped("scara"), mechanism=mechanism, **options))


def _shipped(name: str) -> jp.Simulation:
    scenario = jp.Scenario.load(jp.shipped(f"{name}.toml"))
    return scenario.simulation("0.2 mm", {"integration": {"start": "centred"}})


def undriven(task: Problem) -> Problem:
    """The same with all drives off."""
    table, column, kp, kd = task.drive
    return dataclasses.replace(
        task, drive=(np.zeros_like(table), column, np.zeros_like(kp), np.zeros_like(kd))
    )


def siconos_python() -> str:
    """The Python that can import Siconos, or an empty string."""
    candidates = [os.environ.get("JOINTPLAY_SICONOS_PYTHON", ""), "/usr/bin/python3"]
    for candidate in filter(shutil.which, filter(None, candidates)):
        command = [candidate, "-c", "import siconos.kernel"]
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            return candidate
    return ""


def elsewhere(python: str, script: str, given: dict) -> dict[str, np.ndarray]:
    """What a script saves as arrays, run by another Python, its input on standard input as JSON."""
    with temporary("engine") as folder:
        out = Path(folder) / "arrays.npz"
        subprocess.run(
            [python, script, str(out)],
            input=json.dumps(given),
            text=True,
            check=True,
            stdout=subprocess.DEVNULL,
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        with np.load(out) as found:
            return dict(found)


def missing(engine: str) -> str:
    """Why an engine cannot run, or an empty string."""
    if engine == "siconos":
        remedy = "apt-get install python3-siconos, or name its Python in JOINTPLAY_SICONOS_PYTHON"
        return "" if siconos_python() else f"siconos is not installed: {remedy}"
    found = importlib.util.find_spec(MODULES.get(engine, engine)) is not None
    return "" if found else f"{engine} is not installed: pip install {engine}"
