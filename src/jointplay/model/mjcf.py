"""Reading an MJCF: MuJoCo compiles it, and the compiled model becomes a URDF.

Joints, frames and masses are MuJoCo's own, with its classes, angles and inertias of shapes; joints
of one body become links in series. What a URDF has no words for, play above all, is told in a
scenario's words (`urdf.Beyond.tables`), what is left out in lines (`urdf.Beyond.notes`).

`urdf_text` has a process with limits of time and memory do it, since MuJoCo reads whatever the file
names; there `read` takes out of the MJCF what no inertia depends on, compiles it, and has
`_Reading` write the URDF.
"""

from __future__ import annotations

import json
import math
import os
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.util import find_spec
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base import confined, signals
from jointplay.base.errors import LARGEST, JointplayError
from jointplay.base.files import begins, is_file, read_text
from jointplay.base.imports import extra
from jointplay.base.tables import few
from jointplay.model import urdf
from jointplay.model.elements import Element, document, put, put_inertial, put_joint, put_shape

WIDEST_PLAY = 0.1
"""Range of a second hinge about the same axis up to which it is the play of the first [rad]."""
_PARALLEL = 1e-6
"""Distance of two axes, and sine of the angle between them, up to which they are one [m, 1]."""
_UNBOUNDED = 1e3
"""Error at which a servo's supply, which MuJoCo's actuators lack, would end [rad or m]."""
_FINITE = (
    *("jnt_range", "jnt_stiffness", "qpos0", "qpos_spring", "dof_damping", "dof_frictionloss"),
    *("dof_armature", "body_pos", "body_quat", "body_mass", "body_inertia", "eq_data", "geom_size"),
    *("actuator_gainprm", "actuator_biasprm", "actuator_forcerange", "actuator_ctrlrange"),
    *("actuator_gear", "tendon_range", "tendon_stiffness", "tendon_damping", "wrap_prm"),
)
"""Arrays of a compiled MJCF whose numbers are used."""
_BESIDE = {
    "armature": "dof_armature", "damping": "dof_damping", "friction": "dof_frictionloss",
    "springs": "jnt_stiffness", "limits": "jnt_limited",
}  # fmt: skip
"""Properties of joints of which little is read (`notes`), and the compiled arrays with them."""
TIME_S = 20.0
"""Longest processor time that reading an MJCF may take [s]; large robots take 2 s."""
ROOM = 4e9
"""Most memory that reading an MJCF may take [bytes], by addresses; large robots take a quarter."""
_SHOWN = 30
"""Letters of an unread text that notes show."""
_MERGED = ("compiler", "option", "flag", "statistic", "size")
"""Elements that MuJoCo merges into one, wherever they stand."""
_MAY_BE_BLANK = ("name", "meshdir", "texturedir", "assetdir", "user", "data")
"""Attributes that mean something when they are empty."""
_FILE = re.compile(r"""\bfile\s*=\s*["']([^"'<>]+)["']""")
_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"'<>]+)["']""")
_LFS = b"version https://git-lfs"
"""Beginning of a Git LFS pointer, in place of a file's content."""
_COLLISION_GROUP = 3
"""Least group of geoms that MuJoCo's viewer does not show by default."""


def load_mujoco() -> Any:
    """Import MuJoCo; its warnings are logged, not written to a file in the working folder."""
    with extra("simulators", "mujoco"):
        import mujoco
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(lambda text: signals.say(f"MuJoCo: {text}"))
    return mujoco


def load_spec(path: Path) -> Any:
    """An MJCF as MuJoCo's `MjSpec`, with names for all bodies and joints.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot read the file.
    """
    mujoco = load_mujoco()
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise _refused(path, error) from None
    names = {element.name for element in (*spec.bodies, *spec.joints)}
    for number, body in enumerate(spec.bodies):
        body.name = body.name or _unused(f"body{number}", names)
        for count, joint in enumerate(body.joints):
            end = f"_joint{count + 1}" if len(body.joints) > 1 else "_joint"
            joint.name = joint.name or _unused(f"{body.name}{end}", names)
    return spec


def compiled(spec: Any, path: Path) -> Any:
    """MuJoCo's compiled model of an MJCF.

    Raises:
        JointplayError: MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except (ValueError, load_mujoco().FatalError) as error:
        raise _refused(path, error) from None


def _refused(path: Path, error: Exception) -> JointplayError:
    reason = " ".join(str(error).split())
    return JointplayError(f"MuJoCo cannot read the MJCF {str(path)!r}: {reason}")


def _unused(name: str, names: set[str]) -> str:
    """The name, with a number behind it if it is among `names`, to which it is added."""
    number, base = 2, name
    while name in names:
        name, number = f"{base}_{number}", number + 1
    names.add(name)
    return name


def urdf_text(text: str, path: Path) -> str:
    """The robot of an MJCF as a URDF; converted once as long as no file of text changes.

    MuJoCo reads the file and those that it includes in a process with limits of time and memory.

    Raises:
        JointplayError: see `read`; or it takes more time or memory, or a file that it names is a
            pipe, device or folder.
    """
    with extra("simulators", "mujoco"):
        if find_spec("mujoco") is None:
            raise ImportError("it is not installed")
    stamps = tuple(sorted(_named_files(text, path, set())))
    return _read_apart(path.absolute(), stamps)


def _named_files(text: str, path: Path, seen: set[Path]) -> Iterator[tuple[str, int, int]]:
    """Files of text that an MJCF includes: name, time of the last change [ns], size [bytes]."""
    folders = {"", *_FOLDER.findall(text)}
    yield str(path), path.stat().st_mtime_ns, path.stat().st_size
    for name in dict.fromkeys(_FILE.findall(text)):
        for file in (path.parent / folder / name for folder in folders):
            if file.exists() and not is_file(file):
                raise JointplayError(
                    f"the MJCF {str(path)!r} names {str(file)!r}, which is no file"
                )
            if file.suffix == ".xml" and is_file(file) and file not in seen:
                seen.add(file)
                yield from _named_files(read_text(file, "MJCF"), file, seen)


@lru_cache(maxsize=8)
def _read_apart(path: Path, stamps: tuple[tuple[str, int, int], ...]) -> str:
    """`read` in a process of its own; again if the files' `stamps` are others."""
    return convert_apart(__name__, path)


def convert_apart(module: str, path: Path) -> str:
    """The text that a module's `serve` makes of an MJCF, in a process with limits; see `report`.

    Raises:
        JointplayError: the process reported a fault, or reached its limits.
    """
    with confined.process(module, path, TIME_S, min(ROOM, confined.memory())) as process:
        assert process.stdout
        output = process.stdout.read()
        if not output.endswith(b"}"):
            raise JointplayError(
                f"the MJCF {str(path)!r}: reading it {confined.ended(process, TIME_S)}; it may "
                f"take {ROOM / 1e9:g} GB"
            )
    answer = json.loads(output)
    if "fault" in answer:
        raise JointplayError(answer["fault"])
    return str(answer["text"])


def serve(path: str) -> None:
    """Main function of the process: write the URDF to standard output."""
    report(path, read)


def report(path: str, convert: Callable[[Path], str]) -> None:
    """Write what `convert` makes of an MJCF, or a fault, to standard output as JSON, and exit."""
    try:
        answer = {"text": convert(Path(path))}
    except JointplayError as error:
        answer = {"fault": str(error)}
    except (MemoryError, RuntimeError):  # which MuJoCo raises if it gets no memory
        answer = {"fault": f"MuJoCo gives up on the MJCF {path!r}: it may take {ROOM / 1e9:g} GB"}
    sys.stdout.write(json.dumps(answer))
    sys.stdout.flush()
    os._exit(0)


def read(path: Path) -> str:
    """The robot of an MJCF as a URDF.

    Trees of bodies that float freely beside a robot that is held are left out; if all float, the
    largest is the robot, its base free.

    Raises:
        JointplayError: MuJoCo is not installed or cannot compile the file, or a mesh is missing
            from which a body takes its inertia.
    """
    warnings: list[str] = []
    load_mujoco().set_mju_user_warning(warnings.append)
    spec = load_spec(path)
    meshes = _lighten(spec, path)
    model = compiled(spec, path)
    if odd := [w for w in warnings if "NaN" in w]:  # MuJoCo would take it as not given
        raise JointplayError(f"the MJCF {str(path)!r} has a number that is not finite: {odd[0]}")
    for name in _FINITE:
        if not (np.abs(getattr(model, name)) <= LARGEST).all():
            fault = f"a number that is not finite, or beyond {LARGEST:g}: see "
            fault += name.replace("_", ", ", 1)
            raise JointplayError(f"the MJCF {str(path)!r} has {fault}")
    reading = _Reading(load_mujoco(), model, path, {int(g.id): w for g, w in meshes})
    reading.remarks += [f"MuJoCo: {warning}" for warning in dict.fromkeys(warnings)]
    reading.remarks += _passed_over(path)
    return reading.text()


def _passed_over(path: Path) -> Iterator[str]:
    """Notes on what MuJoCo does not read of a file's XML without saying so."""
    try:
        root = ElementTree.fromstring(read_text(path, "MJCF"))
    except (ElementTree.ParseError, ValueError) as error:
        yield f"note: the MJCF is no well-formed XML, and MuJoCo read what it could: {error}"
        return
    texts = [
        f"{text.strip()[:_SHOWN]!r} in <{element.tag}>"
        for element in root.iter()
        for text in (element.text, *(inner.tail for inner in element))
        if text and text.strip()
    ]
    blank = [
        f"{name} in <{element.tag}>"
        for element in root.iter()
        for name, value in element.attrib.items()
        if not value.strip() and name not in _MAY_BE_BLANK
    ]
    stated: dict[str, set[str]] = {}
    for tag in _MERGED:
        for element in root.iter(tag):
            for name, value in element.attrib.items():
                stated.setdefault(f"{name} in <{tag}>", set()).add(value)
    if twice := [name for name, values in stated.items() if len(values) > 1]:
        yield f"note: given twice in the MJCF, where the last holds: {few(twice)}"
    if texts:
        yield f"note: MuJoCo reads no text between elements: {few(texts)}"
    if blank:
        yield f"note: MuJoCo takes what is empty as not given: {few(blank)}"


@dataclass(frozen=True)
class _Mesh:
    """A mesh file that a geom shows."""

    file: str
    scale: np.ndarray
    place: pin.SE3
    """Pose of the mesh in the frame of the geom, if MuJoCo does not compile the mesh."""


def _lighten(spec: Any, path: Path) -> list[tuple[Any, _Mesh]]:
    """Take out of a spec all that no body's inertia depends on: meshes, textures and the like.

    Geoms of meshes that are taken out become tiny spheres without mass.

    Returns:
        The geoms whose mesh is a file, each with its mesh.
    """
    kinds, shapes = load_mujoco().mjtGeom, load_mujoco().mjtGeomInertia
    spec.compiler.discardvisual = spec.compiler.fusestatic = False
    meshes = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes}
    folder = Path(spec.modelfiledir or path.parent) / spec.meshdir
    needed, shown = set(), []
    for geom in list(spec.geoms):
        if geom.hfieldname:  # terrain
            spec.delete(geom)
        if geom.hfieldname or not geom.meshname:
            continue
        name, mesh = geom.meshname, meshes.get(geom.meshname)
        if mesh is None:
            raise JointplayError(f"a geom of body {geom.parent.name!r} has no mesh {name!r}")
        file = folder / (Path(mesh.file).name if spec.strippath else mesh.file)
        if mesh.file:
            place = placed(mesh.refpos, mesh.refquat).inverse()
            shown.append((geom, _Mesh(str(file), np.array(mesh.scale), place)))
        if _gives_inertia(spec, geom):
            if mesh.file and (not is_file(file) or begins(file, _LFS)):
                raise JointplayError(
                    f"body {geom.parent.name!r} takes its inertia from the mesh {str(file)!r}, "
                    "which is missing: put it there, or give the body an <inertial>"
                )
            needed.add(name)
            continue
        # The geom stays, for the picture of its mesh is placed by it; only its shape goes.
        geom.type, geom.meshname, geom.mass = kinds.mjGEOM_SPHERE, "", 0.0
        geom.size, geom.typeinertia = [1e-3, 0.0, 0.0], shapes.mjINERTIA_VOLUME
    for material in spec.materials:
        for k in range(len(material.textures)):
            material.textures[k] = ""
    unread = [*spec.textures, *spec.skins, *spec.hfields]
    for unused in [*unread, *(mesh for name, mesh in meshes.items() if name not in needed)]:
        spec.delete(unused)
    return shown


def _gives_inertia(spec: Any, geom: Any) -> bool:
    """Whether a body that moves, or the total mass, takes inertia from a geom; see `compiler`."""
    how, body = load_mujoco().mjtInertiaFromGeom, geom.parent
    wanted = spec.compiler.inertiafromgeom
    if wanted == how.mjINERTIAFROMGEOM_FALSE:
        return False
    if wanted == how.mjINERTIAFROMGEOM_AUTO and body.explicitinertial:
        return False
    low, high = spec.compiler.inertiagrouprange
    massless = geom.density == 0.0 if math.isnan(geom.mass) else geom.mass == 0.0
    if massless or not low <= geom.group <= high:
        return False
    moves = spec.compiler.settotalmass > 0.0
    while not moves and body.name != "world":
        moves, body = len(body.joints) > 0, body.parent
    return moves


def placed(position: Any, quaternion: Any) -> pin.SE3:
    """Pose by MuJoCo's position and quaternion, w first."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), np.array(position))


@dataclass(frozen=True)
class _Play:
    """A hinge that is the play of another."""

    hinge: int
    """Number of this hinge."""
    width: float
    """Free angle between its stops [rad]."""
    stiffness: float
    """Stiffness of its stops [N m/rad]."""
    damping: float
    """Damping of its stops [N m s/rad]."""


@dataclass
class _Reading:
    """A compiled MJCF on its way to a URDF.

    First it is decided which bodies are the robot, and what its joints, drives, plays and mimics
    are; then `text` writes the URDF, and fills `tables`, `armature` and `remarks`.
    """

    mujoco: Any
    model: Any
    path: Path
    pictures: dict[int, _Mesh]
    """Mesh files by geom."""
    tables: dict[str, Any] = field(default_factory=dict)
    """Tables of a scenario (`urdf.Beyond.tables`)."""
    armature: dict[str, float] = field(default_factory=dict)
    """Rotors rigidly geared to joints (`urdf.Beyond.armature`)."""
    remarks: list[str] = field(default_factory=list)
    """Notes that come up on the way."""

    def __post_init__(self) -> None:
        model, kinds = self.model, self.mujoco.mjtJoint
        self.body_names = [model.body(i).name for i in range(model.nbody)]
        self.joint_names = [model.joint(i).name for i in range(model.njnt)]
        self.types = [kinds(kind) for kind in model.jnt_type]
        moves = [kind != kinds.mjJNT_FREE for kind in self.types]
        self.names = {*self.body_names, *compress(self.joint_names, moves), urdf.GROUND}
        # The robot: trees that are held, if anything in them moves; else the largest free tree.
        tops = [i for i in range(1, model.nbody) if model.body_parentid[i] == 0]
        tops = [i for i in tops if model.body_mocapid[i] < 0]
        free = [i for i in tops if kinds.mjJNT_FREE in map(self.types.__getitem__, self._joints(i))]
        held = [i for i in tops if i not in free]
        moving = any(
            kind != kinds.mjJNT_FREE and model.body_rootid[body] in held
            for kind, body in zip(self.types, model.jnt_bodyid, strict=True)
        )
        self.floats = bool(free) and not moving
        sizes = np.bincount(model.body_rootid, minlength=model.nbody)
        roots = [max(free, key=lambda top: int(sizes[top]))] if self.floats else held
        self.bodies = [i for i in range(1, model.nbody) if model.body_rootid[i] in roots]
        if left := [self.body_names[i] for i in free if i not in roots]:
            self.remarks.append(f"left out, for they float freely: {few(left)}")
        self.joints = [
            j for i in self.bodies for j in self._joints(i) if self.types[j] != kinds.mjJNT_FREE
        ]
        self.drives = dict(self._position_drives())
        # Hinges that are the play of others are no joints of their own.
        self.play: dict[int, _Play] = {}
        for i in self.bodies:
            self.play.update(self._play_in(i))
        hidden = {play.hinge for play in self.play.values()}
        self.joints = [j for j in self.joints if j not in hidden]
        self.mimics = self._mimics()
        self.passive = {*self._not_acted_on()}

    # Bodies and joints.

    def _joints(self, body: int) -> range:
        first = int(self.model.body_jntadr[body])
        return range(first, first + int(self.model.body_jntnum[body]))

    def _dof(self, joint: int) -> int:
        return int(self.model.jnt_dofadr[joint])

    def _loss(self, name: str, joint: int) -> float:
        """Damping, frictionloss or armature of a joint."""
        values = getattr(self.model, f"dof_{name}").reshape(self.model.nv, -1)
        return float(values[self._dof(joint), 0])

    # Play, drives, equalities.

    def _play_in(self, body: int) -> Iterator[tuple[int, _Play]]:
        """Joints of a body with play, each with the neighbouring hinge that is its play.

        That hinge is free between stops, undriven, and has the same axis.
        """
        hinge = self.mujoco.mjtJoint.mjJNT_HINGE
        hinges = [j for j in self._joints(body) if self.types[j] == hinge]
        loose = {j: play for j in hinges if j not in self.drives and (play := self._dead_band(j))}
        firm = [j for j in hinges if j not in loose]
        for hinge, play in loose.items():
            axis, place = self.model.jnt_axis, self.model.jnt_pos
            near = [
                j for j in firm if abs(hinge - j) == 1
                and np.abs(np.cross(place[j] - place[hinge], axis[hinge])).max() < _PARALLEL
                and np.abs(np.cross(axis[j], axis[hinge])).max() < _PARALLEL
            ]  # fmt: skip
            if near:
                firm.remove(near[0])
                yield near[0], play

    def _dead_band(self, joint: int) -> _Play | None:
        """A hinge as play between stops, its own or those of a tendon on it alone, if any."""
        model, tendons = self.model, self.mujoco.mjtWrap.mjWRAP_JOINT
        inertia = 1.0 / float(model.dof_invweight0[self._dof(joint)])
        # A tendon on this joint alone: slack between two lengths of its spring, or limited.
        for t in range(model.ntendon):
            at = int(model.tendon_adr[t])
            if model.tendon_num[t] != 1 or model.wrap_type[at] != tendons:
                continue
            low, high = model.tendon_lengthspring[t]
            arm, spring = float(model.wrap_prm[at]), float(np.ravel(model.tendon_stiffness[t])[0])
            if arm == 0.0:
                continue
            if model.wrap_objid[at] == joint and spring > 0.0 and high > low:
                damping = float(np.ravel(model.tendon_damping[t])[0])
                width = float(high - low) / abs(arm)
                return _Play(joint, width, spring * arm**2, damping * arm**2)
            if model.wrap_objid[at] == joint and model.tendon_limited[t]:
                width = float(np.ptp(model.tendon_range[t])) / abs(arm)
                solver = model.tendon_solref_lim[t], model.tendon_solimp_lim[t]
                return _Play(joint, width, *_stop(*solver, inertia))
        if not model.jnt_limited[joint] or not 0.0 < np.ptp(model.jnt_range[joint]) <= WIDEST_PLAY:
            return None
        solver = model.jnt_solref[joint], model.jnt_solimp[joint]
        return _Play(joint, float(np.ptp(model.jnt_range[joint])), *_stop(*solver, inertia))

    def _position_drives(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Position actuators as servos, by joint: 1 V stands for 1 N m or 1 N.

        Actuators on one joint add up; several are left out if limits cut each by itself.
        """
        model = self.model
        self.undriven: dict[str, list[str]] = {}
        by_joint: dict[int, list[int]] = {}
        for i in range(model.nu):
            reason = self._not_driven(i)
            if reason:
                self._leave(reason, i)
            else:
                by_joint.setdefault(int(model.actuator_trnid[i, 0]), []).append(i)
        for joint, actuators in by_joint.items():
            cut = any(model.actuator_forcelimited[i] or self._clamps(i) for i in actuators)
            if cut and len(actuators) > 1:
                for i in actuators:
                    self._leave("several actuators with limits on one joint", i)
            else:
                yield joint, self._servo(joint, actuators)

    def _not_acted_on(self) -> Iterator[int]:
        """Joints on which no actuator acts, in a robot with actuators: they are free in MuJoCo."""
        mujoco, model = self.mujoco, self.model
        if not model.nu:
            return
        data = mujoco.MjData(model)
        # Somewhere, lest a tendon's arm be zero there by chance.
        data.qpos[:] = np.random.default_rng(0).uniform(-1.0, 1.0, model.nq)
        for step in ("kinematics", "comPos", "tendon", "transmission"):
            getattr(mujoco, f"mj_{step}")(model, data)
        acted = {*data.moment_colind[data.actuator_moment != 0.0].tolist()}
        for j in self.joints:
            ball = self.types[j] == mujoco.mjtJoint.mjJNT_BALL
            if not ball and j not in self.mimics and self._dof(j) not in acted:
                yield j

    def _leave(self, reason: str, actuator: int) -> None:
        """Note an actuator that is left out, and the reason."""
        name = self.model.actuator(actuator).name or f"actuator {actuator + 1}"
        self.undriven.setdefault(reason, []).append(name)

    def _not_driven(self, i: int) -> str:
        """The reason why an actuator is no servo of a joint; empty if it is one."""
        model, mujoco, kinds = self.model, self.mujoco, self.mujoco.mjtTrn
        kind, joint = kinds(model.actuator_trntype[i]), int(model.actuator_trnid[i, 0])
        if kind not in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
            return "actuators of other things than joints"
        if model.actuator_dyntype[i] != mujoco.mjtDyn.mjDYN_NONE:
            return "actuators with a state (intvelocity, time constants, muscles)"
        constant, stiffness, damping = -model.actuator_biasprm[i, :3]
        plain = model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
        plain &= model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE
        if not (plain and stiffness > 0.0 and damping >= 0.0 and model.actuator_gainprm[i, 0]):
            return "actuators without position gains"
        if constant:
            return "actuators with a constant bias"
        if joint not in self.joints or self.types[joint] == mujoco.mjtJoint.mjJNT_BALL:
            return "actuators of balls, or of what is left out"
        off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION
        group = int(model.actuator_group[i])
        if off or (0 <= group < 31 and model.opt.disableactuator >> group & 1):
            return "actuators that are disabled"
        if np.ravel(getattr(model, "actuator_delay", np.zeros(model.nu)))[i] > 0.0:
            return "actuators with a delay"
        return ""

    def _clamps(self, actuator: int) -> bool:
        """Whether the control of an actuator is clamped to its range."""
        off = self.model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        return bool(self.model.actuator_ctrllimited[actuator]) and not off

    def _servo(self, joint: int, actuators: Sequence[int]) -> dict[str, Any]:
        """The servo that the actuators of one joint are together, all with the same goal.

        A position actuator's force is -k (q - goal) - d v. As a servo of 1 V per N m: the
        proportional gain is k, and its back EMF brakes by torque_constant^2 / resistance = d. The
        servo's supply is out of reach (`_UNBOUNDED`).
        """
        model = self.model
        gears = model.actuator_gear[actuators, 0]
        _, stiffness, damping = (-model.actuator_biasprm[actuators, :3].T * gears**2).sum(1)
        brake = float(damping) or 1e-9 * float(stiffness)
        servo: dict[str, Any] = {
            "kind": "servo", "voltage": _UNBOUNDED * float(stiffness), "p_gain": float(stiffness),
            "torque_constant": brake, "resistance": brake,
        }  # fmt: skip
        first, ranges = actuators[0], []
        if model.actuator_forcelimited[first]:
            ranges.append(abs(float(gears[0])) * model.actuator_forcerange[first])
        if model.jnt_actfrclimited[joint]:
            ranges.append(model.jnt_actfrcrange[joint])
        if ranges:
            effort = float(np.abs(ranges).min())
            if effort == 0.0:
                name = self.joint_names[joint]
                raise JointplayError(
                    f"the MJCF {str(self.path)!r} allows the drive of {name!r} no force one way: "
                    "a forcerange or actuatorfrcrange that is 0 there cannot be read"
                )
            servo["effort"] = effort
            if any(low != -high for low, high in ranges):
                self.remarks.append(
                    f"note: the force of the drive of {self.joint_names[joint]} is limited one way "
                    f"more than the other in the MJCF, here to {effort:g} both ways"
                )
        if self._clamps(first):
            gain = model.actuator_gainprm[first, 0]
            goal = gain / -model.actuator_biasprm[first, 1] / gears[0]
            servo["goals"] = sorted(float(goal * end) for end in model.actuator_ctrlrange[first])
        return servo

    def _mimics(self) -> dict[int, tuple[int, float, float]]:
        """Joints that follow others linearly, by equalities: leader, factor and offset by joint."""
        model, followers = self.model, {}
        self.equalities: list[str] = []
        hidden = {play.hinge: joint for joint, play in self.play.items()}
        if model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_EQUALITY:
            return {}
        for i in range(model.neq):
            follower, leader = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
            kind = self.mujoco.mjtEq(model.eq_type[i])
            linear = kind == self.mujoco.mjtEq.mjEQ_JOINT and not model.eq_data[i, 2:5].any()
            if not model.eq_active0[i]:
                continue
            if not linear or not {follower, leader} <= {*self.joints} or follower in followers:
                held = kind == self.mujoco.mjtEq.mjEQ_JOINT and {follower, leader} & {*hidden}
                for hinge in held or ():
                    self.remarks.append(
                        f"note: an equality of the MJCF holds {self.joint_names[hinge]} and so "
                        f"shuts the play of {self.joint_names[hidden[hinge]]} in MuJoCo; here it "
                        "is free"
                    )
                if not held:
                    self._leave_equality(i, kind)
                continue
            offset, factor = (float(value) for value in model.eq_data[i, :2])
            zero, leads = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (follower, leader))
            followers[follower] = (leader, factor, offset + zero - factor * leads)
        return followers

    def _leave_equality(self, i: int, kind: Any) -> None:
        """Note an equality that is left out.

        Raises:
            JointplayError: it acts on the robot, which would be another without it.
        """
        kinds, model = self.mujoco.mjtEq, self.model
        word = kind.name.removeprefix("mjEQ_").lower()
        ends = [int(end) for end in (model.eq_obj1id[i], model.eq_obj2id[i]) if end >= 0]
        names, acts = [], True
        if kind == kinds.mjEQ_JOINT:
            names, acts = [self.joint_names[j] for j in ends], bool({*ends} & {*self.joints})
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            if model.eq_objtype[i] == self.mujoco.mjtObj.mjOBJ_SITE:
                ends = [int(model.site_bodyid[site]) for site in ends]
            names, acts = [self.body_names[b] for b in ends], bool({*ends} & {*self.bodies})
        elif kind == kinds.mjEQ_TENDON:
            names = [model.tendon(t).name for t in ends]
        else:  # of flexes
            acts = False
        if not acts:
            self.equalities.append(word)
            return
        loop = kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD)
        cure = "close the loop by [loops] of a scenario" if loop else "hold joints by fix"
        raise JointplayError(
            f"the MJCF {str(self.path)!r} has the equality <{word}> of {few(names)}, which cannot "
            f"be read, and without it the robot is another: take it out or set its active to "
            f"false, and {cure}"
        )

    # The URDF.

    def text(self) -> str:
        """Write the URDF, with what it has no words for; fills `tables` on the way."""
        base = _unused("floating_base", self.names) if self.floats else "world"
        root = Element("robot", {"name": self.path.stem})
        link = put(root, "link", name=base)
        if not self.floats:
            self._put_shapes(link, 0)
        inertias = self._inertias()
        for i in self.bodies:
            self._put_body(root, i, base, inertias)
        if self.floats:
            self.tables["robot"] = {"base": "free"}
        gravity = self.model.opt.gravity
        if self.model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_GRAVITY:
            gravity = np.zeros(3)
        if not np.array_equal(gravity, urdf.STANDARD_GRAVITY):
            self.tables.setdefault("robot", {})["gravity"] = [float(value) for value in gravity]
        self._fill_tables()
        named = self.joint_names
        hinges = {named[joint]: named[play.hinge] for joint, play in self.play.items()}
        beyond = {
            "tables": self.tables,
            "notes": list(self.notes()),
            "hinges": hinges,
            "armature": self.armature,
        }
        put(root, urdf.BEYOND).text = json.dumps(beyond)
        return document(root)

    def _inertias(self) -> list[pin.Inertia]:
        """Inertia of each body in its frame.

        Bodies fixed to others whose inertia has a zero, such as point masses, count to the other's.
        """
        model, inertias = self.model, [pin.Inertia.Zero()]
        for i in range(1, model.nbody):
            axes = placed(model.body_ipos[i], model.body_iquat[i])
            tensor = axes.rotation @ np.diag(model.body_inertia[i]) @ axes.rotation.T
            mass = float(model.body_mass[i])
            inertias.append(pin.Inertia(mass, axes.translation, 0.5 * (tensor + tensor.T)))
        for i in range(model.nbody - 1, 0, -1):
            if not model.body_inertia[i].all() and not model.body_jntnum[i]:
                place = placed(model.body_pos[i], model.body_quat[i])
                inertias[model.body_parentid[i]] += place.act(inertias[i])
                inertias[i] = pin.Inertia.Zero()
        return inertias

    def _put_body(
        self, root: Element, body: int, base: str, inertias: Sequence[pin.Inertia]
    ) -> None:
        """Append a body: a link for each of its joints in series, and frames for its sites.

        A joint turns about its anchor, which is where a URDF has the child's frame. Only a last
        joint whose anchor is the body's origin leads to the body's own link directly.
        """
        model, name = self.model, self.body_names[body]
        above = int(model.body_parentid[body])
        parent = self.body_names[above] if above else base
        place = placed(model.body_pos[body], model.body_quat[body])
        joints = [j for j in self._joints(body) if j in self.joints]
        for j in joints:
            anchor = pin.SE3(np.eye(3), model.jnt_pos[j].copy())
            last = j == joints[-1] and not model.jnt_pos[j].any()
            child = name if last else _unused(f"{name}_at_{self.joint_names[j]}", self.names)
            if child != name:
                put(root, "link", name=child)
            self._put_joint(root, j, parent, child, place * anchor)
            parent, place = child, anchor.inverse()
        link = put(root, "link", name=name)
        if parent != name:
            put_joint(root, _unused(f"{name}_fixed", self.names), parent, name, place)
        if inertias[body].mass > 0.0:
            put_inertial(link, inertias[body])
        self._put_shapes(link, body)
        wrapped = set(model.wrap_objid[model.wrap_type == self.mujoco.mjtWrap.mjWRAP_SITE])
        for s in np.flatnonzero(model.site_bodyid == body):
            site = model.site(s).name
            if site and s not in wrapped:
                frame = _unused(site, self.names)
                put(root, "link", name=frame)
                at = placed(model.site_pos[s], model.site_quat[s])
                put_joint(root, _unused(f"{frame}_fixed", self.names), name, frame, at)

    def _put_joint(
        self, root: Element, joint: int, parent: str, child: str, place: pin.SE3
    ) -> None:
        model, kinds = self.model, self.mujoco.mjtJoint
        axis, limited = model.jnt_axis[joint], bool(model.jnt_limited[joint])
        kind = "revolute" if limited else "continuous"
        if self.types[joint] == kinds.mjJNT_BALL:
            kind = "floating"
        elif self.types[joint] == kinds.mjJNT_SLIDE:
            kind = "prismatic"
        if kind != "floating":  # zero is where MuJoCo's coordinate is zero
            zero = -float(model.qpos0[model.jnt_qposadr[joint]]) * axis
            still = np.zeros(3)
            place = place * (
                pin.SE3(np.eye(3), zero) if kind == "prismatic" else pin.SE3(pin.exp3(zero), still)
            )
        element = put_joint(root, self.joint_names[joint], parent, child, place, kind)
        if kind == "floating":
            return
        put(element, "axis", xyz=axis)
        low, high = model.jnt_range[joint] if limited else (0.0, 0.0)
        effort = np.abs(model.jnt_actfrcrange[joint]).min() if model.jnt_actfrclimited[joint] else 0
        put(element, "limit", lower=low, upper=high, effort=effort, velocity=0.0)
        # Friction before a play acts on the motor: there the servo has it.
        before_play = joint in self.play and joint in self.drives
        losses = {} if before_play else self._losses(joint)
        put(
            element, "dynamics",
            damping=losses.get("viscous", 0.0), friction=losses.get("friction", 0.0),
        )  # fmt: skip
        if joint in self.mimics:
            leader, factor, offset = self.mimics[joint]
            follows = {"multiplier": factor, "offset": offset}
            put(element, "mimic", joint=self.joint_names[leader], **follows)

    def _losses(self, joint: int) -> dict[str, float]:
        """Friction of a joint, by the fields of a servo."""
        return {
            "friction": self._loss("frictionloss", joint),
            "viscous": self._loss("damping", joint),
        }

    def _put_shapes(self, link: Element, body: int) -> None:
        """Append a body's geoms as visual and collision shapes."""
        model = self.model
        for g in np.flatnonzero(model.geom_bodyid == body):
            tags = ["visual"] * bool(model.geom_group[g] < _COLLISION_GROUP)
            tags += ["collision"] * bool(model.geom_contype[g] or model.geom_conaffinity[g])
            material = int(model.geom_matid[g])
            colour = model.geom_rgba[g] if material < 0 else model.mat_rgba[material]
            for place, form, sizes in self._shapes(int(g)):
                for role in tags:
                    shape = put_shape(link, role, place, form, **sizes)
                    if role == "visual":
                        looks = put(shape, "material", name=" ".join(f"{x:.3g}" for x in colour))
                        put(looks, "color", rgba=colour)

    def _shapes(self, geom: int) -> Iterator[tuple[pin.SE3, str, dict[str, Any]]]:
        """URDF shapes that make up a geom: pose, tag, attributes; none for planes and the like."""
        model, kinds = self.model, self.mujoco.mjtGeom
        place = placed(model.geom_pos[geom], model.geom_quat[geom])
        size, kind = model.geom_size[geom], kinds(model.geom_type[geom])
        if geom in self.pictures:
            mesh, moved = self.pictures[geom], int(model.geom_dataid[geom])
            if moved >= 0:  # MuJoCo has put the mesh's frame into its centre of mass
                place = place * placed(model.mesh_pos[moved], model.mesh_quat[moved]).inverse()
            else:
                place = place * mesh.place
            file, home = Path(mesh.file), self.path.parent
            if file.is_relative_to(home):
                file = file.relative_to(home)
            yield place, "mesh", {"filename": str(file), "scale": mesh.scale}
        elif kind == kinds.mjGEOM_SPHERE:
            yield place, "sphere", {"radius": size[0]}
        elif kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
            yield place, "cylinder", {"radius": size[0], "length": 2.0 * size[1]}
            for end in (-size[1], size[1]) if kind == kinds.mjGEOM_CAPSULE else ():
                ball = place * pin.SE3(np.eye(3), np.array([0.0, 0.0, end]))
                yield ball, "sphere", {"radius": size[0]}
        elif kind == kinds.mjGEOM_BOX:
            yield place, "box", {"size": 2.0 * size}

    # Tables of a scenario, and notes.

    def _fill_tables(self) -> None:
        """Fill `tables` with balls, gears, drives and springs, and `armature`."""
        model, named = self.model, self.joint_names
        gears, drives, balls, springs = ({} for _ in range(4))
        for j in self.joints:
            if self.types[j] == self.mujoco.mjtJoint.mjJNT_BALL:
                balls[named[j]] = {"kind": "spherical", "ideal": True, "radial_clearance": 1e-4}
                continue
            armature, play = self._loss("armature", j), self.play.get(j)
            if play is not None:
                rotor = armature or self._loss("armature", play.hinge)
                gears[named[j]] = {
                    "kind": "backlash", "play": play.width, "stiffness": play.stiffness,
                    "damping": play.damping,
                } | ({"rotor_inertia": rotor} if rotor else {})  # fmt: skip
            elif armature > 0.0:
                self.armature[named[j]] = armature
            if j in self.drives and j not in self.mimics:
                drives[named[j]] = self.drives[j] | ({} if play is None else self._losses(j))
            elif j in self.passive:
                drives[named[j]] = {"kind": "free"}
            spring = float(model.jnt_stiffness.reshape(model.njnt, -1)[j, 0])
            if spring > 0.0:
                unloaded = float(model.qpos_spring[model.jnt_qposadr[j]])
                springs[f"{named[j]}_spring"] = {
                    "kind": "torsion-spring", "joint": named[j], "stiffness": spring,
                    "rest": unloaded,
                }  # fmt: skip
        filled = {"joints": balls, "gears": gears, "drives": drives, "loads": springs}
        self.tables.update({table: rows for table, rows in filled.items() if rows})

    def notes(self) -> Iterator[str]:
        """Notes on what was read besides the tree, and on what was not."""
        model, named = self.model, self.joint_names
        if self.play:
            parts: dict[str, list[str]] = {}
            for j, play in self.play.items():
                parts.setdefault(f"{math.degrees(play.width):.3g} deg", []).append(named[j])
            widths = "; ".join(f"{width} in {few(names)}" for width, names in parts.items())
            yield f"note: the MJCF has backlash, here of gears as stiff as its stops: {widths}"
        if driven := [named[j] for j in self.joints if j in self.drives and j not in self.mimics]:
            yield (
                "position actuators of the MJCF, here servos with its gains, 1 V for 1 N m: "
                f"{few(driven)}"
            )
        if self.passive:
            names = few([named[j] for j in self.joints if j in self.passive])
            yield f"note: no actuator of the MJCF acts on {names}: free, unless [drives] drives it"
        elif self.joints and not model.nu:
            yield (
                "note: the MJCF has no actuators, by which all its joints would hang free; here "
                "the usual drives hold them, or follow a motion"
            )
        yield from self.remarks
        falling = model.jnt_range[:, 0] > model.jnt_range[:, 1]
        if turned := [named[j] for j in self.joints if falling[j] and not model.jnt_limited[j]]:
            yield f"note: a range from above to below is none in MuJoCo: {few(turned)}"
        hinges = [play.hinge for play in self.play.values()]
        alone = model.tendon_adr[model.tendon_num == 1]
        alone = alone[model.wrap_type[alone] == self.mujoco.mjtWrap.mjWRAP_JOINT]
        tendons = sum(hinge in model.wrap_objid[alone] for hinge in hinges)
        left = {
            "contacts": any(model.geom_contype) or any(model.geom_conaffinity),
            "tendons": model.ntendon > tendons,
            "keyframes": model.nkey,
            "sensors": model.nsensor,
            "flexes": model.nflex,
            "gravity compensation": any(model.body_gravcomp),
            "fluid": model.opt.density or model.opt.viscosity,
            "damping or springs that are not linear": any(
                getattr(model, name).reshape(rows, -1)[:, 1:].any()
                for name, rows in (("dof_damping", model.nv), ("jnt_stiffness", model.njnt))
            ),
        }
        ball, free = self.mujoco.mjtJoint.mjJNT_BALL, self.mujoco.mjtJoint.mjJNT_FREE
        all_joints = (j for i in self.bodies for j in self._joints(i))
        groups = {
            "balls": [j for j in self.joints if self.types[j] == ball],
            "the free base": [j for j in all_joints if self.types[j] == free],
            "hinges of play": hinges,
        }
        for group, joints in groups.items():
            for word, array in _BESIDE.items():
                left[f"{word} of {group}"] = any(self._has(array, j) for j in joints)
        # The limits of a hinge of play are the play; its armature is the rotor's, if the joint has
        # none.
        if all(self._loss("armature", j) == 0.0 for j in self.play):
            left["armature of hinges of play"] = False
        left["limits of hinges of play"] = False
        left["that springs and friction stand before the play"] = any(
            self._has("jnt_stiffness", j)
            or (j not in self.drives and any(self._losses(j).values()))
            for j in self.play
        )
        for word in ("frictionloss", "limit", "passive", "spring", "damper", "equality"):
            flag = getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{word.upper()}", 0)
            left[f"that {word} is disabled"] = bool(model.opt.disableflags & int(flag))
        unread = [word for word, present in left.items() if present]
        if self.equalities:
            unread.append(f"equalities ({', '.join(dict.fromkeys(self.equalities))})")
        unread += [f"{reason} ({few(names)})" for reason, names in self.undriven.items()]
        if unread:
            yield f"note: not read of the MJCF: {', '.join(unread)}"

    def _has(self, array: str, joint: int) -> bool:
        """Whether a joint's entry in a compiled array, by joint or by freedom, is not zero."""
        values = getattr(self.model, array)
        row = joint if array.startswith("jnt") else self._dof(joint)
        return bool(values.reshape(len(values), -1)[row, 0])


def _stop(solref: Any, solimp: Any, inertia: float) -> tuple[float, float]:
    """Stiffness [N m/rad] and damping [N m s/rad] of MuJoCo's soft stop for an inertia [kg m2].

    MuJoCo's constraint is a + d (b v + k r) = (1 - d) a0, with the depth r, the impedance d and the
    acceleration a0 without the stop. At rest a load J a0 sinks in by r = a0 (1 - d) / (d k): the
    stop is a spring of J k d / (1 - d).
    """
    impedance = float(solimp[0])
    most = float(solimp[1])
    first, second = (float(value) for value in solref)
    if first > 0.0:
        stiffness = 1.0 / (most * first * second) ** 2
        damping = 2.0 / (most * first)
    else:
        stiffness, damping = -first / most**2, -second / most
    share = inertia * impedance / (1.0 - impedance)
    return share * stiffness, share * damping
