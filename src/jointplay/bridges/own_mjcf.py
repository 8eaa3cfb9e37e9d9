"""The user's own MJCF with play put into it; all else stays as it is written there.

The text is edited, because MuJoCo writes numbers with six digits. Play is the same as in MJCFs that
are made of URDFs (`reduced_mjcf`): a hinge in series with the joint and a tendon with a dead band.
A second hinge that is the joint's play already is taken for it.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.files import is_file, read_text
from jointplay.bridges.reduced_files import check_encoder
from jointplay.bridges.reduced_mjcf import compile_robot, mass_at, put_play, resolving_step
from jointplay.bridges.reduction import Reduction
from jointplay.bridges.urdf import to_urdf
from jointplay.model.elements import Element, put, written
from jointplay.model.mechanism import Mechanism
from jointplay.model.mjcf import load_mujoco, load_spec, placed
from jointplay.model.urdf import Description, parse

_DEEPEST = 20
"""Files that may include each other, one in the other."""
_PLAIN = {
    **dict.fromkeys(("limited", "actuatorfrclimited"), "false"),
    **dict.fromkeys(("armature", "damping", "frictionloss", "stiffness", "ref", "springref"), "0"),
    "springdamper": "0 0",
}
"""Of a hinge that has nothing from a class of defaults."""


def is_own(description: Description) -> bool:
    """Whether a robot was read of an MJCF that is there."""
    return (
        description.beyond.hinges is not None
        and not description.stored
        and is_file(description.path)
    )


@dataclass(frozen=True)
class OwnRobot:
    """An MJCF into which play is put; in use as `reduced_mjcf.CompiledRobot`."""

    mechanism: Mechanism
    root: Element
    model: Any
    """As MuJoCo compiled it, without the play put in."""
    pose: Mapping[str, float]
    """Joint positions, the rest zero [rad or m]."""
    notes: tuple[str, ...]
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

        Raises:
            JointplayError: a joint that the file does not have by its name, once.
        """
        check_encoder(encoder)
        root, added = copy.deepcopy(self.root), []
        tendon = root.find("tendon")
        tendon = put(root, "tendon") if tendon is None else tendon
        ones = list(reductions)
        loose = [one for one in ones if one.dead_band > 0.0]
        hinges = []
        for one in ones:
            entry = self.mechanism.description.joints[one.joint]
            losses = max(one.friction - entry.friction, 0.0), max(one.viscous - entry.damping, 0.0)
            if one in loose:
                hinge, new = self._hinge(root, one)
                added += [one.joint] * new
                hinges.append(hinge)
                _put_tendons(tendon, one, hinge, *losses)
            elif any(losses):
                self._rub(root, one.joint, *losses)
        self._resize_keys(root, added)
        if loose:
            self._refine(root, loose, hinges)
        return _text(root)

    def _hinge(self, root: Element, one: Reduction) -> tuple[str, bool]:
        """Name of a joint's hinge of play, and whether it was put in."""
        holder, joint = _find(root, one.joint)
        row = self.model.joint(one.joint).dofadr[0]
        if not np.isclose(self.model.dof_armature[row], one.rotor_inertia, rtol=1e-9, atol=0.0):
            joint.set("armature", written(one.rotor_inertia))
        known = (self.mechanism.description.beyond.hinges or {}).get(one.joint)
        if known is not None:
            _find(root, known)[1].set("limited", "false")
            for holder in root.findall("equality"):  # one would hold the play shut
                for equality in holder.findall("joint"):
                    if known in (equality.get("joint1"), equality.get("joint2")):
                        holder.remove(equality)
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

    def _refine(self, root: Element, loose: Sequence[Reduction], hinges: Sequence[str]) -> None:
        """Shorten the step of the whole file if the teeth need it."""
        model = _compiled(
            lambda: load_mujoco().MjModel.from_xml_string(_text(root)), self.mechanism
        )
        rows = [int(model.joint(name).dofadr[0]) for name in hinges]
        mass = mass_at(model, self.pose)
        step = resolving_step(mass, rows, [one.stiffness for one in loose])
        if step < model.opt.timestep:
            put(root, "option", timestep=f"{step:.6g}")


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
    path = mechanism.description.path.resolve()
    root, model = _whole(mechanism)
    note = (
        f"the MJCF is {path.name} with play put in: its friction stays before the play, at the "
        f"motors, and its meshes in {path.parent}"
    )
    return OwnRobot(mechanism, root, model, pose, (note,), {})


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
    spec = load_spec(path)
    model = _compiled(spec.compile, mechanism)
    root = _parse(path)
    _include(root, path.parent, _DEEPEST)
    folders = {"meshdir": spec.meshdir, "texturedir": spec.texturedir}
    put(root, "compiler", **{key: str(path.parent / value) for key, value in folders.items()})
    for part in root.findall("asset/model"):
        part.set("file", str(path.parent / part.get("file", "")))
    return root, model


def _set_place(body: Element, place: pin.SE3) -> None:
    for key in ("quat", "axisangle", "xyaxes", "zaxis", "euler"):
        body.attrib.pop(key, None)
    x, y, z, w = pin.Quaternion(place.rotation).coeffs()
    body.set("pos", written(place.translation))
    body.set("quat", written([w, x, y, z]))


def _compiled(load: Callable[[], Any], mechanism: Mechanism) -> Any:
    try:
        return load()
    except (ValueError, load_mujoco().FatalError) as error:
        place, reason = str(mechanism.description.path), " ".join(str(error).split())
        raise JointplayError(f"MuJoCo cannot load {place!r}: {reason}") from None


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
