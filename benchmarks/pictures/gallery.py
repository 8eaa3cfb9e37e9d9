"""The gallery of the documentation: runs every mechanism, draws it, and writes its numbers.

Pictures and `numbers.csv` go to docs/gallery; the table of its page is written from the numbers.
"""

from __future__ import annotations

import csv
import io
import re
import warnings

import numpy as np
from common import DOCS, command

import jointplay as jp
from jointplay import analysis
from jointplay.base.tables import Table
from jointplay.show.picture import picture

FOLDER = DOCS / "gallery"
SHIPPED = ("scara", "slider_crank", "four_bar", "delta", "three_rrr")
"""Scenarios that lie in the package; the others are in the gallery's own folder."""
QUICK = "gate"  # the mechanism of a quick run
VIEWS = {
    "oil_pendulum": (-65.0, 18.0),
    "spline": (-60.0, 22.0),
    "ball_pendulum": (-60.0, 15.0),
    "jansen": (-90.0, 80.0),
    "delta": (-70.0, 12.0),
    "three_rrr": (-90.0, 80.0),
}
"""Directions from which some are drawn: azimuth and elevation [deg]."""
FIELDS = [
    "mechanism",
    "case",
    "tool_peak_mm",
    "tool_rms_mm",
    "force_peak_N",
    "contacts",
    "residual",
]


def names() -> list[str]:
    return [*SHIPPED, *sorted(path.stem for path in FOLDER.glob("*.toml"))]


def scenario(name: str) -> jp.Scenario:
    shipped = name in SHIPPED
    return jp.Scenario.load(f"jointplay:{name}.toml" if shipped else FOLDER / f"{name}.toml")


def numbers(name: str) -> list[dict[str, str]]:
    """Run all cases; a row for each with play."""
    warnings.simplefilter("ignore", RuntimeWarning)
    given = scenario(name)
    results = {case: given.simulation(case).run() for case in given.cases}
    rows = []
    for case, result in results.items():
        if not analysis.has_play(result):
            continue
        start = result.judge_from
        error = analysis.deviation(result)
        sizes = np.linalg.norm(error.sel(time=error["time"] >= start).values, axis=1)
        force, count = float("nan"), 0
        if result.joints:
            peaks = result["joint_force_peak"].values[result.time >= start]
            force = float(f"{np.linalg.norm(peaks, axis=2).max():.3g}")
            count = sum(len(one.start) for one in analysis.contacts(result, start))
        residual = f"{result.audit.relative_energy_residual:.1e}"
        peak, rms = (f"{1e3 * s:.3g}" for s in (sizes.max(), np.sqrt((sizes**2).mean())))
        if sizes.max() < 1e-12:  # a tool frame that does not move
            peak = rms = "-"
        row = (name, case, peak, rms, f"{force:g}", str(count), residual)
        rows.append(dict(zip(FIELDS, row, strict=True)))
    return rows


def draw(name: str) -> None:
    """The mechanism where its first case with play starts, as a small PNG."""
    from PIL import Image

    given = scenario(name)
    runs = [given.ready_run(case) for case in given.cases]
    shown = next((r for r in runs if r.mechanism.clearance or r.mechanism.gears), runs[0])
    figure = picture(shown.mechanism, shown.workspace.q, title="", view=VIEWS.get(name))
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=80, bbox_inches="tight")  # labels of axes too
    image = Image.open(drawn).convert("RGB").quantize(96, dither=Image.Dither.NONE)
    image.save(FOLDER / f"{name}.png", optimize=True)


def table(rows: list[dict[str, str]]) -> str:
    head = ("case", "tool error, largest / RMS [mm]", "largest force [N]", "contacts")
    lines = [("mechanism", *head)]
    for row in rows:
        force = row["force_peak_N"].replace("nan", "-")
        error = f"{row['tool_peak_mm']} / {row['tool_rms_mm']}"
        lines.append((row["mechanism"], row["case"], error, force, row["contacts"]))
    return Table.of_texts(lines).markdown()


def put(mark: str, table: str) -> None:
    """Write a table into the page, after its mark."""
    page = FOLDER / "README.md"
    after = rf"(<!-- {mark} -->\n)\n?(?:\|.*\n)*"
    text = re.sub(after, lambda m: f"{m[1]}\n{table}\n", page.read_text(encoding="utf-8"))
    page.write_text(text, encoding="utf-8")


def main() -> None:
    own = {"pictures": (False, "draw only"), "jobs": (2, "processes")}
    parser = command(__doc__, "one mechanism; nothing is written", **own)
    parser.add_argument("--only", nargs="*", help="mechanisms")
    options = parser.parse_args()
    if options.quick:
        print(table(numbers(QUICK)))
        return
    chosen = options.only or names()
    for name in chosen:
        draw(name)
    if options.pictures:
        return
    kept = FOLDER / "numbers.csv"
    rows = {}
    if kept.exists():
        with kept.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                rows.setdefault(row["mechanism"], []).append(row)
    study = jp.Study({name: name for name in chosen}, numbers)
    for name, found in study.outcomes(options.jobs):
        rows[name] = found
        print(table(found).splitlines()[2:], flush=True)
    every = [row for name in names() for row in rows.get(name, [])]
    with kept.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        writer.writerows(every)
    put("numbers", table(every))
