"""Analysis of results against numbers reckoned by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from conftest import body, joint
from scipy.spatial.transform import Rotation

import jointplay as jp
from jointplay import analysis
from jointplay.bridges import notebook
from jointplay.paper import scara
from jointplay.simulation.analysis import headline, parts, tool_error
from jointplay.simulation.analysis.tool_error import tops
from jointplay.simulation.result.certificate import alone
from jointplay.simulation.result.result import COMPARED


@pytest.fixture(scope="module")
def pair():
    found = []
    for clearance in (None, 0.2e-3):
        made = scara(clearance)
        found.append(jp.simulate(made.mechanism, made.motion, duration=0.3, judge_from=0.0))
    return found


def test_a_tool_error_that_cannot_be_known_is_missed_with_a_warning(pair, monkeypatch):
    def refuse(*_):
        raise jp.JointplayError("its loops cannot be closed")

    monkeypatch.setattr(tool_error, "tool_motion", refuse)
    unknown = jp.Result(pair[1].dataset.drop_vars(COMPARED, errors="ignore"))
    with pytest.warns(RuntimeWarning, match=r"the tool error is unknown.*loops cannot be closed"):
        assert not analysis.has_tool_error(unknown)


def test_a_tool_error_against_an_ideal_run_that_ends_early_says_so(pair):
    ideal, loose = pair
    early = jp.simulate(ideal.simulation.mechanism, ideal.simulation.motion, duration=0.1)
    shorter = analysis.measured_against(loose, early)
    assert np.isnan(shorter["tool_error"].values[-1])
    (line,) = [one for one in headline.headline(shorter) if "puts the tool" in one]
    assert line.endswith("against the ideal mechanism, whose run ends at 0.1 s")
    assert "whose run ends" not in headline.headline(loose)[0]


def test_what_came_out_of_a_run_is_judged_from_when_the_run_is():
    made = scara(0.2e-3)
    late = jp.simulate(made.mechanism, made.motion, duration=0.3, judge_from=0.2)
    lines = headline.headline(late, detail=True)
    assert lines[0].startswith("Play of 0.2 mm in joint_b puts the tool 'suction_cup' up to ")
    assert " off from 0.2 s on (at t = 0.2" in lines[0]
    kept = late.time >= 0.2
    force = np.linalg.norm(late["joint_force_peak"].values[kept, 0], axis=1).max()
    assert force < np.linalg.norm(late["joint_force_peak"].values[:, 0], axis=1).max()
    assert f"peak force in joint_b from 0.2 s on {alone(force)} N" in lines[-3]
    assert lines[-2].startswith(f"rattle: {10 * late.audit.judged_impacts} impacts a second of ")
    assert lines[-2].endswith(" from 0.2 s on")


def test_the_sentence_names_the_play_that_there_is_or_else_what_gives_way(pair):
    _, loose = pair
    rest = {"rotor_inertia": 0.1, "stiffness": 1e4}

    def said(play_a, play_b, clearance):
        gears = {"joint_a": jp.Gear(play=play_a, **rest), "joint_b": jp.Gear(play=play_b, **rest)}
        mechanism = SimpleNamespace(
            clearance=clearance,
            gears=gears,
            hinges={},
            description=loose.simulation.mechanism.description,
        )
        simulation = SimpleNamespace(mechanism=mechanism, loads={})
        return parts.cause(SimpleNamespace(joints=[], simulation=simulation, values=[]))

    clearance = loose.simulation.mechanism.clearance
    assert said(0.0, 0.0, clearance) == "Play of 0.2 mm in joint_b"
    assert said(0.0, 0.0, {}) == "Elasticity of the gears of joint_a, joint_b"
    assert said(0.0, 0.00872665, clearance) == (
        "Play of 0.2 mm in joint_b and of 0.5 deg in the gear of joint_b"
    )


def test_a_force_has_its_error_if_its_sizes_were_given_and_what_has_none_three_digits(pair):
    """In the summary, the audit's line, and what a notebook shows.

    The bearing's length was assumed: then the first line has no digits that hang on it.
    """
    _, made = pair
    loose = jp.Result(made.dataset.copy())
    loose.dataset.attrs.pop("certificate", None)
    peak = alone(loose.audit.peak_force)
    assert len(peak.replace(".", "")) == 3

    def said(detail=False):
        lines = "\n".join(headline.headline(loose, detail))
        return lines, loose.judgement, dict(notebook.rows_of(loose))["peak force in joint_b"]

    lines, judged, shown = said()
    assert f"peak force in joint_b {peak} N at " in lines
    assert f"largest joint force {peak} N, " in judged
    assert shown == f"{peak} N"
    loose.certificate = jp.certify(loose, strict=False)
    force = loose.certificate["peak joint force"]
    assert "±" in str(force)
    lines, _, shown = said()
    assert f"peak force in joint_b {peak} N at " in lines
    assert shown == f"{peak} N"
    assert f"peak force in joint_b {force} at " in said(detail=True)[0]
    loose.dataset.attrs["values"] = "[]"  # nothing is assumed
    lines, judged, shown = said()
    assert f"peak force in joint_b {force} at " in lines
    assert f"largest joint force {force}, " in judged
    assert shown == str(force)


def test_rattle_counts_impacts_and_splits_a_known_vibration_into_bands(pair):
    _, loose = pair
    known = jp.Result(loose.dataset.copy())
    known.dataset["ideal_tool_velocity"] = 0.0 * known["ideal_tool_velocity"]
    time = known.time
    velocity = np.zeros((len(time), 3))
    velocity[:, 0] = 0.1 * np.sin(2 * np.pi * 50.0 * time) / (2 * np.pi * 50.0)
    velocity[:, 1] = 3.0 * np.sin(2 * np.pi * 500.0 * time) / (2 * np.pi * 500.0)
    known.dataset["tool_velocity"] = (("time", "axis"), velocity)
    found = analysis.rattle(known)
    low, middle, high = found.bands
    assert (low.low, low.high, middle.high, high.high) == (0.0, 100.0, 1000.0, 5000.0)
    # Each sample is a mean over a record interval, which lowers 500 Hz by 0.4 %.
    assert low.rms == pytest.approx(0.1 / np.sqrt(2), rel=0.02)
    assert middle.rms == pytest.approx(3.0 / np.sqrt(2), rel=0.02)
    assert high.rms < 1e-3 * middle.rms
    lost = loose["normal_dissipation"].values
    assert found.impacts == loose.audit.judged_impacts > 0
    assert found.lost == pytest.approx(lost[-1] - lost[0])
    assert found.rate * found.energy == pytest.approx(found.power)
    assert f"{found.rate:.3g} impacts a second" in str(found)


def test_accuracy_of_a_known_error():
    time = np.linspace(0.0, 1.0, 11)
    values = np.zeros((11, 3))
    values[:, 0], values[5, 1] = 1e-3, -4e-3
    error = xr.DataArray(values, {"time": time, "axis": list("xyz")}, ("time", "axis"))
    found = analysis.error_statistics(error)
    assert found.mean[:2] == pytest.approx([1e-3, -4e-4])
    assert found.rms[:2] == pytest.approx([1e-3, 4e-3 / np.sqrt(10)])
    assert found.peak == pytest.approx([1e-3, 4e-3, 0.0, np.hypot(1e-3, 4e-3)])
    assert analysis.error_statistics(error, 0.55).peak[1] == 0.0
    assert analysis.error_at(error, 0.52) == pytest.approx([1e-3, -4e-3, 0, np.hypot(1e-3, 4e-3)])
    with pytest.raises(jp.JointplayError, match="no records"):
        analysis.error_statistics(error, 2.0)


def test_the_mean_over_time_does_not_hang_on_where_records_begin_and_end():
    """A quarter of a cosine: by the plain mean of its records it would be off by 1.2 %."""
    time = np.linspace(0.0, 0.5 * np.pi, 41)
    values = np.stack([np.cos(time), 0.0 * time, 0.0 * time], 1)
    error = xr.DataArray(values, {"time": time, "axis": list("xyz")}, ("time", "axis"))
    found = analysis.error_statistics(error)
    assert found.rms[3] == pytest.approx(np.sqrt(0.5), rel=1e-12)
    assert found.mean[0] == pytest.approx(2.0 / np.pi, rel=2e-4)


@pytest.mark.parametrize("kink", [0.0, 3.0], ids=["smooth", "impact"])
def test_peaks_are_found_between_records(kink):
    """A cosine, at whose peak the speed may jump by 6, recorded at phases that miss it."""
    for phase in np.linspace(0.0, 1.0, 23):
        time = 0.1 * (np.arange(-8.0, 9.0) + phase)
        size = 2.0 * np.cos(time) - kink * np.abs(time)
        rate = -2.0 * np.sin(time) - kink * np.sign(time)
        top, most = (one.max() for one in tops(time, size, rate))
        assert abs(top - 2.0) <= most - top + 1e-6
        assert most - top <= 2.0 * kink * 0.1 / 8.0 + 1e-3
        assert kink or top == pytest.approx(2.0, abs=1e-6)  # records miss up to 2.5e-3


def test_the_stated_error_of_a_peak_covers_what_records_miss():
    """A slider-crank: records of all steps know the peak, of which every 20th misses 0.3 µm."""
    made = jp.Scenario.load("jointplay:slider_crank.toml").simulation("0.2 mm")
    every = replace(made, duration=0.03, record_every=1)
    known = every.run(estimate=False)
    exact = np.linalg.norm(analysis.deviation(known), axis=1).max()
    seldom = replace(every, record_every=20).run(certify=True)
    held = np.linalg.norm(analysis.deviation(seldom), axis=1).max()
    found = seldom.certificate["peak tool error"]
    assert exact - held > 3e-7
    assert abs(found.value - exact) < min(found.error, 0.05 * (exact - held))
    assert seldom.tool_error.peak == found.value


def test_samples_that_turn_round_do_not_rest():
    time = np.linspace(0.0, 0.05, 51)
    swings = jp.Motion(["a"], time, 0.2 * np.sin(50.0 * np.pi * time)[:, None], "spline")
    assert [one for one in analysis.stops(swings, 0.05) if one.at_rest] == []
    way = time / 0.05
    rests = (way**3 * (10.0 - 15.0 * way + 6.0 * way**2))[:, None]
    there_and_back = np.concatenate([rests, rests[-2::-1]])
    moves = jp.Motion(["a"], np.linspace(0.0, 0.1, 101), there_and_back, "spline")
    found = [one.start for one in analysis.stops(moves, 0.1) if one.at_rest]
    assert found == pytest.approx([0.0, 0.05, 0.1])


def test_a_short_run_says_that_its_figures_have_the_fall_of_the_journals():
    made = jp.Scenario.load("jointplay:slider_crank.toml").simulation("0.2 mm")
    result = replace(made, duration=0.004, start="centred", judge_from=0.0).run()
    assert "judged from the start, with the fall of the journals" in headline.summary(result)


def test_stops_are_where_the_reference_rests():
    motion = jp.Motion(["a"], [0, 1, 1.5, 2], [[0], [1], [1], [0.5]])
    found = analysis.stops(motion, 2.0)
    assert [stop.kind for stop in found] == ["stop", "dwell", "stop"]
    assert (found[1].start, found[1].end) == (1.0, 1.5)
    steady = jp.Motion(["a"], [0, 1, 2], [[0], [1], [2]], "constant-speed")
    assert {stop.kind for stop in analysis.stops(steady, 2.0)} == {"pass"}
    assert analysis.stops(motion, 3.0)[-1].end == 3.0  # it stays where it is


def test_deviation_is_the_difference_from_the_twin(pair):
    ideal, played = pair
    error = analysis.deviation(played)
    expected = played["tool_position"].values - ideal["tool_position"].values
    assert np.array_equal(error.values, expected)
    assert not analysis.difference(ideal, ideal).values.any()
    coarse = jp.simulate(
        ideal.simulation.mechanism, ideal.simulation.motion, duration=0.3, record_every=50
    )
    assert np.abs(analysis.difference(played, coarse).values - expected).max() < 1e-8
    other = jp.simulate(ideal.simulation.mechanism, ideal.simulation.motion, duration=0.1)
    assert len(analysis.deviation(analysis.measured_against(played, other))) == len(other.time)
    with pytest.raises(jp.JointplayError, match="has clearance in joint_b"):
        analysis.measured_against(ideal, played)


def test_deviation_of_the_orientation_is_the_rotation_between_the_two(pair):
    ideal, played = pair
    turn = Rotation.from_rotvec([3e-4, -2e-4, 1e-3])
    seen = Rotation.from_quat(ideal["tool_orientation"].values, scalar_first=True)
    turned = ideal.dataset.copy()
    turned["tool_orientation"] = ideal["tool_orientation"].copy(
        data=-(turn * seen).as_quat(scalar_first=True)  # either sign is the same orientation
    )
    error = analysis.difference(jp.Result(turned), ideal, "tool_orientation")
    assert np.abs(error.values - turn.as_rotvec()).max() < 1e-12
    assert (error.attrs["units"], error.dims) == ("rad", ("time", "axis"))
    # The error's rate is the difference of the angular velocities, as far as the errors are small.
    error = analysis.deviation(played, "tool_orientation")
    spins = analysis.deviation(played, "tool_angular_velocity")
    slope = np.gradient(error.values[:, 2], error["time"].values)
    settled = spins.values[:, 2].std()
    assert np.abs(slope - spins.values[:, 2])[1:-1].mean() < 0.02 * settled
    coarse = jp.simulate(
        ideal.simulation.mechanism, ideal.simulation.motion, duration=0.3, record_every=50
    )
    for of, limit in (("tool_orientation", 1e-8), ("tool_angular_velocity", 1e-4)):
        exact = analysis.deviation(played, of).values
        assert np.abs(analysis.difference(played, coarse, of).values - exact).max() < limit


def test_deviation_keeps_the_last_record_where_times_differ_in_a_last_bit(pair):
    ideal, played = pair
    early = jp.Result(ideal.dataset.assign_coords(time=ideal.time * (1.0 - 2e-16)))
    assert early.time[-1] < ideal.time[-1]
    error = analysis.difference(played, early)
    assert np.array_equal(error.values, analysis.deviation(played).values)


def test_contacts_are_those_that_the_run_counted(pair):
    played = pair[1]
    found = analysis.contacts(played)
    assert [place.contact for place in found] == ["radial_A", "radial_B", "axial_A", "axial_B"]
    # Records cannot tell contacts apart that follow each other within one.
    assert 0.8 * played.audit.impacts <= sum(len(p.peak) for p in found) <= played.audit.impacts
    largest = max(place.peak.max() for place in found if len(place.peak))
    assert largest == played["normal_force_peak"].values.max()


def test_shares_sum_to_one(pair):
    for of in ("mode", "form"):
        found = analysis.time_fractions(pair[1], "joint_b", of)
        assert sum(found.values()) == pytest.approx(1.0)
    assert found["none"] == pytest.approx((pair[1]["form"].values == 0).mean())
    with pytest.raises(jp.JointplayError, match="joint_b"):
        analysis.time_fractions(pair[1], "joint_a")


def test_spectrum_of_a_known_vibration(pair):
    """A speed A sin(2 pi f t) has an acceleration of the mean square (2 pi f A)^2 / 2, all at f."""
    f, size = 250.0, 0.01
    dataset = pair[1].dataset.copy(deep=True)
    dataset["tool_velocity"][:, 0] = size * np.sin(2 * np.pi * f * dataset["time"])
    dataset["tool_velocity"][:, 1:] = 0.0
    density = analysis.spectrum(jp.Result(dataset), segment=1024).sel(axis="x")
    assert abs(float(density["frequency"][density.argmax()]) - f) < 10.0
    assert float(density.integrate("frequency")) == pytest.approx(
        (2 * np.pi * f * size) ** 2 / 2, rel=0.02
    )


@pytest.mark.parametrize("start", [None, "centred"])
@pytest.mark.parametrize("how", ["servo, gear", "servo, bearing", "pulled"])
def test_a_run_and_its_ideal_twin_begin_in_the_same_way(how, start, urdf):
    """An arm that its servo, or a load on it, lets hang below where the reference begins."""
    path = urdf(body("arm", 1.0, "0.2 0 0"), joint("lift", "base", "arm", axis="0 1 0"))
    geared, play = how == "servo, gear", 1e-3
    gears = {"lift": jp.Gear(play=play, stiffness=2e4, rotor_inertia=0.01, damping=1.0)}
    bearing = {"lift": jp.RevoluteClearance(radial_clearance=1e-5, axial_clearance=1e-5)}
    servo = jp.loads.Servo(voltage=12.0, p_gain=20.0, torque_constant=2.0, resistance=2.0)
    simulation = jp.Simulation(
        jp.Mechanism(
            path, {} if geared else bearing, gears=gears if geared else {}, gravity=(0, 0, -9.81)
        ),
        jp.Motion(["lift"], [0.0, 0.02], [[0.0], [0.0]]),
        drive=jp.loads.ComputedTorque() if how == "pulled" else servo,
        loads={"pull": jp.loads.Wrench("arm", at=(0.4, 0, 0), force=(0, 0, -20))}
        if how == "pulled"
        else {},
        start=start,
    )
    result = simulation.run()
    for source in (result, simulation):
        twin = analysis.ideal_simulation(source).run()
        assert analysis.is_twin(result, twin)
        rests = [run.simulation.start == "rest" for run in (result, twin)]
        assert rests == [start is None] * 2
        place = twin["q"].values[0, 0]
        assert (abs(place) > 5.0 * play) == (start is None)
        tools = [run["tool_position"].values[0] for run in (result, twin)]
        assert np.linalg.norm(tools[0] - tools[1]) < play
        if start is None:
            assert np.abs(twin["q"].values - place).max() < 1e-6
    other = jp.simulate(
        simulation.mechanism.ideal(),
        simulation.motion,
        drive=simulation.drive,
        loads=simulation.loads,
        start=None if start else "centred",
    )
    assert not analysis.is_twin(result, other)


def test_an_ideal_machine_that_stands_where_it_begins_is_the_twin_of_either_start():
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {}, gravity=(0, 0, -9.81))
    made = scara(0.2e-3)
    ideal = jp.simulate(robot, made.motion, duration=0.01)
    assert ideal.simulation.start is None
    loose = jp.Mechanism(jp.shipped("scara.urdf"), made.mechanism.clearance, gravity=(0, 0, -9.81))
    for start in ("rest", "centred"):
        run = jp.simulate(loose, made.motion, duration=0.01, start=start)
        assert analysis.is_twin(run, ideal)


def test_orientations_that_are_none_are_refused():
    good = np.array([[1.0, 0.0, 0.0, 0.0]])
    assert tool_error.rotations(good).magnitude() == 0.0
    bad = np.concatenate([good, 0.0 * good])
    with pytest.raises(jp.JointplayError, match="record 2 has no orientation of the tool"):
        tool_error.rotations(bad)
    with pytest.raises(jp.JointplayError, match="record 2 has no orientation of the tool"):
        tool_error.turns_between(np.concatenate([good, good]), bad)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-9, 0.0])
def test_turns_are_those_of_scipy(size):
    known = size * Rotation.random(200, rng=1).as_rotvec()
    first = Rotation.random(200, rng=2)
    then = (Rotation.from_rotvec(known) * first).as_quat(scalar_first=True)
    then[::2] *= -1.0  # the same orientations
    turns = tool_error.turns_between(first.as_quat(scalar_first=True), then)
    assert np.abs(turns - known).max() <= 1e-15 * (1.0 + 2.0 * size)


def test_a_run_that_stopped_at_a_state_that_is_no_number_is_summed_up_to_there():
    result = replace(scara(2e-4), duration=0.01).run(estimate=False)
    before = headline.headline(result)
    result = jp.Result(result.dataset.drop_vars(COMPARED, errors="ignore"))
    for name in ("tool_position", "tool_velocity", "tool_orientation", "q", "v"):
        result.dataset[name][-1] = np.nan
    found = headline.headline(result)
    assert "nan" not in " ".join(found)
    assert len(found) == len(before)


def test_what_people_look_for_first_is_on_the_result(pair):
    ideal, loose = pair
    error = loose.tool_error
    off = analysis.deviation(loose)
    assert error.peak == pytest.approx(analysis.error_statistics(off).peak[-1])
    assert error.rms == pytest.approx(analysis.error_statistics(off).rms[-1])
    assert error.distance.sel(time=error.time_of_peak) == pytest.approx(error.peak)
    assert error.turn.attrs["units"] == "rad"
    assert str(error) == headline.headline(loose)[0]
    assert loose.summary().splitlines() == headline.headline(loose)
    assert float(loose.forces.max()) == pytest.approx(loose.audit.peak_force)
    assert loose.forces.dims == ("time", "joint")
    assert str(loose.rattle) in "\n".join(headline.headline(loose, detail=True))
    assert {"tool_error", "forces", "rattle", "summary"} <= set(dir(loose))
    with pytest.raises(jp.JointplayError, match="nothing has play: give --clearance"):
        ideal.tool_error  # noqa: B018


def test_numerical_errors_of_the_tools_error_are_those_of_the_certificate(pair):
    loose = jp.Result(pair[1].dataset.copy())
    loose.dataset.attrs.pop("certificate", None)
    assert loose.tool_error.numerical_errors == {}
    loose.certificate = jp.certify(loose, strict=False)
    known = loose.tool_error.numerical_errors
    assert set(known) == {"peak", "rms", "peak_turn", "rms_turn"}
    assert known["peak"] == loose.certificate["peak tool error"].error
