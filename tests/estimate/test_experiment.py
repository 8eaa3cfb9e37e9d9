"""A run beside an experiment: measured curves against computed ones."""

import numpy as np
import pytest

import jointplay as jp
from jointplay.estimate import beside_experiment
from jointplay.estimate.experiment import curves

LATE, NOISE = 0.004, 2.0


def run(**joints):
    linkage = jp.Linkage(
        points={"O": (0, 0), "A": (0.05, 0), "B": (0.17, 0)},
        ground=["O"],
        links={
            "crank": jp.LinkageLink(["O", "A"], mass=0.3),
            "rod": jp.LinkageLink(["A", "B"], mass=0.21),
            "slider": jp.LinkageLink(["B"], mass=0.14),
        },
        sliders={"guide": jp.LinkageSlider("slider", (1, 0))},
    )
    turns = jp.Motion(["O"], [0, 0.2], [[0], [0.2 * 60]], "constant-speed")
    drive = {"O": jp.loads.Prescribed()}
    return jp.simulate(jp.Mechanism(linkage, joints), turns, drive=drive)


@pytest.fixture(scope="module")
def result():
    return run(B=jp.RevoluteClearance.planar(radial_clearance=1e-4))


@pytest.fixture
def measured(result, tmp_path):
    """What an accelerometer gives whose clock began late, in m/s^2, and a load cell, in kN."""
    path, rng = tmp_path / "measured.csv", np.random.default_rng(4)
    at = np.arange(0.02, 0.18, 0.0007)
    known = curves(result)
    acceleration = np.interp(at, *known["slider acceleration"][:2]) + rng.normal(0, NOISE, len(at))
    force = 1e-3 * np.interp(at, *known["B force"][:2])
    rows = zip(1e3 * (at - LATE), acceleration, force, strict=True)
    text = "\n".join(",".join(f"{value:.9g}" for value in row) for row in rows)
    path.write_text(f"time [ms],slider acceleration [m/s^2],B force [kN]\n{text}\n")
    return path


def test_the_acceleration_of_a_slider_without_play_is_that_of_its_closed_form():
    """The second derivative of r cos + sqrt(l^2 - r^2 sin^2), by finite differences."""
    time, values, unit = curves(run())["slider acceleration"]
    assert unit == "m/s^2"

    def place(t):
        return 0.05 * np.cos(60 * t) + np.sqrt(0.12**2 - (0.05 * np.sin(60 * t)) ** 2)

    h = 1e-4
    ideal = (place(time + h) - 2 * place(time) + place(time - h)) / h**2
    np.testing.assert_allclose(values, ideal, atol=1e-4 * np.abs(ideal).max())


def test_a_shift_is_found_and_noise_is_what_is_left(result, measured):
    found = beside_experiment(result, measured, shift=None)
    assert found.shift == pytest.approx(LATE, abs=2e-5)
    slider, force = found.curves
    assert slider.rms == pytest.approx(NOISE, rel=0.1)
    assert force.unit == "N"
    assert force.rms < 0.01 * np.std(force.measured)
    assert 0.0 < force.own_error < 0.05 * np.abs(force.computed).max()
    given = beside_experiment(result, measured)
    assert given.curves[0].rms > 20 * NOISE
    assert "--shift found" in str(given)


def test_a_constant_that_was_measured_too_decides_no_shift(result, measured):
    head, *rows = measured.read_text().splitlines()
    lines = [f"{head},O speed [rad/s]", *(f"{row},60.1" for row in rows)]
    measured.write_text("\n".join(lines))
    found = beside_experiment(result, measured, shift=None)
    assert found.shift == pytest.approx(LATE, abs=2e-5)
    assert "nan" not in str(found).partition("\n\n")[0]
    assert "O speed: computed and measured differ by 0.1 rad/s RMS; the run's" in str(found)


def test_an_ensemble_has_a_band_in_which_the_run_lies(result, measured):
    found = beside_experiment(result, measured, shift=LATE, runs=8, jobs=1)
    force = found.curves[1]
    low, high = force.band
    assert (high >= low).all()
    assert force.inside > 0.5
    assert "measured in the band" in str(found)
    names = found.csv.splitlines()[0].split(",")
    assert names[0] == "time [s]"
    assert "B force high [N]" in names


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,O [deg]\n0,1\n1,2\n", "'time' has no unit; write 'time \\[s\\]'"),
        ("time [s],slider speed\n0,1\n1,2\n", "write 'slider speed \\[m/s\\]'"),
        ("time [s],slidr [m]\n0,1\n1,2\n", "'slidr \\[m\\]' is unknown; there are: 'time \\[s\\]'"),
        ("time [s],slider [N]\n0,1\n1,2\n", "column 'slider \\[N\\]'"),
        ("time [s],slider [m]\n0,1\n0,2\n", "times must increase; number 2 is 0 s"),
        ("time [s],slider [m]\n5,1\n6,2\n7,3\n", "of 3 measured times 0 lie within the run"),
        ("time [s],slider [m]\n0,1\n0.1,2\n", "of 2 .* and 3 are needed at least$"),
        (
            "tme [s],slider [N]\n0,1\n",
            "'tme \\[s\\]' is unknown, 'slider \\[N\\]': .*expected a length",
        ),
        ("slider [m]\n5\n6\n", "no column 'time \\[s\\]'"),
        ("time [s]\n5\n6\n", "no column beside the time"),
    ],
)
def test_a_measurement_that_cannot_be_laid_beside_the_run_is_refused(result, tmp_path, text, said):
    path = tmp_path / "measured.csv"
    path.write_text(text)
    with pytest.raises(jp.JointplayError, match=said):
        beside_experiment(result, path)
