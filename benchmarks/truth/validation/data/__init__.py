"""Data of others, each file with its source and licence on top; see README.md."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent

LICENCES = {
    "Apache-2.0": "https://www.apache.org/licenses/LICENSE-2.0",
    "BSD-3-Clause": "https://opensource.org/license/bsd-3-clause",
    "CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/",
    "CC-BY-SA-4.0": "https://creativecommons.org/licenses/by-sa/4.0/",
}
"""Of data of others: the licence's text by its SPDX name."""


def origin(
    repository: str, commit: str, path: str, holder: str, licence: str, more: str = ""
) -> list[str]:
    """What a file with data of others says on top, a line each."""
    return [
        f"Source: {repository}, {path}",
        f"Commit: {commit}",
        f"SPDX-FileCopyrightText: {holder}",
        f"SPDX-License-Identifier: {licence}",
        f"Licence: {LICENCES[licence]}{more}",
    ]


def read(name: str) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Columns of a data file, and the numbers in its notes."""
    lines = (HERE / name).read_text(encoding="utf-8").splitlines()
    notes = [line for line in lines if line.startswith("#")]
    head, *rows = lines[len(notes) :]
    table = np.array([row.split(",") for row in rows], float)
    numbers = dict(re.findall(r"(\w+) = ([-+.\de]+)", " ".join(notes)))
    columns = dict(zip(head.split(","), table.T, strict=True))
    return columns, {key: float(value) for key, value in numbers.items()}
