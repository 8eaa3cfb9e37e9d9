"""Reports on sweeps: the page and the PDF."""

import dataclasses
import json
import re

import numpy as np
import pytest
import xarray as xr
from sweep_scenario import SCENARIO

import jointplay as jp
from jointplay.cli import main
from jointplay.show.reports import sweep_report
from jointplay.simulation.analysis.uncertainty import IntervalEstimate
from jointplay.study import sweep_table

AXES = """
clearance = { key = "joints.joint_b.radial_clearance", values = [0, "0.2 mm", "1 nm"] }
"<script>friction" = { key = "joints.joint_b.friction.mu_d", values = [0.0, 0.1] }
"""
SAMPLED = """
clearance = { key = "joints.joint_b.radial_clearance", distribution = "normal", mean = "0.2 mm", std = "0.01 mm" }
"""  # noqa: E501


def swept(folder, axes, options):
    path = folder / "study.toml"
    path.write_text(SCENARIO.format(axes=axes, options=options, duration="0.01 s"))
    jp.sweep(path, folder / "s", jobs=1)
    return folder / "s"


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    """A store with failed cases, and with a name that holds HTML."""
    return swept(tmp_path_factory.mktemp("grid"), AXES, "repeats = 2")


@pytest.mark.usefixtures("checked_figures")
def test_the_page_has_table_lines_maps_and_failed_cases(grid, tmp_path):
    page = tmp_path / "p.html"
    assert main(["report", str(grid), "-o", str(page), "--quiet"]) == 0
    source = page.read_text(encoding="utf-8")
    for name in ("Cases", "Lines", "Heat maps", "Failed cases", "What was run"):
        assert f"<h2>{name}</h2>" in source
    assert "is too large for the contact stiffness at" in source
    assert "4 of 12 cases" in source
    same = source.partition("The same in all cases")[2].partition("</ul>")[0]
    assert "joints.joint_b.axial_clearance 0.2 mm" in same
    assert "joints.joint_b.radial_clearance" not in same  # which is varied
    assert "<script" not in source  # neither of ours nor of a name
    assert "&lt;script&gt;friction" in source
    found = jp.open_sweep(grid).dataset()["peak_force"].values[0, 0].mean()
    assert f"{found:.4g}\u00a0±\u00a00" in source  # the ideal joint's: all runs the same
    assert source.count("data:image/svg+xml") >= 5
    assert (tmp_path / "p.pdf").read_bytes()[:5] == b"%PDF-"


def test_what_is_varied_is_known_by_its_key_however_the_axis_is_written():
    axes = {
        "joints.b.radial_clearance": [1e-4, 2e-4],
        "speed": {"keys": ["motion.speeds.O", "motion.speeds.P"], "from": 1.0, "to": 2.0},
        "gravity": {"key": "environment.gravity", "values": [0]},
        "joints.b.friction.mu_d": {"from": 0.0, "to": 0.1},
        "law": {"variants": {"soft": {"contact": {}}}},
    }
    dataset = xr.Dataset(attrs={"sweep": json.dumps({"axes": axes})})
    assert sweep_table.varied_keys(dataset) == {
        "joints.b.radial_clearance", "motion.speeds.O", "motion.speeds.P", "environment.gravity",
        "joints.b.friction.mu_d", "contact",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [
        (282.0, 391.0, "280 ± 390"),
        (53.083, 0.0518, "53.08 ± 0.05"),
        (53.083, 1e-5, "53.08 ± 0.01"),
        (3.159e-3, 3.4e-5, "0.003159 ± 0.000034"),
        (0.0, 0.0, "0 ± 0"),
    ],
)
def test_a_mean_has_no_more_digits_than_its_interval_leaves_it(value, half, text):
    estimate = IntervalEstimate(value, value - half, value + half, 4)
    assert estimate.plus_minus.replace("\u00a0", " ") == text


def test_a_sweep_is_answered_on_the_first_screens(tmp_path, open_page):
    axes = """
    clearance = { key = "joints.joint_b.radial_clearance", from = "0.1 mm", to = "0.2 mm", number = 12 }
    friction = { key = "joints.joint_b.friction.mu_d", values = [0.0, 0.1] }
    """  # noqa: E501
    page = tmp_path / "p.html"
    sweep_report(swept(tmp_path, axes, ""), page, pdf=False)
    tab = open_page(page.as_uri(), (1280, 900))
    assert tab.evaluate("document.documentElement.scrollHeight") <= 5000
    assert re.search(r"peak force: \S+ N \(at clearance \S+ mm.*\) to ", tab.inner_text("main"))
    rows = tab.locator("#cases tbody tr")
    assert [rows.nth(k).is_visible() for k in range(24)] == [True] * 20 + [False] * 4
    seen = [one.is_visible() for one in tab.locator("main img").all()]
    assert sum(seen) == 2
    assert len(seen) > 6
    tab.emulate_media(media="print")
    assert all(one.is_visible() for one in tab.locator("main img").all())


@pytest.mark.usefixtures("checked_figures")
def test_the_page_of_samples_has_their_distributions(tmp_path):
    store = swept(tmp_path, SAMPLED, "samples = 8")
    assert main(["report", str(store), "--quiet", "--no-pdf"]) == 0
    source = (tmp_path / "s_report.html").read_text(encoding="utf-8")
    assert "<h2>Distributions</h2>" in source
    assert re.search(r"8 samples\s+peak_force \[N\]", source)
    assert "<h2>Heat maps</h2>" not in source
    assert not (tmp_path / "s_report.pdf").exists()


def test_samples_with_a_failed_case_lose_their_sobol_indices_alone(tmp_path, capsys):
    axes = "\n".join(
        f'{name} = {{ key = "joints.joint_b.{key}", distribution = "uniform", from = "{low} mm", '
        f'to = "{high} mm" }}'
        for name, key, low, high in (
            ("clearance", "radial_clearance", 0.1, 9), ("radius", "bearing_radius", 2, 10)
        )
    )  # fmt: skip
    store = swept(tmp_path, axes, 'samples = 4\nsampling = "saltelli"\nseed = 1')
    state = jp.open_sweep(store).dataset()["status"].values
    failed = int((state == "failed").sum())
    assert 0 < failed < state.size
    assert main(["report", str(store), "--quiet", "--no-pdf"]) == 0
    assert main(["study", "uncertainty", str(store), "peak_force"]) == 0
    page = (tmp_path / "s_report.html").read_text(encoding="utf-8")
    for said in (page, capsys.readouterr().out):
        assert re.search(r"\d+ samples, \d+ without a value\s+peak_force \[N\]", said)
        assert f"no Sobol indices: {failed} of " in said


def test_a_sweep_has_a_report_of_its_own(grid, tmp_path, capsys):
    assert main(["report", str(grid), str(grid)]) == 2
    assert main(["report", str(grid), "--impacts", "3"]) == 2
    assert main(["report", str(grid), "-o", str(tmp_path / "page.txt")]) == 2
    err = capsys.readouterr().err
    assert "give only its folder" in err
    assert "--impacts is for results" in err
    assert "must end in .html" in err


@pytest.mark.parametrize(
    ("options", "integration"),
    [("", 'start = "centred"\njudge_from = "0.03 s"'),
     ('start = "0.03 s"', 'start = "centred"\nsettle = "0.01 s"')],
)  # fmt: skip
def test_all_measures_of_a_sweep_are_of_the_part_that_is_judged(options, integration, tmp_path):
    text = SCENARIO.format(axes="", options=options, duration="0.05 s")
    text = text.replace("[sweep.axes]", "").replace("[sweep]", f"{integration}\n[sweep]")
    path = tmp_path / "s.toml"
    path.write_text(text)
    axes = {"joints.joint_b.radial_clearance": ["0.2 mm"]}
    found = jp.sweep(path, tmp_path / "s", axes, jobs=1).dataset().isel(radial_clearance=0)
    one = jp.Scenario.load(path).simulation()
    result = dataclasses.replace(one, settle=None, judge_from=0.03).run()
    audit, late = result.audit, result.time >= 0.03
    peaks = np.linalg.norm(result["joint_force_peak"].values, axis=2)
    assert float(found["peak_force"]) == peaks[late].max() == audit.peak_force
    assert peaks.max() > 1.2 * audit.peak_force  # what is left out matters
    assert float(found["impacts"]) == audit.judged_impacts < audit.impacts
    assert float(found["impulse"]) == audit.judged_impulse < audit.normal_impulse
    assert 0.0 < float(found["penetration"]) < audit.largest_penetration
    gaps = result["gap_min"].values[late]
    assert float(found["penetration"]) == -np.nanmin(gaps)
    lost = result["normal_dissipation"].values
    expected = lost[-1] - lost[np.argmax(late)]
    assert float(found["normal_dissipation"]) == pytest.approx(expected)
    modes = result["mode"].values[late, 0]
    assert float(found["share_free_flight"]) == np.mean(modes == 0)
