"""Shares of the tool's error from runs."""

import numpy as np
import pytest
from conftest import body, joint, tip

from jointplay import Gear, JointplayError, Mechanism, Motion, RevoluteClearance, Simulation
from jointplay.cli import main
from jointplay.simulation.loads import ComputedTorque
from jointplay.study.shares import sensitivity, shares


@pytest.fixture
def arm(urdf):
    """Two hinges about y in a row, the tool beyond."""
    return urdf(
        body("one", com="0.1 0 0"),
        body("two", mass=1.0, com="0.1 0 0"),
        joint("a", "base", "one", axis="0 1 0"),
        joint("b", "one", "two", axis="0 1 0", at="0.3 0 0"),
        tip("two", "0.3 0 0"),
    )


def simulation(arm, plays, **options):
    joints = {n: RevoluteClearance.planar(radial_clearance=c) for n, c in plays.items()}
    motion = Motion(["a", "b"], [0.0, 0.3], [[0.0, 0.0], [0.02, 0.02]])
    gears = options.pop("gears", {})
    return Simulation(Mechanism(arm, joints, gears=gears, tool="tool"), motion, **options)


def test_hanging_journals_share_the_drop_as_their_clearances(arm):
    # Slowly moved, each journal lies at the bottom of its bore: the tool drops by both clearances.
    found = shares(simulation(arm, {"a": 1e-4, "b": 3e-4}), 1)
    assert found.joints == ("a", "b")
    assert found.alone_rms[0] == pytest.approx([1e-4, 3e-4], rel=0.1)
    assert found.rms[0] == pytest.approx(4e-4, rel=0.1)
    assert found.parts[0] == pytest.approx([0.25, 0.75], abs=0.06)
    assert found.interaction[0] == pytest.approx(0.0, abs=0.06)


def test_parts_and_interaction_are_the_whole(arm):
    found = shares(simulation(arm, {"a": 2e-4, "b": 2e-4}), 2)
    assert found.parts.sum(axis=1) + found.interaction == pytest.approx([1.0, 1.0])
    assert (found.peak >= found.rms).all()
    assert "interaction" in str(found)
    assert "simulated, 2 perturbed runs" in str(found)


def test_a_gear_is_a_source_of_its_own(arm):
    gears = {"a": Gear(1e-3, 0.1, 1e4)}
    soft = ComputedTorque(30.0)
    found = shares(simulation(arm, {"b": 1e-4}, gears=gears, drive=soft), 1)
    assert len(found.joints) == 2
    assert found.joints[1].startswith("a")
    assert (found.alone_rms[0] > 1e-5).all()


def test_the_wider_clearance_has_the_larger_index(arm):
    pytest.importorskip("SALib")
    found = sensitivity(simulation(arm, {"a": 2e-5, "b": 4e-4}), 4, slowest=1.0)
    assert found.names == ("clearance a", "clearance b", "friction of the bearings")
    assert len(found.rms) == 4 * (3 + 2)
    assert found.total[1] > 0.5
    assert found.total[0] < 0.2
    assert found.total.argmax() == 1
    assert np.isfinite(found.total_confidence).all()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"samples": 3}, "power of two"),
        ({"spread": 1.0}, "spread"),
        ({"slowest": 0.0}, "slowest"),
        ({"payload": -1.0}, "payload"),
    ],
)
def test_ranges_that_make_no_sense_are_named(arm, options, says):
    with pytest.raises(JointplayError, match=says):
        sensitivity(simulation(arm, {"a": 1e-4}), **options)


def test_what_has_no_error_to_share_is_refused(arm):
    with pytest.raises(JointplayError, match="no joint or gear has play"):
        shares(simulation(arm, {}))
    with pytest.raises(JointplayError, match="no motion"):
        shares(Simulation(simulation(arm, {"a": 1e-4}).mechanism, duration=0.1))
    with pytest.raises(JointplayError, match="runs"):
        shares(simulation(arm, {"a": 1e-4}), 0)


def test_the_command_prints_and_writes(arm, tmp_path, capsys):
    motion, out = tmp_path / "motion.csv", tmp_path / "out"
    motion.write_text("time_s,a,b\n0,0,0\n0.1,0.02,0.02\n")
    order = ["study", "shares", str(arm), "--joint", "a", "--joint", "b", "--motion", str(motion)]
    order += ["--runs", "1", "--jobs", "1", "--quiet", "--tool", "tool", "--out", str(out)]
    assert main(order) == 0
    assert "interaction" in capsys.readouterr().out
    assert (out / "shares.png").stat().st_size > 5000
    rows = (out / "shares.csv").read_text().splitlines()
    assert [row.split(",")[1] for row in rows[1:]] == ["a", "b", "interaction", "all"]
    shares = [float(row.split(",")[4]) for row in rows[1:4]]
    assert sum(shares) == pytest.approx(1.0, abs=1e-4)
