"""What acts in a scenario: drives, friction, loads, payloads."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jointplay.codec import Draft
from jointplay.errors import JointplayError, MissingName, within
from jointplay.fields import fields_of
from jointplay.loads import Load
from jointplay.loads.drive import ComputedTorque, Drive, JointFriction, Torque
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.payload import Payload
from jointplay.motion.reference import Motion
from jointplay.scenario.fitting import beside, drafts, fit
from jointplay.scenario.model import Model


def drive_of(
    model: Model, mechanism: Mechanism, motion: Motion | None
) -> Drive | Mapping[str, Drive]:
    """Drives of all joints, or by joint.

    Raises:
        JointplayError: no such joint, or a drive that cannot be; `where` has the key.
    """
    common: Drive = ComputedTorque()
    shared: Any = model.drive
    if shared is not None:
        if shared.kind is Torque:
            raise JointplayError(
                "a torque acts on one joint; give [drives.JOINT]", where=("drive", "kind")
            )
        common = _one_drive(shared, ("drive",))
    if motion is not None and not model.drives:
        return common
    drives: dict[str, Drive] = {}
    if motion is not None and common.follows:
        drives = dict.fromkeys(motion.joints, common)
    for name, draft in drafts(model.drives).items():
        path = ("drives", name)
        if name not in mechanism.joints:
            raise MissingName("moving joint", name, mechanism.joints, where=path)
        fitted = {}
        if draft.kind is Torque:
            revolute, prismatic = fields_of(Torque)["values"].units
            fitted["values"] = tuple(
                fit(mechanism, name, value, (revolute, prismatic), (*path, "values"))
                for value in draft.fields["values"]
            )
        drives[name] = _one_drive(draft, path, **fitted)
        if drives[name].follows and (motion is None or name not in motion.joints):
            kind = drives[name].kind
            raise JointplayError(
                f"a {kind} drive follows a motion, and [motion] has none for it", where=path
            )
    return drives


def _one_drive(draft: Draft, path: tuple[str, ...], **fitted: Any) -> Drive:
    with within(*path):
        drive: Drive = Draft(draft.kind, draft.word, {**draft.fields, **fitted}).make()
        return drive


def friction_of(model: Model, mechanism: Mechanism) -> dict[str, JointFriction] | None:
    """Friction of all moving joints, where the scenario says anything of it."""
    if not model.joint_friction:
        return None
    entries = mechanism.description.joints
    friction = {
        name: JointFriction(entries[name].friction, entries[name].damping)
        for name in mechanism.joints
    }
    for name, draft in drafts(model.joint_friction).items():
        path = ("joint_friction", name)
        fields = {}
        for key, value in draft.fields.items():
            revolute, prismatic = fields_of(JointFriction)[key].units
            fields[key] = fit(mechanism, name, value, (revolute, prismatic), (*path, key))
        if name not in friction:
            raise MissingName("moving joint", name, mechanism.joints, where=path)
        with within(*path):
            friction[name] = JointFriction(**fields)
    return friction


def loads_of(model: Model, mechanism: Mechanism, folder: Path) -> dict[str, Load]:
    """Springs, wrenches and the like, by name; each is tried on the mechanism."""
    loads: dict[str, Load] = {}
    for name, draft in drafts(model.loads).items():
        fitted = {}
        for key, value in draft.fields.items():
            units = fields_of(draft.kind)[key].units
            if len(units) == 2 and value is not None:
                at = ("loads", name, key)
                fitted[key] = fit(mechanism, draft.fields["joint"], value, (units[0], units[1]), at)
        with (
            within("loads", name),
            beside(folder, str(draft.fields.get("function", ""))),
        ):
            load = Draft(draft.kind, draft.word, {**draft.fields, **fitted}).make()
            load.site(mechanism)
            load.numbers(mechanism)
        loads[name] = load
    return loads


def payloads_of(model: Model, mechanism: Mechanism) -> tuple[Payload, ...]:
    """Payloads, held by the tool if nothing else is said."""
    payloads = []
    drafts: list[Any] = list(model.payloads)
    for index, draft in enumerate(drafts):
        with within("payloads", index):
            payload = Payload(**{"frame": mechanism.tool, **draft.fields})
            if not mechanism.model.existFrame(payload.frame):
                names = [f.name for f in mechanism.model.frames if f.name != "universe"]
                raise MissingName("frame", payload.frame, names, where=("frame",))
            payloads.append(payload)
    return tuple(payloads)
