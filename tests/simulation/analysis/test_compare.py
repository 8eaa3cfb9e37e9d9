"""Two results side by side."""

import math

import numpy as np
import pytest
from warm import call

import jointplay as jp
from jointplay import analysis
from jointplay.paper import scara
from jointplay.simulation.analysis import comparison


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("pair")
    for name, clearance in (("ideal", None), ("tight", 0.2e-3), ("loose", 0.5e-3)):
        made = scara(clearance)
        result = jp.simulate(made.mechanism, made.motion, duration=0.3, judge_from=0.0)
        result.save(path / f"{name}.nc")
    return path


def test_figures_inputs_and_tools_are_compared(folder):
    results = {name: jp.Result.load(folder / f"{name}.nc") for name in ("tight", "loose")}
    found = analysis.compare(results)
    pairs = {one.name: one for one in found.pairs}
    force = pairs["peak joint force"]
    for figure, result in zip((force.first, force.second), results.values(), strict=True):
        sizes = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
        assert figure.value == pytest.approx(sizes.max())
    assert pairs["peak tool error"].ratio > 1.5
    inputs = {place: (was, now) for place, was, now in found.inputs}
    assert inputs["mechanism.clearance.joint_b.radial_clearance"] == (0.2e-3, 0.5e-3)
    assert not any("motion" in place for place in inputs)
    tight, loose = results.values()
    away = np.linalg.norm(loose["tool_position"].values - tight["tool_position"].values, axis=1)
    rms = math.sqrt(np.trapezoid(away**2, tight.time) / tight.time[-1])
    assert found.apart == pytest.approx((away.max(), rms), rel=1e-6)
    aside = "against the ideal mechanism with the same drives, whose own errors they leave out:"
    assert f"\n\ntool errors are by play, {aside}\nfigure" in str(found)
    assert found.answer.startswith("peak tool error by play: ")
    assert f"the two tools are up to {1e3 * away.max():.4g} mm apart" in found.answer


def test_a_difference_within_the_numerical_errors_is_said_to_be(folder):
    figure = comparison.CertifiedFigure
    near = comparison.Pair("peak tool error", figure("", 1.0, 0.2, "m"), figure("", 1.3, 0.2, "m"))
    far = comparison.Pair("", near.first, figure("", 1.5, 0.2, "m"))
    unknown = comparison.Pair("", near.first, figure("", 1.5, math.inf, "m"))
    assert (near.beyond_errors, far.beyond_errors, unknown.beyond_errors) == (False, True, None)
    found = analysis.Comparison(("a", "b"), (), (near,), None)
    assert found.answer.endswith("1.3 times as much, no more than the numerical errors")


def test_causes_that_differ_are_named_with_their_results():
    figure = comparison.CertifiedFigure("peak tool error", 1.0, 0.2, "m")
    pair = comparison.Pair("peak tool error", figure, figure)
    causes = "play", "play and elasticity"
    found = analysis.Comparison(("a", "b"), (), (pair,), None, causes)
    assert "tool errors are by play in a and by play and elasticity in b, against" in str(found)


def test_the_command_prints_the_answer_first_and_draws(folder, tmp_path):
    out = tmp_path / "difference"
    done = call("compare", folder / "ideal.nc", folder / "loose.nc", "--quiet", "--out", out)
    assert done.returncode == 0, done.stderr
    first = done.stdout.splitlines()[0]
    assert first.startswith("the two tools are up to ")
    assert "mechanism.clearance" in done.stdout
    assert done.stdout.startswith((out / "comparison.txt").read_text())
    assert (out / "overview.png").stat().st_size > 5000


def test_what_cannot_be_compared_is_refused(folder, tmp_path):
    done = call("compare", folder, folder / "ideal.nc")
    assert done.returncode == 2
    assert "has 3 results; name one: ideal.nc, loose.nc, tight.nc" in done.stderr
    for one in ("ideal", "tight"):
        result = jp.Result.load(folder / f"{one}.nc")
        result.dataset.attrs["case"] = {"ideal": "ideal", "tight": "0.2 mm"}[one]
        result.save(tmp_path / f"{one}.nc")
    done = call("compare", tmp_path, folder / "ideal.nc")
    assert "has 2 results; name one: ideal.nc, tight.nc" in done.stderr
    done = call("compare", folder / "ideal.nc", folder / "ideal.nc")
    assert "twice: give two results" in done.stderr
    done = call("compare", folder / "ideal.nc", tmp_path / "no.nc")
    assert "no result file" in done.stderr


def test_a_result_is_as_large_as_its_copy(folder):
    result = jp.Result.load(folder / "tight.nc")
    assert "1 times as much" in str(analysis.compare({"tight": result, "same": result}))
