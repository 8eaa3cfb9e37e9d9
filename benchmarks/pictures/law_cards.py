"""Law cards: what each contact law does, alone and at work, a page and a figure for each.

Normal force: one impact of a free body, and the restitutions that impacts have. Friction: a block
whose sliding speed is a slow sinusoid. Film: load, attitude and squeeze against the published
limits. Each law then works in the SCARA's joint B and in the slider-crank's piston pin, beside the
paper's laws (Lankarani-Nikravesh and eq. 21; a film beside the same joint without oil).

Writes docs/law_cards (or --out): README.md, which compares all laws, a page and a figure for each
law, and the data of every run of the mechanisms (law_cards.csv).
"""

import csv
import functools
import io
import warnings
from typing import NamedTuple

import numpy as np
from common import COLOURS, DOCS, Benchmark, Ensemble, ensembles, new_figure, spread
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
from PIL import Image
from scipy.stats import ttest_ind

from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Table

CARDS = DOCS / "law_cards"
TITLES = {"normal": "Normal force", "friction": "Friction", "film": "Film"}
LOOPS = (0.9, 0.5)
RESTITUTIONS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
ROUGH = (0.3, 0.5, 0.9)
"""Nominal restitutions: of the hysteresis loops, of the dots, of the dots with --quick."""
ECCENTRICITIES = np.append(np.linspace(0.01, 0.95, 95), (0.96, 0.97))
PAPER_STYLE = {"color": "0.6", "lw": 1.8}
NEAR_REST = 3.0  # speed to which friction's second panel looks [mm/s]
DPI = 100
SIGNIFICANT = 0.01  # welch's p below which a figure counts as different from the paper's laws'


class Card(NamedTuple):
    """One law's place among the files and tables."""

    family: str
    name: str

    @property
    def stem(self):
        return f"{self.family}_{self.name.replace('-', '_')}"

    @property
    def law(self):
        return REGISTRIES[self.family][self.name]

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


def table(header, rows):
    return Table.of_texts([[str(cell) for cell in row] for row in (header, *rows)]).markdown()


def label(panel, x, y, title=None, small=8):
    panel.set(xlabel=x, ylabel=y)
    panel.legend(frameon=False, fontsize=small)
    if title:
        panel.set_title(title, fontsize=10)


# ---- one law by itself -------------------------------------------------------------------------


@functools.cache
def paper_impact(c_e):
    """That of the paper's law, behind every other."""
    return alone.impact(build(*PAPER), c_e, LOOP_SPEED)


@functools.cache
def paper_sliding():
    """That of eq. 21."""
    return alone.sliding(build("friction", "ambrosio"))


def normal_probe(card, panels, quick):
    """Hysteresis loops and restitutions; returns the page's section."""
    law = build(*card)
    loops, dots = panels
    for c_e, colour, style in zip(LOOPS, COLOURS, ("-", "--"), strict=False):
        own = {"color": colour, "lw": 1.6, "label": f"$c_e$ = {c_e:g}"}
        for hit, look in (
            (paper_impact(c_e), PAPER_STYLE),
            (alone.impact(law, c_e, LOOP_SPEED), own),
        ):
            loops.plot(1e6 * hit.depth, 1e-3 * hit.force, style, **look)
    loops.plot([], [], label="paper's law", **PAPER_STYLE)
    loops.set_xlim(left=0)
    label(loops, "depth [µm]", "normal force [kN]", f"one impact at {LOOP_SPEED:g} m/s")

    asked = np.array(ROUGH if quick else RESTITUTIONS)
    found = np.array([[alone.impact(law, c_e, v).rebound for c_e in asked] for v in SPEEDS])
    fine = np.linspace(0.05, 1.0, 96)
    closed = [law.effective_restitution(c_e) for c_e in fine]
    dots.plot((0, 1), (0, 1), ":", color="black", lw=1, label="as asked")
    if closed[0] is not None:
        dots.plot(fine, closed, color=COLOURS[2], lw=1.4, label="closed form")
    for speed, values, colour, look in zip(
        SPEEDS, found, COLOURS, ({"marker": "o", "ms": 7}, {"marker": "s", "ms": 4}), strict=False
    ):
        words = f"run, {speed:g} m/s"
        dots.plot(asked, values, ls="", mfc="none", color=colour, label=words, **look)
    dots.set(xlim=(0, 1.02), ylim=(0, 1.05))
    label(dots, "nominal restitution $c_e$ [-]", "restitution of an impact [-]", "restitution")

    rows = [
        [f"{c_e:g}", *(f"{v:.3f}" for v in found[:, i]), "-" if exact is None else f"{exact:.3f}"]
        for i, c_e in enumerate(asked)
        for exact in [law.effective_restitution(float(c_e))]
    ]
    header = ["c_e", *(f"run, {speed:g} m/s" for speed in SPEEDS), "closed form"]
    return f"""## Alone

A free body of {alone.MASS:g} kg hits the bore of a planar joint once (C_r = {1e3 * alone.RADIAL:g}
mm, R_i = 10 mm, {1e3 * alone.LENGTH:g} mm long, the paper's steel). Parameters: {parameters(law)}.
Restitution of the impact against the one asked for:

{table(header, rows)}
"""


def friction_probe(card, panels, quick):
    """Friction over speed, whole and near rest; returns the page's section."""
    law = build(*card)
    own, grey = alone.sliding(law), paper_sliding()
    fine = np.linspace(0.0, AMPLITUDE, 1201)
    lasting = alone.steady(law, fine)
    both = 1e3 * np.append(-fine[::-1], fine), np.append(-lasting[::-1], lasting)
    titles = (f"sinusoid of {alone.FREQUENCY:g} Hz", "the same near rest")
    for panel, title in zip(panels, titles, strict=True):
        panel.plot(1e3 * grey[0], grey[1], label="paper's law, eq. 21", **PAPER_STYLE)
        panel.plot(1e3 * own[0], own[1], color=COLOURS[0], lw=1.6, label="this law")
        panel.plot(*both, ":", color=COLOURS[1], lw=1.4, label="at lasting speed")
        label(panel, "sliding speed [mm/s]", "friction / normal force [-]", title)
    panels[1].set_xlim(-NEAR_REST, NEAR_REST)

    at = np.flatnonzero((own[0][:-1] < 0.0) & (own[0][1:] >= 0.0))[0]
    fraction = own[0][at] / (own[0][at] - own[0][at + 1])
    turning = own[1][at] + fraction * (own[1][at + 1] - own[1][at])
    top = own[1][np.argmax(own[0])]
    rows = [
        ["largest", f"{np.abs(own[1]).max():.4f}"],
        ["as the speed passes through zero upwards", f"{turning:.4f}"],
        [f"at {1e3 * AMPLITUDE:g} mm/s", f"{top:.4f}"],
        [f"at a lasting {1e3 * AMPLITUDE:g} mm/s", f"{lasting[-1]:.4f}"],
    ]
    return f"""## Alone

A block of {alone.BLOCK:g} kg is drawn along a wall on which it lies by its weight; its speed is a
sinusoid of {1e3 * AMPLITUDE:g} mm/s and {alone.FREQUENCY:g} Hz. Parameters: {parameters(law)}.
Friction against the speed, over the normal force:

{table(["", "friction / normal force"], rows)}
"""


def film_probe(card, panels, quick):
    """Load, attitude and squeeze over eccentricity; returns the page's section."""
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
    found = []
    for (word, law), colour, style in zip(laws.items(), COLOURS, ("-", "--"), strict=False):
        turning = alone.film_forces(law, properties, e, spin=1.0) / unit
        pressed = -alone.film_forces(law, properties, e, rate=1.0)[0] / unit
        number = 1 / (power * np.pi * np.hypot(*turning))
        found.append((number, np.degrees(np.arctan2(turning[1], -turning[0])), pressed))
        for panel, values in zip(panels, found[-1], strict=True):
            panel.plot(e, values, style, color=colour, lw=1.6, label=word)
    theory = "Ocvirk" if short else "half Sommerfeld"
    ratio, scale = ("S (L/D)²", "µ L³ R/c²") if short else ("S", "µ L R³/c²")
    load, attitude, squeeze = panels
    for panel, values, marker, word in (
        (load, published[0], "o", theory),
        (attitude, published[1], "o", theory),
        (squeeze, half, "o", "Reynolds, half the film"),
        (squeeze, entire, "s", "Reynolds, all of it"),
    ):
        some, look = slice(4, None, 8), {"ls": "", "color": "black", "mfc": "none", "ms": 4}
        panel.plot(e[some], values[some], marker=marker, label=word, **look)
    for panel, up, title in (
        (load, f"Sommerfeld number {ratio} [-]", "load, steady turning"),
        (attitude, "attitude angle [°]", "attitude, steady turning"),
        (squeeze, f"force / ({scale} dε/dt) [-]", "squeeze"),
    ):
        label(panel, "eccentricity ratio [-]", up, title, small=7)
        panel.set_xlim(0, 1)
        if panel is not attitude:
            panel.set_yscale("log")
    attitude.set_ylim(0, 95)

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
    rows = [[format(values[i], form) for values, form in columns] for i in shown]
    squeezed = pressed / half
    worst = int(np.argmax(np.abs(squeezed - 1)))
    rotation = np.abs(published[0] / number - 1).max()
    header = ["ε", ratio, theory, "attitude [°]", theory]
    header += ["squeeze", "Reynolds, half", "Reynolds, all"]
    c, radius, length, _ = properties
    kind = "a short" if short else "a long"
    slenderness = length / (2 * radius)
    return f"""## Alone

A journal of R = {1e3 * radius:g} mm, L = {1e3 * length:g} mm (L/D = {slenderness:.3g}),
c = {1e6 * c:g} µm. S is the Sommerfeld number µ n L D/W (R/c)², n in turns per second; squeeze is
force over {scale} dε/dt at dε/dt > 0. Reynolds: the pressure of {kind} bearing, integrated;
only where it is positive (half), and everywhere (all).

{table(header, rows)}

From ε = {e[0]:g} to {e[-1]:g} the load of steady turning is within {100 * rotation:.1g} % of
{theory}'s, and the squeeze force of this law between {squeezed.min():.3f} and
{squeezed.max():.3f} times Reynolds' half film, furthest from it at ε = {e[worst]:.2f}.
"""


PROBES = {"normal": normal_probe, "friction": friction_probe, "film": film_probe}


# ---- in mechanisms -----------------------------------------------------------------------------


def draw_histories(card, found, panels, quick):
    """Histories of the first run: of this law, and of what it is compared to behind it."""
    word = "the same joint, dry" if card.family == "film" else "paper's laws"
    turn = "crank angle, last turn [°]", 360.0
    for panel, (mechanism, key, unit, (across, end), up, title) in zip(panels, (
        (SCARA, "history", 1.0, ("time [s]", QUICK if quick else 3.0), "joint force [N]",
         "SCARA, joint B"),
        (CRANK, "history", 1e-3, turn, "slider acceleration [10³ m/s²]", "slider-crank"),
        (CRANK, "eccentricity", 1.0, turn, "eccentricity ratio [-]", "slider-crank"),
    ), strict=False):  # fmt: skip
        trial, other = card.trial(mechanism, quick), card.beside(mechanism, quick)
        x = np.linspace(0, end, found[trial][key].shape[1])
        if other != trial:
            panel.plot(x, unit * found[other][key][0], label=word, **PAPER_STYLE)
        own = "this law" if other != trial else word
        panel.plot(x, unit * found[trial][key][0], color=COLOURS[0], lw=0.9, label=own)
        label(panel, across, up, title)
        panel.set_xlim(0, end)
        if mechanism == CRANK:
            panel.set_xticks(range(0, 361, 90))
        if "acceleration" not in up:
            panel.set_ylim(bottom=0)


def differs(values, others):
    """Whether two ensembles have different means (Welch)."""
    if np.ptp(values) == 0.0 and np.ptp(others) == 0.0:
        return bool(values[0] != others[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # nearly equal values
        return bool(ttest_ind(values, others, equal_var=False).pvalue < SIGNIFICANT)


def figures_of(ensemble, mechanism, beside=None):
    """Cells of a table, bold where they differ from those of `beside`."""
    cells = []
    for key in FIGURES[mechanism]:
        text = spread(ensemble[key])
        # A step that is too long can change a peak more than a law does.
        doubtful = key.startswith("peak_force") and ensemble["audit_warnings"].any()
        comparable = beside is not None and not doubtful
        if comparable and key.startswith("peak_force"):
            comparable = not beside["audit_warnings"].any()
        bold = comparable and differs(ensemble[key], beside[key])
        cells.append((f"**{text}**" if bold else text) + " †" * bool(doubtful))
    return cells


def first_warnings(ensemble, kind="law_warnings"):
    return [line for line in str(ensemble[kind][0]).split("\n") if line]


def work_section(card, found, quick):
    """Both mechanisms' tables, parameters and warnings."""
    parts = ["## At work"]
    oily = card.family == "film"
    for mechanism in FIGURES:
        trial, other = card.trial(mechanism, quick), card.beside(mechanism, quick)
        ensemble = found[trial]
        rows = [["this law", *figures_of(ensemble, mechanism, found[other])]]
        if other != trial:
            word = "the same joint, dry" if oily else "paper's laws"
            rows.append([word, *figures_of(found[other], mechanism)])
        law = Trial(mechanism, *card, quick).law()
        joint = trial.bearing()
        place = "joint B" if mechanism == SCARA else "piston pin"
        sizes = (
            f"C_r = {1e3 * joint.cr:g} mm, R_i = {1e3 * joint.ri:g} mm, L_j = {1e3 * joint.lj:g} mm"
        )
        if oily:
            oil, celsius = OIL[mechanism]
            sizes += f", L/D = {joint.lj / (2 * joint.rj):.2f}, {oil} at {celsius:g} °C"
        parts.append(
            f"{mechanism}, {place} ({sizes}); parameters: {parameters(law)}.\n\n"
            + table(["", *FIGURES[mechanism].values()], rows)
        )
        residual = 100 * ensemble["relative_energy_residual"].max()
        parts.append(f"Energy balance within {residual:.2g} % of the energy exchanged.")
        for kind, words, none in (
            ("law_warnings", "Warnings of the law's range, first run", "No warning of its range."),
            ("other_warnings", "The audit's other warnings, †", ""),
        ):
            lines = first_warnings(ensemble, kind)
            parts.append(f"{words}:\n\n" + "\n".join(f"- {x}" for x in lines) if lines else none)
    return "\n\n".join(filter(None, parts)) + "\n"


def write_card(card, found, folder, quick):
    figure, axes = new_figure(2, *((3, 11.0) if card.family == "film" else (2, 8.5)), 6.2)
    by_itself = PROBES[card.family](card, axes[0], quick)
    draw_histories(card, found, axes[1], quick)
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=DPI)
    # A palette instead of 24 bits: a third of the size, for the same picture.
    small = Image.open(drawn).convert("RGB").quantize(256, dither=Image.Dither.NONE)
    small.save(folder / f"{card.stem}.png", optimize=True)
    law = card.law
    at_work = work_section(card, found, quick)
    more = "bearings.md" if card.family == "film" else "theory.md"
    page = f"""# {TITLES[card.family]}: `{card.name}`

`jointplay.physics.contact.{law.__name__}`; [all laws](README.md), [laws.md](../laws.md),
[{more}](../{more}).

$${law.formula}$$

- **Reference:** {law.reference}.
- **Valid for:** {law.validity}.
- **Cost:** [law_cost](../../benchmarks/README.md#cost) measures it.

![{card.name}]({card.stem}.png)

{by_itself}
{at_work}"""
    (folder / f"{card.stem}.md").write_text(page, encoding="utf-8")


# ---- all laws ----------------------------------------------------------------------------------


def index(cards, found, runs, quick):
    """README.md: every law with its card, and the comparison."""
    doubtful = any(ensemble["audit_warnings"].any() for ensemble in found.values())
    never = "" if doubtful else " It never does here."
    command = "python benchmarks law_cards --force" + (" --quick" if quick else "")
    level = f"{100 * SIGNIFICANT:g}"
    cycle = f"its first {QUICK:g} s" if quick else "one cycle of 3 s"
    turns = Trial(CRANK, *PAPER, quick).turns
    parts = [
        f"""# Law cards

Written by `{command}`; not edited by hand. A card has a law's formula, reference
and validity, what it does alone, and what it does in two mechanisms beside the paper's laws.

- **SCARA**: joint B with C_r = C_a = 0.2 mm, weight balanced, {cycle}, step 10 µs;
  restitution 0.9, friction 0.1. Figures are judged from 0.15 s on, when the journal has fallen.
- **Slider-crank**: 5000 rpm, planar piston pin with C_r = 0.5 mm, {turns} turns, step 1 µs;
  restitution 0.9, friction 0.01. Figures are judged from the second turn on.
- **The paper's laws**: `lankarani-nikravesh` and `ambrosio`. A law of normal force works with the
  latter, a law of friction with the former, a film with both where the journal touches.
- **Parameters** are the defaults, and on the card. Of friction laws in the slider-crank,
  coefficients and bristle stiffness are a tenth of the defaults and speeds ten times as high, as
  slider_crank.toml has it for eq. 21. `hunt-crossley` has p = 1, for with its defaults it is
  `lankarani-nikravesh`. `kelvin-voigt` has one damping everywhere, `anagnostopoulos` the effective
  mass of the place.
- **Films** stand in bearings of a slenderness they are made for, beside the same joints without
  oil. End walls stay dry.
- **Steel**: the paper's, with a density of 7800 kg/m³, so that fast approaches are warned of; no
  yield strength, so that pressures are not.
- **Figures** are mean ± standard deviation of {runs} runs whose journals start displaced.
  **Bold** ones differ from those of the paper's laws, or of the dry joint, by more than chance
  (Welch's test at {level} %: of a hundred equal ones, one is bold). Warnings: how many
  of the law's range the first run raised; the card has them.
- **†**: the audit warns of more than the law's range, the card says of what. Such peak forces are
  not compared.{never}
"""
    ]
    for family, title in TITLES.items():
        chosen = [card for card in cards if card.family == family]
        if not chosen:
            continue
        rows = [
            [f"[`{card.name}`]({card.stem}.md)", card.law.reference, card.law.validity]
            for card in chosen
        ]
        parts.append(f"## {title}\n")
        parts.append(table(["law", "reference", "valid for"], rows) + "\n")
        for mechanism, labels in FIGURES.items():
            rows = []
            for card in chosen:
                trial, other = card.trial(mechanism, quick), card.beside(mechanism, quick)
                beside = found[other]
                cells = figures_of(found[trial], mechanism, beside)
                rows.append([card.name, *cells, len(first_warnings(found[trial]))])
                if family == "film":
                    dry = len(first_warnings(beside))
                    rows.append(["the same, dry", *figures_of(beside, mechanism), dry])
            parts.append(f"{mechanism}, {title.lower()}:\n")
            parts.append(table([title.lower(), *labels.values(), "warnings"], rows) + "\n")
    return "\n".join(parts)


def write_data(path, found):
    """Every run of the mechanisms, a row each."""
    keys = sorted({key for labels in FIGURES.values() for key in labels})
    keys += ["relative_energy_residual", "audit_warnings"]
    rows = [["mechanism", "family", "law", "seed", *keys]]
    for trial, ensemble in found.items():
        for i, seed in enumerate(ensemble["seed"]):
            place = (trial.mechanism, trial.family, trial.name, str(seed))
            cells = (f"{ensemble[key][i]:.6g}" if key in ensemble else "" for key in keys)
            rows.append([*place, *cells])
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)


def run_all(cards, args) -> dict[Trial, Ensemble]:
    trials = []
    for mechanism in FIGURES:
        trials.append(Trial(mechanism, *PAPER, args.quick))
        for card in cards:
            trials += card.trial(mechanism, args.quick), card.beside(mechanism, args.quick)
    trials = list(dict.fromkeys(trials))
    return dict(zip(trials, ensembles(trials, args.runs, args.jobs, measure), strict=True))


def main():
    every = {
        f"{family}:{name}": Card(family, name)
        for family, laws in REGISTRIES.items()
        for name in laws
    }
    benchmark = Benchmark("law_cards", __doc__, runs=4, docs=CARDS)
    benchmark.parser.add_argument(
        "--law",
        action="append",
        choices=list(every),
        metavar="FAMILY:NAME",
        help="only this law, such as film:short-bearing; can be repeated (default: all laws; "
        "--quick: one of each family)",
    )
    args = benchmark.parse()
    chosen = args.law or every
    if args.quick and not args.law:  # the first of each family
        chosen = {key.partition(":")[0]: key for key in reversed(every)}.values()
    cards = [every[key] for key in dict.fromkeys(chosen)]
    found = run_all(cards, args)
    write_data(benchmark.path("csv"), found)
    for card in ProgressBar(cards, unit="cards"):
        write_card(card, found, benchmark.folder, args.quick)
    text = index(cards, found, args.runs, args.quick)
    (benchmark.folder / "README.md").write_text(text, encoding="utf-8")
    print(f"written: {benchmark.folder / 'README.md'}, {len(cards)} cards")
