"""The velocity solve: friction, damping and films of all contacts together, implicit in velocity.

The multi-rate method asks, in every micro step, for the velocity v with

    v = v_half + h (a_free + M^-1 [tau + tau_c(q, v)]),    h = dt/2

v_half being the velocity half a step ago, tau what does not depend on v, and tau_c all that does:
contacts (their elastic part, too), films, joint friction, gears. Newton's method on those
coordinates that tau_c moves, for the rims of one journal couple strongly; the matrix is

    I - h M^-1 d(tau_c)/dv

Where laws fall with speed the step is shortened until the error falls. Reference for friction
as one implicit problem in velocity: M. Anitescu, F. Potra, Int. J. Numer. Meth. Engng 55 (2002)
753-784; V. Vasan Kurtz, A. Castro, arXiv 2312.03908.
"""

from __future__ import annotations

import math

from jointplay.kernel.contact import bend, respond, touch
from jointplay.kernel.drive import rub_joints, turn_gears
from jointplay.kernel.film import carry
from jointplay.kernel.frames import (
    pose_of_virtual_link,
    pose_on_path,
    push,
    push_slope,
    twist,
)
from jointplay.kernel.layout import (
    floats,
    frictions,
    gears,
    internal,
    joints,
    matrix,
    wholes,
)

TOLERANCE = 1e-9
"""Error of the velocity solve, as the root of twice its kinetic energy [kg^0.5 m/s]."""

RELATIVE_TOLERANCE = 1e-11
"""The same relative to the state's own."""

MOST_TRIALS = 40
"""Velocities tried before the best of them is taken."""

LEAST_PART = 1.0 / 64.0
"""Smallest part of a Newton step that is tried."""


@internal
def find_touching(run, q, half):
    """Find what depends on the velocity at q, and list the coordinates that it moves."""
    nv = run.nv
    touched, marks = wholes(run.touched, nv), matrix(run.trial, 4, nv)[3]
    for i in range(nv):
        marks[i] = 0.0
    run.touching = 0
    for j in range(run.nj):
        joint = joints(run)[j]
        if joint.first >= 0:
            pose_of_virtual_link(q, joint)
        else:
            pose_on_path(run, joint, q)
        touching = touch(run, j, joint)
        run.touching += 1 if touching else 0
        joint.touching = 1 if touching or joint.sections > 0 else 0
        for r in range(6):
            joint.wrench[r] = 0.0
        if joint.touching == 0:
            continue
        if joint.bristles != 0:
            twist(joint, half)
            bend(run, j, joint, run.dt_before)
        support = wholes(joint.support, joint.nsupport)
        for k in range(joint.nsupport):
            marks[support[k]] = 1.0
    for row in frictions(run):
        marks[row.coordinate] = 1.0
    for gear in gears(run):
        if abs(q[gear.motor] - q[gear.link]) > gear.half_play:
            marks[gear.motor] = marks[gear.link] = 1.0
    n = 0
    for i in range(nv):
        if marks[i] != 0.0:
            touched[n] = i
            n += 1
    run.active = n


@internal
def answer(run, q, v, slopes):
    """Put tau_c at state (q, v) into `contact_push` and, if wanted, its slope into `slope`."""
    nv, n = run.nv, run.active
    touched, tau = wholes(run.touched, nv), floats(run.contact_push, nv)
    slope = matrix(run.slope, nv, nv)
    for i in range(nv):
        tau[i] = 0.0
    if slopes:
        for a in range(n):
            for b in range(n):
                slope[touched[a], touched[b]] = 0.0
    for j in range(run.nj):
        joint = joints(run)[j]
        if joint.touching == 0:
            continue
        twist(joint, v)
        for r in range(6):
            joint.wrench[r] = 0.0
            for c in range(6):
                joint.stiff[r, c] = 0.0
        if joint.sections > 0:
            carry(run, joint, slopes, False)
        respond(run, j, joint, slopes)
        push(joint, tau)
        if slopes:
            push_slope(run, joint)
    rub_joints(run, v, tau, slopes)
    turn_gears(run, q, v, tau, slopes)


@internal
def _error(run, base, v, h):
    """Write what v lacks of solving the equation into `trial`[0]; returns its size squared."""
    nv, n = run.nv, run.active
    touched, tau = wholes(run.touched, nv), floats(run.contact_push, nv)
    minv, wrong = matrix(run.minv, nv, nv), matrix(run.trial, 4, nv)[0]
    size = 0.0
    for a in range(n):
        i = touched[a]
        total = 0.0
        for b in range(n):
            total += minv[i, touched[b]] * tau[touched[b]]
        wrong[a] = v[i] - base[i] - h * total
        size += wrong[a] * wrong[a] / minv[i, i]
    return size


@internal
def _newton_step(run, h):
    """Solve (I - h M^-1 slope) step = -error into `trial`[1], by elimination with pivots."""
    nv, n = run.nv, run.active
    touched, trial = wholes(run.touched, nv), matrix(run.trial, 4, nv)
    minv, slope = matrix(run.minv, nv, nv), matrix(run.slope, nv, nv)
    system = matrix(run.system, n, n + 1)
    for a in range(n):
        for b in range(n):
            system[a, b] = 1.0 if a == b else 0.0
        system[a, n] = -trial[0, a]
    for b in range(n):
        for c in range(n):
            value = h * slope[touched[c], touched[b]]
            if value != 0.0:
                for a in range(n):
                    system[a, b] -= minv[touched[a], touched[c]] * value
    for k in range(n):
        best = k
        for a in range(k + 1, n):
            if abs(system[a, k]) > abs(system[best, k]):
                best = a
        if best != k:
            for b in range(k, n + 1):
                system[k, b], system[best, b] = system[best, b], system[k, b]
        pivot = 1.0 / system[k, k]
        for a in range(k + 1, n):
            factor = system[a, k] * pivot
            if factor != 0.0:
                for b in range(k + 1, n + 1):
                    system[a, b] -= factor * system[k, b]
    for a in range(n - 1, -1, -1):
        total = system[a, n]
        for b in range(a + 1, n):
            total -= system[a, b] * trial[1, b]
        trial[1, a] = total / system[a, a]


@internal
def _start(run, base, v, h):
    """Begin with the forces of the last step."""
    nv, n = run.nv, run.active
    touched, tau = wholes(run.touched, nv), floats(run.contact_push, nv)
    minv = matrix(run.minv, nv, nv)
    for a in range(n):
        i = touched[a]
        total = 0.0
        for b in range(n):
            total += minv[i, touched[b]] * tau[touched[b]]
        v[i] = base[i] + h * total


@internal
def _limit(run, base, minv):
    """Error squared at which the solve is content."""
    touched = wholes(run.touched, run.nv)
    scale = 0.0
    for a in range(run.active):
        i = touched[a]
        scale += base[i] * base[i] / minv[i, i]
    return TOLERANCE * TOLERANCE + RELATIVE_TOLERANCE * RELATIVE_TOLERANCE * scale


@internal
def solve(run, q, base, v, h):
    """Find v on the coordinates that `find_touching` listed, by Newton's method.

    Where it does not get there the best velocity that was met is taken, and counted.
    """
    nv, n = run.nv, run.active
    touched, trial = wholes(run.touched, nv), matrix(run.trial, 4, nv)
    step, best = trial[1], trial[2]
    _start(run, base, v, h)
    limit = _limit(run, base, matrix(run.minv, nv, nv))
    answer(run, q, v, True)
    error = _error(run, base, v, h)
    least, part, trials = error, 0.0, 1
    for a in range(n):
        best[a] = v[touched[a]]
    run.solves += 1
    while not error <= limit:
        if trials >= MOST_TRIALS or not math.isfinite(error):
            run.unsolved += 1
            break
        _newton_step(run, h)
        part = 1.0
        while True:
            for a in range(n):
                v[touched[a]] = best[a] + part * step[a]
            answer(run, q, v, True)
            error = _error(run, base, v, h)
            trials += 1
            if error < least or part <= LEAST_PART or trials >= MOST_TRIALS:
                break
            part *= 0.5
        if not math.isfinite(error):
            break
        least = error
        for a in range(n):
            best[a] = v[touched[a]]
    run.iterations += trials
