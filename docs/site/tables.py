"""Tables of docs/validation.md, docs/peers.md and docs/robots.md, from what is in docs/data."""

import csv
import json
from pathlib import Path

from jointplay.base.tables import Table

DOCS = Path(__file__).parents[1]
HEADS = {
    "theory": "Theory",
    "impacts": "Impacts",
    "oil": "Oil and wear",
    "numerics": "Numerics",
    "literature": "Literature",
    "outside": "Other codes",
    "public": "Public benchmarks",
    "reproducibility": "Reproducibility",
}
"""Sections of the validation, in the order of the page."""


def read(name):
    return json.loads((DOCS / "data" / f"{name}.json").read_text(encoding="utf-8"))


def _verdict(case):
    return "passes" if case["passed"] else "**fails**"


def _anchor(title):
    kept = "".join(c for c in title.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def _summary(data):
    cases = data["cases"]
    passed = sum(case["passed"] for case in cases)
    seconds = sum(case["seconds"] for case in cases)
    rows = [["case", "origin", "error", "limit", ""]]
    for case in cases:
        link = f"[{case['title']}](#{_anchor(case['title'])})"
        error, limit = f"{case['error']:.2g}", f"{case['limit']:.2g}"
        rows.append([link, case["origin"], error, limit, _verdict(case)])
    machine = ", ".join(f"{name} {text}" for name, text in data["machine"].items())
    said = f"{passed} of {len(cases)} cases pass, in {seconds:.0f} s ({machine})."
    return f"{said}\n\n{Table.of_texts(rows).markdown()}"


def _case(case):
    parts = [
        f"### {case['title']}",
        case["compared"],
        f"- **Error {case['error']:.3g}**: {case['measures']}. Limit {case['limit']:.3g}: "
        f"{_verdict(case)} ({case['seconds']:.0f} s).\n- Fails with: {case['wrong']}.",
    ]
    if case["table"]:
        parts.append(Table.of_texts(case["table"]).markdown())
    parts += case["notes"]
    if case["figure"]:
        parts.append(f"![{case['title']}](images/validation/{case['name']}.png)")
    return "\n\n".join(parts)


def validation(data=None):
    """What the markers of docs/validation.md stand for."""
    data = data or read("validation")
    parts = []
    for section, head in HEADS.items():
        cases = [case for case in data["cases"] if case["section"] == section]
        parts += [f"## {head}", *map(_case, cases)] if cases else []
    absent = (f"- {paper['name']}: {paper['found']}." for paper in data["not_compared"])
    return {
        "summary": _summary(data),
        "cases": "\n\n".join(parts),
        "not compared": "\n".join(absent),
    }


PEERS = {
    "free": "Free flight",
    "law": "The same contact law: slider-crank",
    "scara": "The same contact law: SCARA",
    "restitution": "Contact models",
    "models": "First contacts",
    "turns": "Five turns",
    "cost": "Cost at equal error",
    "cheapest": "The cheapest",
    "better": "Where a peer is better",
}
"""Parts of the comparison with other engines, in the order of the page of all numbers."""


def peers(data=None):
    """What the markers of docs/peers.md stand for."""
    data = data or read("peers")
    return {name: data[name] for name in ("machine", "cost", "better")}


def peers_numbers(data=None):
    """The page with all numbers of the comparison with other engines."""
    data = data or read("peers")
    parts = ["# Other engines: all numbers", data["machine"]]
    parts.append("As `python benchmarks peers` wrote them; [Other engines](../peers.md) says what "
                 "was compared.")  # fmt: skip
    for name, head in PEERS.items():
        parts += [f"## {head}", data[name]]
    parts.append("![Journal orbits in the first turn](../images/peers/orbits.png)")
    return "\n\n".join(parts) + "\n"


def tried():
    """What the marker of docs/robots.md stands for: robots that were run."""
    with (DOCS / "data" / "robots.csv").open(encoding="utf-8") as file:
        return {"tried": Table.of_texts([*csv.reader(file)]).markdown()}


def filled(page, texts):
    """A page of docs with each marker `<!-- made here: NAME -->` replaced by its text."""
    text = (DOCS / page).read_text(encoding="utf-8")
    for name, made in texts.items():
        marker = f"<!-- made here: {name} -->"
        if marker not in text:
            raise ValueError(f"docs/{page} has no {marker}")
        text = text.replace(marker, made)
    return text
