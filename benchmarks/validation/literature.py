"""Literature: the slider-crank with clearance in the piston pin, and one with it in the guide.

P. Flores, J. Ambrosio, J. C. P. Claro, H. M. Lankarani, Kinematics and Dynamics of Multibody
Systems with Imperfect Joints, Springer, 2008 (masses and lengths: urdf/slider_crank.urdf).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from common import COLOURS, new_figure, spread

import jointplay as jp
from validation import Outcome, case
from validation.mechanisms import body, joint, urdf

CRANK, ROD = 0.05, 0.12
"""Lengths [m]."""
ROD_MASS, SLIDER_MASS = 0.21, 0.14
"""[kg]."""
ROD_INERTIA = 2.5e-4
"""About its centre, at mid-length [kg m^2]."""
SPEED = 5000 * 2 * np.pi / 60
"""Of the crank [rad/s]."""
TURN = 2 * np.pi / SPEED
"""[s]."""
BORE = 10e-3
"""Radius [m]."""
MODULUS, POISSON, RESTITUTION = 207e9, 0.3, 0.9
CLEARANCES = (0.05e-3, 0.1e-3, 0.2e-3, 0.5e-3)
"""Radial [m]."""
FRICTION = (0.01, 1e-3, 1e-2)
"""Ambrosio's coefficient and ramp [m/s]; chosen here, as in urdf/slider_crank.toml."""
TRANSIENT = 5
"""Turns that are not looked at."""

BOOK = "Flores, Ambrosio, Claro, Lankarani (2008)"
CLASSIC = (
    "P. Flores, J. Ambrosio, J. C. P. Claro, H. M. Lankarani, Kinematics and Dynamics of Multibody "
    "Systems with Imperfect Joints, Springer, 2008"
)


# The mechanism, by hand


@dataclass(frozen=True)
class Ideal:
    """The ideal slider-crank at constant speed, by hand: vector loop and virtual power.

    Loop: CRANK e^(i angle) + ROD e^(i rod) = position. The rod's angle follows from the
    imaginary part, its rates from the derivatives. The crank's moment has the power by which the
    kinetic energy of rod and slider changes; the crank's own does not.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    moment: np.ndarray

    @classmethod
    def at(cls, angle: np.ndarray, rod_inertia: float = ROD_INERTIA) -> Ideal:
        ratio, w = CRANK / ROD, SPEED
        sin, cos = np.sin(angle), np.cos(angle)
        rod = -np.arcsin(ratio * sin)
        rate = -ratio * w * cos / np.cos(rod)
        change = (ratio * w**2 * sin + rate**2 * np.sin(rod)) / np.cos(rod)
        unit, pin = np.exp(1j * rod), CRANK * np.exp(1j * angle)
        end = (
            1j * w * pin + 1j * rate * ROD * unit,
            (-(w**2) * pin + (1j * change - rate**2) * ROD * unit),
        )
        middle = (
            1j * w * pin + 0.5j * rate * ROD * unit,
            (-(w**2) * pin + 0.5 * (1j * change - rate**2) * ROD * unit),
        )
        power = (
            SLIDER_MASS * end[0].real * end[1].real
            + ROD_MASS * (middle[0] * middle[1].conj()).real
            + rod_inertia * rate * change
        )
        return cls((pin + ROD * unit).real, end[0].real, end[1].real, power / w)


def _by_hand(clearance: float, duration: float, step: float) -> np.ndarray:
    """The slider-crank with clearance, integrated here: velocity, acceleration, moment by step.

    Two coordinates, the rod's angle and the slider's position; Newton for the slider, Euler for
    the rod about the crank's pin; Hertz's stiffness with the damping of H. M. Lankarani and P. E.
    Nikravesh (1990), J. Ambrosio's friction; classical Runge-Kutta in plain numbers.
    """
    journal = BORE - clearance
    compliance = (1 - POISSON**2) / MODULUS
    stiffness = 4 / (3 * 2 * compliance) * math.sqrt(BORE * journal / clearance)
    damping = 0.75 * (1 - RESTITUTION**2)
    about_pin = ROD_INERTIA + ROD_MASS * ROD**2 / 4
    mu, v0, v1 = FRICTION

    def rates(time, state, fastest):
        rod, x, turning, v = state
        pin = CRANK * np.exp(1j * SPEED * time).item()
        along = complex(math.cos(rod), math.sin(rod))
        offset = x - pin - ROD * along
        drift = v - 1j * SPEED * pin - 1j * turning * ROD * along
        size = abs(offset)
        depth, sinking, force, arm = size - clearance, 0.0, 0j, 0j
        if depth > 0.0:
            n = offset / size
            sinking = (drift * n.conjugate()).real
            arm = offset + journal * n  # from the bore's centre to the point of contact
            sliding = ((drift - 1j * turning * arm) * n.conjugate()).imag
            grip = mu * min(max((abs(sliding) - v0) / (v1 - v0), 0.0), 1.0)
            press = stiffness * depth**1.5 * (
                1 + damping * sinking / max(fastest, abs(sinking), 1e-9)
            )  # fmt: skip
            force = -press * n * (1 + 1j * math.copysign(grip, sliding))  # on the slider
        lever = ROD * along + arm
        moment = -(lever.conjugate() * force).imag
        pull = -(SPEED**2) * pin
        change = (moment - ROD_MASS * ROD / 2 * (along.conjugate() * pull).imag) / about_pin
        middle = pull + (1j * change - turning**2) * ROD / 2 * along
        on_rod = ROD_MASS * middle + force
        crank = (pin.conjugate() * on_rod).imag
        found = np.array([turning, v, change, force.real / SLIDER_MASS])
        return found, (sinking if depth > 0.0 else None), crank

    state = np.array([0.0, CRANK + ROD, -CRANK / ROD * SPEED, 0.0])
    fastest, kept = 0.0, []
    for n in range(round(duration / step) + 1):
        time = n * step
        first, sinking, crank = rates(time, state, fastest)
        fastest = 0.0 if sinking is None else max(fastest, abs(sinking))
        kept.append((state[3], first[3], crank))
        second = rates(time + step / 2, state + step / 2 * first, fastest)[0]
        third = rates(time + step / 2, state + step / 2 * second, fastest)[0]
        fourth = rates(time + step, state + step * third, fastest)[0]
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    return np.array(kept)


# The mechanism, as the package runs it


def _prepare(turns: float, bearing: jp.ClearanceJoint | None, **options) -> jp.simulation.Run:
    """From the outer dead centre, rod and crank stretched, journal centred."""
    robot = jp.Mechanism(
        jp.shipped("slider_crank.urdf"),
        {} if bearing is None else {"piston_pin": bearing},
        loops={"piston_pin": jp.Loop("rod", "slider", bearing_xyz=(ROD, 0, 0))},
        gravity=(0, 0, 0),
        tool="slider",
    )
    motion = jp.Motion(
        ["crank_pin"], [0, turns * TURN], [[0], [turns * 2 * np.pi]], "constant-speed"
    )
    return jp.Simulation(
        robot, motion, drive={"crank_pin": jp.Prescribed()}, joint_friction={},
        start={"guide": CRANK + ROD}, **options,
    ).prepare()  # fmt: skip


def _bearing(clearance: float, **changes) -> jp.ClearanceJoint:
    return jp.ClearanceJoint.planar(
        radial_clearance=clearance, bearing_radius=BORE,
        **{
            "bearing_length": 20e-3, "restitution": RESTITUTION, "friction": jp.Ambrosio(*FRICTION)
        } | changes,
    )  # fmt: skip


@dataclass(frozen=True)
class Turns:
    """The turns of a run that are looked at; arrays by record."""

    angle: np.ndarray
    """Crank angle since the first of them [rad]."""
    velocity: np.ndarray
    acceleration: np.ndarray
    moment: np.ndarray
    """Slider [m/s, m/s^2], crank [N m]."""
    journal: np.ndarray
    """Journal's centre in bearing axes, shape (records, 2) [m]."""
    pressed: np.ndarray
    """Whether a dry contact force acts."""
    largest_force: float
    """In the pin, between records too [N]."""
    thinnest: float
    """Smallest gap [m]."""
    per_turn: int
    """Records in a turn."""

    @functools.cached_property
    def ideal(self) -> Ideal:
        return Ideal.at(self.angle)

    @property
    def turns(self) -> float:
        return (len(self.angle) - 1) / self.per_turn

    def figures(self) -> dict[str, float]:
        """What the literature speaks of, in numbers."""
        ideal = self.ideal

        def off(name):
            exact = getattr(ideal, name)
            error, peak = getattr(self, name) - exact, np.abs(exact).max()
            return np.sqrt(np.mean(error**2)) / peak, np.abs(getattr(self, name)).max() / peak

        begins = np.count_nonzero(self.pressed[1:] & ~self.pressed[:-1])
        velocity, acceleration, moment = map(off, ("velocity", "acceleration", "moment"))
        once = slice(self.per_turn // 4, None, self.per_turn)  # at 90 degrees
        return {
            "velocity_off": velocity[0],
            "velocity_peak": velocity[1],
            "acceleration_off": acceleration[0],
            "acceleration_peak": acceleration[1],
            "moment_off": moment[0],
            "moment_peak": moment[1],
            "force_kN": 1e-3 * self.largest_force,
            "contact": 100 * np.mean(self.pressed),
            "impacts": begins / self.turns,
            "scatter": np.std(self.acceleration[once]) / np.abs(ideal.acceleration).max(),
            "thinnest_um": 1e6 * self.thinnest,
        }


RECORD = 4e-6
"""Interval of the records, a whole part of a turn [s]."""


@functools.lru_cache(maxsize=256)
def _turning(
    clearance: float,
    seed: int,
    turns: int,
    transient: int,
    step: float,
    friction: float = FRICTION[0],
    restitution: float = RESTITUTION,
    viscosity: float = 0.0,
) -> Turns:
    """Run; the journal begins displaced at random by up to half its clearance along x and y.

    The dead centre does not assemble with a displaced journal held there: rod and slider are
    displaced here, after assembly.
    """
    oil = {"lubricant": jp.ShortBearing(viscosity), "bearing_length": 10e-3} if viscosity else {}
    bearing = _bearing(
        clearance, friction=jp.Ambrosio(friction, *FRICTION[1:]), restitution=restitution, **oil
    )
    run = _prepare(
        turns + transient, bearing, step=step, record_every=round(RECORD / step)
    )  # fmt: skip
    shift = 0.5 * clearance * np.random.default_rng(seed).uniform(-1, 1, 2)
    run.workspace.q[1] -= shift[1] / ROD
    run.workspace.q[2] += shift[0]
    result = run.execute()
    per_turn = round(TURN / RECORD)
    at = slice(transient * per_turn, (transient + turns) * per_turn + 1)
    force = result["joint_force"].values[at, 0, 0]
    return Turns(
        SPEED * (result.time[at] - result.time[at.start]),
        result["tool_velocity"].values[at, 0],
        force / SLIDER_MASS,
        result["drive"].values[at, 0],
        result["journal_centre"].values[at, 0, :2],
        result["normal_force"].values[at, 0, 0] > 0.0,
        float(np.linalg.norm(result["joint_force_peak"].values[at, 0], axis=1).max()),
        float(result["gap_min"].values[at, 0, 0].min()),
        per_turn,
    )


def _runs(quick: bool, clearance: float, **changes: float) -> list[Turns]:
    """The runs of an ensemble."""
    size = {"turns": 4, "transient": 2, "step": 2e-6} if quick else {
        "turns": 20, "transient": TRANSIENT, "step": 1e-6
    }  # fmt: skip
    return [_turning(clearance, seed, **size, **changes) for seed in range(2 if quick else 8)]


def _ensemble(quick: bool, clearance: float, **changes: float) -> dict[str, np.ndarray]:
    """The figures of each run."""
    found = [run.figures() for run in _runs(quick, clearance, **changes)]
    return {name: np.array([one[name] for one in found]) for name in found[0]}


def _size(clearance: float) -> str:
    return f"{1e3 * clearance:g} mm"


@case(
    title="Ideal slider-crank",
    compared="Slider position, velocity, acceleration and crank moment of the ideal slider-crank "
    "at 5000 rpm over a turn against closed forms: vector loop, virtual power (crank 50 mm, rod "
    f"120 mm, masses as in {CLASSIC}). rk4, step 2 µs; the acceleration is the slope of the "
    "recorded velocity.",
    measures="largest error of any curve, relative to the curve's peak",
    wrong="the sign of the rod's moment of inertia in the crank moment",
)
def ideal_slider_crank(quick: bool = False, wrong: bool = False) -> Outcome:
    result = _prepare(1, None, integrator="rk4", step=2e-6, record_every=1).execute()
    exact = Ideal.at(SPEED * result.time, -ROD_INERTIA if wrong else ROD_INERTIA)
    velocity = result["tool_velocity"].values[:, 0]
    curves = {
        "slider position [mm]": (1e3, result["tool_position"].values[:, 0], exact.position),
        "slider velocity [m/s]": (1.0, velocity, exact.velocity),
        "slider acceleration [km/s²]": (
            1e-3, np.gradient(velocity, result.time, edge_order=2), exact.acceleration
        ),
        "crank moment [N m]": (1.0, result["drive"].values[:, 0], exact.moment),
    }  # fmt: skip
    figure, axes = new_figure(2, 2, 8.0, 4.8, sharex=True)
    rows, errors = [["curve", "peak", "largest error / peak"]], []
    angle = np.degrees(SPEED * result.time)
    for panel, (name, (scale, found, by_hand)) in zip(axes.flat, curves.items(), strict=True):
        peak = np.abs(by_hand).max()
        errors.append(float(np.abs(found - by_hand).max() / peak))
        rows.append([name, f"{scale * peak:.4g}", f"{errors[-1]:.1e}"])
        panel.plot(angle, scale * found, color=COLOURS[5], lw=4, label="jointplay")
        panel.plot(angle, scale * by_hand, "k--", lw=1, label="closed form")
        panel.set(ylabel=name, xticks=range(0, 361, 90), xlim=(0, 360))
    for panel in axes[-1]:
        panel.set_xlabel("crank angle [°]")
    axes[0, 0].legend()
    return Outcome(max(errors), 1e-4, rows, figure)


@case(
    title="Slider-crank with clearance: curves",
    compared="Slider velocity, slider acceleration and crank moment with clearance in the piston "
    "pin against an independent integration of the same mechanism written out in the case (two "
    "coordinates, Newton-Euler by hand, Hertz with Lankarani-Nikravesh damping, Ambrosio's "
    "friction, own Runge-Kutta), from the same start over the first third of a turn, before "
    "impacts have magnified rounding. Table and figure: turns after the transient, as the "
    f"literature draws them ({CLASSIC}).",
    measures="largest RMS difference of any curve at any clearance, relative to the ideal peak",
    wrong="half the clearance in the integration by hand",
)
def clearance_curves(quick: bool = False, wrong: bool = False) -> Outcome:
    step, part = (1e-6, 1 / 6) if quick else (0.5e-6, 1 / 3)
    peaks = Ideal.at(np.linspace(0, 2 * np.pi, 3601))
    scales = [
        np.abs(curve).max() for curve in (peaks.velocity, peaks.acceleration, peaks.moment)
    ]  # fmt: skip
    errors, rows = [], [[
        "radial clearance", "difference to hand", "velocity off, RMS/peak [%]",
        "acceleration off, RMS/peak [%]", "peak acceleration / ideal", "peak moment / ideal",
        "peak pin force [kN]", "impacts a turn", "in contact [%]",
    ]]  # fmt: skip
    for clearance in CLEARANCES:
        result = _prepare(
            part, _bearing(clearance), integrator="rk4", step=step, record_every=1
        ).execute()  # fmt: skip
        found = np.column_stack(
            [
                result["tool_velocity"].values[:, 0],
                result["joint_force"].values[:, 0, 0] / SLIDER_MASS,
                result["drive"].values[:, 0],
            ]
        )
        by_hand = _by_hand(clearance / 2 if wrong else clearance, part * TURN, step)
        count = min(len(found), len(by_hand))
        apart = np.sqrt(np.mean((found[:count] - by_hand[:count]) ** 2, axis=0)) / scales
        errors.append(float(apart.max()))
        if quick:
            continue
        group = _ensemble(quick, clearance)
        rows.append(
            [
                _size(clearance),
                f"{errors[-1]:.1e}",
                *(
                    spread(group[name] * scale)
                    for name, scale in (
                        ("velocity_off", 100),
                        ("acceleration_off", 100),
                        ("acceleration_peak", 1),
                        ("moment_peak", 1),
                        ("force_kN", 1),
                        ("impacts", 1),
                        ("contact", 1),
                    )
                ),
            ]  # fmt: skip
        )
    if quick:
        return Outcome(max(errors), 1e-3)
    notes = (
        f"Mean ± standard deviation over 8 runs of 20 turns after {TRANSIENT}, the journal "
        "displaced at the start by up to half its clearance; friction 0.01, restitution 0.9, step "
        "1 µs. The figure shows the last turn of one run; scales differ from panel to panel.",
    )
    return Outcome(max(errors), 1e-3, rows, _draw_curves(), notes)


def _draw_curves():
    figure, axes = new_figure(3, len(CLEARANCES), 10.0, 6.6, sharex=True)
    quantities = (
        ("velocity", 1.0, "slider velocity [m/s]"),
        ("acceleration", 1e-3, "slider acceleration [km/s²]"),
        ("moment", 1e-3, "crank moment [kN m]"),
    )
    for column, clearance in zip(axes.T, CLEARANCES, strict=True):
        run = _runs(False, clearance)[0]
        last = slice(-run.per_turn - 1, None)
        angle = np.linspace(0, 360, run.per_turn + 1)
        for panel, (name, scale, label) in zip(column, quantities, strict=True):
            panel.plot(
                angle, scale * getattr(run, name)[last], color=COLOURS[0], lw=0.9,
                label="with clearance",
            )  # fmt: skip
            panel.plot(
                angle, scale * getattr(run.ideal, name)[last], color=COLOURS[4], lw=1.4, ls="--",
                label="ideal",
            )  # fmt: skip
            panel.set(xticks=(0, 90, 180, 270, 360), xlim=(0, 360))
            if clearance == CLEARANCES[0]:
                panel.set_ylabel(label)
        column[0].set_title(_size(clearance), fontsize=11)
        column[-1].set_xlabel("crank angle [°]")
    axes[0, 0].legend(fontsize=8, loc="upper left")
    return figure


@case(
    title="Slider-crank with clearance: journal orbits and Poincaré maps",
    compared="Path of the journal's centre in its bearing against the clearance circle (contact "
    "forces act outside of it and nowhere else), and against the vector loop closed by hand with "
    f"the recorded rod angle and slider position. Figure as in {CLASSIC}: path of the journal, and "
    "slider velocity over acceleration once a turn.",
    measures="largest violation of either, relative to the clearance",
    wrong="half the clearance for the circle",
)
def clearance_orbits(quick: bool = False, wrong: bool = False) -> Outcome:
    errors, maps = [], []
    rows = [[
        "radial clearance", "largest violation", "Poincaré map: spread of the velocity [m/s]",
        "of the acceleration [m/s²]", "points",
    ]]  # fmt: skip
    for clearance in CLEARANCES:
        run = _prepare(2, _bearing(clearance), step=2e-6, record_every=1)
        result = run.execute()
        journal = result["journal_centre"].values[:, 0, :2]
        away = np.hypot(*journal.T) / (clearance / 2 if wrong else clearance)
        pressed = result["normal_force"].values[:, 0, 0] > 0.0
        circle = max(np.max(1.0 - away[pressed]), np.max(away[~pressed] - 1.0))
        angle, rod, slider = result["q"].values.T
        rod = np.exp(1j * (angle + rod))
        loop = (slider - CRANK * np.exp(1j * angle) - ROD * rod) * rod.conj()
        miss = np.abs(loop - journal @ [1, 1j]).max() / clearance
        errors.append(max(float(circle), float(miss), 0.0))
        if quick:
            continue
        long = [_turning(clearance, seed, 100, 20, 1e-6) for seed in range(2)]
        once = [slice(one.per_turn // 4, None, one.per_turn) for one in long]
        maps.append(
            [
                np.concatenate([getattr(one, name)[at] for one, at in zip(long, once, strict=True)])
                for name in ("acceleration", "velocity")
            ]
        )
        rows.append(
            [_size(clearance), f"{errors[-1]:.1e}", f"{maps[-1][1].std():.2g}",
             f"{maps[-1][0].std():.2g}", str(len(maps[-1][0]))]
        )  # fmt: skip
    if quick:
        return Outcome(max(errors), 1e-9)
    notes = (
        "Paths: 20 turns of one run after the transient; Poincaré maps: crank at 90°, 100 turns "
        "after 20 of each of two runs, which are told apart by colour; the scales of the maps "
        "differ.",
    )
    return Outcome(max(errors), 1e-9, rows, _draw_orbits(maps), notes)


def _draw_orbits(maps):
    figure, axes = new_figure(2, len(CLEARANCES), 10.0, 5.4)
    round_ = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
    for column, clearance, (acceleration, velocity) in zip(axes.T, CLEARANCES, maps, strict=True):
        path, points = column
        centre = 1e3 * _runs(False, clearance)[0].journal
        path.plot(*centre.T, color=COLOURS[0], lw=0.35)
        circle = 1e3 * clearance * round_
        path.plot(circle.real, circle.imag, color=COLOURS[1], lw=1.2, label="clearance circle")
        path.set_aspect("equal")
        path.set_title(_size(clearance), fontsize=11)
        path.set_xlabel("journal x [mm]")
        half = len(velocity) // 2
        for k, (at, mark) in enumerate(((slice(half), "o"), (slice(half, None), "x"))):
            points.plot(
                1e-3 * acceleration[at], velocity[at], mark, color=COLOURS[k], ms=3.5, mew=0.7,
                alpha=0.8, fillstyle="none", label=f"run {k + 1}",
            )  # fmt: skip
        points.ticklabel_format(useOffset=False)
        points.set_xlabel("slider acceleration [km/s²]", fontsize=9)
    axes[0, 0].set_ylabel("journal y [mm]")
    axes[1, 0].set_ylabel("slider velocity [m/s]")
    axes[0, 0].legend(fontsize=7, loc="center")
    axes[1, -1].legend(fontsize=8)
    return figure
