"""Gears between a motor and its joint: backlash, elasticity, kinematic error, hysteresis, friction.

With the motor's coordinate m and the joint's k, the twist of a gear and its lever are

    twist = m + e(m) - k,    lever = 1 + e'(m),    e(m) = sum of a_i sin(n_i m + phase_i)

e being the kinematic error. The torque on the joint is S(twist) + d d(twist)/dt + z: an elastic
curve S beyond the backlash with a damper d, which together never pull the teeth, and the torque z
of bristles, the hysteresis, by which the two sides hold each other within the backlash, too. The
motor feels that torque times the lever, and friction of its own. Bristles follow Dahl's law, which
does not depend on time:

    dz/d(twist) = z_max/b (1 - z/z_max sgn(d(twist)))

so that z after a twist follows exactly from z before it. They store b z^2/(2 z_max) and lose
z^2/z_max per angle.

Compiled apart as `gears`, for runs that have some; what others call calls it.
"""

from __future__ import annotations

import math

from jointplay.base.compiler import carray, compiled, pointer_to
from jointplay.physics.kernel.access import run_at, run_part
from jointplay.physics.kernel.constants import GEAR_BENDS, JOINT_FRICTION_SPEED
from jointplay.physics.kernel.layout import GEAR, GEAR_ROW, GEAR_TORQUE

LEAST_TURN = 1e-12
"""First twist beyond the last one that is tried in a search for a torque [rad]."""
HALVINGS = 64
"""Bisections of that search, after which its interval is no wider than rounding."""


@compiled
def _elastic_torque(gear, depth):
    """Elastic torque at a twist `depth` >= 0 beyond the backlash, a piecewise linear curve."""
    torque = start = 0.0
    for k in range(GEAR_BENDS):
        end = gear.bend_twists[k]
        if depth <= end:
            return torque + gear.slopes[k] * (depth - start)
        torque, start = gear.bend_torques[k], end
    return torque + gear.slopes[GEAR_BENDS] * (depth - start)


@compiled
def _set_twist(gear, twist):
    """Set the twist; find elastic torque and, from that at the last twist, hysteresis."""
    gear.twist = twist
    depth = abs(twist) - gear.half_play
    gear.elastic = _elastic_torque(gear, depth) if depth > 0.0 else 0.0
    gear.hysteresis = 0.0
    if gear.grip > 0.0:
        turn = twist - gear.last_twist
        limit = math.copysign(gear.grip, turn)
        left = math.exp(-abs(turn) / gear.presliding)
        gear.hysteresis = limit + (gear.last_hysteresis - limit) * left


@compiled
def _commit_gear(gear):
    """Keep twist and hysteresis for the next step to go on from."""
    gear.last_twist, gear.last_hysteresis = gear.twist, gear.hysteresis


@compiled
def _place_gears(run, q):
    """See `place_gears`."""
    for gear in run.gears:
        motor = q[gear.motor]
        error, lever = 0.0, 1.0
        for k in range(gear.orders):
            angle = gear.order[k] * motor + gear.phase[k]
            error += gear.amplitude[k] * math.sin(angle)
            lever += gear.amplitude[k] * gear.order[k] * math.cos(angle)
        gear.lever = lever
        _set_twist(gear, motor + error - q[gear.link])


@compiled
def mark_gears(run, marks):
    """Mark the coordinates on which gears act."""
    for gear in run.gears:
        if gear.elastic > 0.0 or gear.rubs != 0:
            marks[gear.motor] = marks[gear.link] = 1.0


@compiled
def _held_torque(gear):
    """Torque on the joint that teeth and bristles hold at rest."""
    return math.copysign(gear.elastic, gear.twist) + gear.hysteresis


@compiled
def _tooth_torque(gear, v):
    """Torque of the teeth >= 0, which flank is in contact (+1, -1, 0), and its rate of approach."""
    if gear.elastic <= 0.0:
        return 0.0, 0.0, 0.0
    side = math.copysign(1.0, gear.twist)
    rate = side * (gear.lever * v[gear.motor] - v[gear.link])
    return max(gear.elastic + gear.damping * rate, 0.0), side, rate  # teeth never pull


@compiled
def _gear_friction(gear, speed):
    """Friction on the motor at its speed, and its derivative.

    It grows with the torque that the gear holds: by one factor where the motor drives the joint, by
    another where the joint drives it.
    """
    if gear.rubs == 0:
        return 0.0, 0.0
    held = _held_torque(gear)
    part = gear.driving_loss if held * speed > 0.0 else gear.driven_loss
    dry = gear.running_torque + part * abs(held)
    turn = math.tanh(speed / JOINT_FRICTION_SPEED)
    slope = dry * (1.0 - turn * turn) / JOINT_FRICTION_SPEED + gear.viscous
    return dry * turn + gear.viscous * speed, slope


@compiled
def _apply_gears(run, v, tau):
    """See `apply_gears`."""
    for gear in run.gears:
        torque, side, _ = _tooth_torque(gear, v)
        gear.torque = side * torque + gear.hysteresis
        friction, _ = _gear_friction(gear, v[gear.motor])
        tau[gear.motor] -= gear.lever * gear.torque + friction
        tau[gear.link] += gear.torque


@compiled
def _add_gear_slopes(run, v):
    """See `add_gear_slopes`."""
    slope, place = run.slope, run.place
    for gear in run.gears:
        m, k = place[gear.motor], place[gear.link]
        _, rise = _gear_friction(gear, v[gear.motor])
        slope[m, m] -= rise
        torque, _, _ = _tooth_torque(gear, v)
        if torque > 0.0:
            slope[m, m] -= gear.lever * gear.lever * gear.damping
            slope[k, k] -= gear.damping
            slope[m, k] += gear.lever * gear.damping
            slope[k, m] += gear.lever * gear.damping


@compiled
def _add_gear_losses(run, v):
    """See `add_gear_losses`."""
    for gear in run.gears:
        torque, _, rate = _tooth_torque(gear, v)
        friction, _ = _gear_friction(gear, v[gear.motor])
        run.power[GEAR] += (torque - gear.elastic) * rate + friction * v[gear.motor]
        if gear.grip > 0.0:
            slip = abs(gear.lever * v[gear.motor] - v[gear.link])
            run.power[GEAR] += gear.hysteresis * gear.hysteresis / gear.grip * slip


@compiled
def record_gears(run, row):
    """Write torque and hysteresis of each gear into a recorded row."""
    at = run.columns[GEAR_TORQUE]
    for gear in run.gears:
        row[at] = gear.torque
        row[at + 1] = gear.hysteresis
        at += 2


_PLACE, _COMMIT, _APPLY, _SLOPES, _LOSSES = range(5)


@compiled
def gears(address, q, v, tau, _time, task):
    """Carry out one of the tasks above (`access.RUN_PART`)."""
    run = run_at(address)
    nv = run.nv
    if task == _PLACE:
        _place_gears(run, carray(q, (nv,)))
    elif task == _COMMIT:
        for gear in run.gears:
            _commit_gear(gear)
    elif task == _APPLY:
        _apply_gears(run, carray(v, (nv,)), carray(tau, (nv,)))
    elif task == _SLOPES:
        _add_gear_slopes(run, carray(v, (nv,)))
    else:
        _add_gear_losses(run, carray(v, (nv,)))


@compiled
def place_gears(run, q):
    """Find levers, twists, elastic torques and hysteresis, which depend on q alone."""
    if run.ng > 0:
        run_part(run.gear_part, run, q, q, q, 0.0, _PLACE)


@compiled
def commit_gears(run):
    """Accept the state of the gears as one of the trajectory."""
    if run.ng > 0:
        run_part(run.gear_part, run, run.q, run.q, run.q, 0.0, _COMMIT)


@compiled
def apply_gears(run, v, tau):
    """Add the gears' torques at the velocities v to tau; after `place_gears`."""
    if run.ng > 0:
        run_part(run.gear_part, run, v, v, tau, 0.0, _APPLY)


@compiled
def add_gear_slopes(run, v):
    """Add the velocity derivatives of the gears' torques to d(tau_c)/dv."""
    if run.ng > 0:
        run_part(run.gear_part, run, v, v, v, 0.0, _SLOPES)


@compiled
def add_gear_losses(run, v):
    """Add the power dissipated in the gears at the velocities v."""
    if run.ng > 0:
        run_part(run.gear_part, run, v, v, v, 0.0, _LOSSES)


_gear = pointer_to(GEAR_ROW)


@compiled
def turn_slowly(address, torques, twists):
    """Load a gear quasi-statically with one torque after another, from its last twist.

    Where several twists bear a torque, the gear stops at the first.

    Args:
        address: address of a record `layout.GEAR_ROW`, in which the gear's state is kept.
        torques: torques on the joint, shape (n,) [N m].
        twists: result, shape (n,) [rad].
    """
    gear = carray(_gear(address), (1,))[0]
    for i in range(len(torques)):
        begin = gear.last_twist
        _set_twist(gear, begin)
        missing = torques[i] - _held_torque(gear)
        if missing != 0.0:
            # Bracket the twist by doubling, then bisect.
            sign = math.copysign(1.0, missing)
            low, high = 0.0, LEAST_TURN
            while True:
                _set_twist(gear, begin + sign * high)
                if not sign * (_held_torque(gear) - torques[i]) < 0.0:
                    break
                low, high = high, 2.0 * high
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                _set_twist(gear, begin + sign * middle)
                if sign * (_held_torque(gear) - torques[i]) < 0.0:
                    low = middle
                else:
                    high = middle
            _set_twist(gear, begin + sign * high)
        _commit_gear(gear)
        twists[i] = gear.twist
