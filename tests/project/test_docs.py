"""Every command and snippet of README and docs runs as it is written, from top to bottom.

What a page takes for granted - a user's robot, results of an earlier command - lies in the folder
that it runs in. Commands that set up a machine are `.ci/run`'s business. What an earlier page has
already is not run again, figures for print are not drawn, the README's runs and the 60 cases of the
shipped sweep are simulated for a shorter time, and a test of a pose has 3 cycles.
"""

import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
from math import cos, sin
from pathlib import Path
from types import SimpleNamespace

import pytest
import warm
import yaml

import jointplay as jp

ROOT = Path(__file__).parents[2]
SITE = ROOT / "docs" / "site"
SHOWN = SimpleNamespace(**runpy.run_path(str(SITE / "shown.py")))
PAGES, blocks, named, commands = SHOWN.PAGES, SHOWN.blocks, SHOWN.named, SHOWN.commands

NIGHTLY = ("jointplay scara", "jointplay run --certify")
"""Commands that take long: the study has a test of its own, certificates many."""

TUTORIAL = (ROOT / "docs" / "tutorials" / "own_robot.md").read_text("utf-8")
ROBOT = re.search(r"^```xml\n(.*?)^```$", TUTORIAL, re.MULTILINE | re.DOTALL)[1]

POSES = "shoulder motor [rad],elbow motor [rad],tool x [m],tool y [m],tool z [m]\n" + "".join(
    f"{a},{b},{cos(a) / 5 + cos(a + b) / 5:.5f},{sin(a) / 5 + sin(a + b) / 5:.5f},0\n"
    for a, b in ((0.1 * i, 0.3 * ((7 * i) % 11) - 1.5) for i in range(12))
)
"""Static poses of that robot."""

STAIRS = "joint,motor [mm],reading [mm]\n" + "".join(
    f"{axis},{place},{0.5 + min(max(place + way * lost / 2, 0), 5) + 2e-4 * (number % 3):.3f}\n"
    for axis, lost in (("x", 0.08), ("y", 0.02))
    for number, (way, place) in enumerate(
        (way, place)
        for _ in range(2)
        for way, places in ((-1, range(1, 6)), (1, range(4, 0, -1)))
        for place in places
    )
)
"""Two axes, forth and back."""


def each(pages):
    """Pages as parameters of a thorough test."""
    named = pytest.mark.parametrize("page", pages, ids=lambda page: str(page.relative_to(ROOT)))
    return lambda test: pytest.mark.thorough(named(test))


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """Results that pages speak of."""
    folder = tmp_path_factory.mktemp("earlier")
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    for name, clearance in (("ideal", None), ("case1_0.2mm", 2e-4), ("case2_0.5mm", 5e-4)):
        joint = (
            jp.RevoluteClearance(radial_clearance=clearance, axial_clearance=clearance)
            if clearance
            else None
        )
        joints = {"joint_b": joint} if joint else {}
        robot = jp.Mechanism(jp.shipped("scara.urdf"), joints, gravity=(0, 0, 0))
        jp.simulate(robot, motion, duration=0.05).save(folder / f"{name}.nc")
    return folder


@pytest.fixture
def folder(earlier, tmp_path, monkeypatch):
    """A folder with what users have: a robot, its motion, results of an earlier run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PATH", f"{warm.folder()}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("MPLBACKEND", "agg")
    (tmp_path / "my_robot.urdf").write_text(ROBOT)
    (tmp_path / "poses.csv").write_text(POSES)
    (tmp_path / "stairs.csv").write_text(STAIRS)
    for name, source in {**{"a": "case1_0.2mm", "b": "case2_0.5mm", "one": "case1_0.2mm"}}.items():
        shutil.copy(earlier / f"{source}.nc", tmp_path / f"{name}.nc")
    shutil.copy(earlier / "case1_0.2mm.nc", tmp_path)
    shutil.copytree(earlier, tmp_path / "results")
    yield tmp_path
    sys.modules.pop("my_laws", None)


def run(command):
    """Run a line of a shell; servers are stopped once they serve."""
    if "--movie" in command and not any(map(shutil.which, ("chromium", "google-chrome"))):
        return None  # films need a browser
    serves = command.startswith(("jointplay play", "jointplay live"))
    if serves and not re.search("--html|--movie", command):
        return serve(command)
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr
    return None


def serve(command):
    process = subprocess.Popen(
        f"exec {command} --no-browser",
        shell=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said = ""
    while "http://" not in said:
        line = process.stdout.readline()
        assert line, f"{command} ended: {said}"
        said += line
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=600)


SWEEP = "jointplay:scara_sweep.toml"


def shorter(command, page):
    """What a command shows in less time."""
    if command.startswith("jointplay run"):
        short = " --set integration.duration=0.2" if page is PAGES[0] else ""
        return f"{command} --no-figures{short}"
    if command.startswith("jointplay report"):
        return f"{command} --no-pdf"
    if command.startswith("jointplay study hunting"):
        return command.replace("--poses 7", "--poses 2")
    if command.startswith("jointplay study iso9283"):
        assert "--cycles 10" in command
        return command.replace("--cycles 10", "--cycles 3")
    if SWEEP not in command:
        return command
    text = jp.shipped("scara_sweep.toml").read_text().replace('"scara', '"jointplay:scara')
    assert text.count("[integration]") == 1
    text = text.replace("[integration]", '[integration]\nduration = "20 ms"')
    Path("scara_sweep.toml").write_text(text)
    return command.replace(SWEEP, "scara_sweep.toml")


def fresh(command):
    """Nothing is overwritten, so a folder that an earlier line filled gives way."""
    found = re.search(r"--out (\S+)", command)
    if found and Path(found[1]).is_dir() and command.startswith("jointplay run"):
        shutil.rmtree(found[1])


PYTHON = [page for page in PAGES if blocks(page, "python")]
SHELL = [page for page in PAGES if blocks(page, "sh")]


@each(PYTHON)
def test_snippets_run_as_they_are_written(page, folder):
    matplotlib = pytest.importorskip("matplotlib.pyplot")
    names = {"my_axes": matplotlib.figure().subplots(), "__name__": "__main__"}
    text = page.read_text()
    for block in blocks(page, "python"):
        source = block.text
        if file := named(block, text):
            (folder / file).write_text(source)
            if f"\npython {file}\n" in text:  # with the page's other commands, below
                continue
        exec(compile(source, f"{page.name}, line {block.line}", "exec"), names)
    matplotlib.close("all")


@each(SHELL)
def test_commands_run_as_they_are_written(page, folder):
    shutil.copy(folder / "one.nc", folder / "run.nc")
    before = {
        command
        for earlier in SHELL[: SHELL.index(page)]
        for block in blocks(earlier, "sh")
        for command in commands(block.text)
    }
    here = [line for block in blocks(page, "sh") for line in commands(block.text)]
    used = {word for line in here if line not in before for word in line.split()[2:]} - {"--out"}
    text = page.read_text()
    for block in blocks(page, "sh", "text", "python"):
        if file := named(block, text):
            (folder / file).write_text(block.text)
        if block.language != "sh":
            continue
        for plain in commands(block.text):
            if plain in before and not used.intersection(plain.split()[2:]):
                continue
            if plain.startswith(("python3 -m venv", "mkdocs", *NIGHTLY)):
                continue
            fresh(plain)
            run(shorter(plain, page))


def same(shown, printed):
    """Whether lines differ by no more than their numbers do from one processor to another.

    A number behind a plus-minus sign is an estimate of rounding and of steps: any will do.
    """
    number = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    if re.sub(number, "#", shown) != re.sub(number, "#", printed):
        return False
    tiny = re.compile(r"± |residual")
    pairs = zip(re.finditer(number, shown), re.finditer(number, printed), strict=True)
    return all(
        float(a[0]) == pytest.approx(float(b[0]), rel=0.02, abs=1e-12)
        or tiny.search(shown[max(0, a.start() - 30) : a.start()])
        for a, b in pairs
    )


@each([page for page in PAGES if blocks(page, "console")])
def test_answers_are_shown_as_they_are_printed(page, folder):
    """In blocks of this kind a command stands behind a dollar sign, and below it what it prints."""
    for part in (part for one in blocks(page, "console") for part in one.text.split("$ ")[1:]):
        command, *shown = part.splitlines()
        done = subprocess.run(
            command, shell=True, capture_output=True, text=True, timeout=1800, check=True
        )
        printed = (done.stdout + done.stderr).splitlines()
        assert shown
        for one in filter(None, shown):
            assert any(same(one, other) for other in printed), (one, done.stdout)


def test_answers_that_differ_are_found():
    assert same("peak 71.41 ± 0.13 N", "peak 71.4 ± 0.4 N")
    assert not same("peak 71.41 ± 0.13 N", "peak 74.41 ± 0.13 N")
    assert not same("peak 71.41 N", "least 71.41 N")


def test_the_first_example_of_python_prints_what_it_says(folder, capsys):
    source = blocks(ROOT / "docs" / "python.md", "python")[0].text
    exec(compile(source, "python.md", "exec"), {"__name__": "__main__"})
    said = float(re.search(r"# ([\d.]+) mm", source)[1])
    assert float(re.search(r"([\d.]+) mm", capsys.readouterr().out)[1]) == pytest.approx(said, 1e-2)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "command",
    ["jointplay run --certify --out certified", f"jointplay study sweep {SWEEP} --out scara_sweep"],
)
def test_long_commands_run(command, folder):
    assert command in "\n".join(page.read_text() for page in PAGES)
    run(command)


def test_the_front_pages_are_short():
    assert len(PAGES[0].read_text().split()) <= 700
    assert len((ROOT / "docs" / "README.md").read_text().split()) <= 350
    pages = "\n".join(page.read_text("utf-8") for page in (ROOT / "docs").rglob("*.md"))
    assert len(re.sub(r"</?(?:details|summary)[^>]*>", "", pages).split()) <= 45_000


def test_robots_that_were_tried_have_numbers_or_a_reason():
    tables = runpy.run_path(str(ROOT / "docs" / "site" / "tables.py"))
    _, _, *rows = tables["tried"]()["tried"].splitlines()
    assert len(rows) > 50
    for row in rows:
        *_, budget, run, remarks = (cell.strip() for cell in row.strip("|").split(" | "))
        assert all(cell == "refused" or float(cell) > 0.0 for cell in (budget, run))
        assert remarks or run != "refused"


def test_lines_of_prose_are_no_longer_than_100_columns(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import wrap

    found = {page.name: wrap.long_lines(page.read_text("utf-8")) for page in wrap.pages()}
    assert {name: lines for name, lines in found.items() if lines} == {}
    assert wrap.long_lines(40 * "word ") != []
    assert wrap.long_lines(f"$$a\n+ b$$\n\n{40 * 'word '}") != []  # after a formula as well
    table = f"| {40 * 'word '} |"
    assert wrap.rewritten(table) == table


LINK = re.compile(r"\]\(([^)#\s]+\.(?:md|ipynb))[#)]")


def test_the_site_has_three_doors_and_from_them_every_page_is_reached():
    text = (ROOT / "mkdocs.yml").read_text("utf-8")
    home, *doors = yaml.safe_load(text[text.index("\nnav:") :])["nav"]
    assert home == {"Home": "README.md"}
    assert len(doors) == 3
    named = [*home.values()]
    for door in doors:
        ((_, entries),) = door.items()
        named += [one if isinstance(one, str) else next(iter(one.values())) for one in entries]
    assert len(named) <= 25
    left, reached = [*named], set()
    while left:
        page = left.pop()
        file = ROOT / "docs" / page
        if page in reached or not file.exists():  # pages that generate.py writes
            continue
        reached.add(page)
        if file.suffix == ".md":
            found = LINK.findall(file.read_text("utf-8"))
            left += [os.path.normpath(Path(page).parent / one) for one in found]
    docs = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "docs").rglob("*.ipynb")]
    assert {str(file.relative_to(ROOT / "docs")) for file in docs} - reached == set()


def test_guides_begin_with_a_picture_that_their_commands_make(monkeypatch):
    monkeypatch.syspath_prepend(str(SITE))
    pictures = SimpleNamespace(**runpy.run_path(str(SITE / "pictures.py")))
    index = (ROOT / "docs" / "guides.md").read_text("utf-8")
    guides = set(re.findall(r"^- \[!\[[^\]]+\]\([^)]+\)\]\(([^)]+)\)", index, re.MULTILINE))
    assert len(guides) > 15
    for page in guides:
        _, blank, picture, *_ = (ROOT / "docs" / page).read_text("utf-8").splitlines()
        found = re.fullmatch(r"!\[([^\]]{15,})\]\(([^)]+)\)", picture)
        assert (blank, bool(found)) == ("", True), (page, picture)
        file = (ROOT / "docs" / page).parent / found[2]
        assert 0 < file.stat().st_size < 100_000
    for name, picture in pictures.PICTURES.items():
        assert pictures.typed(picture), name  # raises where the page has no such command
        assert len([*pictures.TARGET.glob(f"{name}.*")]) == 1
    with pytest.raises(ValueError, match="no command that begins with 'jointplay fly'"):
        SHOWN.command(PAGES[0], "jointplay fly")


def test_answers_of_pages_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "```console\n$ a --b \\\n  c\none\ntwo\n$ d\nthree\n```\n"
        "```sh\ne f\n```\n\n```text\n...\nfour\n```\n```sh\ng\nh\n```\n"
    )
    found = [(" ".join(line.split()), first) for line, first in SHOWN.answers(page)]
    assert found == [("a --b c", "one"), ("d", "three"), ("e f", "four"), ("g", ""), ("h", "")]


def test_every_command_of_the_command_line_is_shown_somewhere():
    from jointplay.cli import parsers

    text = "\n".join(page.read_text() for page in PAGES)
    assert {name for name in parsers() if f"jointplay {name}" not in text} == set()
