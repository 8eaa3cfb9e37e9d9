"""Extracts of public measurements for `identify.py`, from clones of their repositories.

    git clone https://github.com/roboninecom/Measuring-Backlash-in-Popular-UART-Servos
    git clone https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash
    python benchmarks identify_data --data .

writes benchmarks/truth/validation/data/backlash_*.csv with their source and licence on top. Servos:
telemetry of a stand in which elastic bands pull the lever of a standing servo one way and the other
(B. Kotov, Robonine; logs under CC BY 4.0, as the table of files in the repository's paper says).
Damper: a banded rotary friction device in a testing machine, sinusoidal displacement (D. Coble,
P. Huggins, L. Cao, J. Ricles, A. Downey, ARTS-Lab; CC BY-SA 4.0, and so are the extracts). Git
directories without work tree will do.
"""

from __future__ import annotations

import csv
import io
import json
import math
from datetime import datetime
from pathlib import Path

import numpy as np
from truth.measured import Repository, options, source
from truth.validation.data import origin

DATA = Path(__file__).parent / "validation" / "data"
TOLD = "216b5899dc9c1b7264584d7f1388cb4892c2b5f8"
"""The last commit of the servos' repository that has its paper, which names the licence of logs."""
COUNT_RAD = 2.0 * math.pi / 4096
"""Step of the servos' 12-bit encoder."""
BAND_N = 0.15 * 9.80665
"""With which a stretched band pulls the lever of a single servo (their paper: about 0.15 kgf)."""
HOME = 2047
INCH, KIP = 25.4e-3, 4448.2216
EVERY = 8
"""Records of the damper of which one is kept."""

SERVOS = {
    # file: servo under test, pullers towards + and -, and their relaxed targets
    "single": ("backlash_sts3215.csv", "STS3215", 5, (4, 2347), (3, 1747)),
    "single_3250": ("backlash_sts3250.csv", "STS3250", 4, (2, 1747), (1, 2347)),
}
DAMPER = (
    "ARTS-Laboratory", "Dataset-Friction-Damper-with-Backlash",
    "0e09aa9d950760277e31c08cd93fd01f39a5af09", "CC-BY-SA-4.0",
)  # fmt: skip
DAMPERS = ("20", "35", "80")
"""Tension of the band [lb]; dataset 1, 0.5 Hz."""


def write(target: str, about: list[str], origins: tuple, rows: list[str]) -> None:
    """Rows with what they are and their origin on top."""
    lines = [about[0], *origin(*origins), *about[1:]]
    text = "\n".join([*(f"# {line}" for line in lines), *rows])
    (DATA / target).write_text(text + "\n", encoding="utf-8")


def servo(repository: Repository, name: str) -> None:
    """One log: command and encoder of the servo, pull of the bands."""
    target, kind, tested, plus, minus = SERVOS[name]
    path = f"logs/motor_telemetry_{name}.csv"
    rows = list(csv.DictReader(io.StringIO(repository.text(path))))
    about = [
        f"Feetech {kind} in a stand that pulls its lever (0.1 m) both ways; encoder 4096 counts.",
        "Changed: counts to rad about 2047; force: 0.15 kgf (their calibration) by the way of",
        "the puller that stretches; the servo's own drives, and rest before the first pull after",
        "them, left out.",
    ]
    origins = (
        repository.address, repository.commit, path, "2026 B. Kotov, Robonine", "CC-BY-4.0",
        f" (said of logs/ by paper/main_teststand.tex at {TOLD})",
    )  # fmt: skip
    lines = ["time [s],servo motor [rad],servo link [rad],force y [N]"]
    start, pulled = None, False
    for row in rows:
        needed = [row[f"{what} ({tested})"] for what in ("target pos", "pos")]
        pulls = [row[f"pos ({number})"] for number, _ in (plus, minus)]
        if not all((*needed, *pulls)):
            continue
        at = datetime.fromisoformat(row["timestamp"].replace("Z", "+00:00")).timestamp()
        start = at if start is None else start
        force = 0.0
        for sign, text, (_, relaxed) in zip((1, -1), pulls, (plus, minus), strict=True):
            part = abs(float(text) - relaxed) / 400.0
            force += sign * BAND_N * (part if part > 0.05 else 0.0)
        # Between its drives home and the first pull nobody knows where in its play the servo is.
        pulled = float(needed[0]) == HOME and (pulled or force != 0.0)
        if pulled:
            command, place = ((float(text) - HOME) * COUNT_RAD for text in needed)
            lines.append(f"{at - start:.3f},{command:.6f},{place:.6f},{force:.4f}")
    write(target, about, origins, lines)


def damper(repository: Repository, tension: str) -> None:
    """One test: displacement and force, as angle and torque at a radius of one metre."""
    path = f"data/dataset-1/characterization datasets/0.5Hz{tension}lbtension.json"
    table = np.array(json.loads(repository.text(path))["data"])[::EVERY]
    about = [
        f"Banded rotary friction device, band tension {tension} lb, displaced at 0.5 Hz.",
        f"Changed: every {EVERY}th record; inch and kip to SI; as an angle and a torque at a",
        "radius of 1 m.",
    ]
    origins = (
        repository.address, repository.commit, path,
        "2022 D. Coble, P. Huggins, L. Cao, J. Ricles, A. Downey, ARTS-Lab", "CC-BY-SA-4.0",
        " (this extract stays under it)",
    )  # fmt: skip
    lines = ["time [s],drum motor [rad],drum torque [N*m]"]
    lines += [f"{t:.4f},{INCH * x:.7f},{KIP * force:.1f}" for t, x, force in table[:, :3]]
    write(f"backlash_damper_{tension}lb.csv", about, origins, lines)


def main() -> None:
    args = options(__doc__, {"--quick": "nothing to shorten; without clones, says so"})
    if args is None:
        return
    for name in SERVOS:
        servo(source("servos", args.data), name)
    for tension in DAMPERS:
        damper(Repository(*DAMPER, args.data), tension)
