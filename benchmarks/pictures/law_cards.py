"""Law cards: what each contact law does, alone and at work.

Normal force: one impact of a free body, and the restitutions that impacts have. Friction: a block
whose sliding speed is a slow sinusoid. Film: load, attitude and squeeze against the published
limits. Each law then works in the SCARA's joint B and in the slider-crank's piston pin, beside the
paper's laws (Lankarani-Nikravesh and eq. 21; a film beside the same joint without oil).

Writes docs/data/law_cards.json (or into --out), from which the documentation's build makes a page
and a picture for each law, and one that compares all.
"""

import json
from typing import NamedTuple

import numpy as np
from common import DOCS, Ensemble, command, ensembles, folder_of
from pictures import law_probes as alone
from pictures.law_mechanisms import (
    CRANK,
    DRY,
    FIGURES,
    OIL,
    PAPER,
    QUICK,
    SCARA,
    Trial,
    measure,
    viscosity,
)
from pictures.law_probes import AMPLITUDE, LOOP_SPEED, REGISTRIES, SPEEDS, build

from jointplay.base.processes import cores
from jointplay.base.progress import ProgressBar

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
    hits = [alone.impact(law, c_e, LOOP_SPEED) for c_e in LOOPS]
    loops = [
        curve(look, f"$c_e$ = {c_e:g}", 1e6 * hit.depth, 1e-3 * hit.force)
        for look, c_e, hit in zip(("own", "second"), LOOPS, hits, strict=True)
    ]
    asked = np.array(ROUGH if quick else RESTITUTIONS)
    found = np.array([[alone.impact(law, c_e, v).rebound for c_e in asked] for v in SPEEDS])
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
        "setup": f"A free body of {alone.MASS:g} kg hits the bore of a planar joint once (C_r = "
        f"{1e3 * alone.RADIAL:g} mm, R_i = 10 mm, {1e3 * alone.LENGTH:g} mm long, the paper's "
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
    speed, friction = alone.sliding(law)
    fine = np.linspace(0.0, AMPLITUDE, 1201)
    lasting = alone.steady(law, fine)
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
        "setup": f"A block of {alone.BLOCK:g} kg is drawn along a wall on which it lies by its "
        f"weight; its speed is a sinusoid of {1e3 * AMPLITUDE:g} mm/s and {alone.FREQUENCY:g} Hz. "
        f"Parameters: {parameters(law)}. Friction against the speed, over the normal force:",
        "table": [
            ["", "friction / normal force"],
            ["largest", f"{np.abs(friction).max():.4f}"],
            ["as the speed passes through zero upwards", f"{turning:.4f}"],
            [f"at {1e3 * AMPLITUDE:g} mm/s", f"{friction[np.argmax(speed)]:.4f}"],
            [f"at a lasting {1e3 * AMPLITUDE:g} mm/s", f"{lasting[-1]:.4f}"],
        ],
        "panels": [
            panel(f"sinusoid of {alone.FREQUENCY:g} Hz", *axes, lines),
            panel("the same near rest", *axes, lines, xlim=[-NEAR_REST, NEAR_REST]),
        ],
    }


def film_probe(card, quick):
    """Load, attitude and squeeze over eccentricity."""
    properties, e = alone.FILM[card.name], ECCENTRICITIES
    oil = viscosity(CRANK)
    short = card.name == "short-bearing"
    laws = {"this law": build(*card, viscosity=oil)}
    if short:
        laws = {
            f"this law, {word}": build(*card, viscosity=oil, cavitation=word)
            for word in ("gumbel", "sommerfeld")
        }
    unit = alone.film_unit(laws[next(iter(laws))], properties)
    power = 4.0 if short else 1.0  # S (L/D)^2 of the short bearing, S of the long one
    size, angle = alone.published_rotation(card.name, e)
    published = 1 / (power * np.pi * size), np.degrees(angle)
    half, entire = alone.published_squeeze(card.name, e)
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
        turning = alone.film_forces(law, properties, e, spin=1.0) / unit
        pressed = -alone.film_forces(law, properties, e, rate=1.0)[0] / unit
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
        "docs/data; --quick: results/benchmarks/law_cards",
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
    path = folder_of(args, "law_cards", DOCS / "data") / "law_cards.json"
    write(path, laws, trials, args.runs, args.quick)
    print(f"written: {path}, {len(cards)} laws")
