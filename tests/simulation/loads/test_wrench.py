"""Given wrenches: known motions, works and reactions."""

import numpy as np
import pytest
from machines import QUIET, rotor, slider

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import Wrench, WrenchFunction, WrenchOverTime


def drag(time, pose, twist, p, out):
    for k in range(6):
        out[k] = 0.0
    for k in range(3):
        out[k] = -p[0] * twist[k]


def wrong(time, pose, twist, p, out):
    for k in range(6):
        out[k] = 0.0
    out[0] = 1.0 / (0.01 - time) if time < 0.005 else np.nan


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_constant_force_makes_a_parabola_and_its_work(urdf, integrator):
    loads = {"push": Wrench("cart", force=(3.0, 5.0, 0.0))}
    result = jp.simulate(slider(urdf), duration=0.2, loads=loads, integrator=integrator, **QUIET)
    exact = 0.5 * 1.5 * result.time**2
    assert result["q"].values[:, 0] == pytest.approx(exact, abs=2e-6)
    work = result["load_work"].sel(load="push").values
    assert work == pytest.approx(3.0 * result["q"].values[:, 0], abs=1e-5)
    assert result.audit.relative_energy_residual < 1e-4


def test_the_guide_takes_what_the_slider_cannot(urdf):
    loads = {"push": Wrench("cart", force=(3.0, 5.0, -2.0))}
    result = jp.simulate(slider(urdf), duration=0.01, loads=loads, **QUIET)
    reaction = result["reaction_force"].sel(moving_joint="x").values
    assert reaction == pytest.approx(np.tile([0.0, -5.0, 2.0], (len(reaction), 1)), abs=1e-9)


def test_a_tangential_force_that_turns_with_the_disc_is_a_constant_moment(urdf):
    turning = {"push": Wrench("disc", force=(0.0, 2.0, 0.0), at=(0.1, 0, 0), axes="frame")}
    moment = {"push": Wrench("disc", moment=(0.0, 0.0, 0.2))}
    for loads in (turning, moment):
        result = jp.simulate(rotor(urdf), duration=0.3, loads=loads, **QUIET)
        assert result["q"].values[:, 0] == pytest.approx(0.5 * 10.0 * result.time**2, abs=1e-7)


def test_a_force_over_time_is_linear_between_its_points(urdf):
    loads = {"push": WrenchOverTime("cart", (0.1, 0.3), ((0.0, 0, 0), (8.0, 0, 0)))}
    result = jp.simulate(slider(urdf), duration=0.4, loads=loads, **QUIET)
    force = result["load_record"].sel(load_part="push.fx").values
    assert force == pytest.approx(np.interp(result.time, [0.1, 0.3], [0.0, 8.0]), abs=1e-9)
    assert float(result["v"][-1, 0]) == pytest.approx((0.8 + 0.8) / 2.0, rel=1e-6)


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_a_users_function_acts_like_a_law(urdf, integrator):
    loads = {"drag": WrenchFunction("cart", drag, (4.0,))}
    result = jp.simulate(
        slider(urdf),
        duration=0.5,
        loads=loads,
        state={"x": (0.0, 1.0)},
        integrator=integrator,
        **QUIET,
    )
    assert result["v"].values[:, 0] == pytest.approx(np.exp(-2.0 * result.time), abs=1e-8)
    assert result.audit.relative_energy_residual < 1e-8


def test_a_function_that_fails_stops_the_run_and_is_named(urdf):
    loads = {"bad": WrenchFunction("cart", wrong)}
    with pytest.warns(RuntimeWarning, match="load 'bad' gave a non-finite value"):
        result = jp.simulate(slider(urdf), duration=0.02, loads=loads, **QUIET)
    assert result.status.name == "BAD_LOAD"


def test_a_users_function_is_named_in_files_and_not_run_unasked(urdf, tmp_path, monkeypatch):
    module = tmp_path / "my_wrench_of_tests.py"
    module.write_text(
        "def pull(time, pose, twist, p, out):\n    for k in range(6):\n        out[k] = p[0]\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    import my_wrench_of_tests

    from jointplay.physics.contact import functions

    loads = {"pull": WrenchFunction("cart", my_wrench_of_tests.pull, (1.0,))}
    result = jp.simulate(slider(urdf), duration=0.01, loads=loads, **QUIET)
    result.save(tmp_path / "run.nc")
    monkeypatch.setattr(functions, "_known", {})
    shown = jp.Result.load(tmp_path / "run.nc").simulation
    assert shown.loads["pull"].function.source.startswith("def pull(time, pose")
    assert shown.loads["pull"].describe() == loads["pull"].describe()
    with pytest.raises(
        jp.JointplayError,
        match="my_wrench_of_tests:pull' is code of a module that was not imported",
    ):
        shown.run()
    jp.import_module("my_wrench_of_tests")
    again = jp.Result.load(tmp_path / "run.nc").simulation.run()
    assert np.array_equal(again["q"].values, result["q"].values)


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (
            lambda: Wrench("cart", axes="tool"),
            "no axes for a wrench 'tool'; available: world, frame",
        ),
        (lambda: WrenchOverTime("cart", (0.0, 1.0), ((1, 2, 3),)), "2 times but 1 forces"),
        (lambda: WrenchOverTime("cart", (0.0,)), "needs times, and forces or moments"),
        (lambda: WrenchFunction("cart", lambda t: t), r"must take \(time, pose, twist, p, out\)"),
    ],
)
def test_impossible_wrenches_are_refused(load, words):
    with pytest.raises(jp.JointplayError, match=words):
        load()
