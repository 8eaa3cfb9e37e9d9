"""The live page: in a real browser, and over its server."""

import http.client
import json
import math
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from contextlib import contextmanager
from urllib.parse import urlsplit

import browsing
import numpy as np
import pinocchio as pin
import pytest
from browsing import until
from warm import JOINTPLAY

import jointplay as jp
from jointplay.accuracy.error_budget import budget
from jointplay.base.origins import to_text
from jointplay.physics.joints import RollingBearing
from jointplay.scenario import Scenario
from jointplay.scenario.robot import robot_scenario
from jointplay.show.live import answer
from jointplay.show.live.answer import Machine
from jointplay.show.live.state import State
from jointplay.show.live.workers import Workers
from jointplay.simulation.analysis import tool_error, twin
from jointplay.simulation.values import values

DURATION = 0.3
SLIDER_CRANK = "jointplay:slider_crank.toml"


def scenario(**settings):
    """A scenario of the SCARA of short duration."""
    from jointplay.scenario.reading import parse

    given = [f"integration.duration={DURATION}", *(f"{k}={v}" for k, v in settings.items())]
    return robot_scenario(None, (), [parse(text) for text in given])


def machine(radial):
    """Mechanism and motion of that scenario, built without it."""
    joint = jp.RevoluteClearance(radial_clearance=radial, axial_clearance=0.2e-3)
    mechanism = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": joint})
    return mechanism, jp.Motion.from_csv(jp.shipped("scara_motion.csv"))


def state_of(chosen, case=None):
    case = case or chosen.cases[0]
    return State.of(chosen, case, chosen.simulation(case))


@contextmanager
def served(*arguments, program=JOINTPLAY):
    """A running command, and the address that it printed."""
    command = [program, "live", *arguments, "--no-browser", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        assert "live at http://127.0.0.1:" in line
        yield line.split()[2], process
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(900)


@pytest.fixture(scope="module")
def address():
    with served("--duration", str(DURATION)) as (url, _):
        yield url


@pytest.fixture
def tab(browser, address):
    with opened(browser, address) as made:
        yield made


@contextmanager
def opened(browser, address, **options):
    """A page with its first exact answer."""
    with browsing.opened(browser, address, **options) as made:
        answered(made)
        yield made


def answered(tab):
    """Wait for the exact answer to the newest question."""
    until(tab, "() => Boolean(window.jointplay?.timing.ended)")


def figures(tab):
    """What the page holds of the newest answer, by name, SI units."""
    rows = tab.evaluate("() => window.jointplay.answer.cycle.figures")
    return {row["name"]: row["value"] for row in rows}


def type_in(tab, name, text):
    """Type a value into a control's field."""
    field = tab.locator(f"[id$='-{name}']")
    field.fill(str(text))
    field.press("Enter")


def expected(simulation):
    """Figures of a run, computed independently of the page's."""
    result = simulation.run(estimate=False, check_step=False)
    error = np.linalg.norm(tool_error.deviation(result).values, axis=1)
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
    return {"largest tool error": error.max(), "peak force, joint_b": force.max()}


# In a browser.


def test_a_value_gives_what_simulation_and_budget_give(tab):
    type_in(tab, "joint_b.radial_clearance", 0.35)
    answered(tab)
    mechanism, motion = machine(0.35e-3)
    wanted = expected(jp.Simulation(mechanism, motion, duration=DURATION))
    found = figures(tab)
    for name, value in wanted.items():
        assert found[name] == pytest.approx(value, rel=1e-9), name
    from jointplay.accuracy.poses import along_motion

    errors = budget(mechanism, along_motion(mechanism, motion))
    shown = tab.evaluate("() => window.jointplay.answer.budget")
    assert shown["whole"]
    assert shown["worst"] == pytest.approx(errors.worst.max(), rel=1e-9)
    assert shown["rms"] == pytest.approx(errors.rms[errors.worst_pose], rel=1e-9)
    text = tab.locator("[aria-label='static error budget']").inner_text()
    assert f"{1e3 * errors.worst.max():.4f}" in text
    assert "100.0 %" in text


def test_what_adds_to_free_travel_stands_beside_it(tab):
    """Free travel is a bound with rigid contacts, below the largest error in motion or above it."""
    type_in(tab, "joint_b.radial_clearance", 0.3)
    answered(tab)
    mechanism, motion = machine(0.3e-3)
    result = jp.Simulation(mechanism, motion, duration=DURATION).run(estimate=False)
    rows = dict(
        line.split("\t")[:2]
        for line in tab.locator("[aria-label='figures of all cases']").inner_text().splitlines()
        if "\t" in line
    )
    names = ("free travel, at most (contacts rigid)", "contacts give way, at most")
    names += ("drives give way, at most", "all three, at most")
    prefix = {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9}
    shown = (rows[name].split() for name in names)
    free, gives, drives, whole = (float(number) * prefix[unit] for number, unit in shown)
    sunk = result.audit.penetration_over_clearance
    assert sunk > 0.0
    assert gives == pytest.approx(free * sunk, rel=2e-3)
    # With the journal in the middle, what is left is where the drives are.
    ideal, at = twin(result), mechanism.coordinates
    middle = result.q.copy()
    for part in ("x", "y", "z", "pitch", "roll"):
        middle[:, at.index(f"joint_b.{part}")] = 0.0
    model, data = mechanism.model, mechanism.model.createData()
    away = []
    for q, place in zip(middle, ideal["tool_position"].values, strict=True):
        pin.framesForwardKinematics(model, data, q)
        away.append(np.linalg.norm(data.oMf[mechanism.tool_frame].translation - place))
    assert drives == pytest.approx(max(away), rel=1e-3)
    assert whole == pytest.approx(free + gives + drives, rel=1e-3)
    assert figures(tab)["largest tool error"] < whole


def test_an_older_answer_is_not_shown_for_a_newer_question(tab):
    """The first answer is held back, and handed over after the second."""
    shown = tab.evaluate(
        """async () => {
            const live = window.jointplay, ask = live.server.ask, late = [];
            let first = true;
            live.server.ask = (values, receive) => {
                if (!first) return ask(values, receive);
                first = false;
                ask(values, (head, block) => late.push([head, block, receive]));
                return () => {};
            };
            const wait = done => new Promise(go => {
                const look = () => done() ? go() : setTimeout(look, 20);
                look();
            });
            live.values["joint_b.radial_clearance"] = 0.9;
            live.ask();
            await wait(() => late.some(([head]) => head.kind === "cycle" && !head.quick));
            live.values["joint_b.radial_clearance"] = 0.1;
            live.ask();
            await wait(() => live.timing.ended);
            const worst = live.answer.budget.worst;
            for (const [head, block, receive] of late) receive(head, block);
            await new Promise(go => setTimeout(go, 300));
            live.server.ask = ask;
            const old = late.find(([head]) => head.kind === "budget")[0].worst;
            return [worst, live.answer.budget.worst, old, live.budgetBody.innerText];
        }"""
    )
    before, after, old, text = shown
    assert after == before < 0.5 * old
    assert f"{1e3 * before:.4f}" in text


def test_undo_redo_and_reset(tab):
    name = "joint_b.friction"
    field = tab.locator(f"[id$='-{name}']")
    type_in(tab, name, 0.3)
    type_in(tab, name, 0.4)
    answered(tab)
    tab.get_by_role("button", name="Undo").click()
    assert field.input_value() == "0.3"
    tab.get_by_role("button", name="Undo").click()
    assert field.input_value() == "0.1"
    tab.get_by_role("button", name="Redo").click()
    assert field.input_value() == "0.3"
    answered(tab)
    tab.get_by_role("button", name="Reset").click()
    assert field.input_value() == "0.1"
    answered(tab)


def test_keys_on_a_slider_are_one_step_until_a_pause(tab):
    """Each control on its own; a pause, or another control, begins another step."""
    values = "() => ({...live.values})"
    first = tab.evaluate(values)
    names = "joint_b.friction", "joint_b.restitution"
    seen = []
    for name in (*names, *names[1:]):
        tab.locator(f"[id$='-{name}-slider']").focus()
        for _ in range(4):
            tab.keyboard.press("ArrowLeft")
        seen.append(tab.evaluate(values))
        if len(seen) == 2:
            tab.wait_for_timeout(1200)
    for before in (seen[1], seen[0], first):
        tab.get_by_role("button", name="Undo").click()
        assert tab.evaluate(values) == before
    assert tab.get_by_role("button", name="Undo").is_disabled()
    for after in seen:
        tab.get_by_role("button", name="Redo").click()
        assert tab.evaluate(values) == after
    tab.get_by_role("button", name="Reset").click()
    answered(tab)


def test_a_kept_case_stays_beside_later_ones(tab):
    kept = figures(tab)["peak force, joint_b"]
    tab.get_by_role("button", name="Keep as case").click()
    type_in(tab, "payload", 1.5)
    answered(tab)
    now = figures(tab)["peak force, joint_b"]
    assert now > kept
    cells = tab.locator(
        "[aria-label='figures of all cases'] tr", has_text="peak force"
    ).inner_text()
    assert f"{kept:.4g} N" in cells
    assert f"{now:.4g} N" in cells
    assert tab.locator("[aria-label='tool error'] path.curve").count() == 2
    assert "case A" in tab.locator("[aria-label='tool error']").inner_text()
    tab.get_by_role("button", name="remove case case A").click()
    assert tab.locator("[aria-label='tool error'] path.curve").count() == 1


def test_a_saved_scenario_runs_to_the_same_numbers(tab, tmp_path):
    type_in(tab, "joint_b.radial_clearance", 0.31)
    type_in(tab, "gravity", 8.5)
    type_in(tab, "payload", 0.7)
    type_in(tab, "speed", 1.5)
    answered(tab)
    shown = figures(tab)
    with tab.expect_download() as waiting:
        tab.get_by_role("button", name="Save as scenario").click()
    path = tmp_path / "live.toml"
    waiting.value.save_as(path)
    command = [JOINTPLAY, "run", str(path), "--out", str(tmp_path / "out"), "--no-figures"]
    done = subprocess.run([*command, "--quiet"], capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "out").glob("*.nc")
    result = jp.Result.load(file)
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1).max()
    off = tool_error.deviation(result)
    error = float(tool_error.error_statistics(off, result.judge_from).peak[-1])
    assert shown["peak force, joint_b"] == pytest.approx(force, rel=1e-12)
    assert shown["largest tool error"] == pytest.approx(error, rel=1e-9)
    command = [JOINTPLAY, "budget", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    worst = tab.evaluate("() => window.jointplay.answer.budget.worst")
    assert f"{1e3 * worst:.4f}" in done.stdout


def test_a_link_brings_the_values_back(tab, browser):
    type_in(tab, "joint_b.restitution", 0.5)
    answered(tab)
    link = tab.url
    assert link.endswith("#joint_b.restitution=0.5")
    with opened(browser, link) as other:
        assert other.locator("[id$='-joint_b.restitution']").input_value() == "0.5"
        assert figures(other) == pytest.approx(figures(tab))


def test_what_the_model_refuses_is_said_at_the_field(tab):
    type_in(tab, "joint_b.radial_clearance", -0.1)
    answered(tab)
    wrong = tab.locator("[id$='-joint_b.radial_clearance-wrong']").inner_text()
    with pytest.raises(jp.JointplayError) as caught:
        jp.RevoluteClearance(radial_clearance=-1e-4, axial_clearance=2e-4)
    assert str(caught.value) in wrong
    field = tab.locator("[id$='-joint_b.radial_clearance']")
    assert field.get_attribute("aria-invalid") == "true"
    field.fill("0.2")
    field.press("Enter")
    answered(tab)
    assert field.get_attribute("aria-invalid") is None
    assert tab.locator("[id$='-joint_b.radial_clearance-wrong']").inner_text() == ""


def focused(tab):
    return tab.evaluate(
        """() => {
            const here = document.activeElement;
            return here === document.body ? "" : here.getAttribute("aria-label") || here.innerText;
        }"""
    )


def tab_to(tab, words):
    """Press the Tab key until the element of this name has the focus."""
    for _ in range(80):
        tab.keyboard.press("Tab")
        if words in focused(tab):
            return
    raise AssertionError(f"the keyboard does not reach {words!r}")


def test_the_keyboard_alone_does_everything(tab):
    tab_to(tab, "radial clearance [mm], joint_b, slider")
    for _ in range(5):
        tab.keyboard.press("ArrowRight")
    answered(tab)
    value = float(tab.locator("[id$='-joint_b.radial_clearance']").input_value())
    assert value > 0.2
    tab.keyboard.press("Control+z")
    until(tab, "() => window.jointplay.values['joint_b.radial_clearance'] < " + str(value))
    tab.keyboard.press("Control+Shift+z")
    assert float(tab.locator("[id$='-joint_b.radial_clearance']").input_value()) == value
    answered(tab)
    for words in ("play", "time of the picture", "magnification", "shares of", "figures of all"):
        tab_to(tab, words)
    tab_to(tab, "Keep as case")  # around, from the beginning
    tab.keyboard.press("Enter")
    assert tab.evaluate("() => window.jointplay.kept.length") == 1


def test_all_controls_and_charts_have_names(tab):
    nameless = tab.evaluate(
        """() => [...document.querySelectorAll("button, input, select, [role=img], [role=region]")]
            .filter(one => !(one.getAttribute("aria-label") || one.innerText || "").trim())
            .map(one => one.outerHTML)"""
    )
    assert nameless == []
    charts = tab.locator("svg[role=img]")
    assert charts.count() == 4
    for label in charts.evaluate_all("all => all.map(one => one.getAttribute('aria-label'))"):
        assert re.search(r"from .* to ", label)


@pytest.mark.parametrize(("width", "scheme"), [(400, "light"), (1280, "dark")])
def test_the_page_fits(browser, address, width, scheme):
    with opened(browser, address, size=(width, 800), color_scheme=scheme) as page:
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        error, controls = (page.locator(x).bounding_box() for x in (".first", ".controls"))
        assert error["y"] + error["height"] <= 800.0  # seen without scrolling
        assert "Tool error, at most" in page.inner_text(".first")
        assert (controls["y"] >= error["y"] + error["height"]) == (width == 400)
        assert controls["y"] < 800.0
        values = page.locator(".assumed").first
        assert not values.is_visible()  # folded
        page.locator("summary", has_text="What was assumed").press("Enter")
        box = values.bounding_box()
        assert 0 <= box["x"] < box["x"] + box["width"] <= width
        assert "integration.start: at rest" in page.inner_text(".controls")
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        back, ink = page.evaluate(
            """() => {
                const style = getComputedStyle(document.querySelector(".jp-live"));
                const parts = text => text.match(/[0-9]+/g).slice(0, 3).map(Number);
                return [style.backgroundColor, style.color].map(text => Math.max(...parts(text)));
            }"""
        )
        assert (back < ink) == (scheme == "dark")


NEVER_ANSWERED = """() => {
    const root = document.createElement("div");
    const text = id => document.getElementById(id).textContent;
    document.body.prepend(root);
    const nobody = {linked: false, ask: () => () => {}, scenario: () => new Promise(() => {})};
    jointplayLive(MeshCat).mount(root, JSON.parse(text("contents")), text("block"), nobody);
    const cards = [...root.querySelectorAll(".results > .card")].filter(one => one.clientHeight);
    const seen = cards.map(one => [one.querySelector(".will").innerText,
        one.querySelector("progress").getBoundingClientRect().width]);
    root.remove();
    return seen;
}"""


def test_what_is_not_computed_yet_says_what_it_will_be(tab):
    seen = tab.evaluate(NEVER_ANSWERED)
    assert len(seen) == 7
    for words, progress in seen:
        assert len(words) > 20
        assert progress > 50
    assert tab.locator(".coming").count() == 0  # once all is answered


WATCHED = """async () => {
    const live = window.jointplay, seen = {order: [], sizes: new Set(), rows: new Set(), old: 0};
    const {drawCharts, showPicture, showTable} = live, pane = live.view.viewer.renderer.domElement;
    let frames = 0, drawn = 0;
    live.drawCharts = () => {
        seen.order.push("curves");
        drawn = frames;
        drawCharts.call(live);
    };
    live.showPicture = tracks => {
        seen.order.push(frames > drawn ? "picture" : "early");
        showPicture.call(live, tracks);
    };
    live.showTable = () => {
        showTable.call(live);
        seen.rows.add(live.table.querySelectorAll("tr").length);
        seen.old = Math.max(seen.old, live.table.querySelectorAll("td.stale").length);
    };
    const frame = () => new Promise(done => requestAnimationFrame(done));
    live.values["joint_b.radial_clearance"] = 0.27;
    live.ask();
    while (!live.timing.ended) {
        await frame();
        frames++;
        seen.sizes.add(`${pane.clientWidth}x${pane.clientHeight}`);
    }
    seen.left = live.table.querySelectorAll("td.stale").length;
    Object.assign(live, {drawCharts, showPicture, showTable});
    return {...seen, sizes: [...seen.sizes], rows: [...seen.rows]};
}"""


def test_a_question_moves_nothing_and_has_its_curves_before_its_picture(tab):
    """Earlier figures stay, dimmed, until new ones come."""
    seen = tab.evaluate(WATCHED)
    assert len(seen["sizes"]) == 1
    assert len(seen["rows"]) == 1
    assert seen["old"] > 3
    assert seen["left"] == 0
    assert seen["order"].count("picture") >= 1
    assert seen["order"][0] == "curves"
    assert "early" not in seen["order"]


FARTHEST = """() => {
    const {view} = window.jointplay, {camera, scene} = view.viewer;
    scene.updateMatrixWorld(true);
    let most = 0;
    for (const {node, twin} of view.shown.bodies) if (twin) node.traverse(part => {
        if (!part.geometry) return;
        part.geometry.computeBoundingBox();
        const {min, max} = part.geometry.boundingBox;
        for (let k = 0; k < 8; k++) {
            const [x, y, z] = ["x", "y", "z"].map((axis, i) => (k >> i & 1 ? max : min)[axis]);
            const at = min.clone().set(x, y, z).applyMatrix4(part.matrixWorld).project(camera);
            most = Math.max(most, Math.abs(at.x), Math.abs(at.y));
        }
    });
    return most;
}"""
"""Largest distance of the machine's parts from the middle of the picture; 1 is the edge."""


def test_the_whole_machine_is_in_view_whatever_the_shape_of_the_picture(tab):
    for height in (340, 1100, 500):
        tab.evaluate(
            "height => { window.jointplay.pane.parentElement.style.flex = `0 0 ${height}px`; }",
            height,
        )
        until(tab, f"() => window.jointplay.pane.querySelector('canvas').clientHeight === {height}")
        until(tab, f"() => ({FARTHEST})() < 1.0")
        assert tab.evaluate(FARTHEST) > 0.2


def test_the_picture_moves(tab):
    tab.evaluate("() => window.jointplay.seek(0)")
    places = "() => window.jointplay.view.shown.bodies.map(body => [...body.node.matrix.elements])"
    before = np.array(tab.evaluate(places))
    tab.evaluate("() => window.jointplay.seek(0.25)")
    assert np.abs(np.array(tab.evaluate(places)) - before).max() > 1e-3
    tab.get_by_role("button", name="play", exact=True).click()
    until(tab, "() => window.jointplay.time > 0 && window.jointplay.time !== 0.25")
    tab.get_by_role("button", name="pause").click()


def test_a_robot_with_gears_alone_shows_no_orbit(browser):
    options = ("so101", "--preset", "--duration", "0.05")
    with served(*options) as (url, _), opened(browser, url) as page:
        titles = [one for one in page.locator("figcaption").all() if one.is_visible()]
        texts = [title.inner_text() for title in titles]
        assert [text.partition(",")[0] for text in texts] == [
            "Tool error",
            "Energy since the start",
        ]
        before = page.evaluate("() => window.jointplay.answer.budget.worst")
        type_in(page, "shoulder_lift.play", 1.5)
        answered(page)
        assert page.evaluate("() => window.jointplay.answer.budget.worst") > 1.2 * before
        type_in(page, "shoulder_lift.play", -1)
        answered(page)
        assert (
            "gear play must not be negative, got -1 deg"
            in page.locator("[id$='-shoulder_lift.play-wrong']").inner_text()
        )


def test_a_loop_at_constant_speed_and_a_case_of_a_file(browser):
    options = ("--case", "0.05 mm", "--duration", "0.004")
    with served(SLIDER_CRANK, *options) as (url, _), opened(browser, url) as page:
        before = figures(page)["peak force, piston_pin"]
        type_in(page, "speed.crank_pin", 300)
        answered(page)
        assert 0.0 < figures(page)["peak force, piston_pin"] < before
        assert page.evaluate("() => window.jointplay.answer.budget.worst") > 0.0


# The server.


def post(url, body=None, name="ask", **changed):
    """Post a question, and return the status of its answer."""
    place = urlsplit(url)
    headers = {"Content-Type": "application/json", "Origin": f"http://{place.netloc}"}
    headers = {k: v for k, v in (headers | changed).items() if v is not None}
    connection = http.client.HTTPConnection(place.netloc, timeout=900)
    connection.request("POST", place.path + name, json.dumps(body or {"values": {}}), headers)
    answer = connection.getresponse()
    text = answer.read() if answer.status != 200 or name == "scenario" else b""
    connection.close()
    return answer.status, text


def test_who_comes_from_elsewhere_or_has_no_token_is_refused(address):
    place = urlsplit(address)
    root = f"http://{place.netloc}/"
    for changed, status in (
        ({}, 200),
        *(({"Origin": origin}, 403) for origin in ("http://evil.example", None, "null")),
        ({"Host": "evil.example"}, 421),
        ({"Content-Type": "text/plain"}, 415),
    ):
        assert post(address, name="scenario", **changed)[0] == status, changed
    assert post(address, {"values": {"x" * 200_000: 1}}, "scenario")[0] == 413
    assert post(address, name="other")[0] == 404
    assert post(root, name="scenario")[0] == 404
    wrong = place.path[:-2] + ("A" if place.path[-2] != "A" else "B") + "/"
    assert post(f"http://{place.netloc}{wrong}", name="scenario")[0] == 404
    for path, status in (("/", 404), (wrong, 404), (place.path, 200), (place.path + "ask", 404)):
        connection = http.client.HTTPConnection(place.netloc)
        connection.request("GET", path)
        assert connection.getresponse().status == status, path
        connection.close()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"values": {"nothing": 1.0}}, "nothing"),
        ({"values": {"payload": "much"}}, "payload must be a number"),
        ({"values": {"payload": True}}, "payload must be a number"),
        ({"values": {"payload": -1.0}}, "payload"),
        ({"values": {"payload": 10**400}}, "payload must be finite"),
        ([], "values"),
    ],
)
def test_what_is_no_question_is_refused_in_words(address, body, words):
    connection_status, text = post(address, body or [1], "scenario")
    assert connection_status == 422
    assert words in text.decode()


def test_a_question_that_was_overtaken_is_not_computed():
    """Requests of one page can arrive in another order than they were sent."""
    from jointplay.show.live.server import Routes

    class Asked:
        questions = ()

        def ask(self, values, receive):
            self.questions += (values,)
            receive({"kind": "end", "superseded": False}, b"")

    workers = Asked()
    ask = Routes(state_of(scenario()), workers).posts["ask"]
    for number in (1, 3, 2, 4):
        body = {"values": {"payload": float(number)}, "page": "p", "number": number}
        text = b"".join(ask(json.dumps(body).encode()))
        assert (b'"superseded":true' in text) == (number == 2)
    assert [values["payload"] for values in workers.questions] == [1.0, 3.0, 4.0]


@pytest.mark.thorough
def test_nothing_is_left_running_after_a_stop():
    program = shutil.which("jointplay")
    if program is None:
        pytest.skip("jointplay is not installed as a command")
    for number in (signal.SIGTERM, signal.SIGINT):
        with served("--duration", str(DURATION), program=program) as (url, process):
            command = ["ps", "-o", "pid=", "--ppid", str(process.pid)]
            children = subprocess.run(command, capture_output=True, text=True).stdout.split()
            assert len(children) == 2
            post(url)
            process.send_signal(number)
            assert process.wait(900) == 0
            assert not any(os.path.exists(f"/proc/{one}") for one in children)


# What is computed.


def test_controls_are_those_of_the_machine():
    state = state_of(scenario())
    assert [*state.controls] == [
        *("speed", "payload", "gravity"),
        *("joint_b.radial_clearance", "joint_b.axial_clearance"),
        *("joint_b.restitution", "joint_b.friction"),
    ]
    for one in state.controls.values():
        assert one.low <= one.value <= one.high
    radial = state.controls["joint_b.radial_clearance"]
    assert (radial.value, radial.unit, radial.logarithmic) == (0.2, "mm", True)


def test_gears_have_their_play():
    """Gears that turn and screws have a control of their play; a train, which has play in its
    stages, has none."""
    from jointplay.scenario.reading import parse

    given = [parse(f"integration.duration={DURATION}")]
    gear = 'gears.{}={{kind="backlash",play="{}",stiffness="{}",rotor_inertia="{}"}}'
    turns = gear.format("joint_a", "0.4 deg", "2000 N*m/rad", "0.1 kg*m^2")
    slides = gear.format("stroke", "30 um", "1e6 N/m", "2 kg")
    state = state_of(robot_scenario(None, ["joint_b"], [*given, parse(turns), parse(slides)]))
    shown = [state.controls[f"{name}.play"] for name in ("joint_a", "stroke")]
    assert [(one.group, one.value, one.unit) for one in shown] == [
        ("joint_a", pytest.approx(0.4), "deg"),
        ("stroke", pytest.approx(0.03), "mm"),
    ]
    assert all(one.low < one.value < one.high for one in shown)
    values = {"joint_a.play": 0.9, "stroke.play": 0.05}
    made = Machine(state).simulation(values).mechanism.gears
    assert made["joint_a"].play == pytest.approx(np.deg2rad(0.9))
    assert made["stroke"].play == pytest.approx(5e-5)
    stage = "{ratio=50.0,backlash=0.01,efficiency=0.9}"
    train = f'gears.joint_a={{kind="train",stages=[{stage}],rotor_inertia=0.1,stiffness=2e3}}'
    stages = state_of(robot_scenario(None, ["joint_b"], [*given, parse(train)]))
    assert "joint_a.play" not in stages.controls


def test_a_rolling_bearing_has_its_temperature():
    from jointplay.scenario.reading import parse

    given = [
        parse('joints.joint_b={kind="ball-bearing",designation="6010/C3"}'),
        parse(f"integration.duration={DURATION}"),
    ]
    state = state_of(robot_scenario(None, ["joint_b"], given))
    name = "joint_b.temperature_difference"
    assert state.controls[name].unit == "K"
    answering = Machine(state)
    cold, warm = (
        answering.simulation({name: k}).mechanism.clearance["joint_b"] for k in (0.0, 20.0)
    )
    assert isinstance(warm, RollingBearing)
    assert warm.cr < cold.cr
    assert state.controls["joint_b.radial_clearance"].value == pytest.approx(1e3 * cold.cr)


@pytest.mark.parametrize(
    "place",
    [None, SLIDER_CRANK, pytest.param("jointplay:four_bar.toml", marks=pytest.mark.thorough)],
)
def test_quick_and_exact_answers_agree(place):
    chosen = scenario() if place is None else Scenario.load(place)
    answering = Machine(state_of(chosen, next(one for one in chosen.cases if one != "ideal")))
    quick, fine = (
        {row["name"]: row["value"] for head, _ in kind({}) for row in head.get("figures", ())}
        for kind in (answering.quick, answering.fine)
    )
    assert quick.keys() == fine.keys()
    for name, value in fine.items():
        if place or name == "largest tool error":
            assert quick[name] == pytest.approx(value, rel=0.1 if place else 0.05, abs=1e-12), name


def test_the_exact_answer_begins_as_that_of_the_command():
    chosen = scenario()
    case = next(one for one in chosen.cases if one != "ideal")
    answering = Machine(state_of(chosen, case))
    (fine,) = (head for head, _ in answering.fine({}) if head["kind"] == "cycle")
    result = chosen.simulation(case).run(estimate=False, check_step=False)
    result.dataset.attrs["values"] = to_text(values(result.simulation, chosen.origins(case)))
    assert fine["answer"] == f"{result.summary().splitlines()[0]}."
    assert {head.get("answer", "") for head, _ in answering.quick({})} == {""}


def test_the_first_part_of_a_long_answer_is_shown_soon(monkeypatch):
    """The whole answer is then the same as without a first part."""
    chosen = scenario()
    state = state_of(chosen, next(one for one in chosen.cases if one != "ideal"))

    def cycles(soon_s):
        machine = Machine(state)
        monkeypatch.setattr(answer, "SOON_S", soon_s)
        messages = [one for one in machine.quick({}) if one[0]["kind"] != "budget"]
        assert [head["kind"] for head, _ in messages[::2]] == ["cycle"] * (len(messages) // 2)
        return list(zip(messages[::2], messages[1::2], strict=True))

    (usual,) = cycles(math.inf)
    ((first, _), (seen, _)), whole = cycles(0.0)
    assert whole == usual
    assert first["part"]
    (head, _), (all_of_it, _) = whole
    assert not head["part"]
    assert 0 < seen["picture"]["end"] < answer.WORTH * all_of_it["picture"]["end"]
    assert first["message"].startswith("so far ")


def test_only_the_newest_question_is_answered():
    workers = Workers(state_of(scenario()))
    try:
        parts, done = [], threading.Event()

        def receive(head, block):
            parts.append(head)
            if head["kind"] == "end" and not head["superseded"]:
                done.set()

        for k in range(5):
            newest = workers.ask({"joint_b.radial_clearance": 0.1 + 0.1 * k}, receive)
        assert done.wait(900)
        whole = [head for head in parts if not head.get("part")]
        answers = [head for head in whole if head["kind"] in ("budget", "cycle")]
        assert [head["kind"] for head in answers].count("cycle") == 2
        assert answers[-1]["question"] == newest
        ends = [head["question"] for head in parts if head["kind"] == "end"]
        assert sorted(ends) == list(range(1, 6))
    finally:
        workers.close()


def test_a_worker_that_is_killed_is_replaced():
    workers = Workers(state_of(scenario()))
    try:
        os.kill(workers.processes["quick"].pid, signal.SIGKILL)
        end = time.monotonic() + 900.0
        before = workers.processes["quick"]
        while workers.processes["quick"] is before:
            assert time.monotonic() < end
            time.sleep(0.02)
        done = threading.Event()
        workers.ask({}, lambda head, block: done.set() if head["kind"] == "end" else None)
        assert done.wait(900)
    finally:
        workers.close()


def test_a_saved_scenario_finds_its_files_from_any_folder(tmp_path):
    folder = tmp_path / "a"
    folder.mkdir()
    shutil.copy(jp.shipped("scara.urdf"), folder / "arm.urdf")
    shutil.copy(jp.shipped("scara_motion.csv"), folder / "way.csv")
    (folder / "s.toml").write_text(
        '[robot]\nurdf = "arm.urdf"\n[motion]\nfile = "way.csv"\n'
        '[joints."joint_b"]\nkind = "revolute"\nradial_clearance = "0.2 mm"\n'
        'axial_clearance = "0.1 mm"\n'
    )
    text = state_of(Scenario.load(folder / "s.toml")).text({"joint_b.axial_clearance": 0.3})
    (tmp_path / "b.toml").write_text(text)
    again = Scenario.load(tmp_path / "b.toml").simulation()
    assert again.mechanism.clearance["joint_b"].axial_clearance == 0.3e-3
    assert again.mechanism.clearance["joint_b"].radial_clearance == 0.2e-3
