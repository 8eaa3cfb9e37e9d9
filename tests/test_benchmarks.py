"""Every benchmark starts, in its quick form, and is described."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"
MODULES = sorted(path for path in FOLDER.glob("*.py"))
SCRIPTS = [path for path in MODULES if "__main__" in path.read_text(encoding="utf-8")]


@pytest.mark.thorough
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_benchmark_ends_well_in_its_quick_form(script, tmp_path):
    before = states(ROOT / "docs")
    done = subprocess.run(
        [sys.executable, script, "--quick"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert done.stdout.strip(), "it says nothing"
    assert "Traceback" not in done.stderr, done.stderr[-3000:]
    assert states(ROOT / "docs") == before, "a quick form is no part of the documentation"


@pytest.mark.thorough
def test_clearances_with_gravity_agree_with_the_claims_of_the_paper(tmp_path):
    """Both are judged from when the journals have fallen: with gravity the peaks are equal then."""
    page = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")
    row = next(x for x in page.splitlines() if x.startswith("| 5 ") and "loaded, consistent" in x)
    claimed = re.search(r"Fz\\\| ([\d.]+) ± \S+ → ([\d.]+) ±", row).groups()
    command = [sys.executable, FOLDER / "clearance.py", "--quick", "--loaded"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    with (tmp_path / "results/benchmarks/clearance/clearance.csv").open() as file:
        runs = list(csv.DictReader(file))
    for size, force in zip((0.2, 0.5), map(float, claimed), strict=True):
        found = [float(run["peak_force_N"]) for run in runs if float(run["radial"]) == size * 1e-3]
        assert found
        assert found == pytest.approx(len(found) * [force], rel=1e-3)


def states(folder):
    """When each file was written last."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def test_every_benchmark_has_a_quick_form_and_its_section():
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    titles = re.findall(r"^## (.*)$", page, re.MULTILINE)
    sections = {name for title in titles for name in title.split(", ")}
    for script in SCRIPTS:
        assert script.name in sections
        text = script.read_text(encoding="utf-8")
        assert '"--quick"' in text or re.search(r"\b[Bb]enchmark\(", text), script.name
    for module in MODULES:
        assert module.name in page
    assert {name for name in sections if name.endswith(".py")} <= {path.name for path in MODULES}


def test_clearance_cases_come_first_and_documentation_names_them():
    """The scripts that compare clearances do what the package is for."""
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    titles = re.findall(r"^## (\w+)\.py", page, re.MULTILINE)
    first = ["clearance", "radial_axial", "friction_restitution"]
    assert titles[: len(first)] == first
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    for name in first:
        assert f"benchmarks/{name}.py" in text
