"""Stops at the ends of joints, as those of a mass in a gap."""

import numpy as np
import pytest

import jointplay as jp
from jointplay.simulation.analysis.end_stops import struck_stops

GAP, MASS, SPEED, STIFFNESS = 2e-3, 0.5, 0.4, 2e5


@pytest.fixture(scope="module")
def result():
    """A mass that flies to and fro between two stops that lose nothing, no force on it else."""
    drawn = jp.Linkage(
        points={"P": (0.0, 0.0)},
        ground=[],
        links={"mass": jp.LinkageLink(["P"], mass=MASS)},
        sliders={"guide": jp.LinkageSlider("mass", (1, 0))},
    )
    stop = jp.loads.Stop("guide", stiffness=STIFFNESS, lower=-GAP / 2, upper=GAP / 2)
    return jp.simulate(
        jp.Mechanism(drawn, gravity="balanced"),
        drive={"guide": jp.loads.Free()},
        loads={"gap": stop},
        state={"guide": (0.0, SPEED)},
        duration=0.1,
        step=2e-6,
        record_every=10,
    )


def test_a_mass_in_a_gap_strikes_as_often_and_as_hard_as_energy_says(result):
    (stop,) = struck_stops(result)
    swing = np.sqrt(STIFFNESS / MASS)
    assert stop.peak == pytest.approx(MASS * SPEED * swing, rel=2e-3)
    period = 2 * GAP / SPEED + 2 * np.pi / swing  # to and fro, half a swing in each stop
    assert stop.rate == pytest.approx(2 / period, rel=0.15)
    assert stop.impacts == pytest.approx(2 * 0.1 / period, abs=1)
    assert "stop 'gap' of guide:" in result.summary()
    assert "a second, at most 126 N" in result.summary()


def test_stops_that_records_miss_are_said_to_be(result):
    few = result.thinned(200)
    (stop,) = struck_stops(few)
    assert stop.shortest < 6
    assert "record more often" in str(stop)
