"""From wear to maintenance."""

import numpy as np
import pytest
from conftest import body, joint
from test_wear import SCENARIO

import jointplay as jp
from jointplay.cli import main
from jointplay.study.maintenance import maintenance

PLAY = 1e-4


def rubbing(urdf, *, gravity=9.81, target_joint=True, wear_rate=1e-13, second=False, **options):
    """A heavy body whose journal turns in a bore, the tool on its axis."""
    play = {"pin": jp.RevoluteClearance.planar(radial_clearance=PLAY, wear_rate=wear_rate)}
    parts = [body("arm"), joint("pin", "base", "arm")]
    if second:
        parts += [body("end", mass=1.0), joint("tip", "arm", "end")]
        play["tip"] = jp.RevoluteClearance.planar(radial_clearance=PLAY)
    robot = jp.Mechanism(urdf(*parts), play, gravity=(0, -gravity, 0))
    motion = jp.Motion(["pin"], [0, 0.05], [[0], [1.5]], "constant-speed")
    return jp.Simulation(
        robot, motion, **({"drive": jp.loads.ComputedTorque(300.0), "joint_friction": {}} | options)
    )


def test_the_tool_on_the_axis_is_off_by_the_clearance_and_what_has_worn(urdf):
    found = maintenance(rubbing(urdf), 1.1e-4, blocks=2, runs=2)
    assert found.joints == ("pin",)
    assert found.error == pytest.approx([1e-4, 1.05e-4, 1.1e-4], rel=2e-3)
    assert found.growth[:, 0] == pytest.approx([0.0, 5e-6, 1e-5], abs=2e-7)
    assert found.blame == pytest.approx([1.0])
    assert found.reached
    low, high = found.spread
    assert low < found.life < high


def test_life_goes_by_the_wear_rate_and_by_the_cycles_of_a_run(urdf):
    def found(rate=1e-13, count=1.0):
        machine = rubbing(urdf, wear_rate=rate)
        return maintenance(machine, 1.02e-4, blocks=1, runs=1, cycles_per_run=count)

    one = found()
    assert np.isnan(one.standard_error)
    assert "unknown" in str(one)
    assert "an estimate" in str(one)
    assert "1 block of equal cycles" in str(one)
    assert "the tool may be more than its 0.102 mm off" in str(one)
    assert found(rate=1e-12).life == pytest.approx(0.1 * one.life, rel=1e-3)
    assert found(count=2.0).life == pytest.approx(2.0 * one.life, rel=1e-3)


@pytest.mark.parametrize(
    ("machine", "target", "says"),
    [
        ({}, 0.9e-4, r"0\.1 mm before anything wears.*exceeded already"),
        ({"wear_rate": None}, 2e-4, r"pin.*wear_rate"),
        ({"gravity": 0.0, "start": "centred"}, 2e-4, "slides under load"),
        ({}, 1.0, "does not lead"),
    ],
)
def test_questions_without_an_answer_are_refused(urdf, machine, target, says):
    with pytest.raises(jp.JointplayError, match=says):
        maintenance(rubbing(urdf, **machine), target, blocks=1, runs=1)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"target": -1.0}, "target"),
        ({"blocks": 0}, "blocks"),
        ({"runs": 0}, "runs"),
        ({"factor": 0.5}, "factor"),
        ({"cycles_per_run": 0.0}, "cycles per run"),
    ],
)
def test_values_out_of_range_are_named(urdf, changes, says):
    with pytest.raises(jp.JointplayError, match=says):
        maintenance(rubbing(urdf), **({"target": 2e-4} | changes))


def test_the_command_prints_and_writes(urdf, tmp_path, capsys):
    urdf(body("arm"), joint("pin", "base", "arm"))
    file, out = tmp_path / "s.toml", tmp_path / "out"
    file.write_text(SCENARIO)
    order = ["study", "maintenance", str(file), "--blocks", "1", "--runs", "2", "--quiet"]
    assert main([*order, "--target", "0.102 mm", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "pin 100 %" in text
    assert (out / "maintenance.png").stat().st_size > 5000
    rows = (out / "maintenance.csv").read_text().splitlines()
    assert rows[0] == "cycles,standard_error_of_block,error_m,growth_pin_m"
    assert float(rows[-1].split(",")[2]) == pytest.approx(1.02e-4, rel=2e-3)
    assert main([*order, "--target", "0.05 mm"]) == 2
    assert "exceeded already" in capsys.readouterr().err
