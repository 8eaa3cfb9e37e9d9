"""Loads whose laws are called by address: springs, wrenches, stops, controllers, a user's own.

A law is a compiled function

    law(time, x, dx, p, out)

of the time [s] and what it reads. Between two frames x is the pose of the second one in the first
(origin, then orientation row by row), dx its velocity and angular velocity there, and out the
wrench on it: force, then moment about its origin, in axes of the first frame, whose body gets the
opposite. On coordinates x and dx are positions and velocities, out the efforts. p are numbers of
the load.

What a load answers at rest, law(time, x, 0), does not depend on velocity if it stores energy; the
rest does, and takes part in the velocity solve. A load that stores none is evaluated at velocities
extrapolated by half a step, as drives are.
"""

from __future__ import annotations

import math

from numba import types

from jointplay.core.compiler import NUMBERS, calling, internal, pointer
from jointplay.kernel.access import floats, integers, loads, matrix, record_failure
from jointplay.kernel.frames import frame_twist, pose_of_frames, project_frame_slope
from jointplay.kernel.words import ALWAYS, IF_PRESSED, Status

_BAD_LOAD = int(Status.BAD_LOAD)

LOAD_LAW = types.void(types.float64, NUMBERS, NUMBERS, NUMBERS, NUMBERS)
"""Signature of a load's law."""

_DIFFERENCE = 1e-6
"""Difference of velocities by which laws are differentiated, relative; and at rest [m/s]."""


_call = calling(LOAD_LAW)


@internal
def _answer_size(load):
    """How many numbers the law gives."""
    return 6 if load.frames != 0 else load.noutputs


@internal
def _evaluate_law(load, time):
    """Evaluate the law at the load's present inputs, into `out`."""
    inputs = pointer(load.place), pointer(load.rate)
    _call(load.law, (time, *inputs, pointer(load.numbers), pointer(load.out)))
    if load.bounded != 0:
        out, bounds = floats(load.out, load.noutputs), floats(load.bounds, load.noutputs)
        for i in range(load.noutputs):
            if abs(out[i]) > bounds[i]:
                out[i] = math.copysign(bounds[i], out[i])


@internal
def _read_positions(load, q):
    """Copy the coordinates on which the load depends into its x."""
    inputs, place = integers(load.inputs, load.ninputs), floats(load.place, load.ninputs)
    for k in range(load.ninputs):
        place[k] = q[inputs[k]]


@internal
def _read_velocities(load, v):
    """Copy the velocities on which the load depends into its dx."""
    if load.frames != 0:
        frame_twist(load, floats(load.jacobian, 6 * load.nsupport), v, load.twist)
        return
    inputs, rate = integers(load.inputs, load.ninputs), floats(load.rate, load.ninputs)
    for k in range(load.ninputs):
        rate[k] = v[inputs[k]]


@internal
def _evaluate_law_at_rest(load, time):
    """Evaluate the law at zero velocity, into `out` and `elastic`."""
    n = 6 if load.frames != 0 else load.ninputs
    rate = floats(load.rate, n)
    for k in range(n):
        rate[k] = 0.0
    _evaluate_law(load, time)
    out, elastic = floats(load.out, _answer_size(load)), floats(load.elastic, _answer_size(load))
    for i in range(_answer_size(load)):
        elastic[i] = out[i]


@internal
def _project_forces(load, sign, forces, tau):
    """Add the generalised forces of `forces`, times `sign`, to tau."""
    if load.frames != 0:
        n = load.nsupport
        jacobian, support = floats(load.jacobian, 6 * n), integers(load.support, n)
        for k in range(n):
            total = 0.0
            for r in range(6):
                total += jacobian[r * n + k] * forces[r]
            tau[support[k]] += sign * total
        return
    outputs = integers(load.outputs, load.noutputs)
    for k in range(load.noutputs):
        tau[outputs[k]] += sign * forces[k]


@internal
def evaluate_loads(run, q, v, marks):
    """Answer of all loads at q, but for what depends on velocity: into `load_forces`.

    Coordinates on which the rest acts are marked. v are the extrapolated velocities.
    """
    tau = floats(run.load_forces, run.nv)
    for i in range(run.nv):
        tau[i] = 0.0
    for load in loads(run):
        if load.frames != 0:
            pose_of_frames(run, load, load.pose, floats(load.jacobian, 6 * load.nsupport))
        else:
            _read_positions(load, q)
        load.active = 0
        if load.stores == 0:
            _read_velocities(load, v)
            _evaluate_law(load, run.time)
            _project_forces(load, 1.0, floats(load.out, _answer_size(load)), tau)
            continue
        _evaluate_law_at_rest(load, run.time)
        elastic = floats(load.elastic, _answer_size(load))
        _project_forces(load, 1.0, elastic, tau)
        pressed = load.implicit == ALWAYS
        if load.implicit == IF_PRESSED:
            for i in range(_answer_size(load)):
                pressed = pressed or elastic[i] != 0.0
        if not pressed:
            continue
        load.active = 1
        frames = load.frames != 0
        n = load.nsupport if frames else load.noutputs
        moved = integers(load.support if frames else load.outputs, n)
        for k in range(n):
            marks[moved[k]] = 1.0


@internal
def apply_loads(run, base, h):
    """Add the forces from `evaluate_loads` to tau, and their impulse over h to the velocities."""
    nv = run.nv
    forces, tau = floats(run.load_forces, nv), floats(run.tau, nv)
    minv = matrix(run.minv, nv, nv)
    for k in range(nv):
        if forces[k] == 0.0:
            continue
        tau[k] += forces[k]
        for i in range(nv):
            base[i] += h * minv[i, k] * forces[k]


@internal
def apply_velocity_loads(run, v, tau):
    """Add the velocity-dependent part of the loads to tau."""
    for load in loads(run):
        if load.active == 0:
            continue
        _read_velocities(load, v)
        _evaluate_law(load, run.time)
        n = _answer_size(load)
        _project_forces(load, 1.0, floats(load.out, n), tau)
        _project_forces(load, -1.0, floats(load.elastic, n), tau)


@internal
def add_load_slopes(run):
    """Add the loads' derivative by velocity to the slope, after `apply_velocity_loads`."""
    slope, place = matrix(run.slope, run.active, run.active), integers(run.place, run.nv)
    for load in loads(run):
        if load.active == 0:
            continue
        frames, m = load.frames != 0, _answer_size(load)
        n = 6 if frames else load.ninputs
        rate, out = floats(load.rate, n), floats(load.out, m)
        kept = floats(load.elastic + 8 * m, m)
        for i in range(m):
            kept[i] = out[i]
        for c in range(n):
            now = rate[c]
            more = _DIFFERENCE * (abs(now) + 1.0)
            rate[c] = now + more
            _evaluate_law(load, run.time)
            rate[c] = now
            for r in range(m):
                rise = (out[r] - kept[r]) / more
                if frames:
                    load.wrench_slope[r, c] = rise
                elif rise != 0.0:
                    i, k = integers(load.outputs, m)[r], integers(load.inputs, n)[c]
                    slope[place[i], place[k]] += rise
        for i in range(m):
            out[i] = kept[i]
        if frames:
            project_frame_slope(load, place, slope)


@internal
def find_load_powers(run, v):
    """Powers of the loads at velocities v; stops the run where a law has failed."""
    for index in range(run.nl):
        load = loads(run)[index]
        n = _answer_size(load)
        out, elastic = floats(load.out, n), floats(load.elastic, n)
        _read_velocities(load, v)
        if load.stores != 0 and load.implicit != 0 and load.active == 0:
            for i in range(n):
                out[i] = elastic[i]
        outputs = integers(load.outputs, load.noutputs)
        total, finite = 0.0, True
        for i in range(n):
            finite = finite and math.isfinite(out[i])
            speed = load.twist[i] if load.frames != 0 else v[outputs[i]]
            total += (out[i] - elastic[i] if load.stores != 0 else out[i]) * speed
        load.power = total
        if not finite:
            record_failure(run, _BAD_LOAD, index)


@internal
def apply_current_loads(run, q, v, time, tau):
    """Add the forces of all loads at state (q, v) to tau, and find their powers."""
    for load in loads(run):
        if load.frames != 0:
            pose_of_frames(run, load, load.pose, floats(load.jacobian, 6 * load.nsupport))
        else:
            _read_positions(load, q)
        if load.stores != 0:
            _evaluate_law_at_rest(load, time)
        load.active = 1
        _read_velocities(load, v)
        _evaluate_law(load, time)
        _project_forces(load, 1.0, floats(load.out, _answer_size(load)), tau)
    find_load_powers(run, v)


@internal
def add_load_work(run, duration):
    """Add the loads' work at their present powers over `duration`."""
    for load in loads(run):
        load.work += duration * load.power


@internal
def complete_load_work(run):
    """Complete the works of a single-rate step by the trapezoidal rule, if they are pending."""
    for load in loads(run):
        if run.pending != 0:
            load.work += 0.5 * run.dt * (load.before + load.power)
        load.before = load.power


@internal
def add_stage_work(run, stage, weight):
    """Add a stage's part to the works of a Runge-Kutta step; with the fourth they are done."""
    for load in loads(run):
        load.gathered = weight * load.power + (0.0 if stage == 0 else load.gathered)
        if stage == 3:
            load.work += load.gathered


@internal
def record_loads(run, row, at):
    """Write answers, then works, into a record's row from place `at`."""
    for load in loads(run):
        n = _answer_size(load)
        out = floats(load.out, n)
        for i in range(n):
            row[at + i] = out[i]
        at += n
    for load in loads(run):
        row[at] = load.work
        at += 1
