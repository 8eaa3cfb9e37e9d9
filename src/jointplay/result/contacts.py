"""Histories of joints with clearance: gaps, forces, modes and forms."""

from __future__ import annotations

from typing import Any

import numpy as np

from jointplay.geometry import classify_many
from jointplay.kernel import AZIMUTHS
from jointplay.kernel.workspace import Workspace
from jointplay.mechanism.impact import elastic_energy
from jointplay.mechanism.mechanism import Mechanism
from jointplay.result.loads import Variables

_EACH = ("time", "joint", "contact")
_VECTOR = ("time", "joint", "axis")
_JOINT = ("time", "joint")
_LAST = "largest since the last record"

_BY_CONTACT = ("gap_min", "normal", "normal_peak", "tangential")
"""Records of each contact."""

_VARIABLES: tuple[tuple[str, tuple[str, ...], str, str], ...] = (
    ("journal_centre", _VECTOR, "m", "journal centre in the bearing frame"),
    ("tilt", _JOINT, "rad", "angle between the axes"),
    ("gap", _EACH, "m", "gap; negative in penetration"),
    ("gap_min", _EACH, "m", "smallest gap since the last record"),
    ("normal_force", _EACH, "N", "normal force"),
    ("normal_force_peak", _EACH, "N", _LAST),
    ("friction_force", _EACH, "N", "friction force, magnitude"),
    ("joint_force", _VECTOR, "N", "contact force on the journal, world axes"),
    ("joint_force_peak", _VECTOR, "N", f"joint_force where its magnitude was {_LAST}"),
    ("film_force", _VECTOR, "N", "part of joint_force that is the film's, world axes"),
    ("mode", _JOINT, "1", "mode of the joint (Table 1)"),
    ("form", _JOINT, "1", "contact form (Figure 2)"),
)
"""Name, dimensions, unit and meaning."""


def contact_names(mechanism: Mechanism) -> list[str]:
    """Names of the contacts of all joints, each once."""
    names = (name for joint in mechanism.clearance.values() for name in joint.contacts)
    return list(dict.fromkeys(names))


def contact_histories(
    mechanism: Mechanism, workspace: Workspace, body: dict[str, Any]
) -> tuple[Variables, np.ndarray]:
    """Variables of the joints with clearance, and the energy stored in their contacts (n,) [J].

    Args:
        mechanism: what was simulated.
        workspace: has the records.
        body: has `bearings` (n, 3, 3) and `poses` (n, 12) by joint.
    """
    joints, names = mechanism.clearance, contact_names(mechanism)
    n, nj, width = workspace.rows, len(joints), workspace.contacts.shape[1]
    centre, tilt = np.empty((n, nj, 3)), np.empty((n, nj))
    mode, form = np.empty((n, nj), np.int8), np.empty((n, nj), np.int8)
    force, peak, film = (
        workspace.recorded(name).reshape(n, nj, 3).copy()
        for name in ("force", "force_peak", "film_force")
    )
    gap = np.full((n, nj, len(names)), np.nan)
    recorded = [workspace.recorded(name).reshape(n, nj, width) for name in _BY_CONTACT]
    by_contact = [np.full_like(gap, np.nan) for _ in _BY_CONTACT]
    elastic = np.zeros(n)
    for j, (name, joint) in enumerate(joints.items()):
        bearing, poses = body["bearings"][name], body["poses"][name]
        centre[:, j] = poses[:, :3]
        tilt[:, j] = np.arctan2(np.hypot(poses[:, 5], poses[:, 8]), poses[:, 11])
        count = len(joint.contacts)
        at = [names.index(contact) for contact in joint.contacts]
        gap[:, j, at], mode[:, j], form[:, j] = classify_many(
            int(joint.shape), np.array(joint.dimensions), count, poses
        )
        for values, source in zip(by_contact, recorded, strict=True):
            values[:, j, at] = source[:, j, :count]
        for values in (force, peak, film):
            values[:, j] = np.einsum("nik,nk->ni", bearing, values[:, j])
        groups: dict[Any, list[int]] = {}
        for k in range(count):
            groups.setdefault(joint.contact_properties(k), []).append(at[k])
        for contact, members in groups.items():
            parameters = joint.normal.parameters(contact)
            elastic += elastic_energy(joint.normal, parameters, -gap[:, j, members]).sum(axis=1)
    found = (centre, tilt, gap, *by_contact, force, peak, film, mode, form)
    variables: Variables = {
        name: (dims, values, unit, text)
        for (name, dims, unit, text), values in zip(_VARIABLES, found, strict=True)
    }
    if any(joint.wears for joint in joints.values()):
        text = "normal force times sliding distance over the whole run"
        counted = _sliding_work(mechanism, workspace, names)
        variables["sliding_work"] = (("joint", "contact", "azimuth"), counted, "N m", text)
    if all(joint.film is None for joint in joints.values()):
        del variables["film_force"]
    return variables, elastic


def _sliding_work(mechanism: Mechanism, workspace: Workspace, names: list[str]) -> np.ndarray:
    """Around the bores, by joint, contact and azimuth [N m]."""
    counted = np.full((len(mechanism.clearance), len(names), AZIMUTHS), np.nan)
    for j, joint in enumerate(mechanism.clearance.values()):
        for k, work in enumerate(workspace.sliding_work[j]):
            counted[j, names.index(joint.contacts[k])] = work
    return counted
