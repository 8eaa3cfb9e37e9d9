"""Records of a run, and the works that belong to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jointplay.core.compiler import internal
from jointplay.kernel.access import contacts, floats, joints, loads, matrix
from jointplay.kernel.drive import add_prescribed_power
from jointplay.kernel.frames import dot, get_vector, set_vector
from jointplay.kernel.gear import record_gears
from jointplay.kernel.load import complete_load_work, record_loads
from jointplay.kernel.sites import LoadSite
from jointplay.kernel.words import POWERS

_NP = len(POWERS)


@internal
def is_due(run, step):
    """Whether a step is to be recorded."""
    if step % run.every == 0:
        return True
    windows = matrix(run.windows, run.nwindows, 2)
    for w in range(run.nwindows):  # noqa: SIM110 - compiled
        if windows[w, 0] <= step <= windows[w, 1]:
            return True
    return False


@internal
def complete_step(run):
    """Complete what a single-rate method could not know before the acceleration was.

    That is the effort of prescribed motion, and with it the work of the last step by the
    trapezoidal rule, if that is pending.
    """
    if run.prescribed != 0:
        add_prescribed_power(run, floats(run.v, run.nv), floats(run.a, run.nv))
    for i in range(_NP):
        if run.pending != 0:
            run.work[i] += 0.5 * run.dt * (run.before[i] + run.power[i])
        run.before[i] = run.power[i]
    complete_load_work(run)
    run.pending = 0


@internal
def fill_row(run, row):
    """Write the present state into a row of the records; peaks are those of the state."""
    nv, nj, width = run.nv, run.nj, run.width
    q, v, drive = floats(run.q, nv), floats(run.v, nv), floats(run.drive, nv)
    row[0] = run.time
    for i in range(nv):
        row[1 + i] = q[i]
        row[1 + nv + i] = v[i]
        row[1 + 2 * nv + i] = drive[i]
    at = 1 + 3 * nv
    for i in range(_NP):
        row[at + i] = run.work[i]
    at += _NP
    averaged = run.averaged != 0
    for j in range(nj):
        joint = joints(run)[j]
        for i in range(3):
            force = joint.mean_force[i] if averaged else joint.wrench[i]
            film = joint.mean_film_force[i] if averaged else joint.film_wrench[i]
            row[at + 3 * j + i] = row[at + 3 * nj + 3 * j + i] = force
            row[at + 6 * nj + 3 * j + i] = film
        for k in range(width):
            contact = contacts(run, j)[k]
            c = at + 9 * nj + j * width + k
            normal, tangential = contact.normal, contact.tangential
            if not averaged:
                touching = contact.touching != 0
                normal = contact.normal_now if touching else 0.0
                tangential = contact.tangential_now if touching else 0.0
            row[c] = row[c + 2 * width * nj] = normal
            row[c + width * nj] = tangential
            row[c + 3 * width * nj] = contact.gap
    at += 9 * nj + 4 * width * nj
    for j in range(run.cages):
        row[at + j] = joints(run)[j].cage
    at += run.cages
    if run.nr > 0:
        at = record_gears(run, row, at)
    record_loads(run, row, at)


@internal
def _end_peaks(run, row):
    """Let a row hold the peaks since the last record, its own included, and begin new ones."""
    nj, width = run.nj, run.width
    at = 1 + 3 * run.nv + _NP + 3 * nj
    for j in range(nj):
        joint = joints(run)[j]
        c = at + 3 * j
        force = get_vector(row, c)
        if joint.peak_square > dot(force, force):
            set_vector(row, c, get_vector(joint.peak, 0))
        set_vector(joint.peak, 0, (0.0, 0.0, 0.0))
        joint.peak_square = 0.0
        for k in range(width):
            contact = contacts(run, j)[k]
            c = at + 6 * nj + (2 * nj + j) * width + k
            row[c] = max(row[c], contact.normal_peak)
            row[c + width * nj] = min(row[c + width * nj], contact.gap_min)
            contact.normal_peak = 0.0
            contact.gap_min = np.inf


@internal
def write_record(run):
    """Write the current state and the peaks since the last record, and begin new peaks."""
    if run.row >= run.rows:
        return
    columns = run.record_columns
    row = floats(run.record + 8 * columns * run.row, columns)
    fill_row(run, row)
    _end_peaks(run, row)
    run.row += 1


@internal
def _cubic(x0, x1, v0, v1, part, h):
    """Cubic through two values with these rates, `h` apart."""
    rise = x1 - x0
    b, c = 3.0 * rise - h * (2.0 * v0 + v1), h * (v0 + v1) - 2.0 * rise
    return x0 + part * (h * v0 + part * (b + part * c))


@internal
def write_interpolated(run, time, elapsed, h):
    """Write a record `elapsed` after the state of `row_before`, `h` before that of `row_after`.

    Positions and velocities follow cubics, works the parabolas of their powers, the rest lines.
    """
    if run.row >= run.rows:
        return
    nv, columns, part = run.nv, run.record_columns, elapsed / h
    one, other = floats(run.row_before, columns), floats(run.row_after, columns)
    row = floats(run.record + 8 * columns * run.row, columns)
    a0, a1 = floats(run.earlier_a, nv), floats(run.a, nv)
    for i in range(columns):
        row[i] = one[i] + part * (other[i] - one[i])
    row[0] = time
    for i in range(1, 1 + nv):
        k = nv + i
        row[i] = _cubic(one[i], other[i], one[k], other[k], part, h)
        row[k] = _cubic(one[k], other[k], a0[i - 1], a1[i - 1], part, h)
    at = 1 + 3 * nv
    for i in range(_NP):
        rise = run.power[i] - run.before[i]
        row[at + i] = one[at + i] + elapsed * (run.before[i] + 0.5 * part * rise)
    at = columns - run.nl
    for load in loads(run):
        rise = load.power - load.before
        row[at] = one[at] + elapsed * (load.before + 0.5 * part * rise)
        at += 1
    _end_peaks(run, row)
    run.row += 1


# Where each quantity stands in what the kernels write.


def record_columns(
    nv: int,
    nj: int,
    width: int,
    loads: Sequence[LoadSite],
    cages: int = 0,
    refined: int = 0,
) -> tuple[dict[str, slice], int]:
    """Columns of a record by name, and their number.

    `cages`: all joints, if any of them rolls; `refined`: how many gears are so.
    """
    widths = {
        "time": 1,
        "q": nv,
        "v": nv,
        "drive": nv,
        "work": len(POWERS),
        "force": 3 * nj,
        "force_peak": 3 * nj,
        "film_force": 3 * nj,
        "normal": width * nj,
        "tangential": width * nj,
        "normal_peak": width * nj,
        "gap_min": width * nj,
        "cage": cages,
        "gear": 2 * refined,
        "load_force": sum(load.size for load in loads),
        "load_work": len(loads),
    }
    fields, at = {}, 0
    for name, size in widths.items():
        fields[name] = slice(at, at + size)
        at += size
    return fields, at


def contact_statistics(contacts: np.ndarray) -> dict[str, np.ndarray]:
    """What records of contacts (nj, width) have counted, of the same shape.

    Counts, steps, impulses [N s], smallest gap [m], fastest approach [m/s].
    """
    names = {
        "onsets": "onsets",
        "ended": "ended",
        "shortest_steps": "shortest",
        "under_resolved": "under",
        "impulse": "impulse",
        "under_resolved_impulse": "impulse_under",
        "smallest_gap": "deepest",
    }
    statistics = {name: contacts[field].copy() for name, field in names.items()}
    # A contact that has not ended keeps its approach to itself.
    fastest = np.maximum(contacts["fastest"], contacts["ddelta0"])
    return statistics | {"fastest_approach": fastest}
