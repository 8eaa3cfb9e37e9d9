"""The close-up of a joint with clearance: how its journal lies in its bearing, what acts where.

Displacements are far smaller than bodies: seen at true size, no gap is visible. The close-up
magnifies displacements and leaves sizes alone, as plots of elastic deformation do. The journal's
pose (R, c) in the bearing frame is split into an ideal part (Q, t), which a joint without clearance
could have, and the rest: the displacement d = c - t and the small rotation vector w of R Q^T. A
journal point X is drawn with the factor M at

    t + x + M (d + w x x),    x = Q X,

and the bearing with M times its clearance around a journal of true size. To first order in w,
which is below 0.03 rad in the joints simulated here, every gap then appears M times as large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.geometry import touch
from jointplay.mechanism.mechanism import Mechanism


@dataclass
class CloseUp:
    """A journal in its bearing over n records, in bearing axes; m contacts.

    Attributes:
        turn: quaternions (x, y, z, w) of Q, shape (n, 4).
        slide: t, shape (n, 3) [m]; zero but along the guide of a slider.
        displacement: d, shape (n, 3) [m].
        tilt: w, shape (n, 3) [rad].
        place: x of each contact's point on the journal, shape (n, m, 3) [m].
        shift: d + w x x of that point, shape (n, m, 3) [m].
        normal_force: on the journal, shape (n, m, 3) [N].
        friction_force: on the journal, shape (n, m, 3) [N].
    """

    turn: np.ndarray
    slide: np.ndarray
    displacement: np.ndarray
    tilt: np.ndarray
    place: np.ndarray
    shift: np.ndarray
    normal_force: np.ndarray
    friction_force: np.ndarray


def close_up(
    mechanism: Mechanism,
    joint: str,
    q: np.ndarray,
    v: np.ndarray,
    records: np.ndarray,
    acting: np.ndarray,
    normal: np.ndarray,
    friction: np.ndarray,
) -> CloseUp:
    """How the journal of `joint` lies, and what acts on it, at some records of a run.

    Args:
        mechanism: with clearance in `joint`.
        joint: name.
        q, v: states at all records, shape (all, nv).
        records: those that are wanted, shape (n,).
        acting: for each of them and each contact the record whose force is shown (the largest since
            the last one that is wanted, say), shape (n, m).
        normal, friction: magnitudes of those forces, shape (n, m) [N].
    """
    clearance = mechanism.clearance[joint]
    n, m = acting.shape
    acts = normal > 0.0
    needed = np.union1d(records, acting[acts])
    rotation, centre, speed = _relative_motion(mechanism, joint, q[needed], v[needed])
    ideal, slide, tilt = np.empty_like(rotation), np.empty_like(centre), np.empty_like(centre)
    for i in range(len(needed)):
        ideal[i], slide[i] = clearance.ideal_part(rotation[i], centre[i])
        tilt[i] = pin.log3(rotation[i] @ ideal[i].T)
    displacement = centre - slide
    offset, direction = (np.zeros((n, m, 3)) for _ in range(2))
    dimensions = np.array(clearance.dimensions)
    then = np.searchsorted(needed, np.where(acts, acting, records[:, None]))
    for i, k in zip(*np.nonzero(acts), strict=True):
        at = then[i, k]
        contact = touch(
            int(clearance.shape), dimensions, 0, int(k), *centre[at], rotation[at].reshape(9), 0
        )
        offset[i, k], direction[i, k] = contact[1:4], contact[4:7]
    place = _turned(ideal[then] @ np.swapaxes(rotation[then], -1, -2), offset)
    shift = displacement[then] + np.cross(tilt[then], place)
    at_contact = speed[then, :3] + np.cross(speed[then, 3:], offset)
    sliding = at_contact - direction * np.sum(direction * at_contact, axis=2, keepdims=True)
    size = np.linalg.norm(sliding, axis=2, keepdims=True)
    against = np.divide(-sliding, size, out=np.zeros_like(sliding), where=size > 0.0)
    # Where nothing touches, the last point is kept: points that jump would not compress.
    for k in range(m):
        touches = np.flatnonzero(acts[:, k])
        if len(touches):
            last = np.maximum.accumulate(np.where(acts[:, k], np.arange(n), touches[0]))
            place[:, k], shift[:, k] = place[last, k], shift[last, k]
    now = np.searchsorted(needed, records)
    turn = quaternions(ideal[now])
    continuous(turn)
    return CloseUp(
        turn,
        slide[now],
        displacement[now],
        tilt[now],
        place,
        shift,
        normal[:, :, None] * direction,
        friction[:, :, None] * against,
    )


def _relative_motion(
    mechanism: Mechanism, joint: str, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose and motion of the journal relative to the bearing, in bearing axes.

    Returns:
        Rotation (n, 3, 3), centre (n, 3) [m], velocity of the journal's centre and angular velocity
        (n, 6) [m/s, rad/s].
    """
    model, data = mechanism.model, mechanism.data
    (i, bearing), (j, journal) = mechanism.bearing_frame(joint), mechanism.journal_frame(joint)
    places = np.empty((2, len(q), 3, 3)), np.empty((2, len(q), 3))
    twists = np.empty((2, len(q), 6))
    views = [(data.oMi[k].rotation, data.oMi[k].translation, data.v[k].vector) for k in (i, j)]
    for row in range(len(q)):
        pin.forwardKinematics(model, data, q[row], v[row])
        for body, (turn, origin, twist) in enumerate(views):
            places[0][body, row], places[1][body, row] = turn, origin
            twists[body, row] = twist
    turns, origins = places
    turn = turns[0] @ bearing.rotation
    point = origins[1] + turns[1] @ journal.translation
    centre = point - origins[0] - turns[0] @ bearing.translation
    linear, angular = [], []
    for body in range(2):
        spin = _turned(turns[body], twists[body, :, 3:])
        linear.append(_turned(turns[body], twists[body, :, :3]))
        linear[-1] += np.cross(spin, point - origins[body])
        angular.append(spin)
    back = np.swapaxes(turn, -1, -2)
    speed = [_turned(back, values[1] - values[0]) for values in (linear, angular)]
    rotation = back @ turns[1] @ journal.rotation
    return rotation, _turned(back, centre), np.concatenate(speed, axis=1)


def _turned(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Products of matrices (..., 3, 3) and vectors (..., 3)."""
    return np.einsum("...ij,...j->...i", matrix, vector)


def continuous(quaternions: np.ndarray) -> None:
    """Choose the signs of quaternions, shape (n, 4), so that neighbours are close."""
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    quaternions[1:] *= np.where(np.cumsum(flips) % 2, -1.0, 1.0)[:, None]


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Quaternions (x, y, z, w) of rotation matrices (n, 3, 3), by the largest component: (n, 4)."""
    m = matrices
    diagonal = m[:, (0, 1, 2), (0, 1, 2)]
    trace = diagonal.sum(axis=1)
    # Four times the products of each component with all others, whichever is used to divide.
    products = np.empty((len(m), 4, 4))
    for i in range(3):
        products[:, i, i] = 1.0 + 2.0 * diagonal[:, i] - trace
        j, k = (i + 1) % 3, (i + 2) % 3
        products[:, i, j] = products[:, j, i] = m[:, i, j] + m[:, j, i]
        products[:, i, 3] = products[:, 3, i] = m[:, k, j] - m[:, j, k]
    products[:, 3, 3] = 1.0 + trace
    best = products[:, range(4), range(4)].argmax(axis=1)
    rows = products[np.arange(len(m)), best]
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))
