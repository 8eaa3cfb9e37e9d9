"""Step cost, accuracy, scale and start-up in a few minutes, compared with a baseline.

Everything is a ratio of two things measured in the same minutes on the same machine, so that the
numbers of another machine can be compared: no seconds. What is worse than the baseline by more than
its scatter is named, and the exit status is 1. `--update` makes what was measured the baseline.
"""

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from common import Case, command
from cost import scale

from jointplay.base.files import temporary
from jointplay.base.tables import Table
from jointplay.simulation.analysis.headline import headline_of
from jointplay.simulation.analysis.tool_error import ideal_tool

BASELINE = Path(__file__).with_name("baseline.json")

TOLERATED = {
    "step cost": 0.10,
    "accuracy": 0.30,
    "scale: overhead": 0.02,
    "scale: driver": 0.01,
    "scale: short": 0.15,
    "scale: cores": 0.10,
    "start-up": 0.25,
}
"""By how much a ratio may be larger than the baseline's: relative, but for the overhead and the
driver, which are shares; by what begins its name."""

ABSOLUTE = ("scale: overhead", "scale: driver")
SMALLER_IS_WORSE = ("scale: cores",)

ACCURACY_S = 0.5
FINE = {"step": 1e-6, "macro_step": 2e-5, "record_every": 200}
"""The reference of the accuracy: a tenth of the step and macro steps of 20 µs."""


def step_cost():
    """A step over a bare call of `pin.aba`, as `step_cost.py` has it."""
    with temporary("run") as folder:
        command = [sys.executable, Path(__file__).parents[1], "step_cost", "--quick"]
        done = subprocess.run(
            [*command, "--force", "--out", folder], capture_output=True, text=True, check=True
        )
    return {"step cost over a bare aba": float(re.findall(r"ratio ([\d.]+)", done.stdout)[-1])}


def accuracy():
    """Errors of the default settings, relative: the loaded SCARA against a finer run of itself."""
    case = Case(loaded=True)
    simulation = case.simulation(duration=ACCURACY_S)
    runs = simulation.run(), replace(simulation, **FINE).run()
    plain, fine = (headline_of(run, ideal_tool(run), claims=True) for run in runs)
    return {
        f"accuracy: {name}": abs(plain[name].value - figure.value) / abs(figure.value)
        for name, figure in fine.items()
        if name.startswith(("RMS joint force", "dissipated energy"))
    }


def scaling():
    """Ratios of `scale.py`."""
    found = scale.measure(quick=True)
    return {
        "scale: overhead over a 3 s case": found["overhead"],
        "scale: driver over a 3 s case": found["driver_over_case"],
        "scale: short cases over their compute": found["short"],
        "scale: cores, two over one": found["cores"],
    }


def start_up(times=3):
    """CPU time of starting, over that of importing numpy, scipy and Pinocchio.

    The least of several times, in turn: the first may compile.
    """
    own, step = ("-m", "jointplay"), (
        "import jointplay as jp; s = jp.Scenario.load('jointplay:scara.toml');"
        "s.simulation('0.2 mm', {'integration': {'duration': 1e-4}}).run()"
    )  # fmt: skip
    programs = {
        "bare": ("-c", "import numpy, scipy.interpolate, pinocchio"),
        "start-up: import jointplay": ("-c", "import jointplay"),
        "start-up: first step of a run": ("-c", step),
        "start-up: jointplay --version": (*own, "--version"),
        "start-up: jointplay robots": (*own, "robots"),
        "start-up: jointplay budget": (*own, "budget", "ar4", "--clearance", "0.05 mm"),
        "start-up: jointplay run, 0.05 s": (*own, "run", "--duration", "0.05 s", "--out", "run"),
    }
    turns = [{name: _cpu(program) for name, program in programs.items()} for _ in range(times)]
    found = {name: min(turn[name] for turn in turns) for name in programs}
    bare = found.pop("bare")
    return {name: seconds / bare for name, seconds in found.items()}


def _cpu(program):
    with temporary("start") as folder:
        before = sum(os.times()[2:4])  # of children
        # Modules are compiled once, as where the package is installed.
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        subprocess.run(
            [sys.executable, *program], check=True, cwd=folder, env=environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        return sum(os.times()[2:4]) - before


PARTS = {"step": step_cost, "accuracy": accuracy, "scale": scaling, "start": start_up}


def worse(found, baseline):
    """Names of the ratios that got worse, and how."""
    said = []
    for name, value in found.items():
        if name not in baseline:
            continue
        before = baseline[name]
        key = next(begin for begin in TOLERATED if name.startswith(begin))
        margin = TOLERATED[key] * (1.0 if key in ABSOLUTE else abs(before))
        if name.startswith("accuracy"):
            margin = max(margin, 1e-4)  # the last digits of a small error
        beyond = before - value if key in SMALLER_IS_WORSE else value - before
        if beyond > margin:
            said.append(f"{name}: {value:.4g}, and was {before:.4g}")
    return said


def main():
    quick = "accuracy and start-up alone; the status is always 0"
    parser = command(__doc__, quick, update=(False, f"write the ratios to {BASELINE.name}"))
    parser.add_argument("--only", choices=PARTS, nargs="+", default=list(PARTS))
    parser.add_argument("--out", type=Path, metavar="JSON", help="write the ratios")
    args = parser.parse_args()
    parts = PARTS
    if args.quick:
        parts = {"accuracy": accuracy, "start": partial(start_up, 1)}
    found = {}
    for name in [name for name in args.only if name in parts]:
        began = time.perf_counter()
        found |= parts[name]()
        print(f"{name}: {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)
    found = {name: float(np.format_float_positional(v, 4, fractional=False, trim="k"))
             for name, v in found.items()}  # fmt: skip
    known = json.loads(BASELINE.read_text()) if BASELINE.is_file() else {}
    rows = [(name, f"{now:.4g}", f"{known.get(name, np.nan):.4g}") for name, now in found.items()]
    print(Table.of_texts([("ratio", "now", "baseline"), *rows]).markdown())
    text = json.dumps({**known, **found} if args.update else found, indent=1) + "\n"
    if args.out:
        args.out.write_text(text)
    if args.update:
        BASELINE.write_text(text)
        return
    said = worse(found, known)
    for line in said:
        print(f"worse: {line}")
    print(f"worse {len(said)} of {len(found)}")
    if said and not args.quick:
        sys.exit(1)
