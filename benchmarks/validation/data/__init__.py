"""Data of others, each file with its source and licence on top; see README.md."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent


def read(name: str) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Columns of a data file, and the numbers in its notes."""
    lines = (HERE / name).read_text(encoding="utf-8").splitlines()
    notes = [line for line in lines if line.startswith("#")]
    head, *rows = lines[len(notes) :]
    table = np.array([row.split(",") for row in rows], float)
    numbers = dict(re.findall(r"(\w+) = ([-+.\de]+)", " ".join(notes)))
    columns = dict(zip(head.split(","), table.T, strict=True))
    return columns, {key: float(value) for key, value in numbers.items()}
