"""A pendulum with clearance in its pin, and its equations written out for scipy.

The journal is the pin of an arm whose centre of mass is `ARM` away; it moves in a plane and has
three freedoms. Nothing here but the run itself is the package's.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from robots import FREE, body, joint, urdf
from scipy.integrate import solve_ivp

import jointplay as jp

MASS, INERTIA, ARM = 2.0, 1e-2, 0.1  # kg, kg m^2 about the centre of mass, m
GRAVITY = 9.81  # m/s^2, along +x
REST_SPEED = 0.05  # of docs/theory.md, section 5


@dataclass(frozen=True)
class Pendulum:
    """Contact of the pin: F = k delta^1.5 (1 + a ddelta/ddelta0), a = 3/4 (1 - c_e^2); eq. 21.

    ddelta0 is the largest rate of the contact, or that at which the smallest mass of the pin, over
    REST_SPEED squared, would have stored what the contact holds, if that is more.
    """

    stiffness: float = 1e10
    restitution: float = 0.9
    mu: float = 0.1
    v0: float = 1e-4
    v1: float = 1e-3
    gravity: float = GRAVITY
    play: float = 2e-4
    bore: float = 10e-3

    def mechanism(self) -> jp.Mechanism:
        bearing = jp.RevoluteClearance.planar(
            radial_clearance=self.play, bearing_radius=self.bore, stiffness=self.stiffness,
            restitution=self.restitution, friction=jp.contact.Ambrosio(self.mu, self.v0, self.v1),
        )  # fmt: skip
        path = urdf(body("arm", MASS, f"{ARM} 0 0", INERTIA), joint("pin", "base", "arm"))
        return jp.Mechanism(path, {"pin": bearing}, gravity=(self.gravity, 0, 0))

    def run(self, state, duration: float, step: float, integrator: str, **options) -> jp.Run:
        """A run from `state` (x, y, angle and their rates), ready to step."""
        simulation = jp.Simulation(
            self.mechanism(), duration=duration, step=step, integrator=integrator,
            **({"record_every": 10**9} | FREE | options),
        )  # fmt: skip
        run = jp.Run(simulation)
        run.workspace.q[:], run.workspace.v[:] = state[:3], state[3:]
        return run

    def slope(self, y: np.ndarray, approach: float) -> list[float]:
        """Right-hand side; `approach` is ddelta0 of this contact [m/s], 0 in free flight.

        Infinite stands for the present rate: it is still rising.
        """
        x, z, angle, vx, vz, turning = y
        c, s = math.cos(angle), math.sin(angle)
        fx = fz = moment = 0.0
        away = math.hypot(x, z)
        if approach > 0.0 and away > self.play:
            nx, nz = x / away, z / away  # outwards
            depth, rate = away - self.play, nx * vx + nz * vz
            across = 1.0 / (1.0 / MASS + ARM**2 / INERTIA)
            held = REST_SPEED * math.sqrt(0.8 * self.stiffness * depth**2.5 / across)
            ratio = rate / max(abs(rate) if math.isinf(approach) else approach, held)
            slip = nx * vz - nz * vx + turning * (self.bore - self.play)
            a = 0.75 * (1.0 - self.restitution**2)
            normal = self.stiffness * depth**1.5 * (1.0 + a * ratio)
            ramp = min(max((abs(slip) - self.v0) / (self.v1 - self.v0), 0.0), 1.0)
            rub = -self.mu * ramp * normal * math.copysign(1.0, slip)
            fx, fz = -normal * nx - rub * nz, -normal * nz + rub * nx
            moment = rub * (self.bore - self.play)
        # About the centre of mass, which is ARM (c, s) from the journal's.
        spin = (moment - ARM * (c * fz - s * fx)) / INERTIA
        ax = fx / MASS + self.gravity + ARM * (s * spin + c * turning**2)
        az = fz / MASS - ARM * (c * spin - s * turning**2)
        return [vx, vz, turning, ax, az, spin]

    def rise(self, y: np.ndarray, approach: float) -> float:
        """Rate of change of |ddelta| [m/s^2]."""
        away = math.hypot(y[0], y[1])
        rate = (y[0] * y[3] + y[1] * y[4]) / away
        a = self.slope(y, approach)
        bend = (y[0] * a[3] + y[1] * a[4] + y[3] ** 2 + y[4] ** 2 - rate**2) / away
        return math.copysign(1.0, rate) * bend

    def solve(
        self, state, duration: float, method: str, tolerance: float, times=None, approach=0.0
    ) -> Solution:
        """Integrate by scipy; touches, and ends of a rise of ddelta0, are located as events.

        `approach` is ddelta0 if the journal is in contact at the start [m/s].
        """
        y, now, calls, impacts = np.array(state, float), 0.0, 0, 0
        wanted = np.array([duration]) if times is None else np.asarray(times)
        found = np.full((len(wanted), 6), np.nan)
        begun = time.process_time()
        while now < duration:
            inside = approach

            def slope(_, y, inside=inside):
                return self.slope(y, inside)

            def touch(_, y):
                return math.hypot(y[0], y[1]) - self.play

            def risen(_, y, inside=inside):
                return self.rise(y, inside)

            def exceeds(_, y, inside=inside):
                return abs(y[0] * y[3] + y[1] * y[4]) / math.hypot(y[0], y[1]) - inside

            touch.direction = -1.0 if inside else 1.0
            risen.direction, exceeds.direction = -1.0, 1.0
            events = [touch] + ([risen if math.isinf(inside) else exceeds] if inside else [])
            for event in events:
                event.terminal = True
            with np.errstate(over="ignore", invalid="ignore"):  # of steps tried and rejected
                part = solve_ivp(
                    slope, (now, duration), y, method=method, rtol=tolerance, events=events,
                    atol=tolerance * np.array([1e-4, 1e-4, 1.0, 1.0, 1.0, 10.0]), dense_output=True,
                )  # fmt: skip
            calls += part.nfev
            here = (wanted >= now) & (wanted <= part.t[-1])
            if here.any():
                found[here] = part.sol(wanted[here]).T
            y, now = part.y[:, -1], part.t[-1]
            if part.status != 1:
                break
            rate = float(y[:2] @ y[3:5]) / math.hypot(y[0], y[1])
            if len(part.t_events[0]):
                # The next touch must not be this one again.
                y[:2] *= (self.play * (1.0 + math.copysign(1e-13, rate))) / math.hypot(y[0], y[1])
                approach = rate if rate > 0.0 else 0.0
                if approach and self.rise(y, math.inf) > 0.0:
                    approach = math.inf
                impacts += rate > 0.0
            else:
                approach = abs(rate) if math.isinf(inside) else math.inf
        return Solution(found, calls, impacts, time.process_time() - begun)


@dataclass(frozen=True)
class Solution:
    states: np.ndarray
    """(times, 6)."""
    calls: int
    """Evaluations of the right-hand side."""
    impacts: int
    cpu: float
    """[s]"""


def resting(pendulum: Pendulum, angle: float = 0.0) -> np.ndarray:
    """Journal on its bore under the weight of the arm at `angle`, at rest."""
    depth = (MASS * pendulum.gravity / pendulum.stiffness) ** (2 / 3)
    return np.array([pendulum.play + depth, 0.0, angle, 0.0, 0.0, 0.0])
