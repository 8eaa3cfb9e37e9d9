"""The close-up of a joint with clearance: how its journal lies in its bearing, and what acts where.

Displacements are far smaller than bodies: at true size no gap is visible. The close-up magnifies
displacements and leaves sizes alone, as plots of elastic deformation do. The journal's pose (R, c)
in the bearing frame is split into an ideal part (Q, t), which a joint without clearance could have,
and the rest: the displacement d = c - t and the small rotation vector w of R Q^T. A journal point X
is drawn with the factor M at

    t + x + M (d + w x x),    x = Q X,

and the bearing with M times its clearance around a journal of true size. To first order in w, which
is below 0.03 rad in the joints simulated here, every gap then appears M times as large.

`static/closeup.js` draws what is computed here.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jointplay.model.mechanism import Mechanism
from jointplay.model.scene import quaternions
from jointplay.physics.contact import elastic, resultant
from jointplay.physics.geometry import touch
from jointplay.physics.joints import RollingBearing

_STEP_S = 1e-7  # for differences of poses in time: rounding and curvature give 1e-9 m/s


def close_up(
    mechanism: Mechanism,
    joint: str,
    q: np.ndarray,
    v: np.ndarray,
    records: np.ndarray,
    acting: np.ndarray,
    normal: np.ndarray,
    friction: np.ndarray,
    cage: np.ndarray | None = None,
) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """Pose of the journal of `joint`, and the forces of its m contacts, at n records of a run.

    Args:
        mechanism: the machine, with clearance in `joint`.
        joint: name.
        q, v: states at all records, shape (all, nv).
        records: the records to show, shape (n,).
        acting: for each of them and each contact, the record whose force is shown (that of the
            largest since the last record shown, for example), shape (n, m).
        normal, friction: magnitudes of those forces, shape (n, m) [N].
        cage: azimuth of a rolling bearing's first element at all records, shape (all,) [rad].

    Returns:
        In bearing axes: `turn`, quaternions (x, y, z, w) of Q (n, 4); `slide`, t (n, 3) [m], zero
        but along the guide of a slider; `displacement`, d (n, 3) [m]; `tilt`, w (n, 3) [rad];
        `place`, x of each contact's point on the journal, and `shift`, d + w x x of that point
        (n, m, 3) [m]; `normal` and `friction`, forces on the journal (n, m, 3) [N]. And the loads
        of rolling elements, row by row, shape (n, rows * Z) [N]; None if there are none.
    """
    clearance = mechanism.clearance[joint]
    n, m = acting.shape
    acts = normal > 0.0
    # Poses, of which Q, t, d and w are made, at the records to show and at those of the forces.
    needed = np.union1d(records, acting[acts])
    rotation, centre, speed = _relative_motion(mechanism, joint, q[needed], v[needed])
    ideal, slide, tilt = np.empty_like(rotation), np.empty_like(centre), np.empty_like(centre)
    for i in range(len(needed)):
        ideal[i], slide[i] = clearance.ideal_part(rotation[i], centre[i])
        tilt[i] = pin.log3(rotation[i] @ ideal[i].T)
    displacement = centre - slide
    # Points of contact, from the journal's centre, and directions of the normal forces.
    offset, direction = (np.zeros((n, m, 3)) for _ in range(2))
    dimensions = np.array(clearance.dimensions)
    then = np.searchsorted(needed, np.where(acts, acting, records[:, None]))
    bearing = clearance if isinstance(clearance, RollingBearing) else None
    azimuth = np.zeros(len(needed)) if cage is None else cage[needed]
    if bearing is not None:
        at_peak = rotation[then[:, 0]], centre[then[:, 0]], azimuth[then[:, 0]]
        offset[:, 0], direction[:, 0] = _most_loaded(bearing, *at_peak)
    for i, k in zip(*np.nonzero(acts & (bearing is None)), strict=True):
        at = then[i, k]
        contact = touch(
            int(clearance.shape), dimensions, 0, int(k), *centre[at], rotation[at].reshape(9), 0
        )
        offset[i, k], direction[i, k] = contact[1:4], contact[4:7]
    # The points in the ideal orientation, x = Q R^T (offset), and how far they are displaced.
    back = ideal[then] @ np.swapaxes(rotation[then], -1, -2)
    place = np.einsum("...ij,...j->...i", back, offset)
    shift = displacement[then] + np.cross(tilt[then], place)
    # Friction acts against the sliding velocity, the tangential part of the point's velocity.
    at_contact = speed[then, :3] + np.cross(speed[then, 3:], offset)
    sliding = at_contact - direction * np.sum(direction * at_contact, axis=2, keepdims=True)
    size = np.linalg.norm(sliding, axis=2, keepdims=True)
    against = np.divide(-sliding, size, out=np.zeros_like(sliding), where=size > 0.0)
    # While nothing touches, the last point is kept: tracks that jump would compress badly.
    for k in range(m):
        touches = np.flatnonzero(acts[:, k])
        if len(touches):
            last = np.maximum.accumulate(np.where(acts[:, k], np.arange(n), touches[0]))
            place[:, k], shift[:, k] = place[last, k], shift[last, k]
    now = np.searchsorted(needed, records)
    loads = None
    if bearing is not None:
        loads, _ = bearing.element_loads(centre[now], rotation[now][:, :, 2], azimuth[now])
    return {
        "turn": quaternions(ideal[now]),
        "slide": slide[now],
        "displacement": displacement[now],
        "tilt": tilt[now],
        "place": place,
        "shift": shift,
        "normal": normal[:, :, None] * direction,
        "friction": friction[:, :, None] * against,
    }, loads


def _most_loaded(
    bearing: RollingBearing, rotation: np.ndarray, centre: np.ndarray, cage: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Point of the inner ring that the most loaded element touches, and direction of its push.

    Both in bearing axes, shape (n, 3); the point from the ring's centre [m].
    """
    pose = np.hstack([centre, rotation.reshape(-1, 9)])
    load = elastic.answers(bearing.law, bearing.resultant, pose, cage)
    c, s, h = load[:, resultant.COSINE], load[:, resultant.SINE], load[:, resultant.PLACE]
    across, along = load[:, resultant.ACROSS], load[:, resultant.ALONG]
    radius = 0.5 * (bearing.d_pitch - across * bearing.d_element)
    place = np.column_stack([radius * c, radius * s, h - 0.5 * along * bearing.d_element])
    return place, -np.column_stack([across * c, across * s, along])


def _relative_motion(
    mechanism: Mechanism, joint: str, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotation (n, 3, 3), centre (n, 3) [m] and twist (n, 6) [m/s, rad/s] of a journal relative to
    its bearing, in bearing axes; the velocity is that of the journal's centre.
    """
    tree, pairs = mechanism.tree, [mechanism.frames(joint)]
    before, now, after = (
        tree.motion(q + step * v, pairs=pairs).poses[0] for step in (-_STEP_S, 0.0, _STEP_S)
    )
    rate = (after - before) / (2.0 * _STEP_S)
    rotation = now[:, 3:].reshape(-1, 3, 3)
    # The angular velocity stands in the skew-symmetric matrix (dR/dt) R^T.
    turning = rate[:, 3:].reshape(-1, 3, 3) @ np.swapaxes(rotation, 1, 2)
    spin = turning[:, (2, 0, 1), (1, 2, 0)]
    return rotation, now[:, :3], np.hstack([rate[:, :3], spin])
