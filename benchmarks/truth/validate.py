"""Validation: compare runs with theory, with independent integrations and with the literature.

Writes docs/validation.md, a figure and an error number per case. The short form of every case runs
in the test suite, once as it is and once with a deliberate mistake, which must fail.
"""

from __future__ import annotations

import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

from common import DOCS, command, folder_of
from truth.validation import CASES, Case, Outcome, load

from jointplay.base.progress import ProgressBar
from jointplay.simulation.result.stored import versions

HEADS = {
    "theory": "Theory",
    "impacts": "Impacts",
    "oil": "Oil and wear",
    "numerics": "Numerics",
    "literature": "Literature",
    "outside": "Other codes",
    "reproducibility": "Reproducibility",
}


def page(found: dict[str, tuple[Case, Outcome, float]], images: str) -> str:
    """The page in Markdown."""
    failed = [name for name, (_, outcome, _) in found.items() if not outcome.passed]
    seconds = sum(spent for _, _, spent in found.values())
    machine = ", ".join(f"{name} {text}" for name, text in versions().items())
    lines = [
        "# Validation",
        "",
        "Written by `python benchmarks validate`; do not edit. "
        f"{len(found) - len(failed)} of {len(found)} cases pass, in {seconds:.0f} s ({machine}).",
        "",
        "Each case states what is compared. Its error is one number; the case fails above the "
        "limit. *Origin* is the source of the reference: theory, an independent integration in "
        "the case itself, a publication, another engine, a commercial code, an experiment, or "
        "the package itself with other settings. A short form of each case runs in the test "
        "suite, and again with the deliberate mistake named under *fails with*, to show that the "
        "check can fail.",
        "",
        "| case | origin | error | limit | |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| [{case.title}](#{_anchor(case.title)}) | {case.origin} "
        f"| {outcome.error:.2g} | {outcome.limit:.2g} "
        f"| {'passes' if outcome.passed else '**fails**'} |"
        for case, outcome, _ in found.values()
    ]
    section = ""
    for name, (case, outcome, spent) in found.items():
        if case.section != section:
            section = case.section
            lines += ["", f"## {HEADS[section]}"]
        verdict = "passes" if outcome.passed else "**fails**"
        lines += [
            "",
            f"### {case.title}",
            "",
            case.compared,
            "",
            f"- **Error {outcome.error:.3g}**: {case.measures}. "
            f"Limit {outcome.limit:.3g}: {verdict} ({spent:.0f} s).",
            f"- Fails with: {case.wrong}.",
        ]
        if outcome.table:
            header, *rows = outcome.table
            rows = [header, ["---"] * len(header), *rows]
            lines += ["", *(f"| {' | '.join(row)} |" for row in rows)]
        lines += [text for note in outcome.notes for text in ("", note)]
        if outcome.figure is not None:
            lines += ["", f"![{case.title}]({images}/{name}.png)"]
    if len(found) == len(CASES):
        lines += [
            "",
            "## What could not be compared",
            "",
            "The following were considered, but could not be compared:",
            "",
            *(f"- {paper['name']}: {paper['found']}." for paper in absent()),
        ]
    return "\n".join(lines) + "\n"


def absent() -> list[dict[str, str]]:
    """Publications that were not accessible."""
    path = Path(__file__).parent / "validation" / "data" / "not_accessible.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))["paper"]


def _anchor(title: str) -> str:
    kept = "".join(c for c in title.lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def main(arguments: Sequence[str] | None = None) -> int:
    cases = load()
    where = "docs; --quick: results/benchmarks/validate"
    parser = command(__doc__, "the short forms, as in the tests", where)
    parser.add_argument(
        "--only", action="append", choices=list(cases), metavar="CASE", help="repeatable"
    )
    args = parser.parse_args(arguments)
    if args.only and not args.quick and args.out in (None, DOCS):
        parser.error("--only needs --out: docs/validation.md is whole or not at all")
    out = folder_of(args, "validate", DOCS)
    images = out / "images" / "validation"
    images.mkdir(parents=True, exist_ok=True)
    found = {}
    chosen = [c for name, c in cases.items() if not args.only or name in args.only]
    bar = ProgressBar(chosen, unit="cases")
    for case in bar:
        bar.postfix = case.name
        started = time.perf_counter()
        outcome = case.run(args.quick, False)
        found[case.name] = case, outcome, time.perf_counter() - started
        if outcome.figure is not None:
            outcome.figure.savefig(images / f"{case.name}.png", dpi=110)
    (out / "validation.md").write_text(page(found, "images/validation"), encoding="utf-8")
    print(f"written: {out / 'validation.md'}")
    failed = [name for name, (_, outcome, _) in found.items() if not outcome.passed]
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0
