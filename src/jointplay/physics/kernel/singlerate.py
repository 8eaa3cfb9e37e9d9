"""Single-rate methods: explicit Euler and Runge-Kutta, with Pinocchio's acceleration every stage.

A stage is one compiled call and one `pin.aba` call:

    record state n, integrate to n+1, drive efforts and contact forces at n+1  -> tau
    pin.aba(model, data, q, v, tau)                                            -> data.ddq

Where joints are reached through frames, the compiled call stops before the forces; Pinocchio finds
the Jacobians, and a second call, `evaluate_forces`, goes on.
"""

from __future__ import annotations

from jointplay.base.compiler import compiled
from jointplay.physics.kernel.access import record_failure
from jointplay.physics.kernel.constants import Status
from jointplay.physics.kernel.contact import (
    add_contact_forces,
    add_dissipation,
    average_stage_forces,
    bend_at_start,
    commit_contacts,
    find_gaps,
    time_bristles,
)
from jointplay.physics.kernel.drive import (
    add_drive_power,
    add_joint_losses,
    apply_drives,
    apply_joint_friction,
    apply_servos,
    commit_bristles,
    commit_servos,
    prescribe_motion,
)
from jointplay.physics.kernel.film import add_film_forces, add_film_losses, commit_film
from jointplay.physics.kernel.frames import find_pose, find_twist, project_wrench
from jointplay.physics.kernel.gear import add_gear_losses, apply_gears, commit_gears, place_gears
from jointplay.physics.kernel.layout import POWERS, SPEED_LIMIT
from jointplay.physics.kernel.load import add_stage_work, apply_current_loads
from jointplay.physics.kernel.record import complete_step, is_due, write_record
from jointplay.physics.kernel.rolling import advance_cages, advance_cages_by_stage

_NP = len(POWERS)
_RUN_AWAY = int(Status.RUN_AWAY)


@compiled
def _evaluate_joint(run, j, q, v, tau, time, elapsed):
    """Add joint j's forces to tau and its losses to the powers.

    `elapsed` is the time since the last state of the trajectory [s].
    """
    joint = run.joints[j]
    find_pose(run, joint, q)
    for r in range(6):
        joint.wrench[r] = 0.0
    touching = find_gaps(run, j, joint)
    if not touching and joint.sections == 0 and joint.resultant == 0:
        return
    find_twist(joint, v)
    if joint.sections > 0:
        add_film_forces(run, j, joint, True)
        add_film_losses(run, j, joint)
    if joint.bristles != 0:
        if run.time == 0.0 and run.commit != 0:
            bend_at_start(run, j, joint)
        time_bristles(run, j, joint, max(time - run.bent_at, 0.0), elapsed)
    add_contact_forces(run, j, joint)
    add_dissipation(run, j, joint)
    project_wrench(joint, tau)


@compiled
def _evaluate_state(run, q, v, time):
    """Find generalised forces tau and powers at state (q, v).

    With `run.commit` the state is one of the trajectory, not an intermediate stage: the history of
    contacts, gears, servos and bristles is then updated.
    """
    nv = run.nv
    tau = run.tau
    size = 0.0
    for i in range(nv):
        tau[i] = 0.0
        size += abs(v[i])
    for i in range(_NP):
        run.power[i] = 0.0
    # Forces on coordinates: drives, joint friction, gears, loads.
    apply_drives(run, q, v, time, tau)
    apply_servos(run, q, v, time, tau)
    add_drive_power(run, v)
    apply_joint_friction(run, v, time, tau)
    place_gears(run, q)
    apply_gears(run, v, tau)
    add_joint_losses(run, v)
    add_gear_losses(run, v)
    apply_current_loads(run, q, v, time, tau)
    if not size < SPEED_LIMIT:  # true for NaN as well
        record_failure(run, _RUN_AWAY, 0)
    committed = run.commit != 0
    if committed:
        commit_gears(run)
    elapsed = run.dt if committed and run.step > 0 else time - run.time
    duration = run.dt if run.step > 0 else 0.0
    # Bristles are kept half a step ahead with Runge-Kutta; with Euler's method, whose velocities
    # are those of the step's end, it is stable if bristles are those of the end, too.
    ahead = 0.5 * run.dt if run.averaged != 0 else 0.0
    if committed:
        commit_bristles(run, v, ahead)
        commit_servos(run)
    # Forces of the joints with clearance.
    for j in range(run.nj):
        _evaluate_joint(run, j, q, v, tau, time, elapsed)
        if committed:
            commit_contacts(run, j, run.joints[j], duration, ahead)
            if run.joints[j].sections > 0:
                commit_film(run, j, run.joints[j])
    if committed:
        run.bent_at = time + ahead


@compiled
def evaluate_forces(run):
    """Find the forces at the state that `_prepare_evaluation` left, Pinocchio's Jacobians given."""
    _evaluate_state(run, run.q, run.v, run.load_time)


@compiled
def _prepare_evaluation(run, q, v, time, commit):
    """Find the forces at state (q, v), or leave that to `evaluate_forces` if it needs Jacobians."""
    run.commit = 1 if commit else 0
    if run.prescribed != 0:
        prescribe_motion(run, q, v, time)
    if run.through_frames != 0:
        run.load_time = time
    else:
        _evaluate_state(run, q, v, time)


@compiled
def begin(run, commit):
    """Find the forces at the current state, one of the trajectory if `commit`."""
    _prepare_evaluation(run, run.q, run.v, run.time, commit)


@compiled
def semi_implicit_euler(run):
    """Do a step of the semi-implicit Euler method, v += a dt, then q += v dt (first order)."""
    nv = run.nv
    q, v, a = run.q, run.v, run.a
    complete_step(run)
    if is_due(run, run.step):
        write_record(run)
    for i in range(nv):
        v[i] += run.dt * a[i]
    advance_cages(run, v, run.dt)
    for i in range(nv):
        q[i] += run.dt * v[i]
    run.pending = 1
    run.step += 1
    run.time = run.step * run.dt
    _prepare_evaluation(run, q, v, run.time, True)


@compiled
def runge_kutta_4(run):
    """Do one stage of the classical Runge-Kutta method.

    The works are integrated with the state, as further components, and so is the impulse of each
    force: the force recorded is its mean over the step that led to the state.
    """
    nv = run.nv
    q, v, a = run.q, run.v, run.a
    stages = run.stages
    dt, stage = run.dt, run.stage
    complete_step(run)
    if stage == 0 and is_due(run, run.step):
        write_record(run)
    # Add this stage's rates, weighted by 1/6, 1/3, 1/3, 1/6, to the sums.
    weight = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
    for i in range(_NP):
        before = 0.0 if stage == 0 else run.stage_work[i]
        run.stage_work[i] = before + weight * run.power[i]
    add_stage_work(run, stage, weight)
    for j in range(run.nj):
        average_stage_forces(run.joints[j], run.contacts[j], stage, weight / dt)
    # Go on to the next stage, at 1/2, 1/2 and 1 of the step, or to its end.
    ahead = dt if stage == 2 else 0.5 * dt
    advance_cages_by_stage(run, v, stage, weight, ahead)
    for i in range(nv):
        if stage == 0:
            stages[0, i] = q[i]
            stages[1, i] = v[i]
            stages[2, i] = 0.0
            stages[3, i] = 0.0
        stages[2, i] += weight * v[i]
        stages[3, i] += weight * a[i]
        if stage == 3:
            q[i] = stages[0, i] + stages[2, i]
            v[i] = stages[1, i] + stages[3, i]
        else:
            q[i] = stages[0, i] + ahead * v[i]
            v[i] = stages[1, i] + ahead * a[i]
    if stage < 3:
        run.stage = stage + 1
        _prepare_evaluation(run, q, v, run.time + ahead, False)
        return
    run.stage = 0
    run.averaged = 1
    for i in range(_NP):
        run.work[i] += run.stage_work[i]
    run.step += 1
    run.time = run.step * dt
    _prepare_evaluation(run, q, v, run.time, True)
