"""A joint with its servo by another model than the package's: three inertias, LuGre, real firmware.

Friction of motor and link by LuGre's bristles (Canudas de Wit et al., IEEE TAC 40 (1995) 419-425,
from memory), cogging, teeth that stiffen under load, a belt between the link and its outer part, a
cable's drag, a base that others shake, a supply that sags, a D part by filtered counts.
"""

import numpy as np
from numba import njit

PARTS = (
    *("rotor", "link", "outer", "belt", "belt_damping", "half", "stiffness", "hardening"),
    *("damping", "dry", "excess", "stribeck", "bristle", "viscous", "link_dry", "link_viscous"),
    *("load", "stall", "braking", "voltage", "sag", "p_gain", "d_gain", "band", "count", "period"),
    *("filter", "on_motor", "cogging", "cogging_turns", "cogging_phase", "cable", "cable_at"),
    *("shake", "shake_hz"),
)
"""Names of the numbers, in order; SI, referred to the joint."""
STEP_S = 2e-5


@njit(cache=True)
def bristles(z, speed, dry, excess, stribeck, stiffness, dt):
    """Bend of LuGre's bristles after a step, implicit in it, and the torque."""
    level = dry * (1.0 + excess * np.exp(-((speed / stribeck) ** 2))) + 1e-12
    new = (z + dt * speed) / (1.0 + dt * stiffness * abs(speed) / level)
    return new, stiffness * new + 0.3 * np.sqrt(stiffness * 1e-3 * level) * (new - z) / dt


@njit(cache=True)
def run(p, goal, record, start):
    """Angles of motor and link at the times of the goals, which stand `record` s apart."""
    rotor, link, outer, belt, belt_damping, half, stiffness, hardening = p[:8]
    damping, dry, excess, stribeck, bristle, viscous, link_dry, link_viscous = p[8:16]
    load, stall, braking, voltage, sag, p_gain, d_gain, band, count, period = p[16:26]
    smooth, on_motor, cogging, turns, phase, cable, cable_at, shake, shake_hz = p[26:35]
    steps = int(np.ceil(record / STEP_S))
    dt = record / steps
    out = np.empty((2, len(goal)))
    a, b = goal[0], goal[0] + start * half
    c, va, vb, vc, za, zb, left, volts = b, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    before, slope, last, now = b, 0.0, goal[0], 0.0
    drawn = 0.0
    for i in range(len(goal)):
        out[0, i], out[1, i] = a, b
        for _ in range(steps):
            now += dt
            left -= dt
            if left < 0.5 * dt:
                left += period
                read = a if on_motor > 0.5 else b
                if count > 0.0:
                    read = np.round(read / count) * count
                slope += (period / (period + smooth)) * ((read - before) / period - slope)
                before = read
                error = goal[i] - read
                push = p_gain * np.sign(error) * max(abs(error) - band, 0.0)
                push += d_gain * ((goal[i] - last) / period - slope)
                last = goal[i]
                most = voltage - sag * abs(drawn)
                volts = min(max(push * most / voltage, -most), most)
            drawn = (volts * stall - braking * va) / (stall * voltage)
            twist, rate = a - b, va - vb
            over = abs(twist) - half
            torque = 0.0
            if over > 0.0:
                size = stiffness * over * (1.0 + hardening * over * stiffness / (stall * voltage))
                torque = np.sign(twist) * max(size + np.sign(twist) * damping * rate, 0.0)
            za, rub = bristles(za, va, dry, excess, stribeck, bristle, dt)
            zb, rub_link = bristles(zb, vb, link_dry, excess, stribeck, bristle, dt)
            between = belt * (b - c) + belt_damping * (vb - vc)
            drag = cable * (b - cable_at) + load + shake * np.sin(2.0 * np.pi * shake_hz * now)
            cog = cogging * np.sin(turns * a + phase)
            va += dt / rotor * (stall * volts - (braking + viscous) * va - torque - rub - cog)
            vb += dt / link * (torque - between - rub_link - link_viscous * vb - drag)
            vc += dt / outer * between
            a, b, c = a + dt * va, b + dt * vb, c + dt * vc
    return out
