"""What nobody here made: commercial code and other engines, from published or recorded data."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
from common import COLOURS, new_figure
from robots import FREE, body, joint, urdf
from truth.validation import Outcome, Rows, case, off
from truth.validation.data import read
from truth.validation.literature import (
    CRANK,
    GUIDE_CLEARANCE,
    ROD,
    SLIDER_MASS,
    guided,
    pin_bearing,
    prepare,
)
from truth.validation.theory import FACTORS

import jointplay as jp

# RecurDyn: a heavy journal with an arm falls into its bore and swings

BORE, CLEARANCE, LENGTH = 0.46, 0.01, 2.6
"""Bore's radius, radial clearance, journal's length [m]."""
JOURNAL, ARM = 12984.280977103, 271.0
"""Masses [kg]."""
JOURNAL_INERTIA, ARM_INERTIA = 1314.65844893167, 202.0
"""About the bearing's axis, of each about its own centre [kg m^2]."""
ARM_AT = 8.35588256883334e-05, 2.65983598394373
"""Centre of the arm, up and along: the arm begins level [m]."""
GRAVITY = 9.80665
SOURCE = "RecurDyn 2023 (github.com/W-Moorer/sdf-nsc, assets/rev_joint_clearance, BSD-3)"


@functools.cache
def _recurdyn() -> tuple[dict[str, np.ndarray], float]:
    """Its curves, and how far its meshes let the journal fall [m]."""
    columns, numbers = read("recurdyn_revolute.csv")
    return columns, numbers["mesh_gap"]


def _swing(bearing: jp.RevoluteClearance | None, inertia: float = 1.0, **options) -> jp.Result:
    """Journal and arm, one body, dropped level; `inertia` scales the journal's."""
    mass = JOURNAL + ARM
    centre = ARM / mass * np.array(ARM_AT)
    about = (
        inertia * JOURNAL_INERTIA + ARM_INERTIA
        + JOURNAL * centre @ centre + ARM * np.sum((ARM_AT - centre) ** 2)
    )  # fmt: skip
    quarter = math.pi / 2  # z of the joint along x of the world, x of the joint up
    path = urdf(
        body("journal", mass, f"{centre[0]} {centre[1]} 0", (1e4, 1e4, about)),
        joint("pin", "base", "journal", "continuous", rpy=f"{quarter} 0 {quarter}"),
    )
    robot = jp.Mechanism(
        path, {} if bearing is None else {"pin": bearing}, gravity=(0, -GRAVITY, 0), tool="journal"
    )
    return jp.simulate(robot, integrator="rk4", **FREE, **options)


def _bearing(stiffness: float, clearance: float = CLEARANCE) -> jp.RevoluteClearance:
    """Without friction and, as theirs is all but, without loss."""
    return jp.RevoluteClearance.planar(
        bearing_radius=BORE, bearing_length=LENGTH, radial_clearance=clearance,
        stiffness=stiffness, normal=jp.contact.Hertz(), friction=jp.contact.Coulomb(0.0, 1e-3),
    )  # fmt: skip


def _angle(up: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Of the arm, from where it began [rad]."""
    return np.unwrap(np.arctan2(along, up)) - math.atan2(ARM_AT[1], ARM_AT[0])


@case(
    origin="commercial code",
    title="RecurDyn: ideal revolute joint",
    compared="A 13 t journal with an arm, dropped level in an ideal revolute joint, 3 s, no "
    f"friction: the arm's swing against {SOURCE}. rk4, step 0.5 ms.",
    measures="largest difference of the swing angle [rad]",
    wrong="the journal's own moment of inertia smaller by 1 %",
)
def recurdyn_ideal(quick: bool = False, wrong: bool = False) -> Outcome:
    theirs, _ = _recurdyn()
    result = _swing(
        None, 0.99 if wrong else 1.0, duration=1.0 if quick else 3.0, step=5e-4, record_every=1
    )
    at = theirs["time"] <= result.time[-1]
    angle = _angle(theirs["ideal_y"][at], theirs["ideal_z"][at])
    ours = np.interp(theirs["time"][at], result.time, result["q"].values[:, 0])
    error = float(np.abs(ours - angle).max())
    rows = Rows("time [s]|.3f", "RecurDyn [rad]|.6f", "jointplay [rad]|.6f")
    for row in zip(theirs["time"][at][::60], angle[::60], ours[::60], strict=True):
        rows.add(*row)
    return Outcome(error, 1e-4, rows.table)


@case(
    origin="commercial code",
    title="RecurDyn: free fall and first touch",
    compared="The same with a radial clearance of 10 mm (bore 460 mm): height of the journal "
    f"until it touches, and the time of that, against {SOURCE}. Its surfaces are "
    "faceted: with their meshes the journal falls less than 10 mm; the difference is "
    "computed from the meshes (`benchmarks/truth/validation/data/make.py`). It touches "
    "between the last sample with acceleration -g and the next.",
    measures="largest difference of the height over the clearance; 1 more if the time at which the "
    "meshes' gap closes here is not between their two samples",
    wrong="gravity is 9.81 instead of 9.80665 m/s^2, and the gap that of round surfaces",
)
def recurdyn_fall(quick: bool = False, wrong: bool = False) -> Outcome:
    theirs, gap = _recurdyn()
    time, height = theirs["time"], theirs["journal_y"]
    falls = np.abs(theirs["journal_ay"] + GRAVITY) < 1e-3
    before = int(np.argmin(falls)) - 1
    used = CLEARANCE if wrong else gap
    result = _swing(_bearing(7e7, used), duration=0.05, step=2e-5, record_every=1)
    ours = np.interp(time[: before + 1], result.time, result["q"].values[:, 0])
    if wrong:
        ours = ours * 9.81 / GRAVITY
    error = float(np.abs(ours - height[: before + 1]).max() / CLEARANCE)
    touch = result.time[np.argmax(result["normal_force"].values[:, 0, 0] > 0.0)]
    between = bool(time[before] <= touch <= time[before + 1])
    rows = [
        ["", "RecurDyn", "jointplay"],
        ["fall until the touch [mm]",
         f"{-1e3 * height[before]:.2f} to {-1e3 * height[before + 1]:.2f}", f"{1e3 * used:.3f}"],
        ["time of the touch [ms]", f"{1e3 * time[before]:.3f} to {1e3 * time[before + 1]:.3f}",
         f"{1e3 * touch:.3f}"],
        ["the same with round surfaces [ms]", "",
         f"{1e3 * math.sqrt(2 * CLEARANCE / GRAVITY):.3f} (closed form)"],
    ]  # fmt: skip
    return Outcome(error + (not between), 2e-4, rows)


@case(
    origin="commercial code",
    title="RecurDyn: swing with clearance",
    compared="The same for 3 s with the clearance: the gross swing of the arm, while the journal "
    f"bounces in its bore, against {SOURCE}. Hertz's stiffness is fitted to RecurDyn's "
    "contact force (from its accelerations) over its depth; without loss. rk4, step 50 "
    "µs.",
    measures="largest difference of the swing angle [rad]",
    wrong="the journal's own moment of inertia smaller by 10 %",
)
def recurdyn_swing(quick: bool = False, wrong: bool = False) -> Outcome:
    theirs, _ = _recurdyn()
    time = theirs["time"]
    place = np.column_stack([theirs["journal_y"], theirs["journal_z"]])
    away = np.linalg.norm(place, axis=1)
    depth = away - CLEARANCE
    force = np.column_stack(
        [
            JOURNAL * theirs[f"journal_a{part}"] + ARM * theirs[f"arm_a{part}"] + weight
            for part, weight in (("y", (JOURNAL + ARM) * GRAVITY), ("z", 0.0))
        ]
    )
    inside = depth > 0.0
    normal = -np.sum(force[inside] * place[inside], axis=1) / away[inside]
    powers = depth[inside] ** 1.5
    stiffness = float(powers @ normal / (powers @ powers))
    result = _swing(
        _bearing(stiffness), 0.9 if wrong else 1.0, duration=1.5 if quick else 3.0, step=5e-5,
        record_every=20,
    )  # fmt: skip
    at = time <= result.time[-1]
    angle = _angle(
        (theirs["arm_y"] - theirs["journal_y"])[at], (theirs["arm_z"] - theirs["journal_z"])[at]
    )
    q = result["q"].values
    ours = np.interp(time[at], result.time, q[:, 2])
    error = float(np.abs(ours - angle).max())
    if quick:
        return Outcome(error, 0.03)
    ideal = _angle(theirs["ideal_y"], theirs["ideal_z"])
    strongest = int(np.argmax(normal))
    rows = [
        ["", "RecurDyn", "jointplay"],
        ["swing angle at 3 s [rad]", f"{angle[-1]:.4f}", f"{ours[-1]:.4f}"],
        ["the same, ideal joint [rad]", f"{ideal[-1]:.4f}", ""],
        ["deepest [mm]", f"{1e3 * depth.max():.1f}",
         f"{1e3 * (np.linalg.norm(q[:, :2], axis=1).max() - CLEARANCE):.1f}"],
        ["largest contact force [kN]", f"{1e-3 * normal.max():.0f}",
         f"{1e-3 * result['normal_force'].values.max():.0f}"],
        ["arm's end along the bearing's axis, largest [mm]",
         f"{1e3 * np.abs(theirs['arm_x']).max():.0f}", "0 (kept)"],
    ]  # fmt: skip
    figure, axes = new_figure(1, 2, 9.0, 3.4)
    axes[0, 0].plot(time, np.degrees(angle), color=COLOURS[0], label="RecurDyn")
    axes[0, 0].plot(time, np.degrees(ours), "k--", lw=1, label="jointplay")
    axes[0, 0].set(xlabel="time [s]", ylabel="swing [°]")
    axes[0, 0].legend()
    axes[0, 1].plot(1e3 * depth[inside], 1e-3 * normal, ".", ms=3, color=COLOURS[0])
    line = np.linspace(0.0, depth.max(), 50)
    axes[0, 1].plot(1e3 * line, 1e-3 * stiffness * line**1.5, "k--", lw=1)
    axes[0, 1].set(xlabel="depth [mm]", ylabel="contact force [kN]")
    notes = (
        "What cannot be compared: depth, bounces and orbit of the journal. RecurDyn's contact is "
        "one of faceted meshes with a largest depth of 30 mm in its settings; its force falls "
        f"again beyond {1e3 * depth[inside][strongest]:.0f} mm, though the journal sinks to "
        f"{1e3 * depth.max():.0f} mm. That its arm swings along the bearing's axis by some "
        "centimetres, in a model that is almost symmetric, is also caused by the meshes (nothing "
        "holds its journal along the axis, and here the motion is plane). The ideal joint's swing "
        f"differs from RecurDyn's with clearance by up to {np.abs(ideal - angle).max():.3f} rad.",
    )
    return Outcome(error, 0.03, rows, figure, notes)


# Siconos: clearance in the guide, all of the published 200 ms


PARTS = "turns", "speed", "y"


def _apart(time: np.ndarray, ours: jp.Result, turns, speed, place) -> tuple[float, float, float]:
    """RMS differences in time of crank angle [rad], crank speed and place over the clearance."""
    at = time <= ours.time[-1] + 1e-9
    found = []
    for theirs, mine in (
        (2 * np.pi * turns, ours["q"].values[:, 0]),
        (speed, ours["v"].values[:, 0]),
        (place, ours["tool_position"].values[:, 1] / GUIDE_CLEARANCE),
    ):
        gone = np.interp(time[at], ours.time, mine) - theirs[at]
        found.append(float(np.sqrt(np.mean(gone**2))))
    return found[0], found[1], found[2]


@case(
    origin="engine",
    title="Slider-crank with clearance in the guide: Siconos",
    compared="The slider-crank of P. Flores, R. Leine, C. Glocker, Multibody System Dynamics 23 "
    "(2010) 165-190, over all of its 200 ms and in time: crank angle, crank speed and the slider's "
    "place across the guide against the non-smooth code Siconos (Moreau-Jean), run here at five "
    "steps from 10 to 0.6 µs (`truth/peer_engines/siconos_guide.py`, recorded in "
    "`truth/validation/data/siconos_guide.csv`) and extrapolated to h = 0 by a straight line.",
    measures="RMS difference of the crank angle over the run [rad]",
    wrong="half the clearance here",
)
def guide_siconos(quick: bool = False, wrong: bool = False) -> Outcome:
    data, _ = read("siconos_guide.csv")
    result = guided(0.06 if quick else 0.2, GUIDE_CLEARANCE / 2 if wrong else GUIDE_CLEARANCE)
    kinds = [name[: -len("_turns")] for name in data if name.endswith("_turns")]
    apart = {
        kind: _apart(data["time"], result, *(data[f"{kind}_{part}"] for part in PARTS))
        for kind in kinds
    }
    error = apart["limit"][0]
    if quick:  # shorter, so that less may differ
        return Outcome(error, 0.002)
    says = {
        "limit": "Siconos, extrapolated to h = 0",
        "direct": "its example's reference, direct projection, h = 100 µs",
        "combined": "its example's reference, combined projection, h = 100 µs",
    }
    rows = [[
        "against", "angle, RMS [rad]", "speed, RMS [rad/s]", "place / clearance, RMS",
        "turns at 200 ms", "largest place / clearance",
    ]]  # fmt: skip
    rows += [
        [says.get(kind, f"Siconos, h = {kind[1:-2]} µs"), f"{angle:.2g}", f"{speed:.2g}",
         f"{place:.2g}", f"{data[f'{kind}_turns'][-1]:.5f}",
         f"{np.abs(data[f'{kind}_y']).max():.3f}"]
        for kind, (angle, speed, place) in apart.items()
    ]  # fmt: skip
    ours = np.abs(result["tool_position"].values[:, 1]).max() / GUIDE_CLEARANCE
    rows.append(
        ["jointplay", "", "", "", f"{result['q'].values[-1, 0] / (2 * np.pi):.5f}", f"{ours:.3f}"]
    )
    figure, axes = new_figure(3, 1, 8.0, 6.6, sharex=True)
    time = 1e3 * data["time"]
    for panel, part, mine, label in (
        (axes[0, 0], "turns", result["q"].values[:, 0] / (2 * np.pi), "crank turns"),
        (axes[1, 0], "speed", result["v"].values[:, 0], "crank speed [rad/s]"),
        (axes[2, 0], "y", result["tool_position"].values[:, 1] / GUIDE_CLEARANCE,
         "across guide / clearance"),
    ):  # fmt: skip
        panel.plot(1e3 * result.time, mine, color=COLOURS[0], lw=1.3, label="jointplay")
        panel.plot(time, data[f"limit_{part}"], "k--", lw=0.9, label="Siconos, h = 0")
        panel.plot(
            time, data[f"direct_{part}"], ":", color=COLOURS[1], lw=1.1,
            label="Siconos's reference, h = 100 µs",
        )  # fmt: skip
        panel.set_ylabel(label)
    axes[2, 0].set(xlabel="time [ms]")
    axes[0, 0].legend(fontsize=8)
    before = int(np.argmin(np.abs(data["limit_y"]) < 0.9)) - 1
    gain = data["direct_energy"][before] / data["direct_energy"][0] - 1
    stiff = guided(0.2, stiffness=1e10, step=2e-7)
    other = _apart(data["time"], stiff, *(data[f"limit_{part}"] for part in PARTS))
    notes = (
        "Accuracy of the published reference: its step of 0.1 ms is far from the limit of its "
        f"own scheme. Evaluated with the mass matrix, its states gain {100 * gain:.2g} % of "
        f"energy in the first {1e3 * data['time'][before]:g} ms, before any contact, and its "
        "angle then runs ahead, as the table shows. Siconos's own error falls with the step, in "
        "first order, towards the solution found here.",
        "No contact law here is rigid like Siconos's, and the stiffness of the walls matters "
        "more than the remaining difference: with walls ten times as stiff the crank turns "
        f"{stiff['q'].values[-1, 0] / (2 * np.pi):.5f} times, and its angle is {other[0]:.2g} rad "
        "from Siconos's limit. The agreement is of this order, not better.",
        "Small bounces of the light slider differ (rigid walls with Newton's law there; walls "
        "that deform by 6 % of the clearance here), and with them its position across the guide "
        "and the speed in between differ; crank and rod are hardly affected.",
    )
    return Outcome(error, 0.02, rows, figure, notes)


# DyS: the laws once more

DYS_FACTORS = (
    "lankarani-nikravesh", "hunt-crossley-1975", "herbert-mcwhannell", "lee-wang", "flores",
    "qin-lu", "gonthier", "hu-guo",
)  # fmt: skip
"""Laws whose hysteresis factors stand in MBD_system/contact_model/contact_model.py of DyS: as in
`FACTORS`, but for what `DYS_EXPLAINED` says."""

DYS_EXPLAINED = {
    "hu-guo": (0.5, "half of what their balance of energies gives (`HuGuo`)"),
    "goldsmith": (math.pi, "sigma without its pi, before the logarithm and in it"),
    "dubowsky-freudenstein": (math.pi, "sigma without its pi, before the logarithm and in it"),
    "esdu-78035": (math.pi**2, "the same, and once more pi before the logarithm"),
}
"""Where DyS differs: by what factor (before the logarithm, of the depths), and why."""


def _dys_depth(law: str, f: float, contact: jp.contact.ContactProperties) -> float:
    """Depth [m] under f [N/m] by contact_model_cylinder.py of DyS, for a length of 1 m."""
    h = 1.0 / contact.modulus  # its h_i + h_j: (1 - nu^2)/E of both, without pi
    e, gap, r = contact.modulus, contact.clearance, contact.radius
    if law == "johnson":
        return f / (e * math.pi) * (math.log(4 * math.pi * e * gap / f) - 1)
    if law == "esdu-78035":
        return f * math.pi * h * (math.log(4 * gap / (f * h)) + 1)
    return f * h * (math.log(1.0 / (f * r * h)) + 1)  # L^m with L = 1 m


@case(
    origin="engine",
    title="Contact laws in other programs",
    compared="The package's hysteresis factors and cylindrical laws against those in the code of "
    "DyS (L. Skrinjar, J. Slavic, M. Boltezar, github.com/ladisk/DyS, commit 5e6a54d; read, and "
    "its formulas written down in the case), and Carvalho and Martins's factor against the manual "
    "of Exudyn.",
    measures="largest relative difference where both should agree; where DyS differs for a known "
    "reason, difference from the value expected then",
    wrong="Flores's factor with 3/2 for 8/5",
)
def second_opinions(quick: bool = False, wrong: bool = False) -> Outcome:
    laws = jp.contact.NORMAL_LAWS
    rows = Rows("law", "DyS over jointplay|.6g", "why")

    def agree(what: str, ratios: np.ndarray, expected: float = 1.0, why: str = "") -> None:
        rows.add(what, np.mean(ratios), why, errors=(off(one, expected) for one in ratios))

    for name in DYS_FACTORS:
        expected, why = DYS_EXPLAINED.get(name, (1.0, ""))
        asked = np.array((0.3, 0.5, 0.7, 0.9))
        ratios = np.array([expected * FACTORS[name](c) / laws[name].factor(c) for c in asked])
        if wrong and name == "flores":
            ratios *= 15 / 16
        agree(f"`{name}`, factor", ratios, expected, why)
    joint = jp.RevoluteClearance.planar(
        bearing_radius=10e-3, bearing_length=1.0, radial_clearance=2e-4,
        bearing_material=jp.Material(207e9, 0.3), journal_material=jp.Material(207e9, 0.3),
    )  # fmt: skip
    contact = joint.contact_properties(0)
    for name in ("johnson", "goldsmith", "dubowsky-freudenstein", "esdu-78035"):
        law = laws[name]()
        loads = np.array([1e3, 1e4, 1e5])
        theirs = np.array([_dys_depth(name, f, contact) for f in loads])
        ours = np.array([law.depth(f, contact) for f in loads])
        # The slope over ln f is the factor before the logarithm, whatever stands in it.
        factor = np.polyfit(np.log(loads), theirs / loads, 1)[0]
        factor /= np.polyfit(np.log(loads), ours / loads, 1)[0]
        expected, why = DYS_EXPLAINED.get(name, (1.0, ""))
        agree(f"`{name}`, depth before the logarithm", [factor], expected, why)
        rows.add(f"`{name}`, depth at 10 kN/m", f"{theirs[1] / ours[1]:.4g}", why)
    depths = np.array([1e-6, 1e-5, 1e-4])
    law = laws["liu"]()
    ours = [law.function(d, 0.0, 1.0, *law.parameters(contact)) for d in depths]
    theirs = (
        np.pi / 2 * depths * contact.modulus * np.sqrt(depths / (2 * (contact.clearance + depths)))
    )
    agree("`liu`, force", theirs / ours)
    asked = np.array([0.4, 0.6, 0.9])
    manual = 3 / 2 * (1 - asked) * (11 - asked) / (1 + 9 * asked)
    ratios = manual / [laws["carvalho-martins"].factor(c) for c in asked]
    agree("`carvalho-martins`, factor, Exudyn's manual", ratios)
    slow, fast = 1e-3, 1e-2  # DyS: its v0 and v1
    speeds = np.array([0.5e-3, 4e-3, 2e-2])
    ramp = np.clip((speeds - slow) / (fast - slow), 0.0, 1.0)
    law = jp.contact.Ambrosio(0.3, slow, fast)
    ours = np.array([law.function(v, *law.parameters()) for v in speeds])
    rows.errors.append(np.abs(ours - 0.3 * ramp).max())
    grip = 0.3 * np.where(speeds <= fast, 1 - np.exp(-3 * speeds / fast), 0.95)
    law = jp.contact.Threlfall(0.3, fast)
    ours = np.array([law.function(v, *law.parameters()) for v in speeds])
    # Above its v0 DyS takes 0.95, which is 1 - e^-3 in two digits.
    rows.errors.append(np.abs((ours - grip)[speeds <= fast]).max())
    rows.add("`ambrosio`, `threlfall`, coefficients: largest difference",
             f"{np.abs(ours - grip).max():.1g}", "0.95 for 1 - e^-3 there")  # fmt: skip
    return rows.outcome(1e-6)


# MuJoCo and Exudyn: the first impacts of the slider-crank


def _first_impacts(theirs: str, quick: bool, limit: float, **joint: object) -> Outcome:
    """Judged by the largest distance of our journal from theirs over the clearance."""
    data, _ = read("engines_slider_crank.csv")
    clearance = 0.2e-3
    shipped = jp.Scenario.load(jp.shipped("slider_crank.toml")).simulation(
        "0.2 mm", {"integration": {"start": "centred"}}
    )
    mechanism = jp.Mechanism(
        jp.shipped("slider_crank.urdf"),
        {
            "piston_pin": jp.RevoluteClearance.planar(
                radial_clearance=clearance, bearing_radius=0.01, bearing_length=0.02, **joint
            )
        },
        loops=shipped.mechanism.loops, gravity=(0, 0, 0),
    )  # fmt: skip
    simulation = dataclasses.replace(
        shipped, mechanism=mechanism, step=1e-7, integrator="rk4", record_every=100,
        duration=3e-4 if quick else 1e-3,
    )  # fmt: skip
    result = simulation.run()
    crank, rod, slider = result["q"].values.T
    ours = slider - CRANK * np.exp(1j * crank) - ROD * np.exp(1j * (crank + rod))
    at = data["time"] <= result.time[-1] + 1e-12
    time = data["time"][at]
    other = (data[f"{theirs}_x"] + 1j * data[f"{theirs}_y"])[at]
    mine = np.interp(time, result.time, ours.real) + 1j * np.interp(time, result.time, ours.imag)
    apart = np.abs(mine / clearance - other)
    rows = Rows("until [ms]|g", "largest distance of the journals over the clearance|.1e")
    for until in (2e-4, 4e-4, 6e-4, 8e-4, 1e-3):
        if until <= time[-1] + 1e-5:
            rows.add(1e3 * until, apart[time <= until].max())
    return Outcome(float(apart.max()), limit, rows.table)


@case(
    origin="engine",
    title="Exudyn: elastic impacts of the slider-crank",
    compared="The shipped slider-crank with 0.2 mm of clearance, no friction, restitution 1, where "
    "Exudyn's own contact is Hertz's law and nothing else: path of the journal in its bearing over "
    "1 ms (four impacts) against a run of Exudyn with its RK44 at 20 ns (recorded, "
    "`benchmarks/truth/validation/data/engines_slider_crank.csv`). rk4, 0.1 µs.",
    measures="largest distance of the journals over the clearance",
    wrong="restitution 0.99",
)
def exudyn_impacts(quick: bool = False, wrong: bool = False) -> Outcome:
    joint = {"restitution": 0.99 if wrong else 1.0, "friction": jp.contact.Coulomb(0.0, 0.01)}
    return _first_impacts("exudyn", quick, 1e-5, **joint)


@case(
    origin="engine",
    title="MuJoCo: damped impacts of the slider-crank",
    compared="The same with restitution 0.9 and friction 0.01 (ramp to 10 mm/s) against MuJoCo, "
    "which moves the bodies while the contact law is applied from outside; its Euler "
    "method at 20 ns is of first order, which explains the remaining difference. rk4, "
    "0.1 µs.",
    measures="largest distance of the journals over the clearance",
    wrong="friction 0.02",
)
def mujoco_impacts(quick: bool = False, wrong: bool = False) -> Outcome:
    friction = jp.contact.Coulomb(0.02 if wrong else 0.01, 0.01)
    return _first_impacts("mujoco", quick, 1e-4, restitution=0.9, friction=friction)


# Experiments


@case(
    origin="experiment",
    title="Experiment: clearance and speed",
    compared="The abstract of an experiment on a linkage with three clearance joints "
    "(doi 10.1177/16878140211012541): impacts appear in the acceleration, and their amplitude "
    "grows with the size of the clearance and with the driving speed. No numbers of it were "
    "accessible; here the same is checked for the slider-crank, at three clearances and three "
    "speeds. rk4, from the first turn on.",
    measures="number of steps in clearance or speed at which the amplitude does not grow",
    wrong="the speeds are taken in the opposite order",
)
def experiment_findings(quick: bool = False, wrong: bool = False) -> Outcome:
    speeds = (500.0, 1500.0) if quick else (500.0, 1500.0, 4500.0)
    clearances = (0.1e-3, 0.4e-3) if quick else (0.1e-3, 0.2e-3, 0.4e-3)
    turns = 1.0 if quick else 3.0
    found = np.zeros((len(speeds), len(clearances)))
    for i, rpm in enumerate(speeds[::-1] if wrong else speeds):
        for k, clearance in enumerate(clearances):
            joint = pin_bearing(clearance, friction=jp.contact.Coulomb(0.01, 0.01))
            run = prepare(turns, joint, 60 / rpm, step=2e-6, integrator="rk4", record_every=2)
            force = run.finish()["joint_force_peak"].values[:, 0]
            found[i, k] = np.linalg.norm(force, axis=1).max() / SLIDER_MASS
    grows = [*np.diff(found, axis=0).ravel(), *np.diff(found, axis=1).ravel()]
    rows = [["turns a minute", *(f"{1e3 * c:g} mm: largest [m/s²]" for c in clearances)]]
    rows += [
        [f"{rpm:g}", *(f"{a:.3g}" for a in row)] for rpm, row in zip(speeds, found, strict=True)
    ]
    return Outcome(float(np.count_nonzero(np.array(grows) <= 0.0)), 0.0, rows)
