"""Kinematics of a journal in its bearing: pose, twist, and projection of wrenches on coordinates.

Where bearing and journal are neighbours in the tree, joined by the six coordinates of the virtual
link, pose and twist follow from these coordinates. Otherwise - a loop cut at the joint, a locked
freedom, bearing and journal exchanged - they come from frames and Jacobians: Pinocchio's for
single-rate methods, those of `place_bodies` for the multi-rate one.

A contact wrench needs no external force: the force F on the journal and its reaction -F on the
bearing, at the same point, *are* a generalised force tau += J^T w, J being the Jacobian of the
journal's motion relative to the bearing: the F_C of eq. 23 "projected on q".
"""

from __future__ import annotations

import math

from jointplay.base.compiler import compiled

# Vectors of three numbers are tuples in compiled code.


@compiled
def get_vector(array, at):
    """Three numbers of an array, from index `at` on."""
    return array[at], array[at + 1], array[at + 2]


@compiled
def set_vector(array, at, a):
    """Write a vector into an array, from index `at` on."""
    array[at], array[at + 1], array[at + 2] = a


@compiled
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def scale(s, a):
    """s a, for a number s."""
    return s * a[0], s * a[1], s * a[2]


@compiled
def add_scaled(a, s, b):
    """a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@compiled
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a, b):
    """a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def norm(a):
    """|a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@compiled
def pose_of_virtual_link(q, joint):
    """Pose of the journal from the six coordinates of the virtual link: Rz(yaw) Ry(p) Rx(roll)."""
    first = joint.first
    cy, sy = math.cos(q[first + 3]), math.sin(q[first + 3])
    cp, sp = math.cos(q[first + 4]), math.sin(q[first + 4])
    cr, sr = math.cos(q[first + 5]), math.sin(q[first + 5])
    pose, sines = joint.pose, joint.sines
    pose[0], pose[1], pose[2] = q[first], q[first + 1], q[first + 2]
    pose[3], pose[4], pose[5] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    pose[6], pose[7], pose[8] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    pose[9], pose[10], pose[11] = -sp, cp * sr, cp * cr
    sines[0], sines[1], sines[2], sines[3] = sy, cy, sp, cp


@compiled
def _world_pose(rotation, translation, placement):
    """World orientation (three rows) and origin (3) of a frame placed in a body.

    `rotation` is the body's, column by column as Pinocchio has it; `placement` has rows.
    """
    r0 = (rotation[0], rotation[3], rotation[6])
    r1 = (rotation[1], rotation[4], rotation[7])
    r2 = (rotation[2], rotation[5], rotation[8])
    p0, p1, p2 = get_vector(placement, 0), get_vector(placement, 3), get_vector(placement, 6)
    place = get_vector(placement, 9)
    rows = (
        add(add(scale(r0[0], p0), scale(r0[1], p1)), scale(r0[2], p2)),
        add(add(scale(r1[0], p0), scale(r1[1], p1)), scale(r1[2], p2)),
        add(add(scale(r2[0], p0), scale(r2[1], p1)), scale(r2[2], p2)),
    )
    at = (
        translation[0] + r0[0] * place[0] + r0[1] * place[1] + r0[2] * place[2],
        translation[1] + r1[0] * place[0] + r1[1] * place[1] + r1[2] * place[2],
        translation[2] + r2[0] * place[0] + r2[1] * place[1] + r2[2] * place[2],
    )
    return rows, at


@compiled
def _rotate_back(rows, a):
    """R^T a for a matrix R given by its rows."""
    return add(add(scale(a[0], rows[0]), scale(a[1], rows[1])), scale(a[2], rows[2]))


@compiled
def pose_of_frames(run, carried):
    """Find the relative pose (12) and Jacobian (6, n) of the two frames of a joint or load.

    Only coordinates that move one of the two and not the other enter, so that rounding of a common
    motion cannot blur the relative one.
    """
    pose, jacobian = carried.pose, carried.jacobian
    bearing, origin = _world_pose(
        carried.bearing_rotation, carried.bearing_translation, carried.bearing_placement
    )
    journal, place = _world_pose(
        carried.journal_rotation, carried.journal_translation, carried.journal_placement
    )
    # The journal's centre and orientation in bearing axes: R_b^T (p_j - p_b), R_b^T R_j.
    set_vector(pose, 0, _rotate_back(bearing, add_scaled(place, -1.0, origin)))
    for i in range(3):
        row = (0.0, 0.0, 0.0)
        for k in range(3):
            row = add_scaled(row, bearing[k][i], journal[k])
        set_vector(pose, 3 + 3 * i, row)
    # Jacobian columns, from the point at the world's origin to the journal's centre.
    columns = run.world_jacobian
    support, signs = carried.support, carried.signs
    for k in range(carried.nsupport):
        column = columns[support[k]]
        turning = scale(1.0 * signs[k], get_vector(column, 3))
        moving = add(scale(1.0 * signs[k], get_vector(column, 0)), cross(turning, place))
        moving, turning = _rotate_back(bearing, moving), _rotate_back(bearing, turning)
        for r in range(3):
            jacobian[r, k] = moving[r]
            jacobian[3 + r, k] = turning[r]


@compiled
def find_pose(run, joint, q):
    """Find the pose of a joint's journal at q, at which frames, if any, have been placed."""
    if joint.first >= 0:
        pose_of_virtual_link(q, joint)
    else:
        pose_of_frames(run, joint)


@compiled
def frame_twist(carried, v):
    """Find the relative twist J v (6) of the two frames of a joint or load."""
    jacobian, support, twist = carried.jacobian, carried.support, carried.twist
    for r in range(6):
        total = 0.0
        for k in range(carried.nsupport):
            total += jacobian[r, k] * v[support[k]]
        twist[r] = total


@compiled
def find_twist(joint, v):
    """Find the joint's twist: velocity of the journal's centre, angular velocity, bearing axes."""
    if joint.first < 0:
        frame_twist(joint, v)
        return
    out, first, sines = joint.twist, joint.first, joint.sines
    sy, cy, sp, cp = sines[0], sines[1], sines[2], sines[3]
    out[0], out[1], out[2] = v[first], v[first + 1], v[first + 2]
    # The axes of yaw, pitch and roll are e_z, (-sy, cy, 0) and (cy cp, sy cp, -sp).
    out[3] = -sy * v[first + 4] + cy * cp * v[first + 5]
    out[4] = cy * v[first + 4] + sy * cp * v[first + 5]
    out[5] = v[first + 3] - sp * v[first + 5]


@compiled
def project_frame_wrench(carried, sign, wrench, tau):
    """Project a wrench between two frames on the coordinates: tau += sign J^T w."""
    jacobian, support = carried.jacobian, carried.support
    for k in range(carried.nsupport):
        total = 0.0
        for r in range(6):
            total += jacobian[r, k] * wrench[r]
        tau[support[k]] += sign * total


@compiled
def project_wrench(joint, tau):
    """Project the joint's wrench on the coordinates: tau += J^T w."""
    wrench = joint.wrench
    if joint.first < 0:
        project_frame_wrench(joint, 1.0, wrench, tau)
        return
    first, sines = joint.first, joint.sines
    sy, cy, sp, cp = sines[0], sines[1], sines[2], sines[3]
    tau[first] += wrench[0]
    tau[first + 1] += wrench[1]
    tau[first + 2] += wrench[2]
    tau[first + 3] += wrench[5]
    tau[first + 4] += cy * wrench[4] - sy * wrench[3]
    tau[first + 5] += cy * cp * wrench[3] + sy * cp * wrench[4] - sp * wrench[5]


@compiled
def project_frame_slope(carried, place, slope):
    """Project the d(wrench)/d(twist) K between two frames on the coordinates: slope += J^T K J."""
    n, wrench_slope = carried.nsupport, carried.wrench_slope
    jacobian, support = carried.jacobian, carried.support
    for k in range(n):
        for r in range(6):
            total = 0.0
            for c in range(6):
                total += wrench_slope[r, c] * jacobian[c, k]
            if total != 0.0:
                for m in range(n):
                    slope[place[support[m]], place[support[k]]] += jacobian[r, m] * total


@compiled
def project_slope(run, joint):
    """Project the joint's d(wrench)/d(twist) K on the coordinates: slope += J^T K J."""
    slope, wrench_slope = run.slope, joint.wrench_slope
    place = run.place
    if joint.first < 0:
        project_frame_slope(joint, place, slope)
        return
    at, sines = place[joint.first], joint.sines
    sy, cy, sp, cp = sines[0], sines[1], sines[2], sines[3]
    # From angular velocity to rates of yaw, pitch and roll: the columns of K, then its rows.
    for r in range(6):
        a, b, c = wrench_slope[r, 3], wrench_slope[r, 4], wrench_slope[r, 5]
        wrench_slope[r, 3], wrench_slope[r, 4] = c, cy * b - sy * a
        wrench_slope[r, 5] = cy * cp * a + sy * cp * b - sp * c
    for k in range(6):
        a, b, c = wrench_slope[3, k], wrench_slope[4, k], wrench_slope[5, k]
        wrench_slope[3, k], wrench_slope[4, k] = c, cy * b - sy * a
        wrench_slope[5, k] = cy * cp * a + sy * cp * b - sp * c
    for r in range(6):
        for k in range(6):
            slope[at + r, at + k] += wrench_slope[r, k]


# Forward kinematics of the bodies that carry joints reached through frames.


@compiled
def matrix_times_vector(columns, x, y, z):
    """Product of a matrix, nine numbers column by column, and a vector."""
    first = add_scaled(scale(x, get_vector(columns, 0)), y, get_vector(columns, 3))
    return add_scaled(first, z, get_vector(columns, 6))


@compiled
def place_bodies(run, q):
    """Find orientation and origin of all bodies at the coordinates q, and the Jacobian's columns.

    A column has the velocity of the body's point at the world's origin, then its angular velocity.
    """
    columns, bodies = run.world_jacobian, run.bodies
    for b in range(1, run.nb):
        body = bodies[b]
        parent, turn, i = bodies[body.parent], body.turn, body.coordinate
        origin = add(
            get_vector(parent.origin, 0),
            matrix_times_vector(parent.rotation, body.shift[0], body.shift[1], body.shift[2]),
        )
        x = matrix_times_vector(parent.rotation, turn[0], turn[3], turn[6])
        y = matrix_times_vector(parent.rotation, turn[1], turn[4], turn[7])
        axis = matrix_times_vector(parent.rotation, turn[2], turn[5], turn[8])
        if body.slides != 0:
            origin = add_scaled(origin, q[i], axis)
            set_vector(columns[i], 0, axis)
        else:
            c, s = math.cos(q[i]), math.sin(q[i])
            x, y = add_scaled(scale(c, x), s, y), add_scaled(scale(c, y), -s, x)
            set_vector(columns[i], 0, cross(origin, axis))
            set_vector(columns[i], 3, axis)
        set_vector(body.rotation, 0, x)
        set_vector(body.rotation, 3, y)
        set_vector(body.rotation, 6, axis)
        set_vector(body.origin, 0, origin)


@compiled
def point_acceleration(body, arm):
    """Acceleration of a point at `arm` from a body's origin, at constant generalised velocities."""
    omega = get_vector(body.omega, 0)
    turning = cross(get_vector(body.alpha, 0), arm)
    return add(get_vector(body.lift, 0), add(turning, cross(omega, cross(omega, arm))))


@compiled
def find_body_rates(run, v):
    """Find angular velocities of the bodies just placed, and accelerations at constant speeds v."""
    bodies = run.bodies
    for b in range(1, run.nb):
        body = bodies[b]
        parent, rate = bodies[body.parent], v[body.coordinate]
        axis, omega = get_vector(body.rotation, 6), get_vector(parent.omega, 0)
        lift = point_acceleration(
            parent, add_scaled(get_vector(body.origin, 0), -1.0, get_vector(parent.origin, 0))
        )
        alpha, across = get_vector(parent.alpha, 0), scale(rate, cross(omega, axis))
        if body.slides != 0:
            lift = add_scaled(lift, 2.0, across)
        else:
            omega, alpha = add_scaled(omega, rate, axis), add(alpha, across)
        set_vector(body.omega, 0, omega)
        set_vector(body.alpha, 0, alpha)
        set_vector(body.lift, 0, lift)
