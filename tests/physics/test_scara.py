"""The paper's robot: what its worn joint B must carry, and the whole cycle."""

import dataclasses
import math

import numpy as np
import pytest

from jointplay.paper import CONDITIONS, Condition, scara
from jointplay.physics.geometry import Form
from jointplay.physics.kernel import Status

LOADED = Condition("loaded", "consistent")
ARM_2, ARM_3, REACH = 4.35, 3.03, 0.275  # kg, kg, m: masses beyond joint B and the arm's length
DEPTH = 0.33
"""Of the suction cup below joint B, the stroke down [m]."""
WEIGHT = 9.81 * (ARM_2 + ARM_3)


@pytest.mark.parametrize("clearance", [2e-4, 5e-4])
def test_weight_wedges_the_resting_journal_as_statics_say(clearance):
    """Between two strokes, 0.42 to 0.49 s, the loaded robot stands still."""
    worn, ideal = (
        dataclasses.replace(scara(play, LOADED), duration=0.49).run() for play in (clearance, None)
    )
    rest = worn.time > 0.45
    joint = worn.simulation.mechanism.clearance["joint_b"]
    assert worn["joint_force"].values[rest, 0].mean(axis=0) == pytest.approx(
        [0.0, 0.0, WEIGHT], abs=0.01
    )
    reaction = ideal["reaction_force"].sel(moving_joint="joint_b").values[ideal.time > 0.45]
    assert reaction.mean(axis=0) == pytest.approx([0.0, 0.0, WEIGHT], abs=0.01)
    tilt = worn["tilt"].values[rest].mean()
    assert tilt == pytest.approx(2.0 * joint.cr / joint.lj, rel=0.02)
    # The overhang of arms 2 and 3 about the foot on the wall, over the distance of the two rims.
    moment = 9.81 * (ARM_2 * 0.5 * REACH + ARM_3 * REACH) - WEIGHT * joint.rj
    radial = worn["normal_force"].values[rest, 0, :2].mean()
    assert radial == pytest.approx(moment / (joint.lj - 2.0 * joint.rj * tilt), rel=0.01)
    droop = (ideal["tool_position"].values - worn["tool_position"].values)[rest, 2].mean()
    rise = DEPTH * (1.0 - math.cos(tilt))  # the cup swings out below the bearing
    assert droop == pytest.approx((REACH - joint.rj) * tilt + joint.ca - rise, rel=0.01)
    assert (worn["form"].values[rest] == Form.TWO_RADIAL_ONE_AXIAL).all()


@pytest.mark.nightly
@pytest.mark.parametrize("clearance", [2e-4, 5e-4])
@pytest.mark.parametrize("condition", CONDITIONS, ids=str)
def test_whole_cycle_is_sound_and_bears_a_finer_step(condition, clearance):
    """Statistics of 3 s at 10 and 5 us: contact is chaotic, so samples may differ."""
    coarse, fine = (
        dataclasses.replace(scara(clearance, condition), step=step).run() for step in (1e-5, 5e-6)
    )
    for result in (coarse, fine):
        audit = result.audit
        assert result.status == Status.COMPLETED
        assert audit.relative_energy_residual < 1e-3
        assert audit.under_resolved == 0
        assert audit.penetration_over_clearance < 0.1
    assert coarse.audit.relative_energy_residual > 1.5 * fine.audit.relative_energy_residual
    assert coarse.audit.impacts == pytest.approx(fine.audit.impacts, rel=0.15)
    peaks = [float(result["normal_force_peak"].max()) for result in (coarse, fine)]
    assert peaks[0] == pytest.approx(peaks[1], rel=0.2)
    if condition.gravity == "balanced":
        assert set(np.unique(fine["mode"])) == {0, 1, 2}  # claim 4


@pytest.mark.nightly
@pytest.mark.parametrize("condition", CONDITIONS[::2], ids=str)
def test_whole_cycle_stays_within_reach_of_the_clearance(condition):
    """The tool cannot leave the ideal path by more than the play allows, at its lever."""
    ideal = scara(None, condition).run()["tool_position"].values
    for clearance in (2e-4, 5e-4):
        result = scara(clearance, condition).run()
        joint = result.simulation.mechanism.clearance["joint_b"]
        lever = math.hypot(REACH, 0.35 + 0.14)
        limit = 1.2 * (2.0 * joint.cr / joint.lj * lever + joint.cr + joint.ca)
        error = np.linalg.norm(result["tool_position"].values - ideal, axis=1).max()
        assert 2.0 * clearance < error < limit
