"""The law cards, written from docs/data/law_cards.json: a page and a picture for each law."""

import io
import json
import warnings
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import ttest_ind

from jointplay.base.tables import Table
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS
from jointplay.simulation.result.certificate import plus_minus

DATA = Path(__file__).parents[1] / "data" / "law_cards.json"
REGISTRIES = {"normal": NORMAL_LAWS, "friction": FRICTION_LAWS, "film": FILM_LAWS}
TITLES = {"normal": "Normal force", "friction": "Friction", "film": "Film"}
PAPER = ("normal", "lankarani-nikravesh")
SIGNIFICANT = 0.01  # Welch's p below which a figure counts as different from the paper's laws'
LOOKS = {
    "own": {"color": "#0072B2", "lw": 1.6},
    "second": {"color": "#D55E00", "lw": 1.6, "ls": "--"},
    "exact": {"color": "#D55E00", "lw": 1.4, "ls": ":"},
    "asked": {"color": "black", "lw": 1.0, "ls": ":"},
    "dots": {"color": "black", "ls": "", "marker": "o", "ms": 5, "mfc": "none"},
    "squares": {"color": "#009E73", "ls": "", "marker": "s", "ms": 4, "mfc": "none"},
}
"""Styles of a line, by what it is."""
BEHIND = {"color": "0.6", "lw": 1.8}


def stem(family, name):
    return f"{family}_{name.replace('-', '_')}"


def table(rows):
    return Table.of_texts([[str(cell) for cell in row] for row in rows]).markdown()


def spread(values):
    """Mean ± standard deviation over the runs; the mean alone if they all agree."""
    error = 0.0 if np.ptp(values) == 0.0 else float(np.std(values, ddof=1))
    return plus_minus(float(np.mean(values)), error)


def differs(values, others):
    """Whether two ensembles have different means (Welch)."""
    if np.ptp(values) == 0.0 and np.ptp(others) == 0.0:
        return bool(values[0] != others[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # nearly equal values
        return bool(ttest_ind(values, others, equal_var=False).pvalue < SIGNIFICANT)


class Cards:
    """All pages and pictures of a data file."""

    def __init__(self, path=DATA):
        self.data = json.loads(Path(path).read_text(encoding="utf-8"))
        self.laws = {(one["family"], one["name"]): one for one in self.data["laws"]}
        self.trials = {
            (one["mechanism"], one["family"], one["law"]): one for one in self.data["trials"]
        }

    def trial(self, mechanism, family, name):
        """That of a law, and that with which it is compared."""
        itself = PAPER if (family, name) == ("friction", "ambrosio") else (family, name)
        other = ("dry", name) if family == "film" else PAPER
        return self.trials[mechanism, *itself], self.trials[mechanism, *other]

    def cells(self, trial, beside=None):
        """Cells of a table, bold where they differ from those of `beside`."""
        found = []
        for key in self.data["figures"][trial["mechanism"]]:
            values, text = trial["figures"][key], spread(trial["figures"][key])
            # A step that is too long can change a peak more than a law does.
            peak = key.startswith("peak_force")
            doubtful = peak and trial["doubtful"]
            comparable = beside is not None and not (peak and (doubtful or beside["doubtful"]))
            bold = comparable and differs(values, beside["figures"][key])
            found.append((f"**{text}**" if bold else text) + " †" * doubtful)
        return found

    def picture(self, family, name):
        """PNG of the law alone, the paper's law behind it."""
        panels = self.laws[family, name]["panels"]
        behind = {"normal": PAPER, "friction": ("friction", "ambrosio")}.get(family)
        grey = self.laws[behind]["panels"] if behind in self.laws else []
        figure = Figure(figsize=(11.0 if family == "film" else 8.5, 3.3), layout="constrained")
        for i, panel in enumerate(panels):
            axes = figure.add_subplot(1, len(panels), i + 1)
            axes.grid(color="0.9", lw=0.6)
            axes.spines[["top", "right"]].set_visible(False)
            label = "paper's law"
            for line in grey[i]["lines"] if grey else ():
                if line["look"] in ("own", "second"):
                    axes.plot(line["x"], line["y"], label=label, **BEHIND)
                    label = None
            for line in panel["lines"]:
                axes.plot(line["x"], line["y"], label=line["label"], **LOOKS[line["look"]])
            axes.set(xlabel=panel["x"], ylabel=panel["y"])
            axes.set_title(panel["title"], fontsize=10)
            if panel.get("log"):
                axes.set_yscale("log")
            for key in ("xlim", "ylim"):
                if key in panel:
                    axes.set(**{key: panel[key]})
            axes.legend(frameon=False, fontsize=7)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=100)
        return drawn.getvalue()

    def work(self, family, name):
        """Both mechanisms' tables, parameters and warnings."""
        parts = ["## In mechanisms"]
        for mechanism, labels in self.data["figures"].items():
            trial, other = self.trial(mechanism, family, name)
            rows = [["", *labels.values()], ["this law", *self.cells(trial, other)]]
            if other is not trial:
                word = "the same joint, dry" if family == "film" else "paper's laws"
                rows.append([word, *self.cells(other)])
            parts.append(f"{mechanism}, {self.laws[family, name]['work'][mechanism]}")
            parts.append(table(rows))
            residual = 100 * max(trial["figures"]["relative_energy_residual"])
            parts.append(f"Energy balance within {residual:.2g} % of the energy exchanged.")
            if not trial["law_warnings"]:
                parts.append("No warning of the law's range.")
            for kind, words in (
                ("law_warnings", "Warnings of the law's range, first run"),
                ("other_warnings", "The audit's other warnings, †"),
            ):
                lines = "\n".join(f"- {line}" for line in trial[kind])
                parts.append(f"{words}:\n\n{lines}" if lines else "")
        return "\n\n".join(filter(None, parts)) + "\n"

    def page(self, family, name):
        law, alone = REGISTRIES[family][name], self.laws[family, name]
        more = "bearings" if family == "film" else "theory"
        return f"""# {TITLES[family]}: `{name}`

`jointplay.physics.contact.{law.__name__}`; [all laws](README.md), [Laws](../laws.md),
[{more.capitalize()}](../{more}.md).

$$
{law.formula}
$$

- **Reference:** {law.reference}.
- **Valid for:** {law.validity}.
- **Cost:** [law_cost](../reference/benchmarks.md#cost) measures it.

![{name}]({stem(family, name)}.png)

## Alone

{alone["setup"]}

{table(alone["table"])}

{alone.get("note", "")}

{self.work(family, name)}"""

    def index(self):
        """Every law with its card, and the comparison."""
        data = self.data
        doubtful = any(trial["doubtful"] for trial in data["trials"])
        parts = [
            f"""# Law cards

The cards show each contact law alone, and in two mechanisms compared with the paper's laws. They
were computed by `python benchmarks laws`; [the data](../data/law_cards.json) has every run.

- **SCARA**: joint B with C_r = C_a = 0.2 mm, weight balanced, {data["cycle"]}, step 10 µs;
  restitution 0.9, friction 0.1. Figures count from 0.15 s on, when the journal has fallen.
- **Slider-crank**: 5000 rpm, planar piston pin with C_r = 0.5 mm, {data["turns"]} turns, step
  1 µs; restitution 0.9, friction 0.01. Figures count from the second turn on.
- **The paper's laws** are `lankarani-nikravesh` and `ambrosio`. A normal-force law is combined with
  the latter, a friction law with the former, a film with both where the journal touches.
- **Parameters** are the defaults, and stand on the card. For friction laws in the slider-crank,
  coefficients and bristle stiffness are a tenth of the defaults and speeds ten times as high, as in
  slider_crank.toml for eq. 21. `hunt-crossley` has p = 1, because with its defaults it is
  `lankarani-nikravesh`. `kelvin-voigt` has the same damping everywhere, `anagnostopoulos` the local
  effective mass.
- **Films** are in bearings of a slenderness that they are valid for, and compared with the same
  joints without oil. End walls stay dry.
- **Steel** is the paper's, with a density of 7800 kg/m³, so fast approaches cause a warning; it has
  no yield strength, so pressures cause none.
- **Figures** are mean ± standard deviation of {data["runs"]} runs whose journals start displaced.
  **Bold** ones differ from those of the paper's laws, or of the dry joint, by more than chance
  (Welch's test at {100 * SIGNIFICANT:g} %: one of a hundred equal ones is bold). The column of
  warnings counts those of the law's range in the first run; the card has them.
- **†** means that the audit has other warnings, which are on the card. Such peak forces are not
  compared.{"" if doubtful else " There are none here."}
"""
        ]
        for family, title in TITLES.items():
            chosen = [name for kind, name in self.laws if kind == family]
            if not chosen:
                continue
            rows = [["law", "reference", "valid for"]]
            for name in chosen:
                law = REGISTRIES[family][name]
                link = f"[`{name}`]({stem(family, name)}.md)"
                rows.append([link, law.reference, law.validity])
            parts += [f"## {title}\n", table(rows) + "\n"]
            for mechanism, labels in data["figures"].items():
                rows = [[title.lower(), *labels.values(), "warnings"]]
                for name in chosen:
                    trial, other = self.trial(mechanism, family, name)
                    rows.append([name, *self.cells(trial, other), len(trial["law_warnings"])])
                    if family == "film":
                        met = len(other["law_warnings"])
                        rows.append(["the same, dry", *self.cells(other), met])
                parts += [f"{mechanism}, {title.lower()}:\n", table(rows) + "\n"]
        return "\n".join(parts)

    def files(self):
        """Name and content (text or PNG) of each file."""
        yield "README.md", self.index()
        for family, name in self.laws:
            yield f"{stem(family, name)}.md", self.page(family, name)
            yield f"{stem(family, name)}.png", self.picture(family, name)
