"""The user's own MJCF with play put into it; all else stays as it is written there.

The text is edited, because MuJoCo writes numbers with six digits. Play is the same as in MJCFs that
are made of URDFs (`reduced_mjcf`): a hinge in series with the joint and a tendon with a dead band.
A second hinge that is the joint's play already is taken for it.
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
from jointplay.bridges.reduction import Reduction, is_own
from jointplay.bridges.urdf import to_urdf
from jointplay.model.elements import Element, put, written
from jointplay.model.mechanism import Mechanism
from jointplay.model.mjcf import load_mujoco, placed
from jointplay.model.mjcf_whole import compile_file, compile_text
from jointplay.model.urdf import parse

_DEEPEST = 20
"""Files that may include each other, one in the other."""
_PLAIN = {
    **dict.fromkeys(("limited", "actuatorfrclimited"), "false"),
    **dict.fromkeys(("armature", "damping", "frictionloss", "stiffness", "ref", "springref"), "0"),
    "springdamper": "0 0",
}
"""Of a hinge that has nothing from a class of defaults."""


@dataclass(frozen=True)
class OwnRobot:
    """An MJCF into which play is put; in use as `reduced_mjcf.CompiledRobot`."""

    mechanism: Mechanism
    root: Element
    model: Any
    """As MuJoCo compiled it, without the play put in."""
    pose: Mapping[str, float]
    """Joint positions, the rest zero [rad or m]."""
    reductions: tuple[Reduction, ...]
    meshes: Mapping[str, bytes]
    """None: they stay where they lie."""

    def mjcf(
        self,
        reductions: Iterable[Reduction],
        *,
        encoder: str = "motor",
        servos: Mapping[str, Any] | None = None,
    ) -> str:
        """The MJCF with these numbers of play; actuators, sensors and all else are its own.

        Reductions are without the joints' own friction (`reduce`), which stays before the play.

        Raises:
            JointplayError: a joint that the file does not have by its name, once.
        """
        check_encoder(encoder)
        root, added = copy.deepcopy(self.root), []
        tendon = root.find("tendon")
        tendon = Element("tendon") if tendon is None else tendon
        ones = list(reductions)
        loose = [one for one in ones if one.dead_band > 0.0]
        hinges = []
        for one in ones:
            losses = one.friction, one.viscous
            if one in loose:
                hinge, new = self._hinge(root, one)
                added += [one.joint] * new
                hinges.append(hinge)
                _put_tendons(tendon, one, hinge, *losses)
            elif any(losses):
                self._rub(root, one.joint, *losses)
        self._resize_keys(root, added)
        if len(tendon) and tendon not in root:
            root.append(tendon)
        if loose:
            step = self._resolving_step(root, loose, hinges)
            if step < self.model.opt.timestep:
                _last(root, "option").set("timestep", f"{step:.6g}")
        return _text(root)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is in the file, and what is not as it was."""
        return tuple(self._said())

    def _said(self) -> Iterator[str]:
        path = self.mechanism.description.path.resolve()
        assets = " and its meshes and textures in " + str(path.parent) if self._has_files else ""
        yield (
            f"the MJCF is {path.name} with play put in: its friction stays before the play, at the "
            f"motors,{assets}".rstrip(",")
        )
        written = ElementTree.fromstring(self.mjcf(self.reductions))
        steps = [one.get("timestep") for one in written.findall("option")]
        step = float(next((one for one in reversed(steps) if one), self.model.opt.timestep))
        if step < self.model.opt.timestep:
            yield (
                f"note: the step of the MJCF is now {1e3 * step:.4g} ms, for the teeth; it was "
                f"{1e3 * self.model.opt.timestep:.4g} ms"
            )
        held = self.mechanism.description.beyond.hinges or {}
        for one in self.reductions:
            hinge = held.get(one.joint)
            if hinge and one.dead_band > 0.0 and [*_equalities(self.root, hinge)]:
                yield f"note: the equality of {hinge}, which would hold the play shut, is left out"

    @property
    def _has_files(self) -> bool:
        return bool([*_with_files(self.root)])

    def _hinge(self, root: Element, one: Reduction) -> tuple[str, bool]:
        """Name of a joint's hinge of play, and whether it was put in."""
        holder, joint = _find(root, one.joint)
        row = self.model.joint(one.joint).dofadr[0]
        if not np.isclose(self.model.dof_armature[row], one.rotor_inertia, rtol=1e-9, atol=0.0):
            joint.set("armature", written(one.rotor_inertia))
        known = (self.mechanism.description.beyond.hinges or {}).get(one.joint)
        if known is not None:
            _find(root, known)[1].set("limited", "false")
            for holder, equality in [*_equalities(root, known)]:  # it would hold the play shut
                holder.remove(equality)
                if not len(holder):
                    root.remove(holder)
            return known, False
        name = f"{one.joint}_play"
        place = {key: value for key, value in joint.items() if key in ("class", "pos", "axis")}
        hinge = Element("joint", {"name": name, "type": "hinge", **place, **_PLAIN})
        holder.insert([*holder].index(joint) + 1, hinge)
        return name, True

    def _rub(self, root: Element, name: str, friction: float, viscous: float) -> None:
        """Add the friction of a bearing to a joint without play about its axis."""
        _, joint = _find(root, name)
        row = self.model.joint(name).dofadr[0]
        for key, more in (("frictionloss", friction), ("damping", viscous)):
            own = getattr(self.model, f"dof_{key}").reshape(self.model.nv, -1)[row, 0]
            joint.set(key, written(own + more))

    def _resize_keys(self, root: Element, added: Sequence[str]) -> None:
        """Put zeros for the new hinges into the keyframes."""
        for key in root.findall("keyframe/key"):
            for name, first in (("qpos", "qposadr"), ("qvel", "dofadr")):
                if values := key.get(name, "").split():
                    behind = [getattr(self.model.joint(one), first)[0] + 1 for one in added]
                    key.set(name, " ".join(np.insert(np.array(values, object), behind, "0")))

    def _resolving_step(
        self, root: Element, loose: Sequence[Reduction], hinges: Sequence[str]
    ) -> float:
        """The longest step of the whole file that resolves the teeth [s]."""
        model = compile_text(_text(root))
        rows = [int(model.joint(name).dofadr[0]) for name in hinges]
        mass = mass_at(model, self.pose)
        return resolving_step(mass, rows, [one.stiffness for one in loose])


def own_robot(
    mechanism: Mechanism, reductions: Sequence[Reduction], pose: Mapping[str, float], tilt: bool
) -> OwnRobot:
    """A robot's own MJCF, files that it includes put in their place; `pose` as for `compile_robot`.

    Raises:
        JointplayError: MuJoCo cannot compile it, or the tilt of an axis is asked for.
    """
    if tilt:
        raise JointplayError(
            "--tilt is for MJCFs that are made of a URDF; into an MJCF of your own only play about "
            "an axis is put"
        )
    root, model = _whole(mechanism)
    return OwnRobot(mechanism, root, model, pose, tuple(reductions), {})


def corrected_mjcf(
    mechanism: Mechanism, corrections: Mapping[str, pin.SE3]
) -> tuple[str, Mapping[str, bytes]]:
    """A robot's MJCF with its joints where a calibration found them, and files of its meshes.

    An MJCF of the user's own stays as it is but for the places of bodies; of other robots MuJoCo
    makes one of the corrected URDF, with all digits of the places.

    Args:
        mechanism: the robot as it was calibrated.
        corrections: see `to_urdf`.

    Raises:
        JointplayError: MuJoCo is not installed or cannot compile the robot; a body of the MJCF that
            has several joints, lies in a <frame>, or is not written there once.
    """
    if not is_own(mechanism.description):
        text = to_urdf(mechanism.ideal(), corrections)
        new = Mechanism(parse(text, mechanism.description.path, mechanism.allow_unphysical))
        made = compile_robot(new, ())
        root = ElementTree.fromstring(made.mjcf(()))
        for name, joint in new.description.joints.items():
            body = next((one for one in root.iter("body") if one.get("name") == joint.child), None)
            if body is not None and name in corrections:
                _set_place(body, new.model.jointPlacements[new.model.getJointId(name)])
        return _text(root), made.meshes
    root, model = _whole(mechanism)
    hidden = set((mechanism.description.beyond.hinges or {}).values())
    for name, off in corrections.items():
        joint = model.joint(name)
        number = int(joint.bodyid[0])
        element, _ = _find(root, name)
        others = {model.joint(int(j)).name for j in np.flatnonzero(model.jnt_bodyid == number)}
        if others - hidden - {name}:
            raise JointplayError(
                f"the correction of {name!r} cannot be written: its body has several joints"
            )
        if any(element in frame.iter("body") for frame in root.iter("frame")):
            raise JointplayError(f"the correction of {name!r} cannot be written: a <frame> has it")
        anchor = pin.SE3(np.eye(3), joint.pos.copy())
        way = -float(joint.qpos0[0]) * joint.axis
        turns = joint.type[0] == load_mujoco().mjtJoint.mjJNT_HINGE
        zero = pin.SE3(pin.exp3(way), np.zeros(3)) if turns else pin.SE3(np.eye(3), way)
        at = anchor * zero  # the joint's frame, its coordinate zero
        place = placed(model.body_pos[number], model.body_quat[number])
        _set_place(element, place * at * off * at.inverse())
    return _text(root), {}


def _whole(mechanism: Mechanism) -> tuple[Element, Any]:
    """The text of an MJCF in one piece, and as MuJoCo compiles it."""
    path = mechanism.description.path.resolve()
    model = compile_file(path)
    root = _parse(path)
    _include(root, path.parent, _DEEPEST)
    if [*_with_files(root)]:  # which stay where they lie
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
    """Meshes, textures and the like whose files an MJCF names."""
    for holder in (*root.findall("asset"), *root.findall("deformable"), *root.findall("worldbody")):
        for part in holder.iter():
            if part.tag != "model" and any(key.startswith("file") for key in part.attrib):
                yield part


def _equalities(root: Element, hinge: str) -> Iterator[tuple[Element, Element]]:
    """Equalities of a hinge, each with what it is in."""
    for holder in root.findall("equality"):
        for equality in holder.findall("joint"):
            if hinge in (equality.get("joint1"), equality.get("joint2")):
                yield holder, equality


def _last(root: Element, tag: str) -> Element:
    """The last section of this name, which counts most; a new one if there is none."""
    found = root.findall(tag)
    return found[-1] if found else put(root, tag)


def _set_place(body: Element, place: pin.SE3) -> None:
    for key in ("quat", "axisangle", "xyaxes", "zaxis", "euler"):
        body.attrib.pop(key, None)
    x, y, z, w = pin.Quaternion(place.rotation).coeffs()
    body.set("pos", written(place.translation))
    body.set("quat", written([w, x, y, z]))


def _text(root: Element) -> str:
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _parse(path: Path) -> Element:
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    return ElementTree.fromstring(read_text(path, "MJCF"), parser)


def _include(element: Element, folder: Path, deepest: int) -> None:
    """Put the content of included files in the place of each <include>."""
    if not deepest:
        raise JointplayError(f"files of the MJCF include each other more than {_DEEPEST} deep")
    for position in range(len(element) - 1, -1, -1):
        one = element[position]
        if one.tag == "include":
            content = _parse(folder / one.get("file", ""))
            _include(content, folder, deepest - 1)
            element[position : position + 1] = [*content]
        else:
            _include(one, folder, deepest)


def _find(root: Element, name: str) -> tuple[Element, Element]:
    """A joint of the file, and the body in which it is."""
    found = [
        (body, one)
        for world in root.findall("worldbody")
        for body in world.iter()
        for one in body
        if one.tag == "joint" and one.get("name") == name
    ]
    if len(found) != 1:
        raise JointplayError(
            f"the joint {name!r} is not written in the MJCF by this name, once: it has no name, or "
            "comes of <replicate> or <attach>; give it one, or write it out"
        )
    return found[0]


def _put_tendons(
    tendon: Element, one: Reduction, hinge: str, friction: float, viscous: float
) -> None:
    """Put in what holds a hinge of play, in the place of what held it before."""
    names = {part.get("name") for part in tendon}
    for part in list(tendon):
        if part.get("name") == f"{one.joint}.play":
            tendon.remove(part)
        elif [wrapped.get("joint") for wrapped in part] == [hinge]:
            part.attrib.update({"stiffness": "0", "limited": "false"})
    put_play(tendon, one, hinge, friction, viscous)
    if f"{one.joint}.link" in names:  # and its losses are there
        tendon.remove(tendon[-1])
