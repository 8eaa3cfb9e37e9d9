"""Playback: what the page holds, how it is served, and in a real browser."""

import subprocess
import threading
import urllib.request
import zlib

import numpy as np
import pinocchio as pin
import pytest
from browsing import picture, until
from conftest import body, joint
from hypothesis import given
from hypothesis import strategies as st
from packed import unpack, unpack_mesh
from warm import JOINTPLAY

import jointplay as jp
from jointplay.cli import main
from jointplay.model.meshes import surface
from jointplay.model.robots import robot_urdf
from jointplay.model.scene import quaternions
from jointplay.paper import scara
from jointplay.show import player
from jointplay.show.player.server import Server
from jointplay.show.player.tracks import (
    Packer,
    impacts,
    peaks,
    select_records,
    strongest,
)


def run(clearance, duration=0.4):
    made = scara(clearance)
    return jp.simulate(made.mechanism, made.motion, duration=duration)


@pytest.fixture(scope="module")
def cases():
    return {"ideal": run(None), "0.2 mm": run(0.2e-3), "0.5 mm": run(0.5e-3)}


@pytest.fixture(scope="module")
def page(cases):
    return player.page(cases)


# What is kept of the records.


def test_impacts_are_the_peaks_that_stand_out():
    force = np.zeros(1000)
    force[100], force[300:310], force[500] = 50.0, 100.0, 1.0
    found = impacts(force)
    assert len(found.records) == 2  # 1 N does not stand out
    assert found.force.tolist() == [50.0, 100.0]
    assert not len(impacts(np.zeros(10)).records)


@given(st.lists(st.integers(0, 9), min_size=3, max_size=60))
def test_peaks_are_those_that_scipy_finds(values):
    from scipy.signal import find_peaks

    curve = np.array([0, *values, 0], float)
    at, prominence = peaks(curve)
    theirs, more = find_peaks(curve, prominence=0.0)
    assert at.tolist() == theirs.tolist()
    assert prominence.tolist() == more["prominences"].tolist()


@given(st.integers(0, 99))
def test_quaternions_are_pinocchios(seed):
    turns = [pin.Quaternion(pin.SE3.Random().rotation) for _ in range(5)]
    half = pin.Quaternion(np.array([0.6, 0.0, 0.8, 0.0]))  # half a turn: w = 0
    turns = [*turns, half, pin.Quaternion(1.0, 0.0, 0.0, 0.0)]
    found = quaternions(np.array([turn.toRotationMatrix() for turn in turns]))
    for ours, theirs in zip(found, turns, strict=True):
        assert abs(ours @ theirs.coeffs()) == pytest.approx(1.0, abs=1e-12)


@given(st.integers(1, 60), st.integers(0, 9))
def test_packed_triangles_come_back(m, seed):
    random = np.random.default_rng(seed)
    part = surface(random.normal(size=(20, 3)), random.integers(0, 20, (m, 3)))
    packer = Packer()
    packer.raw(b"before")
    entry = packer.mesh(part.triangles)
    again = unpack_mesh(zlib.decompress(packer.deflated()), entry)
    assert (again == part.triangles).all()


@given(st.integers(0, 5), st.integers(20, 400), st.integers(500, 3000))
def test_decimation_keeps_impacts_and_the_budget(number, budget, n):
    moments = np.arange(n) * 1e-4
    random = np.random.default_rng(number)
    at = np.sort(random.choice(np.arange(1, n), number, replace=False))
    force = np.zeros(n)
    force[at] = random.uniform(50, 100, number)
    kept = select_records(moments, [impacts(force)], budget)
    assert len(kept) <= max(budget, 4) + 2
    assert (np.diff(kept) > 0).all()
    assert {0, n - 1} <= set(kept)
    assert set(impacts(force).records) <= set(kept)
    held = force[strongest(force[:, None], kept)[:, 0]]
    assert held.max() == force[: kept[-1] + 1].max()


@given(st.integers(1, 50), st.floats(1e-9, 1e-3), st.integers(0, 9))
def test_packed_numbers_come_back(rows, quantum, seed):
    values = np.random.default_rng(seed).normal(size=(rows, 3)).cumsum(axis=0)
    packer = Packer()
    packer.raw(b"before")
    entry = packer.table(values, quantum)
    again = unpack(zlib.decompress(packer.deflated()), entry)
    assert np.abs(again - values).max() <= 0.51 * entry["quantum"]


@pytest.mark.thorough
def test_a_minute_of_motion_fits(cases):
    """60 s of records are thinned to the budget; the strongest impacts stay."""
    parts = [cases["0.5 mm"].dataset]
    long = parts[0].isel(time=np.tile(np.arange(4001), 150)[:600_000])
    long = long.assign_coords(time=np.arange(600_000) * 1e-4)
    content, _ = player.page({"long": jp.Result(long)}, ghosts=False)
    assert len(content) < 15e6


# The page and its server.


def test_html_is_written_once(page, cases, tmp_path):
    path = player.save_html({"0.2 mm": cases["0.2 mm"]}, tmp_path / "a.html", ghosts=False)
    assert path.read_bytes().lstrip().lower().startswith(b"<!doctype html")
    with pytest.raises(jp.JointplayError, match="exists"):
        player.save_html(cases, path)


def test_server_gives_the_page_on_the_loopback_only():
    with Server(b"<!doctype html>x", port=0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        assert server.server_address[0] == "127.0.0.1"
        with urllib.request.urlopen(server.url) as answer:
            assert answer.read() == b"<!doctype html>x"
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(server.url + "etc/passwd")
        with Server(b"", port=server.port) as other:  # taken: the next one
            assert other.port != server.port
        server.shutdown()


def test_command_serves_and_says_where(cases, tmp_path):
    cases["0.2 mm"].save(tmp_path / "a.nc")
    command = [JOINTPLAY, "play", "a.nc", "--no-browser", "--port", "0", "--no-ghost", "--quiet"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        assert "playing at http://127.0.0.1:" in line
        with urllib.request.urlopen(line.split()[2]) as answer:
            assert b"jointplay" in answer.read()
    finally:
        import signal

        process.send_signal(signal.SIGINT)
        assert process.wait(900) == 0


def test_a_folder_stands_for_its_results(cases, tmp_path):
    (tmp_path / "run").mkdir()
    cases["0.2 mm"].save(tmp_path / "run" / "a.nc")
    assert main(["play", str(tmp_path / "run"), "--html", str(tmp_path / "a.html")]) == 0
    assert (tmp_path / "a.html").exists()
    table = tmp_path / "a.csv"
    assert main(["export", "result", str(tmp_path / "run"), "--out", str(table)]) == 0
    assert table.exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["none.nc"], "no result file"),
        (["bad.nc"], "damaged or not a result"),
        (["."], "'bad.nc' is damaged or not a result"),
        (["none"], "no result file"),
        (["a.nc", "a.nc"], "given twice"),
        (["a.nc", "--joint", "elbow"], "joint_b"),
        (["a.nc", "--port", "99999"], "whole number from 0 to 65535"),
        (["a.nc", "--host", "no.such.host.invalid"], "no host"),
        (["a.nc", "--magnify", "-1"], "-1"),
        (["a.nc", "--html", "bad.nc"], "exists"),
    ],
)
def test_wrong_input_is_named(arguments, text, cases, tmp_path):
    cases["0.2 mm"].save(tmp_path / "a.nc")
    (tmp_path / "bad.nc").write_bytes(b"nothing")
    command = [JOINTPLAY, "play", *arguments, "--no-browser", "--quiet", "--no-ghost"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=900)
    assert done.returncode == 2
    assert text in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.thorough
def test_a_mesh_is_packed_once_however_often_it_is_shown():
    robot = jp.Mechanism(robot_urdf("panda"), tool="panda_hand")
    motion = jp.Motion(robot.joints, [0.0, 0.02], np.zeros((2, len(robot.joints))))
    result = jp.simulate(robot, motion, limits="ignore")
    one = player.page({"a": result})[1]
    four = player.page({name: result for name in "abcd"})[1]
    assert len(four.contents["surfaces"]) == len(one.contents["surfaces"]) > 30
    assert len(four.contents["cases"]) == 4
    assert len(four.block) < 1.2 * len(one.block)
    assert len(four.block) < 1.5e6


# In a browser.


NAMES = """() => {
    const names = [];
    window.jointplay.viewer.scene.traverse(thing => {
        let shown = true;
        for (let at = thing; at; at = at.parent) shown = shown && at.visible;
        names.push([thing.type, thing.name, shown]);
    });
    return names;
}"""

OPENED = """() => {
    const p = window.jointplay, joints = p.cases.flatMap(c => c.joints.map(joint => [c, joint]));
    const forces = joints.map(([c, joint]) => joint.size[c.time.findIndex(t => t >= p.t)]);
    return [p.t, Math.max(...forces), p.strongest];
}"""

PLAY_BEGINS = """() => {
    const p = window.jointplay;
    p.setPlaying(true);
    const t = p.t;
    p.setPlaying(false);
    return t;
}"""


def check(tab):
    things = tab.evaluate(NAMES)
    meshes = [name for kind, name, shown in things if kind == "Mesh" and shown]
    assert len(meshes) > 20
    paths = " ".join(name for _, name, _ in things)
    for part in ("ghost", "trace", "joints"):
        assert part in paths
    begin = picture(tab)
    t, force, strongest = tab.evaluate(OPENED)
    assert t > 0.0
    assert force == pytest.approx(strongest, rel=1e-3)
    assert "the hardest impact" in tab.inner_text("#status")
    assert tab.evaluate(PLAY_BEGINS) == 0.0
    tab.evaluate("window.jointplay.seek(0.2)")
    scrubbed = picture(tab)
    assert tab.evaluate("window.jointplay.t") == pytest.approx(0.2)
    tab.evaluate("window.jointplay.setSpeed(1)")
    tab.keyboard.press(" ")
    until(tab, "window.jointplay.t > 0.25")
    tab.keyboard.press(" ")
    played = picture(tab)
    assert tab.evaluate("window.jointplay.t") > 0.25
    tab.evaluate("window.jointplay.seek(0)")
    tab.keyboard.press("n")  # to the first impact
    assert "impact 1 of" in tab.inner_text("#status")
    impact = picture(tab)
    for image in (begin, scrubbed, played, impact):
        assert image.std() > 0.05
    for one, two in ((begin, scrubbed), (scrubbed, played), (begin, impact)):
        assert np.abs(one - two).mean() > 1e-4


def test_file_plays_in_a_browser(open_page, page, tmp_path):
    path = tmp_path / "scara.html"
    path.write_bytes(page[0])
    tab = open_page(path.as_uri())
    check(tab)
    # The close-up: contact forces where they act, at the strongest moment of all.
    tab.evaluate("""() => {
        const p = window.jointplay;
        const hit = p.impacts.reduce((a, b) => a.force > b.force ? a : b);
        p.setLayout("closeup");
        p.seek(hit.t);
    }""")
    assert picture(tab).std() > 0.05


STRIP = """() => {
    const canvas = document.getElementById("timeline");
    const {width, height} = canvas;
    const {data} = canvas.getContext("2d").getImageData(0, 0, width, height);
    const columns = [];
    for (let x = 0; x < width; x++) {
        let inked = 0;
        for (let y = 8; y < height; y++) if (data[4 * (y * width + x) + 3] > 60) inked++;
        columns.push(inked / height);
    }
    return columns;
}"""


def strip(tab, values=None):
    """The part of each pixel column of the timeline that is drawn, of `values` if given."""
    if values is not None:
        tab.evaluate(
            """values => {
            const p = window.jointplay, name = document.getElementById("signal").value;
            p.signals[name] = {...p.signals[name], of: c => row => values[row]};
            p.drawTimeline();
        }""",
            values,
        )
    return np.array(tab.evaluate(STRIP))


def test_timeline_is_dragged_clicked_and_not_filled(open_page, cases, tmp_path):
    path = player.save_html({"0.2 mm": cases["0.2 mm"]}, tmp_path / "a.html")
    tab = open_page(path.as_uri())
    box = tab.locator("#timeline").bounding_box()
    end = tab.evaluate("window.jointplay.end")

    def at(part):
        return box["x"] + part * box["width"], box["y"] + box["height"] / 2

    tab.mouse.click(*at(0.25))
    assert tab.evaluate("window.jointplay.t") == pytest.approx(0.25 * end, abs=0.002 * end)
    tab.mouse.move(*at(0.3))
    tab.mouse.down()
    tab.mouse.move(*at(0.5))
    tab.mouse.move(*at(0.75))
    assert tab.evaluate("window.jointplay.t") == pytest.approx(0.75 * end, abs=0.002 * end)
    cursor = tab.locator("#cursor").bounding_box()["x"]
    assert cursor == pytest.approx(at(0.75)[0], abs=2.0)
    tab.mouse.move(*at(1.5))  # beyond: the end
    assert tab.evaluate("window.jointplay.t") == pytest.approx(end)
    tab.mouse.up()
    tab.mouse.move(*at(0.1))  # let go of, it is not moved
    assert tab.evaluate("window.jointplay.t") == pytest.approx(end)
    assert not tab.troubles  # before pixels are read, of which browsers complain
    rows = tab.evaluate("window.jointplay.cases[0].time.length")
    constant = strip(tab, [59.0] * rows)
    assert constant.min() > 0.0
    assert constant.max() < 0.1  # a line
    assert "constant, 59 N" in tab.inner_text("#signal-is")
    slight = strip(tab, (59.0 + 0.5 * np.sin(np.linspace(0.0, 9.0, rows))).tolist())
    assert slight.max() < 0.2
    assert "58.5 N to 59.5 N" in tab.inner_text("#signal-is")
    noise = np.random.default_rng(0).uniform(0.0, 1.0, rows)
    assert np.median(strip(tab, noise.tolist())) > 0.4  # what varies within a pixel is seen
    tab.troubles.clear()


def test_player_is_dark_where_the_system_is_and_by_its_switch(open_page, page, tmp_path):
    path = tmp_path / "a.html"
    path.write_bytes(page[0])
    tab = open_page(path.as_uri())
    bright = picture(tab).mean()
    tab.click("#theme")
    by_switch = picture(tab).mean()
    tab.click("#theme")
    assert picture(tab).mean() == pytest.approx(bright, abs=0.01)
    tab.evaluate("delete document.documentElement.dataset.theme")
    tab.emulate_media(color_scheme="dark")
    assert picture(tab).mean() == pytest.approx(by_switch, abs=0.01)
    assert by_switch < 0.6 * bright


@pytest.mark.parametrize("name", ["slider_crank", "four_bar"])
def test_loops_play_in_a_browser(open_page, name, tmp_path):
    scenario = jp.Scenario.load(f"jointplay:{name}.toml")
    results = {}
    for case in (scenario.cases[0], scenario.cases[-1]):
        results[case] = scenario.simulation(case, {"integration": {"duration": "0.012 s"}}).run()
    path = player.save_html(results, tmp_path / "a.html")
    tab = open_page(path.as_uri())
    begin = picture(tab)
    tab.evaluate("window.jointplay.seek(0.006)")
    assert np.abs(begin - picture(tab)).mean() > 1e-4


def test_balls_and_sliders_have_close_ups(open_page, urdf, tmp_path):
    path = urdf(
        body("a"), body("b", com="0.1 0 0"), joint("one", "base", "a", "prismatic"),
        joint("two", "a", "b", "floating", at="0.2 0 0"),
    )  # fmt: skip
    joints = {
        "one": jp.PrismaticClearance(clearance=1e-4),
        "two": jp.SphericalClearance(radial_clearance=1e-4),
    }
    robot = jp.Mechanism(path, joints, gravity=(0, -9.81, 0))
    result = jp.simulate(robot, duration=0.05, drive=jp.loads.Free(), joint_friction={}, step=5e-6)
    tab = open_page(player.save_html({"a": result}, tmp_path / "a.html").as_uri())
    shots = []
    for name in joints:
        tab.evaluate(f"window.jointplay.setJoint({name!r}); window.jointplay.setLayout('closeup')")
        shots.append(picture(tab))
    assert np.abs(shots[0] - shots[1]).mean() > 1e-3
