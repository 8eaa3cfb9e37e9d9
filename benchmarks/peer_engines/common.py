"""What all engines are given, and what they give back.

The mechanism is read here from the URDF's text, and the contact forces are written down once more,
so that an engine and jointplay share numbers but not code. One exception: the gaps of the tilting
cylinder are those of `jointplay.geometry` for all.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import math
import os
import shutil
import subprocess
import time
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from numba import njit
from scipy.interpolate import CubicHermiteSpline

import jointplay as jp
from jointplay.drive import REFERENCE_NODE_S
from jointplay.geometry import touch_cylinder
from jointplay.joints import VIRTUAL_LINK

ARMATURE = 1e8
"""Inertia that keeps a crank turning at constant speed where an engine cannot prescribe motion."""


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
        """Inertia tensor, shape (3, 3)."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_links(text: str, clearance: str = "") -> list[Link]:
    """Moving links of a URDF; the joint `clearance` becomes six coordinates.

    Only what the shipped mechanisms need: joints along x, y or z, no rotated frames.
    """
    robot = ElementTree.fromstring(text)
    bodies = {link.get("name"): link.find("inertial") for link in robot.iter("link")}
    found: list[Link] = []
    at = {joint.find("parent").get("link") for joint in robot.iter("joint")}
    index = {name: -1 for name in at - {j.find("child").get("link") for j in robot.iter("joint")}}
    for joint in robot.iter("joint"):
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        if joint.get("type") == "fixed":
            continue
        origin = joint.find("origin")
        assert origin is None or origin.get("rpy") in (None, "0 0 0"), "rotated frames"
        offset = _numbers(origin.get("xyz")) if origin is not None else (0.0, 0.0, 0.0)
        own = {}
        inertial = bodies[child]
        if inertial is not None:
            at = inertial.find("origin")
            tensor = inertial.find("inertia")
            own = {
                "mass": float(inertial.find("mass").get("value")),
                "com": _numbers(at.get("xyz")) if at is not None else (0.0, 0.0, 0.0),
                "inertia": tuple(
                    float(tensor.get("i" + part)) for part in ("xx", "yy", "zz", "xy", "xz", "yz")
                ),
            }
        name, before = joint.get("name"), index[parent]
        if name == clearance:
            axes = np.vstack([np.eye(3), np.eye(3)[::-1]])
            for k, (part, axis) in enumerate(zip(VIRTUAL_LINK, axes, strict=True)):
                last = own if k == 5 else {}
                found.append(Link(f"{name}.{part}", before, k < 3, tuple(axis), offset, **last))
                before, offset = len(found) - 1, (0.0, 0.0, 0.0)
        else:
            slides = joint.get("type") == "prismatic"
            found.append(
                Link(name, before, slides, _numbers(joint.find("axis").get("xyz")), offset, **own)
            )
        index[child] = len(found) - 1
    return found


def _numbers(text: str) -> tuple[float, float, float]:
    x, y, z = (float(word) for word in text.split())
    return x, y, z


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
    """k [N/m^1.5] and a of F = k d^1.5 (1 + a d'/d'_0); mu, v0, v1 of the friction ramp."""
    bearing: tuple[int, tuple[float, float, float]]
    """Link of the bearing and the bearing's centre on it."""
    journal: tuple[int, tuple[float, float, float]]
    start: np.ndarray
    """q and v at the start, shape (2, nv)."""
    prescribed: int
    """Coordinate that turns at constant speed, or -1."""
    drive: tuple[np.ndarray, ...]
    """Table (nodes, 3 nu) of q, v, effort; driven column, kp, kd by coordinate (nv,)."""

    @property
    def clearance(self) -> float:
        """C_r [m]."""
        return float(self.sizes[0] - self.sizes[1])

    def with_links(self, index: int, **changes: object) -> Problem:
        """The same with another link `index`: a deliberate mistake."""
        links = list(self.links)
        links[index] = dataclasses.replace(links[index], **changes)
        return dataclasses.replace(self, links=tuple(links))

    def with_start(self, q: np.ndarray, v: np.ndarray | None = None) -> Problem:
        """The same from another state."""
        return dataclasses.replace(
            self, start=np.array([q, self.start[1] if v is None else v], float)
        )


def problem(simulation: jp.Simulation) -> Problem:
    """Everything an engine needs of a simulation with one joint with clearance."""
    mechanism = simulation.mechanism
    ((name, joint),) = mechanism.clearance.items()
    planar = name in mechanism.loops
    links = read_links(mechanism.description.text, "" if planar else name)
    assert [link.name for link in links] == list(mechanism.coordinates)
    run = simulation.prepare()
    rows = run.workspace.coordinates
    if planar:
        frames = (mechanism.bearing_frame(name), mechanism.journal_frame(name))
        sites = [(i - 1, tuple(placement.translation)) for i, placement in frames]
    else:
        first = mechanism.virtual_link(name)
        sites = [(links[first].parent, links[first].offset), (first + 5, (0.0, 0.0, 0.0))]
    normal = joint.normal.parameters(joint.contact_properties(0))
    friction = joint.friction.parameters()
    ramp = friction if len(friction) == 3 else (friction[0], 0.0, friction[1])  # Coulomb's
    prescribed = np.flatnonzero(rows[4])
    return Problem(
        simulation,
        tuple(links),
        planar,
        np.array([joint.ri, joint.rj, 0.5 * joint.li, 0.5 * joint.lj]),
        np.array([*normal, *ramp], float),
        sites[0],
        sites[1],
        np.array([run.workspace.q, run.workspace.v]),
        int(prescribed[0]) if prescribed.size else -1,
        (run.workspace.reference, rows[0], rows[2], rows[3]),
    )


def slider_crank(
    clearance: float = 0.2e-3, mu: float = 0.01, ramp: float = 0.01, **joint: object
) -> Problem:
    """The shipped slider-crank, restitution and stiffness as shipped, the ramp from zero speed.

    Args:
        clearance: C_r [m].
        mu: friction coefficient.
        ramp: sliding speed at which it is reached [m/s].
        joint: other fields of the joint.
    """
    shipped = jp.Scenario.load(jp.shipped("slider_crank.toml")).simulation("0.2 mm")
    old = shipped.mechanism
    fields = {
        "radial_clearance": clearance,
        "restitution": 0.9,
        "bearing_radius": 0.01,
        "bearing_length": 0.02,
        "friction": jp.Coulomb(mu, ramp),
    } | joint
    mechanism = jp.Mechanism(
        jp.shipped("slider_crank.urdf"),
        {"piston_pin": jp.ClearanceJoint.planar(**fields)},
        loops=old.loops,
        gravity=(0.0, 0.0, 0.0),
    )
    return problem(dataclasses.replace(shipped, mechanism=mechanism))


def scara(clearance: float = 0.2e-3, **options: object) -> Problem:
    """The shipped SCARA, weight balanced, C_r = C_a = `clearance`; `options` of the simulation."""
    shipped = jp.Scenario.load(jp.shipped("scara.toml")).simulation("0.2 mm")
    joint = dataclasses.replace(
        jp.ClearanceJoint(radial_clearance=clearance, axial_clearance=clearance),
        friction=jp.Ambrosio(0.1),
    )
    mechanism = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": joint}, gravity=(0, 0, 0))
    return problem(dataclasses.replace(shipped, mechanism=mechanism, **options))


@dataclass(frozen=True)
class Trace:
    """What an engine computed."""

    time: np.ndarray
    """[s], shape (n,)."""
    q: np.ndarray
    """Coordinates in jointplay's order, shape (n, nv)."""
    v: np.ndarray
    force: np.ndarray
    """Magnitude of the resultant contact force, shape (n,) [N]."""
    seconds: float
    """CPU time of the time loop [s]."""
    steps: int

    def at(self, times: np.ndarray) -> np.ndarray:
        """Coordinates at other times, shape (m, nv)."""
        return CubicHermiteSpline(self.time, self.q, self.v)(times)


def offset(links: Problem, q: np.ndarray) -> np.ndarray:
    """Journal's centre in the bearing, shape (n, 3) [m]: world axes if planar, else bearing's."""
    if not links.planar:
        first = links.journal[0] - 5
        return q[:, first : first + 3]
    (_, at), rod = links.bearing, links.links[links.bearing[0]]
    a, b = q[:, 0], q[:, 0] + q[:, 1]
    x = rod.offset[0] * np.cos(a) + at[0] * np.cos(b)
    y = rod.offset[0] * np.sin(a) + at[0] * np.sin(b)
    return np.column_stack([q[:, 2] - x, -y, np.zeros(len(q))])


def run_jointplay(
    task: Problem,
    step: float,
    duration: float,
    every: int = 1,
    integrator: str = "semi-implicit-euler",
) -> Trace:
    """This package."""
    simulation = dataclasses.replace(
        task.simulation, step=step, duration=duration, record_every=every, integrator=integrator
    )
    run = simulation.prepare()
    run.workspace.q[:], run.workspace.v[:] = task.start
    if not any(np.any(part) for part in task.drive[2:]) and task.prescribed < 0:
        run.workspace.reference[:] = 0.0  # undriven
        run.workspace.coordinates[2:4] = 0.0
    started = time.process_time()
    status = run.loop()
    spent = time.process_time() - started
    if status != 0:
        raise RuntimeError(run.message(status))
    recorded = run.workspace.recorded
    force = np.linalg.norm(recorded("force"), axis=1)
    return Trace(
        recorded("time")[:, 0].copy(),
        recorded("q").copy(),
        recorded("v").copy(),
        force,
        spent,
        run.steps,
    )


def undriven(task: Problem) -> Problem:
    """The same with all drives off."""
    table, column, kp, kd = task.drive
    return dataclasses.replace(
        task, drive=(np.zeros_like(table), column, np.zeros_like(kp), np.zeros_like(kd))
    )


@njit(cache=True)
def drive_effort(t, q, v, table, column, kp, kd, out):
    """Efforts of computed torque with PD, linear between the nodes of the table [N m or N]."""
    nu = table.shape[1] // 3
    place = t / REFERENCE_NODE_S
    node = min(int(place), table.shape[0] - 2)
    s = min(place - node, 1.0)
    for i in range(q.size):
        out[i] = 0.0
        u = int(column[i])
        if u >= 0:
            want = (1.0 - s) * table[node] + s * table[node + 1]
            out[i] = want[2 * nu + u] + kp[i] * (want[u] - q[i]) + kd[i] * (want[nu + u] - v[i])


@njit(cache=True)
def _forces(gap, rate, speed, law, memory, k, commit):
    """Normal force and friction over sliding speed of one contact; `memory` has d'_0, or 0."""
    approach = max(abs(rate), 1e-9, memory[k])
    if commit:
        memory[k] = approach
    normal = max(law[0] * (-gap) ** 1.5 * (1.0 + law[1] * rate / approach), 0.0)
    mu = law[2] * min(max((speed - law[3]) / (law[4] - law[3]), 0.0), 1.0)
    return normal, mu * normal / speed if speed > 0.0 else 0.0


@njit(cache=True)
def planar_wrench(c, u, w, sizes, law, memory, commit, out):
    """Force on a journal with parallel axis and its moment about the journal's centre.

    Args:
        c, u: journal's centre and its velocity as seen from the bearing, >= 2 components along
            any axes [m, m/s].
        w: relative angular velocity about z [rad/s].
        sizes, law: see `Problem`.
        memory: d'_0 of the contact, (1,).
        commit: whether the state is an accepted one, and d'_0 is kept.
        out: force (3) and moment (3) [N, N m].
    """
    out[:] = 0.0
    distance = math.hypot(c[0], c[1])
    gap = sizes[0] - sizes[1] - distance
    if gap >= 0.0:
        if commit:
            memory[0] = 0.0
        return
    ex, ey = c[0] / distance, c[1] / distance
    rx, ry = sizes[1] * ex, sizes[1] * ey
    vx, vy = u[0] - w * ry, u[1] + w * rx
    rate = ex * vx + ey * vy
    sx, sy = vx - rate * ex, vy - rate * ey
    normal, drag = _forces(gap, rate, math.hypot(sx, sy), law, memory, 0, commit)
    out[0] = -normal * ex - drag * sx
    out[1] = -normal * ey - drag * sy
    out[5] = rx * out[1] - ry * out[0]


@njit(cache=True)
def spatial_wrench(c, turn, u, w, sizes, law, memory, commit, out):
    """Force and moment on a journal that tilts, all in the bearing frame; see `planar_wrench`.

    Args:
        c, u, w: (3,).
        turn: orientation of the journal in the bearing, (3, 3).
        sizes, law: see `Problem`.
        memory: (4,).
        commit: see `planar_wrench`.
        out: (6,).
    """
    out[:] = 0.0
    for k in range(4):
        gap, rx, ry, rz, nx, ny, nz = touch_cylinder(
            k,
            c[0],
            c[1],
            c[2],
            turn[0, 2],
            turn[1, 2],
            turn[2, 2],
            sizes[0],
            sizes[1],
            sizes[2],
            sizes[3],
        )
        if gap >= 0.0:
            if commit:
                memory[k] = 0.0
            continue
        vx = u[0] + w[1] * rz - w[2] * ry
        vy = u[1] + w[2] * rx - w[0] * rz
        vz = u[2] + w[0] * ry - w[1] * rx
        rate = -(nx * vx + ny * vy + nz * vz)
        sx, sy, sz = vx + rate * nx, vy + rate * ny, vz + rate * nz
        speed = math.sqrt(sx * sx + sy * sy + sz * sz)
        normal, drag = _forces(gap, rate, speed, law, memory, k, commit)
        fx, fy, fz = normal * nx - drag * sx, normal * ny - drag * sy, normal * nz - drag * sz
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += ry * fz - rz * fy
        out[4] += rz * fx - rx * fz
        out[5] += rx * fy - ry * fx


@njit(cache=True)
def world_wrench(planar, here, there, bearing, journal, slow, fast, sizes, law, memory, out):
    """Force on the journal and moment about its centre in world axes; commits.

    Args:
        planar: which of the wrenches above.
        here, there: centres of bearing and journal (3,) [m].
        bearing, journal: their orientations row by row, (9,).
        slow, fast: angular velocity and velocity of bearing and of journal, in world axes (6,).
        sizes, law, memory, out: see the wrenches above.

    Returns whether they touch.
    """
    turn, c, u, w = np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3)
    ax, ay, az = there[0] - here[0], there[1] - here[1], there[2] - here[2]
    # Of the journal's centre as seen from the bearing, which turns.
    vx = fast[3] - slow[3] - (slow[1] * az - slow[2] * ay)
    vy = fast[4] - slow[4] - (slow[2] * ax - slow[0] * az)
    vz = fast[5] - slow[5] - (slow[0] * ay - slow[1] * ax)
    for i in range(3):
        bx, by, bz = bearing[i], bearing[3 + i], bearing[6 + i]
        c[i] = bx * ax + by * ay + bz * az
        u[i] = bx * vx + by * vy + bz * vz
        w[i] = bx * (fast[0] - slow[0]) + by * (fast[1] - slow[1]) + bz * (fast[2] - slow[2])
        for k in range(3):
            turn[i, k] = bx * journal[k] + by * journal[3 + k] + bz * journal[6 + k]
    if planar:
        planar_wrench(c, u, w[2], sizes, law, memory, True, out)
    else:
        spatial_wrench(c, turn, u, w, sizes, law, memory, True, out)
    touching = False
    for i in (0, 3):
        x, y, z = out[i], out[i + 1], out[i + 2]
        touching = touching or x != 0.0 or y != 0.0 or z != 0.0
        for k in range(3):
            out[i + k] = bearing[3 * k] * x + bearing[3 * k + 1] * y + bearing[3 * k + 2] * z
    return touching


@dataclass(frozen=True)
class Impact:
    """One contact from touch to release."""

    time: float
    """When the gap vanished [s]."""
    duration: float
    impulse: float
    """[N s]."""


def impacts(trace: Trace, task: Problem, rigid: bool = False) -> list[Impact]:
    """Contacts of a planar trace with a record at every step, in order; open ones left out.

    Without penetration (`rigid`) a contact is a row of steps with an impulse.
    """
    gap = task.clearance - np.linalg.norm(offset(task, trace.q)[:, :2], axis=1)
    touching = trace.force > 0.0 if rigid else gap < 0.0
    inside = np.concatenate([[False], touching, [False]])
    starts, ends = (np.flatnonzero(np.diff(inside.astype(int)) == way) for way in (1, -1))
    found = []
    for first, last in zip(starts, ends, strict=True):
        if first == 0 or last >= len(gap):
            continue

        def crossing(k: int) -> float:
            part = gap[k - 1] / (gap[k - 1] - gap[k])
            return float(trace.time[k - 1] + part * (trace.time[k] - trace.time[k - 1]))

        if rigid:
            step = float(trace.time[1] - trace.time[0])
            impulse = step * float(np.sum(trace.force[first:last]))
            found.append(Impact(float(trace.time[first]), step * (last - first), impulse))
            continue
        begin, end = crossing(first), crossing(last)
        force, times = trace.force[first - 1 : last + 1], trace.time[first - 1 : last + 1]
        found.append(Impact(begin, end - begin, float(np.trapezoid(force, times))))
    return found


def siconos_python() -> str:
    """The Python that can import Siconos, or an empty string."""
    candidates = [os.environ.get("JOINTPLAY_SICONOS_PYTHON", ""), "/usr/bin/python3"]
    for candidate in filter(None, candidates):
        if shutil.which(candidate):
            answer = subprocess.run(
                [candidate, "-c", "import siconos.kernel"], capture_output=True, check=False
            )
            if answer.returncode == 0:
                return candidate
    return ""


def missing(engine: str) -> str:
    """Why an engine cannot run, or an empty string."""
    if engine == "siconos":
        remedy = "apt-get install python3-siconos, or name its Python in JOINTPLAY_SICONOS_PYTHON"
        return "" if siconos_python() else f"siconos is not installed: {remedy}"
    found = importlib.util.find_spec(engine) is not None
    return "" if found else f"{engine} is not installed: pip install {engine}"
