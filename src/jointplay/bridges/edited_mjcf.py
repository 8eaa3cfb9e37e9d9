"""The user's own MJCF with play put into it; all else stays as it is written there.

The text is edited, as MuJoCo itself would write numbers with six digits. Play is represented as in
MJCFs made from URDFs (`reduced_mjcf`): a hinge in series with the joint and a tendon with a dead
band. A second hinge that already is the joint's play is used for it.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.files import read_text
from jointplay.bridges.reduced_files import check_encoder
from jointplay.bridges.reduced_mjcf import compile_robot, mass_at, put_play, resolving_step
from jointplay.bridges.reduction import Reduction, from_mjcf_file
from jointplay.bridges.urdf import to_urdf
from jointplay.model.elements import Element, put, written
from jointplay.model.mechanism import Mechanism
from jointplay.model.mjcf import load_mujoco, placed
from jointplay.model.mjcf_whole import compile_file, compile_text
from jointplay.model.urdf import parse

_DEEPEST = 20
"""Deepest nesting of included files (judged: more is a circle)."""
_PLAIN = {
    **dict.fromkeys(("limited", "actuatorfrclimited"), "false"),
    **dict.fromkeys(("armature", "damping", "frictionloss", "stiffness", "ref", "springref"), "0"),
    "springdamper": "0 0",
}
"""Attributes of a hinge of play that override all defaults of its class."""


@dataclass(frozen=True)
class EditedRobot:
    """An MJCF into which play is put; used like `reduced_mjcf.CompiledRobot`."""

    mechanism: Mechanism
    root: Element
    model: Any
    """The MJCF as MuJoCo compiles it, without the added play."""
    pose: Mapping[str, float]
    """Joint positions, the rest zero [rad or m]."""
    reductions: tuple[Reduction, ...]
    meshes: Mapping[str, bytes]
    """Files of meshes: none, as they stay where they are."""

    def mjcf(
        self,
        reductions: Iterable[Reduction],
        *,
        encoder: str = "motor",
        servos: Mapping[str, Any] | None = None,
    ) -> str:
        """The MJCF with these numbers of play; actuators, sensors and all else are its own.

        The reductions do not have the joints' own friction (`reduce`), which stays before the play.

        Raises:
            JointplayError: a joint that the file does not name exactly once.
        """
        check_encoder(encoder)
        root, added = copy.deepcopy(self.root), []
        tendon = root.find("tendon")
        tendon = Element("tendon") if tendon is None else tendon
        reductions = list(reductions)
        loose = [r for r in reductions if r.dead_band > 0.0]
        hinges = []
        for r in reductions:
            if r in loose:
                hinge, inserted = self._hinge(root, r)
                added += [r.joint] * inserted
                hinges.append(hinge)
                _put_tendons(tendon, r, hinge)
            elif r.friction or r.viscous:
                self._add_friction(root, r)
        self._resize_keys(root, added)
        if len(tendon) and tendon not in root:
            root.append(tendon)
        if loose:
            model = compile_text(_text(root))
            rows = [int(model.joint(name).dofadr[0]) for name in hinges]
            mass = mass_at(model, self.pose)
            step = resolving_step(mass, rows, [r.stiffness for r in loose])
            if step < self.model.opt.timestep:
                _last(root, "option").set("timestep", f"{step:.6g}")
        return _text(root)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the file's content, and on its differences from the original."""
        path = self.mechanism.description.path.resolve()
        files = [*_with_files(self.root)]
        assets = f" and its meshes and textures in {path.parent}" if files else ""
        lines = [
            f"the MJCF is {path.name} with play put in: its friction stays before the play, at the "
            f"motors,{assets}".rstrip(",")
        ]
        written = ElementTree.fromstring(self.mjcf(self.reductions))
        steps = [option.get("timestep") for option in written.findall("option")]
        step = float(next(filter(None, reversed(steps)), self.model.opt.timestep))
        if step < self.model.opt.timestep:
            lines.append(
                f"note: the step of the MJCF is now {1e3 * step:.4g} ms, for the teeth; it was "
                f"{1e3 * self.model.opt.timestep:.4g} ms"
            )
        hinges = self.mechanism.description.beyond.hinges or {}
        for r in self.reductions:
            hinge = hinges.get(r.joint)
            if hinge and r.dead_band > 0.0 and [*_equalities(self.root, hinge)]:
                lines.append(
                    f"note: the equality of {hinge}, which would hold the play shut, is left out"
                )
        return tuple(lines)

    def _hinge(self, root: Element, reduction: Reduction) -> tuple[str, bool]:
        """Prepare a joint's hinge of play; returns its name, and whether it was added."""
        holder, joint = _find(root, reduction.joint)
        row = self.model.joint(reduction.joint).dofadr[0]
        rotor = reduction.rotor_inertia
        if not np.isclose(self.model.dof_armature[row], rotor, rtol=1e-9, atol=0.0):
            joint.set("armature", written(rotor))
        play_hinge = (self.mechanism.description.beyond.hinges or {}).get(reduction.joint)
        if play_hinge is not None:
            _find(root, play_hinge)[1].set("limited", "false")
            for holder, equality in [*_equalities(root, play_hinge)]:  # they would lock the play
                holder.remove(equality)
                if not len(holder):
                    root.remove(holder)
            return play_hinge, False
        name = f"{reduction.joint}_play"
        attributes = {key: value for key, value in joint.items() if key in ("class", "pos", "axis")}
        hinge = Element("joint", {"name": name, "type": "hinge", **attributes, **_PLAIN})
        holder.insert([*holder].index(joint) + 1, hinge)
        return name, True

    def _add_friction(self, root: Element, reduction: Reduction) -> None:
        """Add the friction of a bearing to that of a joint without play about its axis."""
        _, joint = _find(root, reduction.joint)
        row = self.model.joint(reduction.joint).dofadr[0]
        for key, addition in (("frictionloss", reduction.friction), ("damping", reduction.viscous)):
            value = getattr(self.model, f"dof_{key}").reshape(self.model.nv, -1)[row, 0]
            joint.set(key, written(value + addition))

    def _resize_keys(self, root: Element, added: Sequence[str]) -> None:
        """Insert zeros for the added hinges into the keyframes."""
        for key in root.findall("keyframe/key"):
            for name, address in (("qpos", "qposadr"), ("qvel", "dofadr")):
                if values := key.get(name, "").split():
                    indices = [getattr(self.model.joint(joint), address)[0] + 1 for joint in added]
                    key.set(name, " ".join(np.insert(np.array(values, object), indices, "0")))


def edited_robot(
    mechanism: Mechanism, reductions: Sequence[Reduction], pose: Mapping[str, float], tilt: bool
) -> EditedRobot:
    """A robot's own MJCF, with included files inserted; `pose` as for `compile_robot`.

    Raises:
        JointplayError: MuJoCo cannot compile it, or the tilt of axes is asked for (`tilt`).
    """
    if tilt:
        raise JointplayError(
            "--tilt is for MJCFs that are made from a URDF; an MJCF of your own gets only the play "
            "about joints' own axes"
        )
    root, model = _load_included(mechanism)
    return EditedRobot(mechanism, root, model, pose, tuple(reductions), {})


def corrected_mjcf(
    mechanism: Mechanism, corrections: Mapping[str, pin.SE3]
) -> tuple[str, Mapping[str, bytes]]:
    """A robot's MJCF with its joints where a calibration found them, and files of its meshes.

    An MJCF of the user's own stays as it is but for the poses of bodies; for other robots MuJoCo
    makes one from the corrected URDF, in which the poses are written with all digits.

    Args:
        mechanism: the robot as it was calibrated.
        corrections: see `to_urdf`.

    Raises:
        JointplayError: MuJoCo is not installed or cannot compile the robot; a body of the MJCF that
            has several joints, lies in a <frame>, or is not written exactly once.
    """
    if not from_mjcf_file(mechanism.description):
        text = to_urdf(mechanism.ideal(), corrections)
        corrected = Mechanism(parse(text, mechanism.description.path, mechanism.allow_unphysical))
        compiled = compile_robot(corrected, ())
        root = ElementTree.fromstring(compiled.mjcf(()))
        bodies, model = {body.get("name"): body for body in root.iter("body")}, corrected.model
        for name, joint in corrected.description.joints.items():
            body = bodies.get(joint.child)
            if body is not None and name in corrections:
                _set_placement(body, model.jointPlacements[model.getJointId(name)])
        return _text(root), compiled.meshes
    root, model = _load_included(mechanism)
    hidden = set((mechanism.description.beyond.hinges or {}).values())
    for name, correction in corrections.items():
        joint = model.joint(name)
        number = int(joint.bodyid[0])
        element, _ = _find(root, name)
        names = {model.joint(int(j)).name for j in np.flatnonzero(model.jnt_bodyid == number)}
        if names - hidden - {name}:
            raise JointplayError(
                f"the correction of {name!r} cannot be written: its body has several joints"
            )
        if any(element in frame.iter("body") for frame in root.iter("frame")):
            raise JointplayError(f"the correction of {name!r} cannot be written: a <frame> has it")
        anchor = pin.SE3(np.eye(3), joint.pos.copy())
        offset = -float(joint.qpos0[0]) * joint.axis
        rotates = joint.type[0] == load_mujoco().mjtJoint.mjJNT_HINGE
        zero = pin.SE3(pin.exp3(offset), np.zeros(3)) if rotates else pin.SE3(np.eye(3), offset)
        joint_frame = anchor * zero  # the joint's frame, its coordinate zero
        body_frame = placed(model.body_pos[number], model.body_quat[number])
        _set_placement(element, body_frame * joint_frame * correction * joint_frame.inverse())
    return _text(root), {}


def _load_included(mechanism: Mechanism) -> tuple[Element, Any]:
    """A robot's MJCF as one element, with included files inserted, and as MuJoCo compiles it."""
    path = mechanism.description.path.resolve()
    model = compile_file(path)
    root = _parse(path)
    _include(root, path.parent, _DEEPEST)
    if [*_with_files(root)]:  # they stay where they are, so their folders become absolute
        folders = {"meshdir": "", "texturedir": ""}
        for compiler in root.findall("compiler"):
            for key in folders:
                folders[key] = compiler.get(key, compiler.get("assetdir", folders[key]))
        for key, value in folders.items():
            _last(root, "compiler").set(key, str(path.parent / value))
    for part in root.findall("asset/model"):
        part.set("file", str(path.parent / part.get("file", "")))
    return root, model


def _with_files(root: Element) -> Iterator[Element]:
    """Yield meshes, textures and other elements of an MJCF that name files."""
    for holder in (*root.findall("asset"), *root.findall("deformable"), *root.findall("worldbody")):
        for part in holder.iter():
            if part.tag != "model" and any(key.startswith("file") for key in part.attrib):
                yield part


def _equalities(root: Element, hinge: str) -> Iterator[tuple[Element, Element]]:
    """Yield the equalities of a hinge, each after its parent element."""
    for holder in root.findall("equality"):
        for equality in holder.findall("joint"):
            if hinge in (equality.get("joint1"), equality.get("joint2")):
                yield holder, equality


def _last(root: Element, tag: str) -> Element:
    """The last section of this name, which overrides the others; a new one if there is none."""
    sections = root.findall(tag)
    return sections[-1] if sections else put(root, tag)


def _set_placement(body: Element, placement: pin.SE3) -> None:
    for key in ("quat", "axisangle", "xyaxes", "zaxis", "euler"):
        body.attrib.pop(key, None)
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    body.set("pos", written(placement.translation))
    body.set("quat", written([w, x, y, z]))


def _text(root: Element) -> str:
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _parse(path: Path) -> Element:
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    return ElementTree.fromstring(read_text(path, "MJCF"), parser)


def _include(element: Element, folder: Path, deepest: int) -> None:
    """Replace each <include> by the content of its file."""
    if not deepest:
        raise JointplayError(f"files of the MJCF include each other more than {_DEEPEST} deep")
    for position in range(len(element) - 1, -1, -1):
        child = element[position]
        if child.tag == "include":
            content = _parse(folder / child.get("file", ""))
            _include(content, folder, deepest - 1)
            element[position : position + 1] = [*content]
        else:
            _include(child, folder, deepest)


def _find(root: Element, name: str) -> tuple[Element, Element]:
    """Body and element of a joint by its name."""
    matches = [
        (body, element)
        for world in root.findall("worldbody")
        for body in world.iter()
        for element in body
        if element.tag == "joint" and element.get("name") == name
    ]
    if len(matches) != 1:
        raise JointplayError(
            f"the MJCF does not name a joint {name!r} exactly once: it has no name there, or comes "
            "from <replicate> or <attach>; give it one, or write it out"
        )
    return matches[0]


def _put_tendons(tendon: Element, reduction: Reduction, hinge: str) -> None:
    """Add the tendons of a joint's play in place of those that held its hinge before."""
    names = {part.get("name") for part in tendon}
    for part in list(tendon):
        if part.get("name") == f"{reduction.joint}.play":
            tendon.remove(part)
        elif [wrapped.get("joint") for wrapped in part] == [hinge]:
            part.attrib.update({"stiffness": "0", "limited": "false"})
    put_play(tendon, reduction, hinge)
    if f"{reduction.joint}.link" in names:  # the file has this tendon, with its losses, already
        tendon.remove(tendon[-1])
