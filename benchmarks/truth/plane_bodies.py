"""Plane linkages in absolute coordinates, apart from the package: the reference of `linkages`.

Each body has three coordinates: where the drawing's origin has moved with it (a complex number) and
its angle. Pins, slides and drives are constraints between bodies: Newton's method finds places, one
linear system accelerations and Lagrange's multipliers, which are forces of pins and moments of
drives. No tree, no loops, nothing of the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY, STEEL = 9.81, 7800.0
"""[m/s^2], [kg/m^3]."""
MAX_STEP_S = 2e-5
"""So that no impact is stepped over: the shortest last ten times as long [s]."""
LOOK_AHEAD_S = 1e-5
"""Of the central difference of constraints along the motion [s]: its error is 1e-8 at 20 rad/s."""


@dataclass(frozen=True)
class Body:
    """Mass [kg], centre in the drawing [m], moment of inertia about it [kg m^2]."""

    mass: float
    centre: complex
    inertia: float

    @classmethod
    def of_lines(cls, mass: float, points: Sequence[complex]) -> Body:
        """Round steel rods from point to point, closed of three or more; a cube at a single one."""
        if len(points) == 1:
            return cls(mass, points[0], mass * (mass / STEEL) ** (2 / 3) / 6)
        lines = list(pairwise([*points, *points[: len(points) > 2]]))
        lengths = np.array([abs(end - start) for start, end in lines])
        middles = np.array([(start + end) / 2 for start, end in lines])
        parts = mass * lengths / lengths.sum()
        centre = complex(parts @ middles / mass)
        thick = mass / (STEEL * lengths.sum()) / np.pi
        own = lengths**2 / 12 + thick / 4 + np.abs(middles - centre) ** 2
        return cls(mass, centre, float(parts @ own))


@dataclass
class Plane:
    """A plane linkage; `pins` have two bodies and a place, `slides` a direction besides.

    Body None is the ground. `drives` name pins or slides that move as told.
    """

    bodies: Mapping[str, Body]
    pins: Mapping[str, tuple[str | None, str, complex]]
    slides: Mapping[str, tuple[str | None, str, complex, complex]] = field(default_factory=dict)
    drives: Sequence[str] = ()
    cut: str = ""
    """A pin that does not hold: contact acts there."""

    def __post_init__(self) -> None:
        self.at = {name: 3 * k for k, name in enumerate(self.bodies)}
        self.rows: dict[str, int] = {}
        for name in [*self.pins, *self.slides]:
            if name != self.cut:
                self.rows[name] = 2 * len(self.rows)
        self.first_drive = 2 * len(self.rows)
        self.matrix = np.zeros((3 * len(self.bodies),) * 2)

    def frame(self, q: np.ndarray, body: str | None) -> tuple[complex, float]:
        if body is None:
            return 0j, 0.0
        x, y, angle = q[self.at[body] : self.at[body] + 3]
        return complex(x, y), float(angle)

    def place(self, q: np.ndarray, body: str | None, point: complex) -> complex:
        shift, angle = self.frame(q, body)
        return shift + np.exp(1j * angle) * point

    def velocity(self, q: np.ndarray, v: np.ndarray, body: str | None, point: complex) -> complex:
        if body is None:
            return 0j
        shift, rate = self.frame(v, body)
        return shift + 1j * rate * np.exp(1j * self.frame(q, body)[1]) * point

    def _column(self, body: str | None, q: np.ndarray, point: complex) -> np.ndarray:
        """How the coordinates of its body move a point, complex."""
        column = np.zeros(len(q), complex)
        if body is not None:
            at = self.at[body]
            column[at : at + 3] = 1, 1j, 1j * np.exp(1j * self.frame(q, body)[1]) * point
        return column

    def _turn(self, bearing: str | None, journal: str, size: int) -> np.ndarray:
        row = np.zeros(size)
        for body, sign in ((journal, 1.0), (bearing, -1.0)):
            if body is not None:
                row[self.at[body] + 2] = sign
        return row

    def gaps(
        self, q: np.ndarray, driven: Sequence[float], aside: Mapping[str, complex]
    ) -> np.ndarray:
        """What constraints lack; journals of the pins in `aside` are off by these vectors [m]."""
        found = []
        for name, (bearing, journal, point) in self.pins.items():
            if name != self.cut:
                gap = self.place(q, journal, point) - self.place(q, bearing, point)
                gap -= aside.get(name, 0j)
                found += [gap.real, gap.imag]
        for bearing, journal, point, along in self.slides.values():
            turned = self.frame(q, bearing)[1]
            gap = self.place(q, journal, point) - self.place(q, bearing, point)
            across = (gap * np.conj(along * np.exp(1j * turned))).imag
            found += [self.frame(q, journal)[1] - turned, across]
        for name, value in zip(self.drives, driven, strict=True):
            bearing, journal, *rest = self.pins.get(name) or self.slides[name]
            if name in self.pins:
                found.append(self.frame(q, journal)[1] - self.frame(q, bearing)[1] - value)
            else:
                gap = self.place(q, journal, rest[0]) - self.place(q, bearing, rest[0])
                way = rest[1] * np.exp(1j * self.frame(q, bearing)[1])
                found.append((gap * np.conj(way)).real - value)
        return np.array(found)

    def slopes(self, q: np.ndarray) -> np.ndarray:
        """The constraints' Jacobian."""
        rows = []
        for name, (bearing, journal, point) in self.pins.items():
            if name != self.cut:
                row = self._column(journal, q, point) - self._column(bearing, q, point)
                rows += [row.real, row.imag]

        def sliding(name: str) -> np.ndarray:
            bearing, journal, point, along = self.slides[name]
            way = along * np.exp(1j * self.frame(q, bearing)[1])
            gap = self.place(q, journal, point) - self.place(q, bearing, point)
            row = self._column(journal, q, point) - self._column(bearing, q, point)
            row = row * np.conj(way)
            if bearing is not None:
                row[self.at[bearing] + 2] -= 1j * gap * np.conj(way)
            return row

        for name, (bearing, journal, *_) in self.slides.items():
            rows += [self._turn(bearing, journal, len(q)), sliding(name).imag]
        for name in self.drives:
            if name in self.pins:
                rows.append(self._turn(*self.pins[name][:2], len(q)))
            else:
                rows.append(sliding(name).real)
        return np.array(rows)

    def closed(
        self, q: np.ndarray, driven: Sequence[float], aside: Mapping[str, complex] | None = None
    ) -> np.ndarray:
        """The position near q where all constraints hold."""
        for _ in range(30):
            gap = self.gaps(q, driven, aside or {})
            if np.abs(gap).max() < 1e-13:
                break
            q = q - np.linalg.solve(self.slopes(q), gap)
        assert np.abs(gap).max() < 1e-11, "the reference did not close"
        return q

    def speeds(self, q: np.ndarray, driven: Sequence[float]) -> np.ndarray:
        wanted = np.zeros(len(q))
        wanted[self.first_drive :] = driven
        return np.linalg.solve(self.slopes(q), wanted)

    def balance(
        self, q: np.ndarray, v: np.ndarray, pushes: Sequence[tuple[str, complex, complex]] = ()
    ) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations, and forces of constraints (on the journals), drives at constant speed.

        Args:
            pushes: body, point of its drawing and force [N] each.
        """
        n, mass, effort = len(q), np.zeros((len(q),) * 2), np.zeros(len(q))
        for name, body in self.bodies.items():
            at = self.at[name]
            column = self._column(name, q, body.centre)
            rate = v[at + 2]
            mass += body.mass * np.real(np.outer(np.conj(column), column))
            mass[at + 2, at + 2] += body.inertia
            pull = -(rate**2) * np.exp(1j * q[at + 2]) * body.centre
            effort += np.real(np.conj(column) * body.mass * (-1j * GRAVITY - pull))
        for name, point, force in pushes:
            effort += np.real(np.conj(self._column(name, q, point)) * force)
        slopes, h = self.slopes(q), LOOK_AHEAD_S
        change = (self.slopes(q + h * v) - self.slopes(q - h * v)) @ v / (2 * h)
        m = len(slopes)
        system = np.block([[mass, slopes.T], [slopes, np.zeros((m, m))]])
        found = np.linalg.solve(system, np.concatenate([effort, -change]))
        return found[:n], -found[n:]

    def force(self, forces: np.ndarray, pin: str) -> complex:
        """On the journal of a pin [N]."""
        return complex(*forces[self.rows[pin] : self.rows[pin] + 2])

    def runs(
        self,
        q: np.ndarray,
        v: np.ndarray,
        times: np.ndarray,
        contact: Callable[[complex], complex] | None = None,
    ) -> np.ndarray:
        """States (n, 2 nq) at times; `contact` gives the force on the cut pin's journal [N] by its
        place in the bearing [m]."""
        size = len(q)

        def pushes(q: np.ndarray) -> list[tuple[str, complex, complex]]:
            if contact is None:
                return []
            bearing, journal, point = self.pins[self.cut]
            assert bearing is not None
            centre = self.place(q, journal, point)
            force = contact(centre - self.place(q, bearing, point))
            shift, angle = self.frame(q, bearing)  # the force goes through both centres
            return [
                (journal, point, force),
                (bearing, (centre - shift) * np.exp(-1j * angle), -force),
            ]

        def rates(_: float, state: np.ndarray) -> np.ndarray:
            q, v = state[:size], state[size:]
            return np.concatenate([v, self.balance(q, v, pushes(q))[0]])

        solved = solve_ivp(
            rates, (times[0], times[-1]), np.concatenate([q, v]), "DOP853", times,
            rtol=1e-10, atol=1e-12, max_step=MAX_STEP_S,
        )  # fmt: skip
        return np.array(solved.y.T)
