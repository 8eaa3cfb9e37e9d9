"""Play of a joint whose encoder is on the motor, by a model of the joint fitted at each play.

While the teeth are parted the motor is rid of the link's friction and inertia, and its lag behind
the goal shows it. A `ServoJoint` of which the frictions, elasticity, inertias, loop and the goal's
limit of acceleration are unknown is fitted to the logged positions at each of several plays; the
interval has the plays of which the best sum of squares is near the least one (profile likelihood).
How near counts residuals that hang together as one, and allows for a joint that is not as modelled.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.progress import ProgressBar
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint, limit
from jointplay.estimate.wiggle import (
    LARGEST,
    Known,
    ServoLog,
    Untold,
    begin_of,
    on_grid,
    wiggle_goal,
)

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

PLAYS = np.append(np.radians([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25]), LARGEST)
"""At which the model is fitted first [rad]."""
UNKNOWNS = {
    "wind-up": (np.log(0.012), 1.2),
    "damping": (np.log(0.15), 0.8),
    "friction": (np.log(0.02), 1.0),
    "link's friction": (np.log(0.01), 1.3),
    "excess": (0.3, 0.3),
    "Stribeck's speed": (np.log(0.1), 1.0),
    "viscous": (0.2, 0.2),
    "load": (0.0, 0.012),
    "rotor": (0.0, 0.12),
    "link": (0.0, 0.17),
    "gain": (0.0, 0.05),
    "delay": (0.004, 0.006),
    "acceleration": (np.log(60.0), 1.5),
}
"""Usual value and deviation of what is fitted: logarithms of torques by the torque at stall, of the
teeth's wind-up at stall [rad], the damping's ratio, a speed [rad/s], factors on what is known and
the goals' largest acceleration [rad/s^2]; plain are the static excess, viscous friction by the
motor's braking, load by stall beyond what is known, and how late goals arrive [s]."""
NOISE = 1e-3
"""Of a position [rad], by which residuals and deviations from what is usual are weighed."""
STARTS = [(play, limit) for play in np.radians([0.2, 0.9]) for limit in (25.0, 400.0)]
"""Plays [rad] and accelerations [rad/s^2] from which fits begin."""
ENOUGH = 1e-3
"""Relative change of the sum of squares at which a fit ends; intervals end at changes of a third
and more."""
NEAR = 40.0
"""Chi square, by independent residuals, up to which a play is in the interval."""
UNFIT = 0.07
"""Residuals by the lag (RMS) up to which a fit counts."""
_USUAL, _DEVIATION = (np.array(one) for one in zip(*UNKNOWNS.values(), strict=True))
_AT = {name: k for k, name in enumerate(UNKNOWNS)}
_LEAST, _MOST = (_USUAL + side * _DEVIATION for side in (-4.0, 4.0))
_LEAST[[_AT["excess"], _AT["viscous"]]] = 0.0


class Profile:
    """Fits to one log over play."""

    def __init__(self, log: ServoLog, known: Known) -> None:
        self.log, self.known = log, known
        self._now = np.arange(log.time[0], log.time[-1] + RECORD_S, RECORD_S)
        self._since, self._wiggle = self._now - begin_of(log, "motor"), wiggle_goal("motor")
        known_of = known.servo, known.rotor_inertia, known.link_inertia
        even = ServoJoint.of(*known_of, play=0.0, stiffness=1.0, load=known.load)
        self._usual = replace(even, resolution=0.0)
        self.fits: dict[float, OptimizeResult] = {}

    def joint(self, play: float, x: np.ndarray) -> ServoJoint:
        """The model with what is fitted."""
        usual, at = self._usual, dict(zip(UNKNOWNS, x, strict=True))
        by = dict(zip(UNKNOWNS, np.exp(x), strict=True))
        most = usual.stall * usual.voltage
        rotor, link = usual.rotor_inertia * by["rotor"], usual.link_inertia * by["link"]
        stiffness, reduced = most / by["wind-up"], rotor * link / (rotor + link)
        return replace(
            usual, rotor_inertia=rotor, link_inertia=link, play=play, stiffness=stiffness,
            damping=2.0 * by["damping"] * np.sqrt(stiffness * reduced),
            friction=most * by["friction"], link_friction=most * by["link's friction"],
            excess=at["excess"], stribeck_speed=by["Stribeck's speed"],
            viscous=at["viscous"] * usual.braking, load=usual.load + most * at["load"],
            p_gain=usual.p_gain * by["gain"],
        )  # fmt: skip

    def residuals(self, play: float, x: np.ndarray) -> np.ndarray:
        """Of the logged positions [rad]."""
        goal = np.interp(self._since - x[_AT["delay"]], *self._wiggle)
        passed = np.empty_like(goal)
        limit(goal, float(np.exp(x[_AT["acceleration"]])), passed)
        motor, _ = self.joint(play, x).move(passed + self.log.goal[0])
        return self.log.position - np.interp(self.log.time, self._now, motor)

    def fit(self, play: float, x: np.ndarray, tries: int = 8) -> OptimizeResult:
        """Least squares of residuals and deviations from what is usual, from `x` on."""
        from scipy.optimize import least_squares

        def weighed(x: np.ndarray) -> np.ndarray:
            return np.append(self.residuals(play, x) / NOISE, (x - _USUAL) / _DEVIATION)

        return least_squares(
            weighed, x, bounds=(_LEAST, _MOST), x_scale=_DEVIATION, diff_step=1e-3, ftol=ENOUGH,
            max_nfev=tries,
        )  # fmt: skip

    def sweep(self, x: np.ndarray, plays: np.ndarray) -> np.ndarray:
        """Fit play after play, each from where the last one ended; the better fits are kept."""
        for play in map(float, plays):
            found, old = self.fit(play, x), self.fits.get(play)
            self.fits[play] = found if old is None or found.cost < old.cost else old
            x = self.fits[play].x
        return x

    def search(self) -> None:
        """Fit the joint at all plays, and at some about the best."""
        starts = []
        for play, acceleration in STARTS:
            x = _USUAL.copy()
            x[_AT["acceleration"]] = np.log(acceleration)
            starts.append(self.fit(play, x, 10))
        x = min(starts, key=lambda one: one.cost).x
        sweeps = PLAYS[::-1], PLAYS, PLAYS[::-1]
        for plays in ProgressBar(sweeps, f"fits to {self.log.joint}", delay=2.0, leave=False):
            x = self.sweep(x, plays)
        for _ in range(2):
            plays = sorted(self.fits)
            k = plays.index(self.best)
            for other in plays[max(k - 1, 0) : k + 2]:
                if other != self.best:
                    self.sweep(self.fits[self.best].x, np.array([0.5 * (other + plays[k])]))

    @property
    def best(self) -> float:
        """The play of the best fit [rad]."""
        return min(self.fits, key=lambda play: self.fits[play].cost)

    def chi_square(self) -> tuple[np.ndarray, np.ndarray]:
        """Plays [rad] that were fitted, in order, and how much worse each fits than the best."""
        plays = np.array(sorted(self.fits))
        cost = np.array([self.fits[play].cost for play in plays])
        count = len(self.log.time) / self.together
        return plays, count * (cost / cost.min() - 1.0)

    def ends(self) -> tuple[float, float]:
        """Ends of the play's interval [rad].

        Raises:
            Untold: the model fits at no play, a load leans on the link, or see `on_grid`.
        """
        sent, seen = on_grid(self.log, "motor")
        self.search()
        off = float(np.std(self.left) / np.std(sent - seen))
        if off > UNFIT:
            raise Untold(
                f"no joint of the model moves as this log does: {off:.0%} of its lag is left over"
            )
        found = self.joint(self.best, self.fits[self.best].x)
        if abs(found.load) > found.link_friction:
            raise Untold(
                f"a load of {abs(found.load):.2g} N m leans on the link, above its friction of "
                f"{found.link_friction:.2g} N m: the torque on its teeth does not reverse"
            )
        return ends_of(*self.chi_square())

    @property
    def left(self) -> np.ndarray:
        """Residuals of the best fit [rad]."""
        return self.residuals(self.best, self.fits[self.best].x)

    @property
    def together(self) -> float:
        """How many of its residuals hang together, by their autocorrelation until it ends."""
        left = self.left
        along = np.correlate(left, left, "full")[len(left) :] / np.sum(left**2)
        ends = np.flatnonzero(along < 0.05)
        return 1.0 + 2.0 * float(along[: ends[0] if len(ends) else None].sum())


def ends_of(plays: np.ndarray, worse: np.ndarray) -> tuple[float, float]:
    """Where chi square over play passes `NEAR`, on both sides of its least [rad]."""
    inside = np.flatnonzero(worse <= NEAR)
    first, last = int(inside[0]), int(inside[-1])
    low, high = float(plays[0]), float(plays[-1])
    if first > 0:
        low = float(np.interp(-NEAR, -worse[first - 1 : first + 1], plays[first - 1 : first + 1]))
    if last < len(plays) - 1:
        high = float(np.interp(NEAR, worse[last : last + 2], plays[last : last + 2]))
    return low, high
