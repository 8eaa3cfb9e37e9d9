"""What is refused is refused at once: nothing that takes long to import is imported for it.

Which modules are loaded does not depend on the machine; how long that takes does.
"""

import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from warm import call

import jointplay as jp

SLOW = (
    *("numba", "llvmlite", "pinocchio", "coal", "scipy", "xarray", "pandas", "matplotlib"),
    *("pint", "trimesh", "yourdfpy", "meshcat", "pydantic"),
)
"""Packages that take a tenth of a second and more."""

PROGRAM = """
import json, os, sys
from jointplay.cli import main
for arguments in json.loads(sys.argv[1]):
    read, write = os.pipe()
    if os.fork() == 0:
        os.dup2(write, 2)
        sys.stderr = open(2, "w", 1, closefd=False)
        try:
            status = main(arguments)
        except SystemExit as ended:  # of the parser
            status = ended.code
        sys.stderr.flush()
        with open("found", "w") as found:
            json.dump([status, [name for name in {slow!r} if name in sys.modules]], found)
        os._exit(0)
    os.close(write)
    with open(read) as said:
        text = said.read()
    assert os.wait()[1] == 0, text
    with open("found") as found:
        status, slow = json.load(found)
    print(json.dumps([status, text, slow]), flush=True)  # or a copy says it again
"""
"""Does one command after the other, each in a copy of a process that has not done any."""

SCENARIO = """
[robot]
urdf = "jointplay:scara.urdf"
[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"
{more}
[motion]
file = "jointplay:scara_motion.csv"
"""


def outcomes(lines, folder):
    """Status, what was said, and slow modules, of each command."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(slow=SLOW), json.dumps(lines)],
        cwd=folder, stdout=subprocess.PIPE, text=True, timeout=900, check=True,
    )  # fmt: skip
    found = [line for line in done.stdout.splitlines() if line.startswith("[")]
    return list(map(json.loads, found))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    tmp_path = tmp_path_factory.mktemp("startup")
    (tmp_path / "good.toml").write_text(SCENARIO.format(more=""))
    (tmp_path / "bad.toml").write_text(SCENARIO.format(more='radial_clearnce = "1 mm"'))
    (tmp_path / "unit.toml").write_text(SCENARIO.format(more='bearing_radius = "10 s"'))
    (tmp_path / "full").mkdir()
    taken = ("result.nc", "good.nc", "case1_0.2mm.nc", "budget.csv", "allocation.png")
    for name in (*taken, "iso9283.csv", "plan.txt", "j.sdf"):
        (tmp_path / "full" / name).write_bytes(b"something")
    (tmp_path / "swept").mkdir()
    (tmp_path / "swept" / "cases.sqlite").write_text("{}")
    (tmp_path / "there.html").write_text("")
    (tmp_path / "a.nc").write_bytes(b"")
    return tmp_path


REFUSALS = [
    (["run", "--out", "full"], "already holds results (result.nc)"),
    (["run", "good.toml", "--out", "full"], "already holds results (good.nc)"),
    (["run", "bad.toml", "--out", "new"], "radial_clearance"),
    (["run", "no_such_robot", "--out", "new"], "no_such_robot"),
    (["run", "good.toml", "--case", "other", "--out", "new"], "good"),
    (["check", "bad.toml"], "radial_clearnce"),
    (["check", "none.toml"], "none.toml"),
    (["play", "none.nc"], "no result file"),
    (["play", "a.nc", "--html", "there.html"], "exists"),
    (["report", "none.nc"], "no result file"),
    (["report", "a.nc", "-o", "there.html"], "exists"),
    (["scara", "--out", "full"], "already holds results (case1_0.2mm.nc)"),
    (["scara", "--out", "new", "--runs", "1"], "at least 2 runs"),
    (["scara", "--out", "new", "--jobs", "0"], "jobs must be a whole number"),
    (["budget", "ur5", "--out", "full"], "already holds results (budget.csv)"),
    (["allocate", "ur5", "--target", "1e-4", "--out", "full"], "(allocation.png)"),
    (["export", "simulator", "ur5", "--joint", "j", "--out", "full"], "(j.sdf)"),
    (["study", "iso9283", "good.toml", "--out", "full"], "(iso9283.csv)"),
    (["identify", "good.toml", "--plan", "--out", "full"], "(plan.txt)"),
    (["calibrate", "ur5", "poses.csv", "--folds", "some"], "--folds: must be a number"),
    (["calibrate", "ur5", "poses.csv", "--scatter", "0 mm"], "--scatter must be positive"),
    (["study", "sweep", "good.toml", "--out", "swept"], "--resume"),
    (["study", "sweep", "good.toml", "--out", "full"], "a folder that holds other files"),
    (["plot", "swept", "x=a", "y=b", "--out", "there.html"], "exists"),
    (["study", "uncertainty", "swept", "m", "--out", "there.html"], "exists"),
    (["export", "result", "a.nc", "--out", "table.xyz"], "table.xyz"),
]


@pytest.fixture(scope="module")
def refusals(folder):
    """What became of each, by its words."""
    found = outcomes([arguments for arguments, _ in REFUSALS], folder)
    return dict(zip(map(str, REFUSALS), found, strict=True))


@pytest.mark.parametrize("refusal", REFUSALS, ids=lambda refusal: " ".join(refusal[0]))
def test_refusals_import_nothing_slow(refusal, refusals):
    status, said, slow = refusals[str(refusal)]
    assert status == 2
    assert refusal[1] in said
    assert len(said.strip().splitlines()) == 1
    assert slow == []


def test_a_wrong_unit_may_need_pint_only(folder):
    ((status, said, slow),) = outcomes([["check", "unit.toml"]], folder)
    assert status == 2
    assert '"10 s"' in said
    assert set(slow) <= {"pint", "scipy"}  # which pint imports


def test_a_check_without_a_picture_needs_no_library_of_results_and_figures(folder):
    ((status, said, slow),) = outcomes([["check", "good.toml", "--no-picture"]], folder)
    assert status == 0, said
    assert not {"xarray", "pandas", "matplotlib"} & set(slow)


UNUSED = (
    *("numba", "fontTools.subset", "trimesh", "yourdfpy", "meshcat", "pint", "dask.array"),
    *("distributed", "scipy"),
)
"""What takes long to import, and a run that draws its figures does not need."""


def test_a_run_imports_what_it_needs_alone(folder):
    robot = ["run", "scara", "--joint", "joint_b=0.1mm", "--duration", "1 ms", "--out"]
    program = (
        "import json, sys; from jointplay.cli import main\n"
        "status = main(json.loads(sys.argv[1]))\n"
        f"sys.exit(status or ', '.join(name for name in {UNUSED!r} if name in sys.modules) or 0)"
    )
    call(*robot, "once", cwd=folder)  # may compile
    command = [sys.executable, "-c", program, json.dumps([*robot, "again"])]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "next: jointplay play" in done.stdout
    assert {path.suffix for path in (folder / "again").iterdir()} == {".nc", ".png"}


WITHOUT_NUMBA = """
import json, sys
sys.modules.update(dict.fromkeys(("numba", "matplotlib", "xarray")))
from jointplay.cli import main
sys.exit(main(json.loads(sys.argv[1])))
"""

DECISIONS = [
    ["budget", "scara", "--clearance", "0.05 mm"],
    ["budget", "scara", "--joint", "joint_b=6205"],
    ["budget", "scara", "--clearance", "0.05 mm", "--whole", "industrial"],
    ["budget", "so101", "--preset"],
    ["check", "good.toml", "--no-picture"],
    ["robots"],
    ["export", "urdf", "scara", "--clearance", "0.1 mm", "--out", "clone.urdf"],
]
QUICK = DECISIONS[2], DECISIONS[4]


@pytest.mark.parametrize(
    "line",
    [pytest.param(line, marks=() if line in QUICK else pytest.mark.thorough) for line in DECISIONS],
    ids=" ".join,
)
def test_decisions_import_neither_a_compiler_nor_figures(line, folder, monkeypatch):
    """Statics of joints call a few compiled functions, which are at hand after the first time."""
    monkeypatch.chdir(folder)
    first = call(*line)
    assert first.returncode == 0, first.stderr
    for made in folder.glob("clone*"):
        made.unlink()
    again = subprocess.run(
        [sys.executable, "-c", WITHOUT_NUMBA, json.dumps(line)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (again.returncode, again.stdout) == (0, first.stdout), again.stderr


def test_the_ideal_mechanism_of_a_run_is_not_simulated_for_its_figures(folder, monkeypatch):
    from jointplay.cli import main
    from jointplay.simulation.analysis import tool_error
    from jointplay.study import certification

    made, own = [], tool_error.tool_motion
    for module in (tool_error, certification):
        monkeypatch.setattr(
            module, "tool_motion", lambda *asked: made.append(own(*asked)) or made[-1]
        )
    run = ["run", str(folder / "good.toml"), "--duration", "1 ms", "--no-error-estimate"]
    assert main([*run, "--out", str(folder / "drawn"), "--quiet"]) == 0
    assert len(made) == 1
    assert (folder / "drawn" / "overview.png").exists()
    (file,) = (folder / "drawn").glob("*.nc")
    saved = jp.Result.load(file)
    assert saved["tool_error"].attrs["units"] == "m"
    assert len(made) == 1  # it is in the file
    off = saved["tool_position"].values - saved["ideal_tool_position"].values
    assert np.array_equal(off, saved["tool_error_vector"])
    assert np.array_equal(np.linalg.norm(off, axis=1), saved["tool_error"])


def test_an_occupied_folder_is_not_claimed_and_a_free_one_not_made(folder):
    assert outcomes([["run", "bad.toml", "--out", "new"]], folder)[0][0] == 2
    assert not (folder / "new").exists()


def test_names_of_figures_are_those_that_are_drawn():
    from jointplay.show.plots.figures import CHARTS
    from jointplay.show.plots.names import NAMES

    assert tuple(CHARTS) == NAMES


FRONTS = sorted(Path(jp.__file__).parent.rglob("__init__.pyi"))


@pytest.mark.parametrize("front", FRONTS, ids=lambda path: path.parent.name)
def test_packages_have_all_that_their_stubs_name(front):
    place = front.parent.relative_to(Path(jp.__file__).parents[1])
    module = importlib.import_module(".".join(place.parts))
    names = re.findall(r"^from \S+ import \w+ as (\w+)$", front.read_text(), re.MULTILINE)
    assert sorted(names) == sorted(module.__all__)
    assert all(hasattr(module, name) for name in names)
    with pytest.raises(AttributeError, match="nothing"):
        module.nothing  # noqa: B018


@pytest.mark.thorough
def test_a_list_of_robots_that_is_kept_loads_none(folder, monkeypatch):
    monkeypatch.setenv("JOINTPLAY_CACHE", str(folder / "cache"))
    (_, _, slow), (status, _, slow_again) = outcomes([["robots"], ["robots"]], folder)
    assert "pinocchio" in slow
    assert (status, slow_again) == (0, [])


@pytest.mark.thorough
def test_a_budget_at_a_pose_does_not_import_statistics(tmp_path):
    program = (
        "import sys; from jointplay.cli import main\n"
        "main(['budget', 'jointplay:scara.toml'])\n"
        "sys.exit('scipy.stats' in sys.modules or 'matplotlib' in sys.modules)"
    )
    assert (
        subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=False).returncode == 0
    )
    begun = [sys.executable, "-m", "jointplay", "robots", "--presets"]
    assert "so101" in subprocess.run(begun, capture_output=True, text=True, check=True).stdout
