"""Every mechanism of the gallery runs, has its picture, and its numbers are of the right size."""

import csv
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jointplay as jp
from jointplay.model.loop import assemble
from jointplay.physics.kernel import Status

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "gallery"
PAGE = (FOLDER / "README.md").read_text(encoding="utf-8")
SHIPPED = ("scara", "slider_crank", "four_bar", "delta", "three_rrr")
NAMES = [*SHIPPED, *sorted(path.stem for path in FOLDER.glob("*.toml"))]
SHORT = 0.02
"""Time that a test simulates [s]; the numbers of the page are of whole runs."""


def scenario(name):
    place = f"jointplay:{name}.toml" if name in SHIPPED else FOLDER / f"{name}.toml"
    return jp.Scenario.load(place)


def rows():
    with (FOLDER / "numbers.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("name", NAMES)
def test_the_page_shows_it_with_picture_numbers_and_command(name):
    from matplotlib.image import imread

    assert f"({name}.png)" in PAGE
    image = imread(FOLDER / f"{name}.png")
    assert image[..., :3].std() > 0.02
    assert (FOLDER / f"{name}.png").stat().st_size < 80_000
    place = f"jointplay:{name}.toml" if name in SHIPPED else f"docs/gallery/{name}.toml"
    assert f"jointplay run {place} --out " in PAGE
    own = [row for row in rows() if row["mechanism"] == name]
    assert own
    for row in own:
        assert row["case"] in scenario(name).cases
        line = f"| {row['case']} | {row['tool_peak_mm']} / {row['tool_rms_mm']} | "
        assert line in PAGE
        assert abs(float(row["residual"])) < 0.05


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_every_case_runs(name):
    given = scenario(name)
    for case in given.cases:
        changes = {"integration": {"duration": SHORT, "settle": 0}}
        result = given.simulation(case, changes).run(check_step=False)
        assert result.status == Status.COMPLETED, (case, result.message)
        assert np.isfinite(result.q).all()


@pytest.mark.parametrize("angle", [0.0, 2.0, 3.14, 4.5, -2.0])
def test_jansens_leg_closes_on_the_same_side_wherever_its_crank_begins(angle):
    """The foot is where circles about the pins meet, each on the side on which it is drawn."""

    def meet(p, r, q, s, side):
        way = q - p
        length = np.hypot(*way)
        along = (length**2 + r**2 - s**2) / (2.0 * length)
        ahead = way / length
        across = np.array([-ahead[1], ahead[0]])
        return p + along * ahead + side * np.sqrt(r**2 - along**2) * across

    end, pivot = 15.0 * np.array([np.cos(angle), np.sin(angle)]), np.array([-38.0, -7.8])
    upper = meet(end, 50.0, pivot, 41.5, -1)
    knee = meet(end, 61.9, pivot, 39.3, 1)
    outer = meet(upper, 55.8, pivot, 40.1, -1)
    ankle = meet(outer, 39.4, knee, 36.7, -1)
    foot = meet(ankle, 65.7, knee, 49.0, -1)
    changes = {
        "integration": {"duration": SHORT, "settle": 0},
        "start": {"crank_pin": angle},
        "loads": {"ground": {"times": [0.0, 1.0], "forces": [[0, 0, 0]] * 2}},
    }
    simulation = scenario("jansen").simulation("ideal", changes)
    found = simulation.run(check_step=False)["tool_position"].values[0]
    assert found / 2e-3 == pytest.approx([*foot, 0.0], abs=1e-5)


def test_the_gate_leans_by_as_much_as_its_hinges_let_it():
    """Radial play C at two hinges 0.7 m apart: the corner, 1.2 m out, hangs 2 C 1.2/0.7 lower."""
    given = scenario("gate")
    run = given.ready_run("0.3 mm")
    upright = given.simulation("0.3 mm").mechanism.ideal()
    heights = []
    for mechanism, q in (
        (run.mechanism, run.workspace.q),
        (upright, assemble(upright, np.zeros(upright.model.nq), [])),
    ):
        pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
        heights.append(float(mechanism.data.oMf[mechanism.tool_frame].translation[2]))
    sag = heights[1] - heights[0]
    assert sag == pytest.approx(2 * 0.3e-3 * 1.2 / 0.7 + 0.5e-3, rel=0.15)  # and its axial play


@pytest.mark.nightly
@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("scara", "slider_crank")])
def test_the_numbers_can_be_measured_again(name):
    from pictures import gallery

    known = {row["case"]: row for row in rows() if row["mechanism"] == name}
    for row in gallery.numbers(name):
        for field, factor in (("tool_rms_mm", 1.3), ("force_peak_N", 3.0)):
            if row[field] == "-":
                continue
            then, now = float(known[row["case"]][field]), float(row[field])
            if np.isfinite(then):
                assert then / factor <= now <= then * factor, (row, field)
