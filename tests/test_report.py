"""Reports, through the command and in a browser."""

import shutil
import subprocess

import numpy as np
import pytest
from conftest import body, joint
from warm import JOINTPLAY

import jointplay as jp
from jointplay import reports
from jointplay.study import scara

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Short runs of the study, as files."""
    path = tmp_path_factory.mktemp("study")
    for name, clearance in (("ideal", None), ("worn", 0.2e-3), ("loose", 0.5e-3)):
        made = scara(clearance)
        jp.simulate(made.mechanism, made.motion, duration=0.4).save(path / f"{name}.nc")
    return path


@pytest.fixture(scope="module")
def page(folder):
    done = call("report", folder, "--quiet", "--impacts", "2")
    assert done.returncode == 0, done.stderr
    return folder / "report.html"


def call(*arguments):
    command = [JOINTPLAY, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)


def test_page_has_its_sections_and_no_addresses(page):
    text = page.read_text(encoding="utf-8")
    for name in ("At a glance", "Parameters", "Assumptions", "Audit", "Accuracy", "Impacts"):
        assert f"<h2>{name}</h2>" in text
    assert "default-src 'none'" in text
    assert "worn" in text
    assert page.stat().st_size < 15e6
    assert page.with_suffix(".pdf").read_bytes().startswith(b"%PDF")


def test_numbers_are_those_of_the_results(page, folder):
    from jointplay import analysis

    worn, ideal = (jp.Result.load(folder / f"{name}.nc") for name in ("worn", "ideal"))
    error = analysis.accuracy(analysis.deviation(worn, ideal), 0.15)
    text = page.read_text(encoding="utf-8")
    assert f"{1e3 * error.rms[3]:.3g}" in text
    assert f"{1e6 * worn.audit.largest_penetration:.3g}" in text


def test_any_mechanism_can_be_reported(tmp_path):
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    results = {}
    for case in ("ideal", "0.2 mm"):
        simulation = scenario.simulation(case, {"integration": {"duration": "0.014 s"}})
        results[case] = simulation.run()
    reports.report(results, tmp_path / "a.html", impacts=1, pdf=False)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "piston_pin" in text


def test_balls_oil_and_wear_without_a_motion(urdf, tmp_path):
    path = urdf(
        body("a"), body("b", com="0.1 0 0"), joint("one", "base", "a"),
        joint("two", "a", "b", "floating", at="0.2 0 0"),
    )  # fmt: skip
    joints = {
        "one": jp.RevoluteClearance(
            radial_clearance=1e-4, axial_clearance=1e-4, bearing_length=8e-3,
            lubricant=jp.contact.ShortBearing(0.1), wear_rate=1e-14,
        ),
        "two": jp.SphericalClearance(radial_clearance=1e-4),
    }  # fmt: skip
    robot = jp.Mechanism(path, joints, gravity=(0, -9.81, 0))
    result = jp.simulate(robot, duration=0.05, drive=jp.loads.Free(), joint_friction={}, step=5e-6)
    reports.report({"ball": result}, tmp_path / "a.html", impacts=1)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "Reynolds" in text
    assert "Archard" in text
    assert "no lubricant is given are dry" in text  # the ball


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda p: [p / "none.nc"], "no result file"),
        (lambda p: [_write(p / "text.nc", b"no netcdf")], "damaged or not a result"),
        (lambda p: [p], "holds no results"),
        (lambda p: [_write(p / "cut.nc", b"\x89HDF\r\n\x1a\n" + b"\0" * 99)], "damaged"),
    ],
)
def test_what_is_no_result_is_named(make, text, tmp_path):
    done = call("report", *make(tmp_path))
    assert done.returncode == 2
    assert text in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def _write(path, data):
    path.write_bytes(data)
    return path


def test_nothing_is_overwritten(page, folder):
    done = call("report", folder, "--quiet")
    assert done.returncode == 2
    assert "exists" in done.stderr


PATIENCE_MS = 900_000
"""A deadline for pages that never get ready, not a measure of speed."""

ZOOMED = """() => {
    const [low, high] = document.getElementById("chart-contacts").layout.xaxis.range;
    return Math.abs(low - 0.2) < 1e-9 && Math.abs(high - 0.201) < 1e-9;
}"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_page_works_in_a_browser_without_a_network(page, tmp_path):
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from matplotlib.image import imread

    troubles, requests = [], []
    with sync.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1100, "height": 900})
        tab.set_default_timeout(PATIENCE_MS)
        tab.on("console", lambda message: troubles.append(message.text))
        tab.on("pageerror", lambda error: troubles.append(str(error)))
        tab.on("request", lambda request: requests.append(request.url))
        tab.goto(page.as_uri())
        tab.wait_for_function("window.jointplayReport && window.jointplayReport.ready")
        shots = []
        for name in ("tool_displacement", "journal_orbit", "contacts"):
            tab.evaluate(f"document.getElementById('chart-{name}').scrollIntoView()")
            tab.wait_for_selector(f"#chart-{name}.drawn")
            shots.append(tmp_path / f"{name}.png")
            tab.locator(f"#chart-{name}").screenshot(path=shots[-1])
        # Zooming one chart in time zooms all, down to single steps.
        tab.evaluate("window.jointplayReport.show([0.2, 0.201])")
        tab.wait_for_function(ZOOMED)
        ranges = tab.evaluate("document.getElementById('chart-contacts').layout.xaxis.range")
        tab.locator("#chart-contacts").screenshot(path=tmp_path / "zoomed.png")
        drawn = tab.evaluate("window.jointplayReport.drawn")
        browser.close()
    assert not troubles
    assert requests == [page.as_uri()]
    assert ranges == pytest.approx([0.2, 0.201])
    assert drawn >= 3
    images = [imread(shot)[..., :3] for shot in [*shots, tmp_path / "zoomed.png"]]
    assert all(image.std() > 0.02 for image in images)
    before, after = images[-2:]
    assert before.shape != after.shape or np.abs(before - after).mean() > 1e-3


IN_PRINT = """() => {
    const broken = [], right = document.documentElement.clientWidth;
    for (const cell of document.querySelectorAll("th, td")) {
        const words = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
        for (let node = words.nextNode(); node; node = words.nextNode()) {
            for (const word of node.data.matchAll(/[\\w.,]+/g)) {
                const range = document.createRange();
                range.setStart(node, word.index);
                range.setEnd(node, word.index + word[0].length);
                const tops = new Set([...range.getClientRects()].map(box => Math.round(box.top)));
                if (tops.size > 1) broken.push(word[0]);
            }
        }
    }
    const tables = [...document.querySelectorAll("table")];
    const wide = tables.filter(one => one.getBoundingClientRect().right > right + 1).length;
    const charts = [...document.querySelectorAll(".chart")].map(one => one.id);
    const empty = charts.filter(id => !document.querySelector(`#${id} .main-svg .trace`));
    return { broken, wide, tables: tables.length, charts: charts.length, empty };
}"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_a_print_has_whole_words_whole_tables_and_all_charts(page, tmp_path):
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1100, "height": 900})
        tab.set_default_timeout(PATIENCE_MS)
        tab.goto(page.as_uri())
        tab.wait_for_function("window.jointplayReport && window.jointplayReport.ready")
        tab.pdf(path=tmp_path / "at_once.pdf")  # draws what was not yet on the screen
        tab.emulate_media(media="print")
        tab.set_viewport_size({"width": 703, "height": 1000})  # A4 between its margins
        seen = tab.evaluate(IN_PRINT)
        browser.close()
    assert seen["tables"] > 8
    assert seen["charts"] > 10
    assert seen["broken"] == []
    assert seen["wide"] == 0
    assert seen["empty"] == []
    assert (tmp_path / "at_once.pdf").stat().st_size > 100_000
