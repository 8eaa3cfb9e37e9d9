"""Reports, through the command and in a browser."""

import re
import shutil
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from browsing import DRAWN, UNFOLD, until
from conftest import body, joint
from PIL import Image
from warm import call

import jointplay as jp
from jointplay.paper import scara
from jointplay.show import reports


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Short runs of the study, as files."""
    path = tmp_path_factory.mktemp("study")
    for name, clearance in (("ideal", None), ("worn", 0.2e-3)):
        made = scara(clearance)
        start = {"judge_from": 0.15} if clearance else {}
        jp.simulate(made.mechanism, made.motion, duration=0.4, **start).save(path / f"{name}.nc")
    return path


@pytest.fixture(scope="module")
def page(folder):
    done = call("report", folder, "--quiet", "--impacts", "1")
    assert done.returncode == 0, done.stderr
    return folder / "report.html"


def test_results_of_the_same_name_are_called_by_their_folders(folder, tmp_path):
    for name in ("tight", "loose"):
        (tmp_path / name).mkdir()
        shutil.copy(folder / "worn.nc", tmp_path / name / "result.nc")
    places = [tmp_path / "tight", tmp_path / "loose" / "result.nc"]
    assert list(reports.load(places, [])) == ["tight", "loose"]


def test_page_has_its_sections_and_no_addresses(page):
    text = page.read_text(encoding="utf-8")
    assert "ambrosio (mu d 0.1, v0 0.0001 m/s, v1 0.001 m/s)" in text
    assert "young 207 GPa" in text
    for name in ("At a glance", "Parameters", "Assumptions", "Audit", "Accuracy", "Impacts"):
        assert f"<h2>{name}</h2>" in text
    for chart in ("energy", "modes", "forms"):
        assert f'id="chart-{chart}"' in text
    assert "default-src 'none'" in text
    assert "worn" in text
    assert page.stat().st_size < 15e6
    pdf = page.with_suffix(".pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    # Texts are encoded for TrueType; in others a minus would stand across the digit behind it. And
    # every letter has a typeface: superscripts of powers of ten are no boxes.
    assert b"/TrueType" in pdf or b"/CIDFontType2" in pdf
    assert b"/Type3" not in pdf
    assert b"LastResort" not in pdf


@pytest.mark.thorough
def test_a_machine_with_gears_alone_has_no_empty_sections(tmp_path):
    options = ["--gear", "joint_b=1 mrad", "--gear-stiffness", "2e4", "--rotor-inertia", "0.5"]
    run = [
        "run",
        "scara",
        *options,
        "--duration",
        "0.1",
        "--no-error-estimate",
        "--no-figures",
        "--quiet",
    ]
    done = call(*run, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    done = call("report", tmp_path, "--quiet", "--no-pdf")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    for name in ("Bearings", "Impacts"):
        assert f"<h2>{name}</h2>" not in text
    assert 'id="chart-force_x"' in text  # of the ideal joint: its constraint force
    assert "journal" not in text.partition("<script")[0].lower()
    assert "<h2>Spectrum</h2>" in text


def test_numbers_are_those_of_the_results(page, folder):
    from jointplay import analysis

    worn, ideal = (jp.Result.load(folder / f"{name}.nc") for name in ("worn", "ideal"))
    error = analysis.error_statistics(analysis.difference(worn, ideal), 0.15)
    text = page.read_text(encoding="utf-8")
    assert f"{1e3 * error.rms[3]:.3g}" in text
    assert f"{1e6 * worn.audit.largest_penetration:.3g}" in text


@pytest.mark.thorough
def test_a_planar_machine_has_no_charts_of_zeros_and_no_empty_columns(tmp_path):
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    integration = {"duration": "0.01 s"}
    result = scenario.simulation("0.2 mm", {"integration": integration}).run(estimate=False)
    reports.report({"crank": result}, tmp_path / "a.html", impacts=0, pdf=False)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    idle = re.search("No force acts along ([xyz])", text)[1]
    drawn = {axis for axis in "xyz" if f'id="chart-force_{axis}"' in text}
    assert drawn == set("xyz") - {idle}
    assert 'id="chart-tilt"' not in text
    assert '<th scope="col">case</th>' not in text
    assert '<th scope="col">axis</th>' in text


@pytest.mark.thorough
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


@pytest.mark.parametrize(
    ("error", "marked"), [pytest.param(5.0, False, marks=pytest.mark.thorough), (400.0, True)]
)
def test_a_glance_shows_errors_and_marks_uncertain_figures(folder, tmp_path, error, marked):
    from jointplay.simulation.result.certificate import Certificate, CertifiedFigure

    result = jp.Result.load(folder / "worn.nc")
    late = result.time >= result.judge_from
    peak = np.linalg.norm(result["joint_force_peak"].values[late], axis=2).max()
    figure = CertifiedFigure("peak joint force", float(peak), error, "N")
    result.certificate = Certificate((figure,), ("a further run",))
    reports.report({"0.2 mm": result}, tmp_path / "a.html", impacts=0, pdf=False)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    seen = text[text.index('id="glance"') : text.index("<h2>Parameters")]
    assert f"±\u00a0{error:.0f}" in seen
    assert (">uncertain</strong>" in seen) == marked
    assert ("compare designs" in seen) == marked


@pytest.mark.thorough
def test_the_error_of_servos_is_the_same_in_sentence_and_table(tmp_path):
    done = call("run", "so101", "--preset", "--out", tmp_path, "--quiet", "--no-figures",
                "--duration", "0.2 s")  # fmt: skip
    assert done.returncode == 0, done.stderr
    reports.report({"so101": jp.Result.load(tmp_path / "result.nc")}, tmp_path / "a.html",
                   pdf=False)  # fmt: skip
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    told = re.search(r"up to ([\d.]+) mm from where it was sent", text)
    shown = re.search(r"tool from where it was sent, peak \[mm\]</th><td[^>]*>([\d.]+)<", text)
    assert float(told[1]) == float(shown[1])
    assert '"name":"from where it was sent"' in text  # a curve of the first chart


@pytest.mark.thorough
def test_title_and_cases_are_those_of_the_scenario(tmp_path):
    path = tmp_path / "crank.toml"
    text = jp.Scenario.load("jointplay:slider_crank.toml").text
    text = text.replace('title = "', 'title = "Mine: ', 1)
    path.write_text(text.replace('urdf = "', 'urdf = "jointplay:'), encoding="utf-8")
    done = call("run", path, "--out", tmp_path / "out", "--quiet", "--no-figures", "--jobs", "1",
                "--no-error-estimate", "--set", "integration.duration=5e-3")  # fmt: skip
    assert done.returncode == 0, done.stderr
    done = call("report", tmp_path / "out", "--quiet", "--impacts", "0", "--no-pdf")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h1>Mine: " in text
    glance = text[text.index('id="glance"') : text.index("<h2>Parameters")]
    names = ["ideal", "0.05 mm", "0.1 mm", "0.2 mm", "0.5 mm"]
    places = [glance.index(f">{name}</span>") for name in names]
    assert places == sorted(places)
    assert 'alt="slider_crank at the start of the run; play in piston_pin"' in glance
    assert glance.count("integration.start") == 1  # of all cases
    assert "0.2_mm" not in text


def test_a_list_folds_several_points_or_none():
    from jointplay.show.reports.parts import Block, Grid, Points, shortened
    from jointplay.show.reports.template import page

    for part, few in (
        (Points("abcde"), Points("abcd")),
        (Grid(["x"], [["a"]] * 5), Grid(["x"], [["a"]] * 4)),
    ):
        shown = page("t", "s", {}, [(Block("b", list), [*shortened(part, "case")])])
        assert "The other 2 cases" in shown
        shown = page("t", "s", {}, [(Block("b", list), [*shortened(few, "case")])])
        assert "The other" not in shown


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("ideal", "words"),
    [([], "play in the gear of joint_b"), (["--ideal"], "nothing has play")],
)
def test_the_picture_says_which_gears_have_play(ideal, words, tmp_path):
    options = ["--gear", "joint_b=1 mrad", "--gear-stiffness", "2e4", "--rotor-inertia", "0.5"]
    options += [*ideal, "--duration", "5e-3", "--no-error-estimate", "--no-figures", "--quiet"]
    done = call("run", "jointplay:scara.urdf", *options, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    done = call("report", tmp_path / "out", "--quiet", "--impacts", "0", "--no-pdf")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f"at the start of the run; {words}" in text
    assert "Tool errors are against the ideal mechanism with the same drives" in text


def _write(path, data):
    path.write_bytes(data)
    return path


def test_nothing_is_overwritten(page, folder):
    done = call("report", folder, "--quiet")
    assert done.returncode == 2
    assert "exists" in done.stderr


ZOOMED = """() => {
    const [low, high] = document.getElementById("chart-contacts").plots[0].across.range;
    return Math.abs(low - 0.2) < 1e-9 && Math.abs(high - 0.201) < 1e-9;
}"""


WHOLE = "() => Boolean(window.jointplayReport?.whole)"


@pytest.fixture
def open_report(open_page):
    """Opens a report in a browser, unfolds all of it, and waits until its charts are drawn."""

    def opened(page, width, scheme="light", folded=False):
        tab = open_page(page.as_uri(), (width, 900), color_scheme=scheme)
        if not folded:
            until(tab, WHOLE)
            tab.evaluate(UNFOLD)
            tab.evaluate(DRAWN)
        until(tab, WHOLE)
        return tab

    return opened


TURNING = [f"{name}_joint" for name in (
    "shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"
)]  # fmt: skip
FIRST = """() => ({
    high: document.documentElement.scrollHeight, wide: document.documentElement.scrollWidth,
    shown: [...document.querySelectorAll(".chart")].filter(one => one.checkVisibility()).map(one => one.id),
    drawn: [...document.querySelectorAll(".chart")].filter(one => one.querySelector("path.curve[d^=M]")).length,
    folded: [...document.querySelectorAll("details.part > summary")].map(one => one.innerText),
})"""  # noqa: E501


@pytest.mark.parametrize("number", [1, 6])
def test_answer_picture_and_three_charts_come_first_the_rest_is_folded(
    number, tmp_path, open_report
):
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    arm = jp.Mechanism("ur5", dict.fromkeys(TURNING[:number], bearing))
    result = jp.simulate(arm, duration=0.02, drive=jp.loads.Free())
    reports.report({"result": result}, tmp_path / "a.html", impacts=0, pdf=False)
    charts = ["chart-first_error", "chart-first_orbit", "chart-first_force"]
    for width, most in ((1280, 5000), (400, 5000)):
        tab = open_report(tmp_path / "a.html", width, folded=True)
        seen = tab.evaluate(FIRST)
        assert seen["high"] <= most
        assert seen["wide"] <= width
        assert seen["shown"] == charts
        assert seen["drawn"] == 3
        text = tab.inner_text("#at-a-glance")
        assert f"in {', '.join(TURNING[:number])} puts the tool" in text
        assert tab.locator("#at-a-glance img").count() == 1
        for chart in (charts[0], charts[2]):  # sizes, from zero up
            assert tab.evaluate(f"document.getElementById('{chart}').plots[0].up.range[0]") == 0.0
        # Assumed values are on the first screen; their effects unfold by one key, at that width.
        assert tab.locator("#at-a-glance h3", has_text="assumed").bounding_box()["y"] < 900
        unfold = tab.locator("#at-a-glance summary", has_text="what others would change")
        unfold.press("Enter")
        cells = tab.locator("#assumed").locator("tbody th, tbody td")
        assert "joints" in " ".join(cells.all_inner_texts())
        for cell in (cells.first, cells.nth(1), cells.nth(3)):
            box = cell.bounding_box()
            assert 0 <= box["x"] < box["x"] + box["width"] <= width
        unfold.press("Enter")
        names = ["Parameters", "Assumptions", "Audit", "Motion of the tool"]
        names += ["Accuracy", "Bearings", "Forces", "Impacts", "Spectrum"]
        for name, title in zip(names, seen["folded"], strict=True):
            assert title.startswith(name)
            assert len(title) > len(name) + 15  # and says what is inside
        # A link to a section opens it, and its charts are drawn.
        tab.locator("nav a", has_text="Forces").click()
        until(tab, "() => document.querySelector('#chart-force_z path')")
        if number > 3:
            assert "The other 3 joints" in tab.inner_text("#forces")


def test_page_works_in_a_browser_without_a_network(page, open_report):
    from matplotlib.image import imread

    tab = open_report(page, 1100)
    images = []

    def take(name):
        tab.evaluate(f"document.getElementById('chart-{name}').scrollIntoView()")
        images.append(imread(BytesIO(tab.locator(f"#chart-{name}").screenshot()))[..., :3])

    for name in ("tool_displacement", "journal_orbit", "contacts"):
        take(name)
    # Zooming one chart in time zooms all, down to single steps.
    tab.evaluate("window.jointplayReport.show([0.2, 0.201])")
    until(tab, ZOOMED)
    take("contacts")
    assert all(image.std() > 0.02 for image in images)
    before, after = images[-2:]
    assert before.shape != after.shape or np.abs(before - after).mean() > 1e-3


LINES = """() => document.getElementById("chart-tool_velocity").plots.flatMap((plot, axis) =>
    [...plot.inner.querySelectorAll("path.curve")].map(path => ({
        numbers: path.getAttribute("d").match(/-?[\\d.]+/g).map(Number), name: path.dataset.name,
        axis, x: [plot.across.range, plot.wide], y: [plot.up.range, plot.high] })))"""


def test_a_drawn_curve_is_within_half_a_pixel_of_the_record(page, folder, open_report):
    tab = open_report(page, 1280)
    show_whole_run(tab)
    drawn = tab.evaluate(LINES)
    assert len(drawn) == 6  # three axes, two cases
    for one in drawn:
        result = jp.Result.load(folder / f"{one['name']}.nc")
        record = result["tool_velocity"].values[:, one["axis"]]
        (x0, x1), wide = one["x"]
        (y0, y1), high = one["y"]
        across = (result.time - x0) / (x1 - x0) * wide
        down = (y1 - record) / (y1 - y0) * high
        line = np.array(one["numbers"]).reshape(-1, 2)
        assert (np.diff(line[:, 0]) >= -1e-6).all()
        assert distance(np.column_stack([across, down]), line).max() < 0.5


def show_whole_run(tab):
    """Zoom by the button, with the chart of velocities in view."""
    tab.evaluate("document.getElementById('chart-tool_velocity').scrollIntoView()")
    tab.click("#whole")
    until(tab, "() => !document.getElementById('chart-tool_velocity').plots[0].across.range[0]")
    tab.evaluate(DRAWN)


def distance(points, line):
    """Distances of points (n, 2) from a polyline whose points are sorted from left to right."""
    near = np.full(len(points), np.inf)
    at = np.searchsorted(line[:, 0], points[:, 0])
    for shift in range(-6, 7):
        k = np.clip(at + shift, 1, len(line) - 1)
        begin, along = line[k - 1], line[k] - line[k - 1]
        part = np.sum((points - begin) * along, axis=1) / np.maximum(
            np.sum(along**2, axis=1), 1e-12
        )
        foot = begin + np.clip(part, 0.0, 1.0)[:, None] * along
        near = np.minimum(near, np.linalg.norm(points - foot, axis=1))
    return near


@pytest.mark.parametrize("seed", range(3))
def test_what_is_left_out_of_long_records_is_near_the_line(seed):
    from jointplay.show.reports.charts import MAX_RECORDS, Times

    number = 7 * MAX_RECORDS
    time = np.linspace(0.0, 1.0, number)
    noise = np.random.default_rng(seed).normal(size=number).cumsum() / 300.0
    values = np.sin(40.0 * time) + (noise if seed else 0.0)
    kept = Times(time, 1.0, np.ones(number, bool)).kept(values)
    assert len(kept) <= 1.1 * MAX_RECORDS
    scale = np.array([1000.0, 150.0 / np.ptp(values)])  # pixels
    points = np.column_stack([time, values]) * scale
    assert distance(points[::97], points[kept]).max() < 0.1


SEEN = """() => {
    const inside = element => { for (let at = element; at; at = at.parentElement)
        if (getComputedStyle(at).overflowX === "auto") return true; return false; };
    const right = document.documentElement.clientWidth;
    const charts = [...document.querySelectorAll(".chart")];
    return {
        wide: document.documentElement.scrollWidth - innerWidth,
        out: [...document.querySelectorAll("table")].filter(
            one => one.getBoundingClientRect().right > right + 1 && !inside(one)).length,
        paper: getComputedStyle(document.body).backgroundColor,
        charts: charts.map(one => [one.getAttribute("role"), one.getAttribute("aria-label"),
            getComputedStyle(one.querySelector(".plots")).backgroundColor, one.clientWidth,
            one.clientHeight, one.querySelector(".plots").getBoundingClientRect().height]),
    };
}"""


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), (1280, "light")])
def test_a_report_fits_the_screen_light_and_dark(page, open_report, width, scheme):
    seen = open_report(page, width, scheme).evaluate(SEEN)
    assert seen["wide"] <= 0
    assert seen["out"] == 0
    assert (seen["paper"] == "rgb(255, 255, 255)") == (scheme == "light")
    for role, label, paper, across, high, drawn in seen["charts"]:
        assert role == "group"
        assert ": " in label
        assert paper == seen["paper"]
        assert across > 0.85 * min(width, 1120)
        assert high >= drawn - 1.0  # what follows does not cover it


HIDE = "() => { document.getElementById('chart-first_error').parentElement.hidden = %s; }"


def test_a_chart_that_had_no_room_is_drawn_once_it_has_some(page, open_report):
    tab = open_report(page, 1280)
    tab.evaluate(HIDE % "true")
    tab.evaluate("window.jointplayReport.show([0.2, 0.3])")  # draws what is in view
    tab.evaluate(DRAWN)
    tab.evaluate(HIDE % "false")
    seen = "() => document.getElementById('chart-first_error').plots[0].across.range[0] === 0.2"
    until(tab, seen)
    assert tab.locator("#chart-first_error path.curve").count() == 1


def test_a_single_case_is_named_nowhere_and_pictures_are_no_slabs_in_the_dark(
    folder, tmp_path, open_report
):
    result = jp.Result.load(folder / "worn.nc")
    reports.report({"only": result}, tmp_path / "a.html", impacts=0, pdf=False)
    tab = open_report(tmp_path / "a.html", 1280, "dark")
    assert "only" not in re.findall(r"\w+", tab.inner_text("header") + tab.inner_text("#glance"))
    words = tab.locator(".key *, .plots text").all_text_contents()
    assert not any(re.search(r"\bonly\b", word) for word in words)
    pixels = Image.open(BytesIO(tab.locator("#at-a-glance img").screenshot())).convert("L")
    assert np.mean(np.asarray(pixels) > 200) < 0.2


def test_charts_and_tables_show_the_same_time(page, open_report):
    tab = open_report(page, 1280)
    assert tab.evaluate("document.getElementById('chart-tool_velocity').plots[0].across.range") == [
        pytest.approx(0.15),
        pytest.approx(0.4),
    ]
    assert "figures from 0.15 s on" in tab.inner_text("#glance")
    show_whole_run(tab)


def test_charts_zoom_name_what_is_under_the_pointer_hide_and_are_saved(page, open_report):
    tab = open_report(page, 1280)
    chart = tab.locator("#chart-tool_velocity")
    chart.scroll_into_view_if_needed()
    ranges = "id => document.getElementById(id).plots[0].across.range"
    before = tab.evaluate(ranges, "chart-tool_velocity")

    def drag(first, last):
        box = tab.locator("#chart-tool_velocity .plots").bounding_box()
        for act, part in (
            (tab.mouse.move, first),
            (tab.mouse.down, None),
            (tab.mouse.move, last),
            (tab.mouse.up, None),
        ):
            act(*([] if part is None else [box["x"] + part * box["width"], box["y"] + 80]))
        tab.evaluate(DRAWN)

    drag(0.3, 0.6)
    low, high = tab.evaluate(ranges, "chart-tool_velocity")
    assert before[0] < low < high < before[1]
    assert tab.evaluate("window.jointplayReport.range") == [low, high]  # of all charts
    tab.keyboard.down("Shift")
    drag(0.6, 0.5)
    tab.keyboard.up("Shift")
    moved = tab.evaluate(ranges, "chart-tool_velocity")
    assert moved[0] > low
    assert moved[1] - moved[0] == pytest.approx(high - low)
    x, y = tab.evaluate(
        """() => { const [plot] = document.getElementById("chart-tool_velocity").plots;
            const seen = plot.inner.getBoundingClientRect(), [one] = plot.series;
            const k = one.x.length >> 1;
            return [seen.left + plot.across.at(one.x[k]), seen.top + plot.up.at(one.y[k])]; }"""
    )
    tab.mouse.move(x, y)
    assert re.search(r"(ideal|worn): .* m/s at 0\.\d+ s", chart.locator(".tip").inner_text())
    beside = chart.locator(".tip").bounding_box()
    sides = [beside["x"] - x, x - beside["x"] - beside["width"], abs(beside["y"] - y)]
    assert 0.0 < max(sides[:2]) < 30.0
    assert sides[2] < 30.0
    lines = chart.locator("path.curve").count()
    chart.get_by_role("button", name="worn").click()
    assert chart.locator("path.curve").count() == lines - 3
    with tab.expect_download() as saved:
        chart.get_by_role("button", name="save").click()
    picture = ElementTree.parse(saved.value.path()).getroot()
    assert picture.tag.endswith("svg")
    assert "velocity x [m/s]" in "".join(picture.itertext())
    chart.locator(".plots").dblclick(position={"x": 300, "y": 80})
    tab.evaluate(DRAWN)
    assert tab.evaluate(ranges, "chart-tool_velocity") == [0, pytest.approx(0.4)]


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
    const empty = charts.filter(id => !document.querySelector(`#${id} .plots path`));
    return { broken, wide, tables: tables.length, charts: charts.length, empty };
}"""


def test_a_print_has_whole_words_whole_tables_and_all_charts(page, open_page, tmp_path):
    tab = open_page(page.as_uri(), (1100, 900))
    until(tab, "() => Boolean(window.jointplayReport?.whole)")
    tab.pdf(path=tmp_path / "at_once.pdf")  # unfolds all, and draws what was not yet on the screen
    folded = "() => [...document.querySelectorAll('details')].every(one => !one.open)"
    until(tab, folded)
    tab.emulate_media(media="print")
    tab.set_viewport_size({"width": 703, "height": 1000})  # A4 between its margins
    seen = tab.evaluate(IN_PRINT)
    assert seen["tables"] > 8
    assert seen["charts"] > 10
    assert seen["broken"] == []
    assert seen["wide"] == 0
    assert seen["empty"] == []
    assert (tmp_path / "at_once.pdf").stat().st_size > 100_000
