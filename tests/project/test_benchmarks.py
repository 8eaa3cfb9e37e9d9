"""Every benchmark starts, in its quick form, and is described."""

import csv
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from warm import PYTHON

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "benchmarks"
SCRIPTS = runpy.run_path(str(FOLDER))["scripts"]()


@pytest.mark.thorough
@pytest.mark.parametrize("name", [name for name in SCRIPTS if name != "fuzz"])
def test_benchmark_ends_well_in_its_quick_form(name, tmp_path):
    """That of `fuzz` has a test of its own; what times starts or kills processes is started."""
    before = states(ROOT / "docs")
    started = SCRIPTS[name].parent.name in ("cost", "robustness")
    command = [sys.executable if started else PYTHON, FOLDER, name, "--quick"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert done.stdout.strip(), "it says nothing"
    assert "Traceback" not in done.stderr, done.stderr[-3000:]
    assert states(ROOT / "docs") == before, "a quick form is no part of the documentation"


@pytest.mark.thorough
def test_clearances_with_gravity_agree_with_the_claims_of_the_paper(tmp_path):
    """Both are judged from when the journals have fallen: with gravity the peaks are equal then."""
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    row = next(x for x in page.splitlines() if x.startswith("| 5 ") and "loaded, consistent" in x)
    claimed = re.search(r"Fz\\\| ([\d.]+) ± \S+ → ([\d.]+) ±", row).groups()
    command = [sys.executable, FOLDER, "clearance", "--quick", "--loaded"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    with (tmp_path / "results/benchmarks/clearance/clearance.csv").open() as file:
        runs = list(csv.DictReader(file))
    for size, force in zip((0.2, 0.5), map(float, claimed), strict=True):
        found = [float(run["peak_force_N"]) for run in runs if float(run["radial"]) == size * 1e-3]
        assert found
        assert found == pytest.approx(len(found) * [force], rel=1e-3)


def states(folder):
    """When each file was written last, but for compiled modules, which other tests write."""
    paths = (path for path in folder.rglob("*") if path.suffix != ".pyc" and path.is_file())
    return {path: path.stat().st_mtime_ns for path in paths}


def test_every_benchmark_is_listed_and_has_a_quick_form():
    command = [sys.executable, FOLDER]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    for name, path in SCRIPTS.items():
        assert f"\n  {name} " in listed
        text = path.read_text(encoding="utf-8")
        assert re.search(r"\b(Benchmark|command|options)\(", text), name


def test_a_benchmark_that_is_not_there_is_refused_with_those_that_are():
    done = subprocess.run([sys.executable, FOLDER, "clarance"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "no 'clarance'" in done.stderr
    assert "clearance" in done.stderr


def test_documentation_names_the_comparisons_of_clearance():
    """The scripts that compare clearances do what the package is for."""
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    for name in ("clearance", "radial_axial", "friction_restitution"):
        assert f"benchmarks/paper/{name}.py" in text or f"benchmarks {name}" in text
