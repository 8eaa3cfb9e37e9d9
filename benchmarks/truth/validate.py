"""Validation: compare runs with theory, with independent integrations and with the literature.

Writes docs/data/validation.json, from which the documentation's build makes the tables of
docs/validation.md, and a figure per case. The short form of every case runs in the test suite, once
as it is and once with a deliberate mistake, which must fail.
"""

from __future__ import annotations

import json
import re
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common import DOCS, command, folder_of
from truth.validation import Case, Outcome, load

from jointplay.base.progress import ProgressBar
from jointplay.simulation.result.stored import versions


def record(case: Case, outcome: Outcome, seconds: float) -> dict[str, Any]:
    """A case and what it found, for the file."""
    texts = ("section", "name", "title", "origin", "compared", "measures", "wrong")
    return {name: getattr(case, name) for name in texts} | {
        "error": float(outcome.error),
        "limit": float(outcome.limit),
        "passed": bool(outcome.passed),
        "seconds": round(seconds),
        "table": [list(row) for row in outcome.table],
        "notes": list(outcome.notes),
        "figure": outcome.figure is not None,
    }


def write(path: Path, records: Sequence[dict[str, Any]]) -> None:
    data = {"machine": versions(), "cases": records, "not_compared": absent()}
    text = json.dumps(data, indent=1, ensure_ascii=False)
    # A row of a table is a line.
    row = re.compile(r'\[\s+("(?:[^"\\]|\\.)*"(?:,\s+"(?:[^"\\]|\\.)*")*)\s+\]')
    text = row.sub(lambda m: "[" + re.sub(r"\n\s+", " ", m[1]) + "]", text)
    path.write_text(text + "\n", encoding="utf-8")


def absent() -> list[dict[str, str]]:
    """Publications that were not accessible."""
    path = Path(__file__).parent / "validation" / "data" / "not_accessible.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))["paper"]


def main(arguments: Sequence[str] | None = None) -> int:
    cases = load()
    where = "docs; --quick: results/benchmarks/validate"
    parser = command(__doc__, "the short forms, as in the tests", where)
    parser.add_argument(
        "--only", action="append", choices=list(cases), metavar="CASE", help="repeatable"
    )
    args = parser.parse_args(arguments)
    if args.only and not args.quick and args.out in (None, DOCS):
        parser.error("--only needs --out: docs/data/validation.json has all cases")
    out = folder_of(args, "validate", DOCS)
    images = out / "images" / "validation"
    images.mkdir(parents=True, exist_ok=True)
    records = []
    chosen = [c for name, c in cases.items() if not args.only or name in args.only]
    bar = ProgressBar(chosen, unit="cases")
    for case in bar:
        bar.postfix = case.name
        started = time.perf_counter()
        outcome = case.run(args.quick, False)
        records.append(record(case, outcome, time.perf_counter() - started))
        if outcome.figure is not None:
            outcome.figure.savefig(images / f"{case.name}.png", dpi=110)
    path = out / "data" / "validation.json"
    path.parent.mkdir(exist_ok=True)
    write(path, records)
    print(f"written: {path}")
    failed = [one["name"] for one in records if not one["passed"]]
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0
