"""Reproducibility: the same bits again, and files that say what made them."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr
from common import Case
from truth.validation import Outcome, case

import jointplay as jp
from jointplay.base.files import temporary
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation.result import FORMAT

CHILD = """
import sys
import jointplay as jp
simulation = jp.Result.load(sys.argv[1]).simulation
simulation.run().save(sys.argv[2])
"""


def differing(one: xr.Dataset, other: xr.Dataset) -> list[str]:
    """Variables that do not agree bit for bit."""
    bits = [{n: x.values.tobytes() for n, x in data.variables.items()} for data in (one, other)]
    return [str(name) for name in bits[0] | bits[1] if bits[0].get(name) != bits[1].get(name)]


def elsewhere(file: Path, out: Path, **environment: str) -> xr.Dataset:
    """Run the simulation of a result file again in a new process."""
    subprocess.run(
        [sys.executable, "-c", CHILD, str(file), str(out)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), **environment},
        check=True,
        capture_output=True,
        timeout=600,
    )
    return xr.load_dataset(out, engine="h5netcdf")


@case(
    origin="itself",
    title="Bit-for-bit repetition",
    compared="A run of the SCARA (0.5 mm, random start) is repeated in the same process, and from "
    "its result file in a new one; every variable of the results is compared bit for bit.",
    measures="number of variables that differ",
    wrong="the run to compare with has a friction coefficient larger by one part in 10^15",
)
def same_bits(quick: bool = False, wrong: bool = False) -> Outcome:
    duration = 0.05 if quick else 1.5
    friction = 0.1 * (1.0 + 1e-15) if wrong else 0.1
    case_of = Case(radial=0.5e-3, axial=0.5e-3)
    first = case_of.simulation(1, duration=duration).run()
    again = Case(radial=0.5e-3, axial=0.5e-3, friction=friction)
    second = again.simulation(1, duration=duration).run()
    rows = [["repeated", "variables", "differing"]]
    number = len(first.dataset.variables)
    different = differing(first.dataset, second.dataset)
    rows.append(["in the same process", f"{number}", f"{len(different)}"])
    notes = []
    if wrong:
        return Outcome(float(len(different)), 0.0, rows)
    with temporary("reproducibility") as folder:
        file = first.save(Path(folder) / "first.nc")
        child = differing(first.dataset, elsewhere(file, Path(folder) / "child.nc"))
        rows.append(["from the file, in another process", f"{number}", f"{len(child)}"])
        different += child
        if not quick:
            # Another machine's code: the kernels compiled for any processor of this kind.
            other = elsewhere(
                file, Path(folder) / "generic.nc", NUMBA_CPU_NAME="generic",
                NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(Path(folder) / "cache"),
            )  # fmt: skip
            away = np.abs(other["tool_position"].values - first["tool_position"].values).max(axis=1)
            unlike = int(np.argmax(away > 0.0)) if away.any() else -1
            if unlike < 0:
                notes.append(
                    "With kernels compiled for a generic processor instead of this one the bits "
                    "are the same as well."
                )
            else:
                million = int(np.argmax(away > 1e-9)) if away.max() > 1e-9 else len(away) - 1
                notes.append(
                    "Against this run, one whose kernels were compiled for a generic processor, "
                    "as another machine might: the last bit differs from "
                    f"{first.time[unlike]:.3g} s on, the tool by 1 nm from "
                    f"{first.time[million]:.3g} s on, and by {1e3 * away.max():.2g} mm in the end. "
                    f"Impacts: {first.audit.impacts} and {jp.Result(other).audit.impacts}."
                )
    notes.append(
        "What to expect: one machine with one set of versions gives the same bits, in any "
        "process and at any load; nothing in a run depends on time, threads or the order of a "
        "dictionary. Another processor, operating system or version of numba, Pinocchio or the C "
        "library may round the last bit differently (fused multiply-add, sin and cos). Impacts "
        "may then separate the trajectories, on average at the rate of the Lyapunov exponents "
        "above, but very unevenly. Across machines, compare energies, ensembles and limits, as "
        "here, not single samples."
    )
    return Outcome(float(len(different)), 0.0, rows, notes=notes)


@case(
    origin="itself",
    title="Result files record their origin",
    compared="A saved result, opened without the package (xarray): the versions of package, "
    "Python and libraries against those installed; the scenario (robot, clearance, motion, step, "
    "integrator, seed) against the inputs of the run.",
    measures="number of entries missing or wrong",
    wrong="the run had another seed",
)
def provenance(quick: bool = False, wrong: bool = False) -> Outcome:
    del quick
    asked = Case(radial=0.5e-3, axial=0.3e-3, restitution=0.8)
    simulation = asked.simulation(7, duration=0.02)
    with temporary("reproducibility") as folder:
        file = simulation.run().save(Path(folder) / "result.nc")
        attributes = xr.load_dataset(file, engine="h5netcdf").attrs
    named, made = json.loads(attributes["versions"]), json.loads(attributes["simulation"])
    bearing = made["mechanism"]["clearance"]["joint_b"]
    expected = {
        "file format": (attributes["jointplay_format"], FORMAT),
        "python": (named["python"], ".".join(map(str, sys.version_info[:3]))),
        "machine": (bool(named["machine"]), True),
        **{
            f"version of {name}": (named[name], version(name))
            for name in ("pin", "numpy", "numba", "scipy")
        },
        "version of jointplay": (bool(named["jointplay"]), True),
        "URDF": (
            made["mechanism"]["urdf_text"],
            jp.shipped("scara.urdf").read_text(encoding="utf-8"),
        ),
        "radial clearance [m]": (bearing["radial_clearance"], 0.5e-3),
        "axial clearance [m]": (bearing["axial_clearance"], 0.3e-3),
        "restitution": (bearing["restitution"], 0.8),
        "friction": (bearing["friction"]["mu_d"], 0.1),
        "gravity [m/s^2]": (list(made["mechanism"]["gravity"]), [0.0, 0.0, 0.0]),
        "motion": (made["motion"]["joints"], list(simulation.motion.joints)),
        "step [s]": (made["step"], 1e-5),
        "integrator": (made["integrator"], DEFAULT),
        "duration [s]": (made["duration"], 0.02),
        "seed": (made["seed"], 8 if wrong else 7),
        "status": (attributes["status"], "completed"),
        "audit": (math.isfinite(json.loads(attributes["audit"])["energy_residual"]), True),
    }
    rows = [["entry", "in the file", ""]]
    for name, (found, wanted) in expected.items():
        text = f"{len(found)} characters" if name == "URDF" else str(found)
        rows.append([name, text, "as asked" if found == wanted else f"**not {wanted}**"])
    missing = sum(found != wanted for found, wanted in expected.values())
    return Outcome(float(missing), 0.0, rows)
