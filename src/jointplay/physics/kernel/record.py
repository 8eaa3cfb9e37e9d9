"""Recorded rows: the state, forces, peaks and works, written at states or interpolated between."""

from __future__ import annotations

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.physics.kernel.constants import POWERS
from jointplay.physics.kernel.drive import add_prescribed_power
from jointplay.physics.kernel.frames import dot, get_vector, set_vector
from jointplay.physics.kernel.gear import record_gears
from jointplay.physics.kernel.layout import (
    BRISTLE_TORQUE,
    CAGE,
    DRIVE_EFFORT,
    FILM_FORCE,
    FORCE,
    FORCE_PEAK,
    GAP_MIN,
    LOAD_WORK,
    NORMAL_FORCE,
    NORMAL_PEAK,
    TANGENTIAL_FORCE,
    TIME,
    WORK,
    Q,
    V,
)
from jointplay.physics.kernel.load import complete_load_work, record_loads

_NP = len(POWERS)


@compiled
def is_due(run, step):
    """Whether a step is to be recorded."""
    if step % run.record_every == 0:
        return True
    windows = run.windows
    for w in range(run.nwindows):  # noqa: SIM110 - compiled
        if windows[w, 0] <= step <= windows[w, 1]:
            return True
    return False


@compiled
def complete_step(run):
    """Complete a single-rate step, once Pinocchio has given the acceleration at its end.

    That is, the effort of prescribed motion, and with it the works of the step by the trapezoidal
    rule, if they are pending.
    """
    if run.prescribed != 0:
        add_prescribed_power(run, run.v, run.a)
    for i in range(_NP):
        if run.pending != 0:
            run.work[i] += 0.5 * run.dt * (run.before[i] + run.power[i])
        run.before[i] = run.power[i]
    complete_load_work(run)
    run.pending = 0


@compiled
def fill_row(run, row):
    """Write the present state into a recorded row; peaks are the values at this state."""
    q, v, drive, at = run.q, run.v, run.drive, run.columns
    row[at[TIME]] = run.time
    for i in range(run.nv):
        row[at[Q] + i] = q[i]
        row[at[V] + i] = v[i]
        row[at[DRIVE_EFFORT] + i] = drive[i]
    for i in range(_NP):
        row[at[WORK] + i] = run.work[i]
    averaged = run.averaged != 0
    for j in range(run.nj):
        joint = run.joints[j]
        for i in range(3):
            force = joint.mean_force[i] if averaged else joint.wrench[i]
            film = joint.mean_film_force[i] if averaged else joint.film_wrench[i]
            place = 3 * j + i
            row[at[FORCE] + place] = row[at[FORCE_PEAK] + place] = force
            row[at[FILM_FORCE] + place] = film
        for k in range(run.width):
            contact = run.contacts[j, k]
            place = run.width * j + k
            normal, tangential = contact.normal, contact.tangential
            if not averaged:
                touching = contact.touching != 0
                normal = contact.normal_now if touching else 0.0
                tangential = contact.tangential_now if touching else 0.0
            row[at[NORMAL_FORCE] + place] = row[at[NORMAL_PEAK] + place] = normal
            row[at[TANGENTIAL_FORCE] + place] = tangential
            row[at[GAP_MIN] + place] = contact.gap
    for j in range(run.cages):
        row[at[CAGE] + j] = run.joints[j].cage
    record_gears(run, row)
    place = at[BRISTLE_TORQUE]
    for friction in run.frictions:
        if friction.presliding > 0.0:
            row[place] = friction.torque
            place += 1
    record_loads(run, row)


@compiled
def _end_peaks(run, row):
    """Raise the peaks in a row to those since the last record, and begin new ones."""
    at = run.columns
    for j in range(run.nj):
        joint = run.joints[j]
        c = at[FORCE_PEAK] + 3 * j
        force = get_vector(row, c)
        if joint.peak_square > dot(force, force):
            set_vector(row, c, get_vector(joint.peak, 0))
        set_vector(joint.peak, 0, (0.0, 0.0, 0.0))
        joint.peak_square = 0.0
        for k in range(run.width):
            contact = run.contacts[j, k]
            peak, gap = at[NORMAL_PEAK] + run.width * j + k, at[GAP_MIN] + run.width * j + k
            row[peak] = max(row[peak], contact.normal_peak)
            row[gap] = min(row[gap], contact.gap_min)
            contact.normal_peak = 0.0
            contact.gap_min = np.inf


@compiled
def write_record(run):
    """Write the current state and the peaks since the last record, and begin new peaks."""
    if run.row >= run.rows:
        return
    row = run.record[run.row]
    fill_row(run, row)
    _end_peaks(run, row)
    run.row += 1


@compiled
def _cubic(x0, x1, v0, v1, part, h):
    """Cubic Hermite interpolation between two values with their rates, `h` apart."""
    rise = x1 - x0
    b, c = 3.0 * rise - h * (2.0 * v0 + v1), h * (v0 + v1) - 2.0 * rise
    return x0 + part * (h * v0 + part * (b + part * c))


@compiled
def write_interpolated(run, time, elapsed, h):
    """Write a record interpolated `elapsed` [s] into the step of length h between two states.

    `row_before` and `row_after` hold the states. Positions and velocities follow cubics, works
    parabolas, as powers follow lines; all else follows lines.
    """
    if run.row >= run.rows:
        return
    part, at = elapsed / h, run.columns
    earlier, later, row = run.row_before, run.row_after, run.record[run.row]
    a0, a1 = run.earlier_a[0], run.a
    for c in range(row.size):
        row[c] = earlier[c] + part * (later[c] - earlier[c])
    # Then what is smoother than a line.
    row[at[TIME]] = time
    for i in range(run.nv):
        q, v = at[Q] + i, at[V] + i
        row[q] = _cubic(earlier[q], later[q], earlier[v], later[v], part, h)
        row[v] = _cubic(earlier[v], later[v], a0[i], a1[i], part, h)
    for i in range(_NP):
        rise, c = run.power[i] - run.before[i], at[WORK] + i
        row[c] = earlier[c] + elapsed * (run.before[i] + 0.5 * part * rise)
    for index in range(run.nl):
        load, c = run.loads[index], at[LOAD_WORK] + index
        rise = load.power - load.before
        row[c] = earlier[c] + elapsed * (load.before + 0.5 * part * rise)
    _end_peaks(run, row)
    run.row += 1
