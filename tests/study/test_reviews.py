"""Reviews of a run: other steps, other contact laws, other starts."""

import dataclasses

import numpy as np
import pytest

import jointplay as jp
from jointplay.cli import main
from jointplay.cli.commands.init import LINKAGES
from jointplay.scenario import Scenario
from jointplay.study import reviews

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def simulation():
    return dataclasses.replace(Scenario.load(LINKAGES["slider-crank"]).simulation(), duration=0.08)


def test_a_run_of_equal_steps_converges_and_states_its_error(simulation):
    fixed = dataclasses.replace(simulation, tolerance=None, step=2e-6, record_every=10)
    found = reviews.convergence(fixed, jobs=1)
    assert found.of == "step"
    assert found.chosen in found.sizes
    error = found.distance("RMS tool error")
    assert error[-1] < 0.5 * error[0]
    assert found.order("RMS tool error") > 0.2
    at = found.sizes.index(found.chosen)
    away = abs(found.values["RMS tool error"][at] - found.truth["RMS tool error"])
    assert away <= found.stated["RMS tool error"]
    assert "within the stated error" in str(found)
    assert "stated error" in str(found.table)
    heads, *rows = str(found.table).splitlines()
    assert heads.startswith("step [µs]")
    assert float(rows[-2].split()[0]) == pytest.approx(1e6 * found.finest, rel=1e-3)


def test_laws_differ_by_what_they_dissipate(simulation):
    names = ["hertz", "lankarani-nikravesh", "flores"]
    bouncy = simulation.mechanism.clearance["B"]
    soft = simulation.mechanism.with_clearance({"B": dataclasses.replace(bouncy, restitution=0.5)})
    found = reviews.laws(dataclasses.replace(simulation, mechanism=soft), names, jobs=1)
    assert list(found.figures) == names
    force = {law: found.figures[law]["peak joint force"][0] for law in names}
    assert force["hertz"] > force["flores"]  # Hertz loses no energy, and goes on bouncing
    for law, (time, size) in found.curves.items():
        assert size.max() <= force[law] * (1.0 + 1e-9)
        assert len(time) == len(size)


def test_laws_that_cannot_be_are_refused(simulation):
    with pytest.raises(jp.JointplayError, match="no normal-force law 'florez'; did you mean"):
        reviews.laws(simulation, ["hertz", "florez"])
    with pytest.raises(jp.JointplayError, match="two laws or more"):
        reviews.laws(simulation, ["hertz"])
    with pytest.raises(jp.JointplayError, match="'kelvin-voigt' has parameters"):
        reviews.laws(simulation, ["hertz", "kelvin-voigt"])


def test_perturbed_starts_have_the_spread_of_their_runs(simulation):
    found = reviews.spread(simulation, 4, jobs=1)
    runs = [dataclasses.replace(simulation, seed=seed).run(estimate=False) for seed in range(4)]
    forces = [float(np.linalg.norm(run["joint_force_peak"], axis=-1).max()) for run in runs]
    judged = found.figures["peak joint force"]
    assert (judged <= np.array(forces) * (1.0 + 1e-9)).all()
    assert np.ptp(judged) > 0.0
    judged = np.isin(runs[1].time, found.times)
    own = runs[1].tool_error.distance.values[judged]
    np.testing.assert_allclose(found.curves["tool error"][1], own)


@pytest.mark.usefixtures("checked_figures")
def test_run_draws_each_for_print(tmp_path, monkeypatch, capsys):
    path = tmp_path / "crank.toml"
    text = LINKAGES["slider-crank"].read_text(encoding="utf-8")
    path.write_text(text.replace('"0.2 s"', '"0.04 s"'), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    order = ["run", "crank.toml", "--out", "out", "--no-figures", "--no-error-estimate"]
    assert main([*order, "--converge", "--laws", "hertz,flores", "--ensemble", "3"]) == 0
    for name in ("converge", "laws", "ensemble"):
        picture = (tmp_path / "out" / f"crank_{name}.pdf").read_bytes()
        assert picture.startswith(b"%PDF")
        assert b"/FontFile" in picture or b"TrueType" in picture
    assert "3 perturbed starts" in capsys.readouterr().out
