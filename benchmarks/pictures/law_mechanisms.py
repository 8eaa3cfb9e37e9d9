"""Contact laws at work: the SCARA's cycle and the slider-crank's turns, law by law."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
from common import JOINT, RECORD_INTERVAL, ideal_tool, motion
from cost.mechanism_cost import SPEED, slider_crank
from pictures.law_probes import build

import jointplay as jp
from jointplay.model.impact import effective_mass

SCARA, CRANK = "SCARA", "slider-crank"
PAPER = ("normal", "lankarani-nikravesh")
"""With eq. 21: the paper's laws, to which all others are compared."""
DRY = "dry"  # family of the trials without the oil that a film's joint is compared to

TURNS, TURN = 5, 2 * np.pi / SPEED
"""Turns of the crank, the first of which is start-up, and the duration of one [s]."""
QUICK = 0.2  # duration of a quick run of the SCARA [s]
BINS = 400  # places in time at which a card's histories are kept

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


def _binned(time, values, span):
    """Largest magnitude in each of `BINS` parts of the span, the sign kept."""
    at = np.searchsorted(np.linspace(*span, BINS + 1)[1:-1], time)
    found = np.full(BINS, np.nan)
    for k in range(BINS):
        part = values[at == k]
        if part.size:
            found[k] = part[np.argmax(np.abs(part))]
    return found


def measure(trial, seed):
    """Run once and reduce the run to its figures and histories."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # a run that fails must not enter a mean
        simulation = trial.simulation(seed)
        result = simulation.run()
    audit, time = result.audit, result.time
    judged = time >= result.judge_from * (1 - 1e-9)
    force = result["joint_force_peak"].values[:, 0]
    size = np.linalg.norm(force, axis=1)
    lost = sum(result[f"{kind}_dissipation"].values for kind in ("normal", "friction", "film"))
    lost = float(np.ptp(lost[judged]))
    peak, met = float(size[judged].max()), float(audit.judged_impacts or 0)
    if trial.mechanism == SCARA:
        tool = result["tool_position"].values
        away = 1e3 * np.linalg.norm((tool - ideal_tool(False)[: len(tool)])[judged], axis=1)
        found = float(np.sqrt(np.mean(away**2))), float(away.max()), peak, met, lost
        span, history = (0.0, time[-1]), size
    else:
        model = simulation.mechanism.model
        # The guide is ideal and without friction: only the pin's force moves the slider along it.
        history = force[:, 0] / model.inertias[model.getJointId("guide")].mass
        late = trial.turns - 1
        span = late * TURN, trial.turns * TURN
        fastest = 1e-3 * float(np.abs(history[judged]).max())
        found = fastest, 1e-3 * peak, met / late, lost / late
    figures = dict(zip(FIGURES[trial.mechanism], found, strict=True))
    within = time >= span[0]
    centre = np.linalg.norm(result["journal_centre"].values[:, 0, :2], axis=1)
    ratio = centre / simulation.mechanism.clearance[trial._place].cr
    return figures | {
        "relative_energy_residual": audit.relative_energy_residual,
        "audit_warnings": float(len(audit.warnings) - len(audit.law_warnings)),
        "other_warnings": "\n".join(x for x in audit.warnings if x not in audit.law_warnings),
        "history": _binned(time[within], history[within], span),
        "eccentricity": _binned(time[within], ratio[within], span),
        "law_warnings": "\n".join(audit.law_warnings),
    }
