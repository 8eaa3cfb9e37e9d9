"""Law cards: the behaviour of each contact law, alone and in mechanisms.

Normal force: one impact of a free body, and the restitutions that impacts have. Friction: a block
whose sliding speed is a slow sinusoid. Film: load, attitude and squeeze against the published
limits. Impacts and sliding are runs of jointplay's own time loop on the smallest mechanisms that
show the law; films are evaluated by the compiled function that the time loop calls. Each law then
works in the SCARA's joint B and in the slider-crank's piston pin, beside the paper's laws
(Lankarani-Nikravesh and eq. 21; a film beside the same joint without oil).

Writes docs/data/law_cards.json (or into --out), from which the documentation's build makes a page
and a picture for each law, and one that compares all.
"""

import ctypes
import json
import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from common import (
    DOCS,
    JOINT,
    RECORD_INTERVAL,
    Ensemble,
    command,
    completed,
    ensembles,
    folder_of,
    ideal_tool,
    motion,
)
from cost.mechanism_cost import SPEED, slider_crank
from robots import body, flying, joint, urdf

import jointplay as jp
from jointplay.base.processes import cores
from jointplay.base.progress import ProgressBar
from jointplay.model.impact import effective_mass, impact_duration
from jointplay.paper.cases import JUDGED_FROM_S
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS, FilmProperties
from jointplay.physics.contact.machine_code import MAX_PARAMETERS, compiled_law

REGISTRIES = {"normal": NORMAL_LAWS, "friction": FRICTION_LAWS, "film": FILM_LAWS}
"""All laws, by family and name."""

CHOSEN = {
    ("normal", "kelvin-voigt"): {"damping": 1e3},
    ("normal", "hunt-crossley"): {"n": 1.5, "p": 1.0, "q": 1.0},
}
"""Parameters that differ from the defaults.

Kelvin-Voigt has none for its damping; Hunt-Crossley's default is the paper's law, and shows nothing
of its own.
"""

MASS = 1.0  # of the body in the impact [kg]
RADIAL, LENGTH = 0.2e-3, 20e-3
"""Radial clearance and length of the bore that it hits: about one half of the SCARA's joint [m]."""
LOOP_SPEED, SPEEDS = 0.1, (0.02, 0.2)
"""Approach speeds: of the hysteresis loops, of the restitutions [m/s]."""
STEPS_OF_AN_IMPACT = 400

BLOCK, AMPLITUDE, FREQUENCY = 2.0, 30e-3, 2.0
"""Mass [kg] of the block that slides, its largest speed [m/s], and how often it goes back [Hz]."""

FILM = {
    "short-bearing": FilmProperties(clearance=50e-6, radius=10e-3, length=9e-3, contacts=1),
    "pinkus-sternlicht": FilmProperties(clearance=50e-6, radius=10e-3, length=42e-3, contacts=1),
}
"""Bearings with a slenderness that each film is made for."""


def build(family, name, mass=MASS, **parameters):
    """The law as its card has it; `mass` [kg] is that of Anagnostopoulos."""
    fields = CHOSEN.get((family, name), {}) | parameters
    if name == "anagnostopoulos":
        fields = {"mass": float(f"{mass:.3g}")} | fields
    return REGISTRIES[family][name](**fields)


class Impact(NamedTuple):
    """One impact: depth [m] and force [N] while it lasts, and the restitution."""

    depth: np.ndarray
    force: np.ndarray
    rebound: float


def impact(law, restitution, speed):
    """Let a free body of `MASS` fly at the bore once."""
    bearing = jp.RevoluteClearance.planar(
        radial_clearance=RADIAL,
        bearing_length=LENGTH,
        restitution=restitution,
        normal=law,
        friction=jp.contact.Ambrosio(0.0),
    )
    contact = bearing.radial_contact
    whole = impact_duration(law, law.parameters(contact), MASS, speed)
    step = whole / STEPS_OF_AN_IMPACT
    # A plastic impact takes long to come out.
    options = {"step": step, "duration": 13 * whole, "record_every": 1}
    result = flying(bearing, MASS, 0.5 * step * speed, speed, **options).finish()
    depth = -result["gap"].values[:, 0, 0]
    within = np.flatnonzero(depth > 0.0)
    out = within[0] + np.flatnonzero(depth[within[0] :] <= 0.0)
    if not out.size:
        raise SystemExit(f"{law.name}: an impact at {speed:g} m/s did not end")
    during = slice(within[0], out[0])
    force = result["normal_force"].values[during, 0, 0]
    return Impact(depth[during], force, -float(result["v"].values[out[0], 0]) / speed)


def sliding(law, cycles=1.5):
    """Draw a block along a wall it is pressed to by its weight, the speed a sinusoid.

    Returns:
        speed [m/s] and friction over normal force [-], shape (n,), of the last whole cycle.
    """
    robot = urdf(
        body("carriage", 1.0),
        joint("along", "base", "carriage", "prismatic"),
        body("block", BLOCK),
        joint("press", "carriage", "block", "prismatic", "1 0 0"),
    )
    guide = jp.PrismaticClearance(
        clearance=1e-5, planar=True, lock_tilt=True, restitution=0.5, friction=law
    )
    mechanism = jp.Mechanism(
        robot, {"guide": guide}, loops={"guide": jp.Loop("base", "block")}, gravity=(-9.81, 0, 0)
    )
    turn = 2 * np.pi * FREQUENCY
    times = np.linspace(0.0, cycles / FREQUENCY, round(80 * cycles) + 1)
    places = -AMPLITUDE / turn * np.cos(turn * times)
    motion = jp.Motion(["along"], times, places[:, None], "spline")
    result = jp.simulate(
        mechanism,
        motion,
        drive={"along": jp.loads.Prescribed()},
        start="centred",
        joint_friction={},
        step=1e-5,
    )
    # The block has fallen on the wall, and lies still, long before the last cycle.
    late = result.time > (cycles - 1.0) / FREQUENCY
    speed = result["v"].sel(coordinate="along").values[late]
    force = result["joint_force"].values[late, 0]
    return speed, -force[:, 2] / force[:, 0]


def steady(law, speeds):
    """Coefficient of lasting sliding at `speeds` >= 0 [m/s]."""
    p = (ctypes.c_double * MAX_PARAMETERS)(*law.parameters())
    function = compiled_law(law).ctypes
    if not law.bristles:
        return np.array([function(speed, p) for speed in speeds])
    # Bristles at rest in themselves: z = A v/r, F = k z + c v, under a normal force of 1 N.
    out = (ctypes.c_double * 8)()
    found = []
    for speed in speeds:
        function(speed, 1.0, 0.0, p, out)
        away, rate, stiffness, _, viscous, _, dwell, _ = out
        function(speed, 1.0, dwell, p, out)  # the cap for a dwell that has settled
        held = stiffness * away * speed / rate if rate > 0.0 else 0.0
        found.append(min(held, out[5]) + viscous * speed)
    return np.array(found)


def film_forces(law, properties, eccentricities, rate=0.0, spin=0.0):
    """F_r and F_t [N], shape (2, n): `rate` of the eccentricity ratio [1/s], `spin` [rad/s]."""
    p = (ctypes.c_double * MAX_PARAMETERS)(*law.parameters(properties))
    out = (ctypes.c_double * 4)()
    function = compiled_law(law).ctypes
    found = []
    for eccentricity in eccentricities:
        function(eccentricity, rate, 0.0, spin, p, out)
        found.append(out[:2])
    return np.array(found).T


def published_rotation(name, e):
    """Load over mu w L R^3/c^2 (L^3 R for the short bearing) and attitude [rad], steady turning.

    Ocvirk's short bearing; half Sommerfeld's long one.
    """
    root = np.sqrt(1.0 - e * e)
    if name == "short-bearing":
        load = e / (4.0 * root**4) * np.sqrt(16.0 * e * e + np.pi**2 * root**2)
        return load, np.arctan2(np.pi * root, 4.0 * e)
    load = 6.0 * e / ((2.0 + e * e) * root**2) * np.sqrt(4.0 * e * e + np.pi**2 * root**2)
    return load, np.arctan2(np.pi * root, 2.0 * e)


def published_squeeze(name, e):
    """Squeeze force over the same with de/dt for w: half the film (positive pressure), all of it.

    Half a film is Reynolds' equation integrated here; a whole one has a closed form.
    """
    rest = 1.0 - e * e
    angle, step = np.linspace(-np.pi, np.pi, 200001, retstep=True)
    half = []
    for each in e:
        if name == "short-bearing":  # p ~ cos/(1 - e cos)^3
            pressure = np.cos(angle) / (1.0 - each * np.cos(angle)) ** 3
        else:  # zero at the film's ends, a quarter turn from the thinnest place
            pressure = 6.0 / each * (1.0 / (1.0 - each * np.cos(angle)) ** 2 - 1.0)
        half.append(step * np.sum(np.maximum(pressure, 0.0) * np.cos(angle)))
    whole = math.pi * (1.0 + 2.0 * e * e) / rest**2.5
    if name != "short-bearing":
        whole = 12.0 * math.pi / rest**1.5
    return np.array(half), whole


def film_unit(law, properties):
    """The force mu L R^3/c^2, or mu L^3 R/c^2 for the short bearing, for 1 rad/s [N]."""
    c, radius, length, _ = properties
    if law.name == "short-bearing":
        return law.viscosity * length**3 * radius / c**2
    return law.viscosity * length * radius**3 / c**2


# At work: the SCARA's cycle and the slider-crank's turns, law by law.


SCARA, CRANK = "SCARA", "slider-crank"
PAPER = ("normal", "lankarani-nikravesh")
"""With eq. 21: the paper's laws, to which all others are compared."""
DRY = "dry"  # family of the trials without the oil that a film's joint is compared to

TURNS, TURN = 5, 2 * np.pi / SPEED
"""Turns of the crank, the first of which is start-up, and the duration of one [s]."""
QUICK = 0.2  # duration of a quick run of the SCARA [s]

STEEL = replace(jp.Material(), density=jp.material("carbon-steel").density)
"""The paper's, with the density that it leaves out: the laws can then judge the approach speeds."""

SCARA_JOINT = jp.RevoluteClearance(
    radial_clearance=0.2e-3,
    axial_clearance=0.2e-3,
    bearing_material=STEEL,
    journal_material=STEEL,
)
CRANK_JOINT = jp.RevoluteClearance.planar(
    radial_clearance=0.5e-3,
    bearing_length=20e-3,
    bearing_material=STEEL,
    journal_material=STEEL,
    friction=jp.contact.Ambrosio(mu_d=0.01, v0=1e-3, v1=1e-2),
)
"""Those of scara.toml's 0.2 mm and of slider_crank.toml's 0.5 mm."""

OILED = {
    ("short-bearing", SCARA): {"bearing_length": 10e-3},
    ("pinkus-sternlicht", SCARA): {"bearing_length": 42e-3},
    ("short-bearing", CRANK): {"bearing_length": 9e-3, "radial_clearance": 0.05e-3},
    ("pinkus-sternlicht", CRANK): {"bearing_length": 42e-3, "radial_clearance": 0.05e-3},
}
"""Dimensions within each film's slenderness [m]; a pin that runs in oil fits more closely."""
OIL = {SCARA: ("ISO VG 460", 40.0), CRANK: ("ISO VG 46", 40.0)}  # oil and its temperature [deg C]

SCALES = {"mu": 0.1, "sigma": 0.1, "xi": 0.1, "v": 10.0}
"""Friction of the slider-crank by the first letters of its parameters, relative to the defaults.

slider_crank.toml treats eq. 21 so: an oiled pin that slides at up to 2 m/s.
"""


FIGURES = {
    SCARA: {
        "deviation_rms_mm": "tool deviation, RMS [mm]",
        "deviation_max_mm": "tool deviation, largest [mm]",
        "peak_force_N": "peak joint force [N]",
        "impacts": "impacts",
        "loss_J": "lost [J]",
    },
    CRANK: {
        "peak_acceleration_1e3_m_s2": "peak slider acceleration [10³ m/s²]",
        "peak_force_kN": "peak joint force [kN]",
        "impacts_per_turn": "impacts a turn",
        "loss_per_turn_J": "lost in a turn [J]",
    },
}
"""What is measured in each mechanism, and its label."""


def viscosity(mechanism):
    """Of the mechanism's oil [Pa s]."""
    oil, celsius = OIL[mechanism]
    return jp.oil(oil).viscosity(celsius)


@dataclass(frozen=True)
class Trial:
    """One law in one mechanism."""

    mechanism: str
    family: str
    name: str
    quick: bool = False  # the first `QUICK` of the SCARA's cycle, two turns of the crank

    ideal = False  # for `common.ensembles`: a journal can be displaced

    @property
    def turns(self):
        return 2 if self.quick else TURNS

    def law(self):
        """The law, as this mechanism has it."""
        if self.family == "film":
            return build("film", self.name, viscosity=viscosity(self.mechanism))
        if self.name == "anagnostopoulos":
            robot, reference, options = self._robot(self._base())
            q = jp.Run(jp.Simulation(robot, reference, start="centred", **options)).workspace.q
            return build("normal", self.name, mass=effective_mass(robot, self._place, q))
        law = build(self.family, self.name)
        if self.family == "friction" and self.mechanism == CRANK:
            return type(law)(**{key: value * _scale(key) for key, value in vars(law).items()})
        return law

    def bearing(self):
        base = self._base()
        if self.family == DRY:
            return base
        return replace(base, **{"lubricant" if self.family == "film" else self.family: self.law()})

    def simulation(self, seed):
        robot, reference, options = self._robot(self.bearing())
        if self.mechanism == SCARA:
            options |= {"step": 1e-5, "record_every": round(RECORD_INTERVAL / 1e-5)}
            options |= {"duration": QUICK} if self.quick else {}
            options["judge_from"] = JUDGED_FROM_S
        else:
            options |= {"step": 1e-6, "record_every": 4, "duration": self.turns * TURN}
            options["judge_from"] = TURN
        return jp.Simulation(robot, reference, seed=seed, start="centred", **options)

    @property
    def _place(self):
        return JOINT if self.mechanism == SCARA else "piston_pin"

    def _base(self):
        base = SCARA_JOINT if self.mechanism == SCARA else CRANK_JOINT
        sizes = OILED.get((self.name, self.mechanism))
        # What was derived from the old dimensions must not contradict the new ones.
        derived = {"journal_radius": None, "journal_length": None}
        return replace(base, **derived, **sizes) if sizes else base

    def _robot(self, bearing):
        if self.mechanism == SCARA:
            robot = jp.Mechanism(jp.shipped("scara.urdf"), {JOINT: bearing}, gravity=(0, 0, 0))
            return robot, motion(), {}
        robot, reference, _ = slider_crank(bearing)
        # The slider's start is left open: it gives way to a displaced journal. From zero it finds
        # the outer dead centre, where crank and rod are stretched.
        return robot, reference, {"drive": {"crank_pin": jp.loads.Prescribed()}}


def _scale(name):
    return next((scale for start, scale in SCALES.items() if name.startswith(start)), 1.0)


def measure(trial, seed):
    """Run once and reduce the run to its figures."""
    simulation = trial.simulation(seed)
    result = completed(simulation.run())
    audit = result.audit
    judged = result.time >= result.judge_from * (1 - 1e-9)
    force = result["joint_force_peak"].values[:, 0]
    size = np.linalg.norm(force, axis=1)
    lost = sum(result[f"{kind}_dissipation"].values for kind in ("normal", "friction", "film"))
    lost = float(np.ptp(lost[judged]))
    peak, met = float(size[judged].max()), float(audit.judged_impacts)
    if trial.mechanism == SCARA:
        tool = result["tool_position"].values
        away = 1e3 * np.linalg.norm((tool - ideal_tool(False)[: len(tool)])[judged], axis=1)
        found = float(np.sqrt(np.mean(away**2))), float(away.max()), peak, met, lost
    else:
        model = simulation.mechanism.model
        # The guide is ideal and without friction: only the pin's force moves the slider along it.
        acceleration = force[judged, 0] / model.inertias[model.getJointId("guide")].mass
        late = trial.turns - 1
        found = 1e-3 * float(np.abs(acceleration).max()), 1e-3 * peak, met / late, lost / late
    figures = dict(zip(FIGURES[trial.mechanism], found, strict=True))
    return figures | {
        "relative_energy_residual": audit.relative_energy_residual,
        "audit_warnings": float(len(audit.warnings) - len(audit.law_warnings)),
        "other_warnings": "\n".join(x for x in audit.warnings if x not in audit.law_warnings),
        "law_warnings": "\n".join(audit.law_warnings),
    }


# The cards.


LOOPS = (0.9, 0.5)
RESTITUTIONS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
ROUGH = (0.3, 0.5, 0.9)
"""Nominal restitutions: of the hysteresis loops, of the dots, of the dots with --quick."""
ECCENTRICITIES = np.append(np.linspace(0.01, 0.95, 95), (0.96, 0.97))
NEAR_REST = 3.0  # speed to which friction's second panel looks [mm/s]
POINTS = 320  # that are kept of a curve


class Card(NamedTuple):
    """One law's place among the tables."""

    family: str
    name: str

    def trial(self, mechanism, quick):
        """Its own, in a mechanism; eq. 21 is one of the paper's laws."""
        itself = PAPER if self == ("friction", "ambrosio") else self
        return Trial(mechanism, *itself, quick)

    def beside(self, mechanism, quick):
        """That with which it is compared."""
        other = (DRY, self.name) if self.family == "film" else PAPER
        return Trial(mechanism, *other, quick)


def parameters(law):
    shown = {k: f"{v:.4g}" if isinstance(v, float) else v for k, v in vars(law).items()}
    return ", ".join(f"{key} = {value}" for key, value in shown.items()) or "none"


def rounded(values):
    return [float(f"{value:.4g}") for value in values]


def curve(look, label, x, y, near=np.inf):
    """A line of a picture, with the points that its shape needs; more of them where |x| < near."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if len(x) > POINTS:
        parts = [each for each in (x, y, np.clip(x, -near, near)) if np.ptp(each)]
        way = sum(np.abs(np.diff(each)) / np.ptp(each) for each in parts)
        way = np.append(0.0, np.cumsum(way))
        at = np.searchsorted(way, np.linspace(0.0, way[-1], POINTS // 2))
        at = np.unique(np.append(np.maximum(at - 1, 0), at))  # both ends of a jump
        x, y = x[at], y[at]
    return {"look": look, "label": label, "x": rounded(x), "y": rounded(y)}


def panel(title, x, y, lines, **options):
    return {"title": title, "x": x, "y": y, "lines": lines} | options


def normal_probe(card, quick):
    """Hysteresis loops and restitutions."""
    law = build(*card)
    hits = [impact(law, c_e, LOOP_SPEED) for c_e in LOOPS]
    loops = [
        curve(look, f"$c_e$ = {c_e:g}", 1e6 * hit.depth, 1e-3 * hit.force)
        for look, c_e, hit in zip(("own", "second"), LOOPS, hits, strict=True)
    ]
    asked = np.array(ROUGH if quick else RESTITUTIONS)
    found = np.array([[impact(law, c_e, v).rebound for c_e in asked] for v in SPEEDS])
    exact = [law.effective_restitution(float(c_e)) for c_e in asked]
    dots = [curve("asked", "as asked", (0, 1), (0, 1))]
    if exact[0] is not None:
        fine = np.linspace(0.05, 1.0, 39)
        dots.append(curve("exact", "closed form", fine, [*map(law.effective_restitution, fine)]))
    for look, speed, values in zip(("dots", "squares"), SPEEDS, found, strict=True):
        dots.append(curve(look, f"run, {speed:g} m/s", asked, values))
    rows = [["c_e", *(f"run, {speed:g} m/s" for speed in SPEEDS), "closed form"]]
    for c_e, values, closed in zip(asked, found.T, exact, strict=True):
        last = "-" if closed is None else f"{closed:.3f}"
        rows.append([f"{c_e:g}", *(f"{v:.3f}" for v in values), last])
    return {
        "setup": f"A free body of {MASS:g} kg hits the bore of a planar joint once (C_r = "
        f"{1e3 * RADIAL:g} mm, R_i = 10 mm, {1e3 * LENGTH:g} mm long, the paper's "
        f"steel). Parameters: {parameters(law)}. Restitution of the impact against the one asked "
        "for:",
        "table": rows,
        "panels": [
            panel(f"one impact at {LOOP_SPEED:g} m/s", "depth [µm]", "normal force [kN]", loops),
            panel("restitution", "nominal restitution $c_e$ [-]", "of an impact [-]", dots),
        ],
    }


def friction_probe(card, quick):
    """Friction over speed, whole and near rest."""
    law = build(*card)
    speed, friction = sliding(law)
    fine = np.linspace(0.0, AMPLITUDE, 1201)
    lasting = steady(law, fine)
    both = 1e3 * np.append(-fine[::-1], fine), np.append(-lasting[::-1], lasting)
    lines = [
        curve("own", "this law", 1e3 * speed, friction, NEAR_REST),
        curve("exact", "at lasting speed", *both, NEAR_REST),
    ]
    at = np.flatnonzero((speed[:-1] < 0.0) & (speed[1:] >= 0.0))[0]
    fraction = speed[at] / (speed[at] - speed[at + 1])
    turning = friction[at] + fraction * (friction[at + 1] - friction[at])
    axes = "sliding speed [mm/s]", "friction / normal force [-]"
    return {
        "setup": f"A block of {BLOCK:g} kg is drawn along a wall on which it lies by its "
        f"weight; its speed is a sinusoid of {1e3 * AMPLITUDE:g} mm/s and {FREQUENCY:g} Hz. "
        f"Parameters: {parameters(law)}. Friction against the speed, over the normal force:",
        "table": [
            ["", "friction / normal force"],
            ["largest", f"{np.abs(friction).max():.4f}"],
            ["as the speed passes through zero upwards", f"{turning:.4f}"],
            [f"at {1e3 * AMPLITUDE:g} mm/s", f"{friction[np.argmax(speed)]:.4f}"],
            [f"at a lasting {1e3 * AMPLITUDE:g} mm/s", f"{lasting[-1]:.4f}"],
        ],
        "panels": [
            panel(f"sinusoid of {FREQUENCY:g} Hz", *axes, lines),
            panel("the same near rest", *axes, lines, xlim=[-NEAR_REST, NEAR_REST]),
        ],
    }


def film_probe(card, quick):
    """Load, attitude and squeeze over eccentricity."""
    properties, e = FILM[card.name], ECCENTRICITIES
    oil = viscosity(CRANK)
    short = card.name == "short-bearing"
    laws = {"this law": build(*card, viscosity=oil)}
    if short:
        laws = {
            f"this law, {word}": build(*card, viscosity=oil, cavitation=word)
            for word in ("gumbel", "sommerfeld")
        }
    unit = film_unit(laws[next(iter(laws))], properties)
    power = 4.0 if short else 1.0  # S (L/D)^2 of the short bearing, S of the long one
    size, angle = published_rotation(card.name, e)
    published = 1 / (power * np.pi * size), np.degrees(angle)
    half, entire = published_squeeze(card.name, e)
    theory = "Ocvirk" if short else "half Sommerfeld"
    ratio, scale = ("S (L/D)²", "µ L³ R/c²") if short else ("S", "µ L R³/c²")
    across = "eccentricity ratio [-]"
    load, attitude, squeeze = panels = [
        panel("load, steady turning", across, f"Sommerfeld number {ratio} [-]", [], log=True),
        panel("attitude, steady turning", across, "attitude angle [°]", [], ylim=[0, 95]),
        panel("squeeze", across, f"force / ({scale} dε/dt) [-]", [], log=True),
    ]
    found = []
    for look, (word, law) in zip(("own", "second"), laws.items(), strict=False):
        turning = film_forces(law, properties, e, spin=1.0) / unit
        pressed = -film_forces(law, properties, e, rate=1.0)[0] / unit
        number = 1 / (power * np.pi * np.hypot(*turning))
        found.append((number, np.degrees(np.arctan2(turning[1], -turning[0])), pressed))
        for one, values in zip(panels, found[-1], strict=True):
            one["lines"].append(curve(look, word, e, values))
    some = slice(4, None, 8)
    for one, look, values, word in (
        (load, "dots", published[0], theory),
        (attitude, "dots", published[1], theory),
        (squeeze, "dots", half, "Reynolds, half the film"),
        (squeeze, "squares", entire, "Reynolds, all of it"),
    ):
        one["lines"].append(curve(look, word, e[some], values[some]))

    number, angle, pressed = found[0]
    columns = (
        *(
            (e, ".2f"),
            (number, ".4g"),
            (published[0], ".4g"),
            (angle, ".1f"),
            (published[1], ".1f"),
        ),
        *((pressed, ".4g"), (half, ".4g"), (entire, ".4g")),
    )
    shown = [int(np.argmin(np.abs(e - each))) for each in (0.1, 0.3, 0.5, 0.7, 0.9, 0.95)]
    header = ["ε", ratio, theory, "attitude [°]", theory]
    header += ["squeeze", "Reynolds, half", "Reynolds, all"]
    squeezed = pressed / half
    worst = int(np.argmax(np.abs(squeezed - 1)))
    rotation = np.abs(published[0] / number - 1).max()
    c, radius, length, _ = properties
    return {
        "setup": f"A journal of R = {1e3 * radius:g} mm, L = {1e3 * length:g} mm (L/D = "
        f"{length / (2 * radius):.3g}), c = {1e6 * c:g} µm. S is the Sommerfeld number µ n L D/W "
        f"(R/c)², n in turns per second; squeeze is force over {scale} dε/dt at dε/dt > 0. "
        f"Reynolds: the pressure of {'a short' if short else 'a long'} bearing, integrated; only "
        "where it is positive (half), and everywhere (all).",
        "table": [header, *([format(values[i], form) for values, form in columns] for i in shown)],
        "note": f"From ε = {e[0]:g} to {e[-1]:g} the load of steady turning is within "
        f"{100 * rotation:.1g} % of {theory}'s, and the squeeze force of this law between "
        f"{squeezed.min():.3f} and {squeezed.max():.3f} times Reynolds' half film, furthest from "
        f"it at ε = {e[worst]:.2f}.",
        "panels": panels,
    }


PROBES = {"normal": normal_probe, "friction": friction_probe, "film": film_probe}


def in_mechanisms(card, quick):
    """Bearing and parameters that the law has in each mechanism, in words."""
    found = {}
    for mechanism in FIGURES:
        joint = card.trial(mechanism, quick).bearing()
        place = "joint B" if mechanism == SCARA else "piston pin"
        words = f"{place} (C_r = {1e3 * joint.cr:g} mm, R_i = {1e3 * joint.ri:g} mm, "
        words += f"L_j = {1e3 * joint.lj:g} mm"
        if card.family == "film":
            oil, celsius = OIL[mechanism]
            words += f", L/D = {joint.lj / (2 * joint.rj):.2f}, {oil} at {celsius:g} °C"
        law = Trial(mechanism, *card, quick).law()
        found[mechanism] = f"{words}); parameters: {parameters(law)}."
    return found


def record(trial, ensemble):
    """An ensemble's figures, run by run, and the warnings of its first run."""

    def warned(kind):
        return [line for line in str(ensemble[kind][0]).split("\n") if line]

    keys = [*FIGURES[trial.mechanism], "relative_energy_residual"]
    return {
        "mechanism": trial.mechanism,
        "family": trial.family,
        "law": trial.name,
        "figures": {key: [float(f"{value:.9g}") for value in ensemble[key]] for key in keys},
        "law_warnings": warned("law_warnings"),
        "other_warnings": warned("other_warnings"),
        "doubtful": bool(ensemble["audit_warnings"].any()),
    }


def run_all(cards, args) -> dict[Trial, Ensemble]:
    trials = []
    for mechanism in FIGURES:
        trials.append(Trial(mechanism, *PAPER, args.quick))
        for card in cards:
            trials += card.trial(mechanism, args.quick), card.beside(mechanism, args.quick)
    trials = list(dict.fromkeys(trials))
    return dict(zip(trials, ensembles(trials, args.runs, args.jobs, measure), strict=True))


def write(path, laws, trials, runs, quick):
    """The data of all cards: `laws` from `probe`, `trials` from `record`."""
    head = {
        "cycle": f"its first {QUICK:g} s" if quick else "one cycle of 3 s",
        "turns": Trial(CRANK, *PAPER, quick).turns,
        "runs": runs,
        "figures": FIGURES,
    }
    parts = [f'"{key}": {json.dumps(value, ensure_ascii=False)}' for key, value in head.items()]
    for key, rows in (("laws", laws), ("trials", trials)):
        lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows)
        parts.append(f'"{key}": [\n{lines}\n]')
    path.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def probe(card, quick):
    place = {"family": card.family, "name": card.name, "work": in_mechanisms(card, quick)}
    return place | PROBES[card.family](card, quick)


def main():
    every = {
        f"{family}:{name}": Card(family, name)
        for family, laws in REGISTRIES.items()
        for name in laws
    }
    parser = command(
        __doc__,
        "one law of each family, shorter runs",
        "docs/data; --quick: results/benchmarks/laws",
        runs=(4, "of each case, with journals displaced at the start"),
        jobs=(cores(), "processes"),
    )
    parser.add_argument(
        "--law",
        action="append",
        choices=list(every),
        metavar="FAMILY:NAME",
        help="only this law, such as film:short-bearing; can be repeated (default: all laws; "
        "--quick: one of each family)",
    )
    args = parser.parse_args()
    if args.runs < 2 or args.jobs < 1:
        parser.error("--runs must be at least 2 and --jobs at least 1")
    if args.law and not args.quick and args.out is None:
        parser.error("--law needs --out: docs/data/law_cards.json has all laws")
    if args.quick:
        args.runs = min(args.runs, 2)
    chosen = args.law or every
    if args.quick and not args.law:  # the first of each family
        chosen = {key.partition(":")[0]: key for key in reversed(every)}.values()
    cards = [every[key] for key in dict.fromkeys(chosen)]
    trials = [record(*one) for one in run_all(cards, args).items()]
    laws = [probe(card, args.quick) for card in ProgressBar(cards, unit="laws")]
    path = folder_of(args, "laws", DOCS / "data") / "law_cards.json"
    write(path, laws, trials, args.runs, args.quick)
    print(f"written: {path}, {len(cards)} laws")
