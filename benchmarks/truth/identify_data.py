"""Extracts of public measurements for `identify.py`, from clones of their repositories.

    git clone https://github.com/roboninecom/Measuring-Backlash-in-Popular-UART-Servos servos
    git clone https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash damper
    python benchmarks identify_data servos damper

writes benchmarks/truth/validation/data/backlash_*.csv with their source and licence on top. Servos:
telemetry of a stand in which elastic bands pull the lever of a standing servo one way and the other
(B. Kotov, Robonine; logs under CC BY 4.0, as the table of files in the repository's paper says).
Damper: a banded rotary friction device in a testing machine, sinusoidal displacement (D. Coble,
P. Huggins, L. Cao, J. Ricles, A. Downey, ARTS-Lab; CC BY-SA 4.0, and so are the extracts). Git
directories without work tree will do.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import subprocess
from datetime import datetime
from pathlib import Path

import numpy as np
from truth.validation.data import origin

DATA = Path(__file__).parent / "validation" / "data"
TOLD = "216b5899dc9c1b7264584d7f1388cb4892c2b5f8"
"""The last commit of the servos' repository that has its paper, which names the licence of logs."""
COUNT_RAD = 2.0 * math.pi / 4096
"""Step of the servos' 12-bit encoder."""
BAND_N = 0.15 * 9.80665
"""With which a stretched band pulls the lever of a single servo (their paper: about 0.15 kgf)."""
HOME, RELAXED, STRETCHED = 2047, {1: 1747, -1: 2347}, {1: 2147, -1: 1947}
INCH, KIP = 25.4e-3, 4448.2216
EVERY = 8
"""Records of the damper of which one is kept."""

SERVOS = {
    # file: servo under test, pullers towards + and -, and their relaxed targets
    "single": ("backlash_sts3215.csv", "STS3215", 5, (4, 2347), (3, 1747)),
    "single_3250": ("backlash_sts3250.csv", "STS3250", 4, (2, 1747), (1, 2347)),
}
DAMPERS = {
    "20": "backlash_damper_20lb.csv",
    "35": "backlash_damper_35lb.csv",
    "80": "backlash_damper_80lb.csv",
}
"""By tension of the band [lb]; dataset 1, 0.5 Hz."""


def shown(repository: Path, path: str) -> str:
    """Text of a file in the newest commit."""
    order = ["git", "-C", str(repository), "show", f"HEAD:{path}"]
    return subprocess.run(order, capture_output=True, text=True, check=True).stdout


def commit(repository: Path) -> str:
    order = ["git", "-C", str(repository), "rev-parse", "HEAD"]
    return subprocess.run(order, capture_output=True, text=True, check=True).stdout.strip()


def sourced(*words: str) -> list[str]:
    return [f"# {line}" for line in origin(*words)]


def servo(repository: Path, name: str) -> None:
    """One log: command and encoder of the servo, pull of the bands."""
    target, kind, tested, plus, minus = SERVOS[name]
    path = f"logs/motor_telemetry_{name}.csv"
    rows = list(csv.DictReader(io.StringIO(shown(repository, path))))
    lines = [
        f"# Feetech {kind} in a stand that pulls its lever (0.1 m) both ways; encoder 4096 counts.",
        *sourced(
            "github.com/roboninecom/Measuring-Backlash-in-Popular-UART-Servos",
            commit(repository),
            path,
            "2026 B. Kotov, Robonine",
            "CC-BY-4.0",
            f" (said of logs/ by paper/main_teststand.tex at {TOLD})",
        ),
        "# Changed: counts to rad about 2047; force: 0.15 kgf (their calibration) by the way of",
        "# the puller that stretches; the servo's own drives, and rest before the first pull after",
        "# them, left out.",
        "time [s],servo motor [rad],servo link [rad],force y [N]",
    ]
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
    (DATA / target).write_text("\n".join(lines) + "\n", encoding="utf-8")


def damper(repository: Path, tension: str) -> None:
    """One test: displacement and force, as angle and torque at a radius of one metre."""
    path = f"data/dataset-1/characterization datasets/0.5Hz{tension}lbtension.json"
    table = np.array(json.loads(shown(repository, path))["data"])[::EVERY]
    lines = [
        f"# Banded rotary friction device, band tension {tension} lb, displaced at 0.5 Hz.",
        *sourced(
            "github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash",
            commit(repository),
            path,
            "2022 D. Coble, P. Huggins, L. Cao, J. Ricles, A. Downey, ARTS-Lab",
            "CC-BY-SA-4.0",
            " (this extract stays under it)",
        ),
        f"# Changed: every {EVERY}th record; inch and kip to SI; as an angle and a torque at a",
        "# radius of 1 m.",
        "time [s],drum motor [rad],drum torque [N*m]",
    ]
    lines += [f"{t:.4f},{INCH * x:.7f},{KIP * force:.1f}" for t, x, force in table[:, :3]]
    (DATA / DAMPERS[tension]).write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("servos", type=Path, nargs="?", default=Path("servos"))
    parser.add_argument("damper", type=Path, nargs="?", default=Path("damper"))
    parser.add_argument(
        "--quick", action="store_true", help="nothing to shorten; without the clones, say so only"
    )
    folders = parser.parse_args()
    missing = [str(folder) for folder in (folders.servos, folders.damper) if not folder.is_dir()]
    if missing:
        text = f"no clone in {' and '.join(missing)}; {parser.prog} --help says of what"
        if not folders.quick:
            parser.error(text)
        print(f"skipped: {text}")
        return
    for name in SERVOS:
        servo(folders.servos, name)
    for tension in DAMPERS:
        damper(folders.damper, tension)
