"""Loads: springs, wrenches, stops, controllers, a user's own laws, called by address.

A law is a compiled function

    law(time, x, dx, p, out)

of the time [s], positions x, velocities dx and the load's numbers p, which writes forces to out.
Between two frames x is the pose of the second one in the first (origin, then orientation row by
row), dx its velocity and angular velocity there, and out the wrench on it: force, then moment about
its origin, in axes of the first frame, whose body gets the opposite. On coordinates x and dx are
their positions and velocities, out the efforts.

The force of a load that stores energy is split: the part at rest, law(time, x, 0), does not depend
on velocity; the rest does, and takes part in the velocity solve. A load that stores none is
evaluated at velocities extrapolated by half a step, as drives are.

Compiled apart as `loads`, for runs that have some; the functions without underscore call it.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import address_of, calling, carray, compiled, pointer
from jointplay.physics.kernel.access import record_failure, run_at, run_part
from jointplay.physics.kernel.constants import ALWAYS, IF_PRESSED, Status
from jointplay.physics.kernel.frames import (
    frame_twist,
    pose_of_frames,
    project_frame_slope,
    project_frame_wrench,
)
from jointplay.physics.kernel.layout import LOAD_FORCE, LOAD_WORK

_BAD_LOAD = int(Status.BAD_LOAD)

LOAD_LAW = "v(d,p,p,p,p)"
"""Signature of a load's law, see `compiler.Compiled.native`."""
_DIFFERENCE = 1e-6
"""Step in velocity of the difference quotients that differentiate laws: relative, and in addition
absolute [m/s or rad/s]."""


_call = calling(LOAD_LAW)


@compiled
def _evaluate_law(load, time):
    """Evaluate the law at the load's present inputs into `out`, limited by its bounds."""
    inputs = address_of(load.place), address_of(load.rate)
    _call(load.law, (time, *inputs, pointer(load.numbers), address_of(load.out)))
    out, bounds = load.out, load.bounds
    for i in range(bounds.size):
        if abs(out[i]) > bounds[i]:
            out[i] = math.copysign(bounds[i], out[i])


@compiled
def _read_positions(run, load, q):
    """Find the positions that the law reads, its x."""
    if load.frames != 0:
        pose_of_frames(run, load)
        return
    inputs, place = load.inputs, load.place
    for k in range(load.ninputs):
        place[k] = q[inputs[k]]


@compiled
def _read_velocities(load, v):
    """Find the velocities that the law reads, its dx."""
    if load.frames != 0:
        frame_twist(load, v)
        return
    inputs, rate = load.inputs, load.rate
    for k in range(load.ninputs):
        rate[k] = v[inputs[k]]


@compiled
def _evaluate_law_at_rest(load, time):
    """Evaluate the law at zero velocity, into `out` and `elastic`."""
    rate = load.rate
    for k in range(rate.size):
        rate[k] = 0.0
    _evaluate_law(load, time)
    out, elastic = load.out, load.elastic[0]
    for i in range(out.size):
        elastic[i] = out[i]


@compiled
def _project_forces(load, sign, forces, tau):
    """Project a load's efforts or wrench on the coordinates, and add that times `sign` to tau."""
    if load.frames != 0:
        project_frame_wrench(load, sign, forces, tau)
        return
    outputs = load.outputs
    for k in range(outputs.size):
        tau[outputs[k]] += sign * forces[k]


@compiled
def _evaluate_loads(run, q, v, marks):
    """See `evaluate_loads`."""
    tau = run.load_forces
    for i in range(run.nv):
        tau[i] = 0.0
    for load in run.loads:
        _read_positions(run, load, q)
        load.active = 0
        if load.stores == 0:
            # Without energy all of it is explicit.
            _read_velocities(load, v)
            _evaluate_law(load, run.time)
            _project_forces(load, 1.0, load.out, tau)
            continue
        _evaluate_law_at_rest(load, run.time)
        elastic = load.elastic[0]
        _project_forces(load, 1.0, elastic, tau)
        # The rest takes part in the velocity solve, if there is any.
        pressed = load.implicit == ALWAYS
        if load.implicit == IF_PRESSED:
            for i in range(elastic.size):
                pressed = pressed or elastic[i] != 0.0
        if not pressed:
            continue
        load.active = 1
        moved = load.support if load.frames != 0 else load.outputs
        for k in range(moved.size):
            marks[moved[k]] = 1.0


@compiled
def apply_loads(run, base, h):
    """Add the forces from `evaluate_loads` to tau, and their impulse over h to the velocities."""
    nv = run.nv
    forces, tau = run.load_forces, run.tau
    minv = run.minv
    for k in range(nv):
        if forces[k] == 0.0:
            continue
        tau[k] += forces[k]
        for i in range(nv):
            base[i] += h * minv[i, k] * forces[k]


@compiled
def _apply_velocity_loads(run, v, tau):
    """See `apply_velocity_loads`."""
    for load in run.loads:
        if load.active == 0:
            continue
        _read_velocities(load, v)
        _evaluate_law(load, run.time)
        _project_forces(load, 1.0, load.out, tau)
        _project_forces(load, -1.0, load.elastic[0], tau)


@compiled
def _add_load_slopes(run):
    """See `add_load_slopes`."""
    slope, place = run.slope, run.place
    for load in run.loads:
        if load.active == 0:
            continue
        frames, rate, out, forces = load.frames != 0, load.rate, load.out, load.elastic[1]
        for i in range(out.size):
            forces[i] = out[i]
        for c in range(rate.size):
            now = rate[c]
            more = _DIFFERENCE * (abs(now) + 1.0)
            rate[c] = now + more
            _evaluate_law(load, run.time)
            rate[c] = now
            for r in range(out.size):
                rise = (out[r] - forces[r]) / more
                if frames:
                    load.wrench_slope[r, c] = rise
                elif rise != 0.0:
                    i, k = load.outputs[r], load.inputs[c]
                    slope[place[i], place[k]] += rise
        for i in range(out.size):
            out[i] = forces[i]
        if frames:
            project_frame_slope(load, place, slope)


@compiled
def _find_load_powers(run, v):
    """See `find_load_powers`."""
    for index in range(run.nl):
        load = run.loads[index]
        out, elastic, outputs = load.out, load.elastic[0], load.outputs
        _read_velocities(load, v)
        if load.stores != 0 and load.implicit != 0 and load.active == 0:
            for i in range(out.size):
                out[i] = elastic[i]
        total, finite = 0.0, True
        for i in range(out.size):
            finite = finite and math.isfinite(out[i])
            speed = load.twist[i] if load.frames != 0 else v[outputs[i]]
            total += (out[i] - elastic[i] if load.stores != 0 else out[i]) * speed
        load.power = total
        if not finite:
            record_failure(run, _BAD_LOAD, index)


@compiled
def _apply_current_loads(run, q, v, time, tau):
    """See `apply_current_loads`."""
    for load in run.loads:
        _read_positions(run, load, q)
        if load.stores != 0:
            _evaluate_law_at_rest(load, time)
        load.active = 1
        _read_velocities(load, v)
        _evaluate_law(load, time)
        _project_forces(load, 1.0, load.out, tau)
    _find_load_powers(run, v)


@compiled
def add_load_work(run, duration):
    """Add the loads' work at their present powers over `duration`."""
    for load in run.loads:
        load.work += duration * load.power


@compiled
def complete_load_work(run):
    """Complete the loads' works of a single-rate step by the trapezoidal rule, if pending."""
    for load in run.loads:
        if run.pending != 0:
            load.work += 0.5 * run.dt * (load.before + load.power)
        load.before = load.power


@compiled
def add_stage_work(run, stage, weight):
    """Add a stage's part to the loads' works of a Runge-Kutta step; the fourth completes them."""
    for load in run.loads:
        load.gathered = weight * load.power + (0.0 if stage == 0 else load.gathered)
        if stage == 3:
            load.work += load.gathered


@compiled
def record_loads(run, row):
    """Write efforts and works of all loads into a recorded row."""
    at = run.columns[LOAD_FORCE]
    for index in range(run.nl):
        load = run.loads[index]
        out = load.out
        for i in range(out.size):
            row[at + i] = out[i]
        at += out.size
        row[run.columns[LOAD_WORK] + index] = load.work


_EVALUATE, _APPLY, _SLOPES, _POWERS, _CURRENT = range(5)


@compiled
def loads(address, q_at, v_at, tau_at, time, task):
    """Carry out one of the tasks above (`access.RUN_PART`)."""
    run = run_at(address)
    nv = run.nv
    q, v, tau = carray(q_at, (nv,)), carray(v_at, (nv,)), carray(tau_at, (nv,))
    if task == _EVALUATE:
        _evaluate_loads(run, q, v, tau)  # here `tau` carries the marks
    elif task == _APPLY:
        _apply_velocity_loads(run, v, tau)
    elif task == _SLOPES:
        _add_load_slopes(run)
    elif task == _POWERS:
        _find_load_powers(run, v)
    else:
        _apply_current_loads(run, q, v, time, tau)


@compiled
def evaluate_loads(run, q, v, marks):
    """Find `load_forces`, the part of all loads at q that the velocity solve leaves alone.

    Coordinates on which the velocity-dependent rest acts are marked. v are extrapolated velocities,
    at which loads that store no energy are evaluated.
    """
    if run.nl > 0:
        run_part(run.load_part, run, q, v, marks, 0.0, _EVALUATE)


@compiled
def apply_velocity_loads(run, v, tau):
    """Add the velocity-dependent part of the loads to tau."""
    if run.nl > 0:
        run_part(run.load_part, run, v, v, tau, 0.0, _APPLY)


@compiled
def add_load_slopes(run):
    """Add the loads' velocity derivatives to d(tau_c)/dv; after `apply_velocity_loads`."""
    if run.nl > 0:
        run_part(run.load_part, run, run.q, run.q, run.q, 0.0, _SLOPES)


@compiled
def find_load_powers(run, v):
    """Find the powers of the loads at velocities v; stop the run where a law has failed."""
    if run.nl > 0:
        run_part(run.load_part, run, v, v, v, 0.0, _POWERS)


@compiled
def apply_current_loads(run, q, v, time, tau):
    """Add the forces of all loads at state (q, v) to tau, and find their powers."""
    if run.nl > 0:
        run_part(run.load_part, run, q, v, tau, time, _CURRENT)
