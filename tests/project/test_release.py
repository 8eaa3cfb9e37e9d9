"""What is said of the package in several places says the same."""

import email
import os
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.resources import files
from pathlib import Path

import pytest
import yaml
from sweep_scenario import GRID, SCENARIO

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
DATA = ROOT / "benchmarks" / "truth" / "validation" / "data"
LICENCES = runpy.run_path(str(DATA / "__init__.py"))["LICENCES"]
CONDA_NAMES = {"pin": "pinocchio", "matplotlib": "matplotlib-base", "meshcat": "meshcat-python"}


EXTRAS = PROJECT["optional-dependencies"]
NOT_FOR_USERS = {"peers", "test", "test-all", "docs", "dev"}
"""Extras that develop and compare; the others are told to users."""


def oldest():
    """All that users need, each pinned to its lower bound, which is therefore a release."""
    needed = [*PROJECT["dependencies"]]
    for name in EXTRAS.keys() - NOT_FOR_USERS:
        needed += [one for one in EXTRAS[name] if not one.startswith("jointplay[")]
    bounds = {re.fullmatch(r"([\w-]+)>=([\w.]+)(,<[\w.]+)?", entry) for entry in needed}
    return sorted(f"{name}=={version}" for name, version, _ in (one.groups() for one in bounds))


def test_what_is_needed_has_a_lower_bound():
    assert "pin==4" in oldest()


@pytest.mark.nightly
def test_the_oldest_versions_that_are_allowed_work(tmp_path):
    def does(*command):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"

    constraints = tmp_path / "oldest.txt"
    constraints.write_text("\n".join(oldest()))
    does(sys.executable, "-m", "venv", "old")
    extras = ",".join(sorted(EXTRAS.keys() - NOT_FOR_USERS))
    does("old/bin/pip", "install", "-q", f"{ROOT}[{extras}]", "-c", str(constraints))
    jointplay = str(tmp_path / "old/bin/jointplay")
    does(jointplay, "run", "--duration", "0.05", "--quiet", "--out", "run")
    does(jointplay, "report", "run")
    for suffix in ("parquet", "mcap", "yaml"):
        does(jointplay, "export", "result", "run/result.nc", "--out", f"result.{suffix}")
    does(jointplay, "budget", "ur5", "--clearance", "0.05 mm")
    reduce = (
        "export",
        "simulator",
        "ur5",
        "--joint",
        "elbow_joint",
        "--clearance",
        "0.1 mm",
        "--tilt",
    )
    does(jointplay, *reduce, "--quiet", "--out", "reduced")
    scenario = tmp_path / "sweep.toml"
    scenario.write_text(SCENARIO.format(duration="20 ms", options="", axes=GRID))
    does(jointplay, "study", "sweep", str(scenario), "--quiet", "--out", "sweep")
    does(jointplay, "report", "sweep", "--out", "sweep.html")


COMPILES = """
import hashlib, numba, jointplay as jp
from jointplay.paper import scara
made = scara(2e-4)
result = jp.simulate(made.mechanism, made.motion, duration=0.05).dataset
numbers = [v.values.tobytes() for v in result.variables.values() if v.dtype.kind == "f"]
print(len(numbers), hashlib.sha256(b"".join(numbers)).hexdigest())
"""


@pytest.mark.nightly
def test_numbas_newest_three_releases_compile_to_the_same_numbers(tmp_path):
    def does(*command):
        own = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        return subprocess.check_output(command, cwd=tmp_path, text=True, env=own)

    does(sys.executable, "-m", "venv", "new")
    does("new/bin/pip", "install", "-q", str(ROOT))
    said = does("new/bin/pip", "index", "versions", "numba")
    newest = re.search(r"Available versions: (.*)", said)[1].split(", ")
    minors = list(dict.fromkeys(one.rpartition(".")[0] for one in newest))[:3]
    answers = set()
    for minor in minors:
        does("new/bin/pip", "install", "-q", f"numba=={minor}.*")
        (tmp_path / "cache").mkdir()
        answers.add(does("new/bin/python", "-c", COMPILES))
        shutil.rmtree(tmp_path / "cache")
    assert len(minors) == 3
    assert len(answers) == 1


@pytest.mark.nightly
def test_from_a_released_wheel_a_first_run_compiles_nothing(tmp_path):
    """As the workflow of releases makes it: with objects for all processors."""

    def does(*command, **options):
        done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
        assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"

    clone = tmp_path / "clone"
    does("git", "clone", "-q", ROOT, clone)
    own = {**os.environ, "PYTHONPATH": str(clone / "src")}
    does(sys.executable, ".ci/objects.py", cwd=clone, env=own)
    does(sys.executable, "-m", "build", "-q", "--wheel", "--outdir", tmp_path, cwd=clone)
    (wheel,) = tmp_path.glob("*.whl")
    does(sys.executable, "-m", "venv", tmp_path / "new")
    does(tmp_path / "new/bin/pip", "install", "-q", f"{wheel}[robots]")
    (tmp_path / "cache").mkdir()
    for call in (
        "run scara --joint joint_b=0.1mm --duration 0.05 --out run",
        "budget ur5 --joint elbow_joint=6204",
        "budget so101 --preset",
    ):
        command = [tmp_path / "new/bin/jointplay", *call.split()]
        does(*command, cwd=tmp_path, env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")})
    assert not [*(tmp_path / "cache").rglob("*.o")]


def test_what_is_advised_to_install_is_there():
    advice = re.compile(r"pip install (?:-q )?(?:-e )?'([^']*)'")
    said = {}
    for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "src").rglob("*.py")]:
        for name in advice.findall(path.read_text()):
            said.setdefault(name, path)
    there = {f".[{one}]" for one in EXTRAS} | {".[{name}]"}  # the one function that says it
    assert said.keys() - there == set()
    readme = (ROOT / "README.md").read_text()
    assert advice.findall(readme)[0] == ".[robots]"  # its first commands name robots


def test_citation_and_recipe_say_what_the_project_says():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == RECIPE["context"]["version"] == PROJECT["version"]
    about, urls = RECIPE["about"], PROJECT["urls"]
    source = citation["repository-code"]
    assert source == about["homepage"] == about["repository"] == urls["Source"]
    assert about["documentation"] == urls["Documentation"]
    assert about["license"] == PROJECT["license"]


def test_the_conda_recipe_needs_what_the_project_needs():
    assert RECIPE["schema_version"] == 1
    assert f">={RECIPE['context']['python_min']}" == PROJECT["requires-python"]
    wanted = {"python >=${{ python_min }}"}
    for entry in PROJECT["dependencies"]:
        name, version = re.fullmatch(r"([\w-]+)(.*)", entry).groups()
        bound = "" if name == "eigenpy" else version  # conda-forge has an older one
        wanted.add(f"{CONDA_NAMES.get(name, name)} {bound}".strip())
    assert {str(entry) for entry in RECIPE["requirements"]["run"]} == wanted


@pytest.mark.parametrize("path", sorted((ROOT / ".github").rglob("*.yml")), ids=lambda p: p.name)
def test_github_files_are_well_formed(path):
    assert yaml.safe_load(path.read_text())["name"]


def test_the_package_says_that_it_is_typed():
    assert (files("jointplay") / "py.typed").is_file()


def notes(path):
    return [line[2:] for line in path.read_text().splitlines() if line.startswith("# ")]


@pytest.mark.parametrize("path", sorted(DATA.glob("*.csv")), ids=lambda p: p.name)
def test_data_say_whose_they_are_and_under_which_licence(path):
    said = dict(re.findall(r"^([\w-]+): (.+)$", "\n".join(notes(path)), re.MULTILINE))
    licence = said["SPDX-License-Identifier"]
    table = (DATA / "README.md").read_text()
    assert path.name in table
    if licence == "MIT":  # made here
        assert "Source" not in said
        return
    assert said["Licence"].startswith(LICENCES[licence])
    assert re.fullmatch(r"[0-9a-f]{40}", said["Commit"])
    assert said["Source"].startswith("github.com/")
    assert said["SPDX-FileCopyrightText"]
    assert "Changed" in said
    (row,) = [line for line in table.splitlines() if f"`{path.name}`" in line]
    assert f"[{licence}]({LICENCES[licence]})" in row
    assert said["Commit"] in row
    assert said["Source"].split(",")[0] in row


@pytest.mark.thorough
@pytest.mark.needs("hatchling", "hatch_fancy_pypi_readme")
def test_packages_carry_their_licences_and_a_readme_whose_links_lead_somewhere(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        shipped = {path: wheel.read(path) for path in wheel.namelist()}
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as source:
        sources = {path.partition("/")[2] for path in source.getnames()}
    about = f"jointplay-{PROJECT['version']}.dist-info/"
    said = email.message_from_bytes(shipped[about + "METADATA"])
    assert said["License-Expression"] == "MIT AND Apache-2.0"
    assert said.get_all("License-File") == ["LICENSE", *sorted(PROJECT["license-files"][1:])]
    assert all(f"{about}licenses/{path}" in shipped for path in said.get_all("License-File"))
    # What README and the comment above `license` name, and nothing else.
    apache = {path for path in shipped if b"Apache License" in shipped[path]}
    assert apache == {"jointplay/shipped/so101.urdf", f"{about}licenses/LICENSES/Apache-2.0.txt"}
    assert not [path for path in shipped if b"SPDX-License-Identifier" in shipped[path]]

    data = [path for path in DATA.iterdir() if path.suffix in (".csv", ".md", ".LICENSE")]
    assert {str(path.relative_to(ROOT)) for path in data} <= sources
    assert {path for path in sources if path.startswith("LICENSE")} >= {*PROJECT["license-files"]}

    links = re.findall(r"\]\(([^)#]+)", said.get_payload())
    ours = re.compile(rf"{PROJECT['urls']['Source']}/(?:blob|raw)/v{PROJECT['version']}/(.+)")
    assert all(link.startswith("https://") for link in links)
    assert len(paths := [found[1] for link in links if (found := ours.fullmatch(link))]) > 10
    assert all((ROOT / path).exists() for path in paths)


def test_an_extract_of_share_alike_data_stays_share_alike():
    for path in DATA.glob("backlash_damper_*.csv"):
        assert "SPDX-License-Identifier: CC-BY-SA-4.0" in notes(path)


def test_pictures_of_the_docs_are_small():
    pictures = [*(ROOT / "docs").rglob("*.png")]
    assert pictures
    assert sum(path.stat().st_size for path in pictures) < 4.5e6  # docs/site/compress.py
