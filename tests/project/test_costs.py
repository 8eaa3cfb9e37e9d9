"""What an addition costs its user: one file each, in tests/additions, and it goes all the way.

Each is simulated, saved, loaded, run again from what the file says, and reported on.
"""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.base.schema import add, family_of
from jointplay.physics.contact.law import NormalForceLaw
from jointplay.physics.joints import Clearance
from jointplay.show import reports
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive
from jointplay.simulation.result import Result

sys.path.append(str(Path(__file__).parents[1]))
PLAY = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """What is added here is not there for other tests in this process."""
    families = [family_of(base) for base in (Load, Drive, Clearance, NormalForceLaw)]
    before = [dict(family.members) for family in families]
    yield
    for family, members in zip(families, before, strict=True):
        family.members.clear()
        family.members.update(members)


def addition(name):
    return importlib.import_module(f"additions.{name}")


ADDITIONS = {
    "law": lambda: {"bearing": jp.RevoluteClearance(normal=addition("law").HalfDamped(), **PLAY)},
    "spring": lambda: {"loads": {"own": addition("spring").CubicSpring("swing", 300.0)}},
    "recorded": lambda: {
        "loads": {"own": addition("recorded").Distance("arm", at=(0.3, 0.0, 0.4))}
    },
    "drive": lambda: {"loads": {"own": addition("drive").BRAKE}},
    "joint_kind": lambda: {"bearing": addition("joint_kind").ThreeSided(radial_clearance=1e-4)},
}


def swing(path, bearing=None, loads=None, duration=0.1):
    mechanism = jp.Mechanism(path, {} if bearing is None else {"swing": bearing})
    return jp.simulate(
        mechanism,
        duration=duration,
        state={"swing": 0.3},
        loads=loads or {},
        drive=jp.loads.Free(),
        joint_friction={},
    )


@pytest.fixture
def pendulum(urdf):
    return urdf(body("arm", 2.0, "0 0 -0.2"), joint("swing", "base", "arm", axis="0 1 0"))


@pytest.mark.parametrize("name", ADDITIONS)
def test_an_addition_is_one_file_and_goes_all_the_way(name, pendulum, tmp_path):
    result = swing(pendulum, **ADDITIONS[name]())
    assert result.status == jp.Status.COMPLETED
    assert result.audit.relative_energy_residual < 1e-3
    loaded = Result.load(result.save(tmp_path / "own.nc"))
    again = loaded.simulation.run()
    assert again.dataset.drop_attrs().identical(result.dataset.drop_attrs())
    reports.report({"own": loaded}, tmp_path / "report.html", pdf=False)
    said = (tmp_path / "report.html").read_text(encoding="utf-8")
    words = {"law": "half-damped", "joint_kind": "three-sided", "recorded": "distance"}
    assert words.get(name, "own") in said


def test_each_addition_acts(pendulum):
    """A spring pushes back, a brake takes energy, a law and a kind of joint are felt."""
    plain, played = swing(pendulum), swing(pendulum, jp.RevoluteClearance(**PLAY))
    sprung = swing(pendulum, **ADDITIONS["spring"]())
    assert sprung["load_energy"].values[0, 0] == pytest.approx(0.25 * 300.0 * 0.3**4)
    assert sprung["q"].values[-1, 0] < plain["q"].values[-1, 0]
    braked = swing(pendulum, **ADDITIONS["drive"]())
    assert braked["kinetic_energy"].values[-1] < plain["kinetic_energy"].values[-1]
    seen = (
        swing(pendulum, **ADDITIONS["recorded"]())["load_record"]
        .sel(load_part="own.distance")
        .values
    )
    assert seen == pytest.approx(np.full(len(seen), 0.5), abs=1e-12)
    for name in ("law", "joint_kind"):
        own = swing(pendulum, **ADDITIONS[name]())
        assert not np.array_equal(own["journal_centre"], played["journal_centre"])


def test_a_pin_rests_in_the_corner_of_its_three_sides(urdf):
    """Sides at 0 and 120 degrees: pushed along their bisector, both carry as much as the push."""
    bore = addition("joint_kind").ThreeSided(radial_clearance=1e-4)
    path = urdf(body("arm", 2.0), joint("swing", "base", "arm"))
    push = 9.81 * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3), 0.0])
    mechanism = jp.Mechanism(path, {"swing": bore}, gravity=tuple(push))
    result = jp.simulate(mechanism, duration=0.01, drive=jp.loads.Free(), start="rest")
    forces = result["normal_force"].values[-1].ravel()
    assert forces == pytest.approx([19.62, 19.62, 0.0], rel=1e-3)


def test_a_cause_of_error_of_ones_own_counts_in_budgets_and_allocations():
    """As large as the tolerance that it repeats, and it is paid for like all others."""
    arm = jp.Mechanism("example-robot-data:ur5", {})
    pose, flat = {"elbow_joint": 0.9}, addition("cause").Flatness(3e-4)
    known = jp.RobotErrors(axis_offset=0.0, axis_tilt=3e-4)
    found = jp.budget(arm, pose, causes=["geometry", flat], errors=known)
    worst = found.by("cause")
    assert worst["flatness"] == pytest.approx(worst["geometry"], rel=1e-9)
    assert "flatness" in str(found.table())
    target = 0.5 * float(found.worst[0])
    made = jp.allocate(
        arm, pose, target, causes=["geometry", flat], errors=known, prices={"flatness": 0.25}
    )
    assert made.error == pytest.approx(target, rel=1e-6)
    free = {(one.joint, one.cause): one.remaining for one in made.choices if one.held == "target"}
    pairs = [(x, free[joint, "geometry"]) for (joint, cause), x in free.items()
             if cause == "flatness" and (joint, "geometry") in free]  # fmt: skip
    assert len(pairs) >= 2
    for own, other in pairs:  # at a quarter of the price half of the size
        assert own == pytest.approx(0.5 * other, rel=1e-4)
    again = jp.budget(arm, pose, causes=["geometry", flat], errors=known, remaining=made.parts)
    assert again.worst[0] == pytest.approx(target, rel=1e-6)


def test_a_word_is_given_once():
    spring = addition("spring").CubicSpring
    add(Load, spring)
    other = type("Other", (spring,), {})
    with pytest.raises(jp.JointplayError, match="there is a load 'cubic-spring' already"):
        add(Load, other)
    with pytest.raises(jp.JointplayError, match="int cannot be added to Load"):
        add(Load, int)


def test_a_plan_and_a_measure_are_a_function_each(pendulum, tmp_path):
    measure, plan = addition("measure").longest_flight, addition("plan").one_at_a_time
    play = {"swing": jp.RevoluteClearance(**PLAY)}
    base = jp.Simulation(
        jp.Mechanism(pendulum, play), duration=0.02, drive=jp.loads.Free(), judge_from=0.0
    )
    cases = plan(base, 2.0, duration=0.02, step=1e-5)
    study = jp.Study(cases, jp.study.Measure(measure), jp.study.Memory())
    here = dict(study.outcomes(jobs=1))
    assert list(here) == ["base", "duration up", "duration down", "step up", "step down"]
    assert all(
        0.0 < value <= case.duration
        for value, case in zip(here.values(), cases.values(), strict=True)
    )
    assert jp.Study(cases, jp.study.Measure(measure)).run(jobs=2) == list(here.values())
    assert here["base"] == measure(base.run())
    # What the store has does not run again.
    assert dict(jp.Study(cases, pytest.fail, study.store).outcomes()) == {}


def test_a_kind_of_measurement_is_one_file():
    """Its intervals hold the truth, and it says what its measurement cannot tell."""
    from jointplay.estimate import solve

    own, truth, random = addition("frequencies"), (2e3, 0.3), np.random.default_rng(2)
    payloads = np.repeat([0.0, 1.0, 2.0, 4.0], 5)
    seen = own.frequency(*truth, payloads) + 0.02 * random.standard_normal(len(payloads))
    for one, value in zip(solve(own.measured("j", payloads, seen, 0.02)), truth, strict=True):
        assert one.known
        assert one.low < value < one.high
        assert one.half_width < 0.2 * value
    dark = solve(own.measured("j", np.zeros(20), own.frequency(*truth, 0.0) + 0 * seen, 0.02))
    assert [one.reason for one in dark] == [
        "it acts only together with j inertia",
        "it acts only together with j gear stiffness",
    ]
