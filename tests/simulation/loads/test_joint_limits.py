"""The URDF's limits: motions beyond them are refused, speeds and efforts reported or cut."""

import numpy as np
import pytest
from conftest import body

import jointplay as jp
from jointplay.simulation.loads import Controller

LIMITED = """
  <joint name="a" type="{kind}"><parent link="base"/><child link="disc"/>
    <axis xyz="0 0 1"/><limit {limits}/></joint>"""


def rotor(urdf, limits='lower="-1" upper="1" effort="0.5" velocity="4"', kind="revolute"):
    path = urdf(body("disc", 1.0, "0 0 0", 0.02), LIMITED.format(kind=kind, limits=limits))
    return jp.Mechanism(path, gravity=(0.0, 0.0, 0.0))


def swing(height, duration=1.0):
    return jp.Motion(["a"], [0.0, duration], [[0.0], [height]])


def push(time, q, v, p, out):
    out[0] = p[0]


def test_a_motion_beyond_a_position_limit_is_refused_unless_told_otherwise(urdf):
    robot = rotor(urdf)
    words = r"takes joint 'a' to 1.2 rad at t = 1 s, beyond its limits -1 to 1 rad"
    with pytest.raises(jp.JointplayError, match=words):
        jp.simulate(robot, swing(1.2))
    result = jp.simulate(robot, swing(1.2), limits="ignore")
    assert result.audit.warnings == []


def test_speeds_of_the_motion_are_reported_at_once_and_those_of_the_run_in_its_audit(urdf):
    with pytest.warns(RuntimeWarning, match=r"asks joint 'a' for a speed of .* rad/s at t = "):
        result = jp.simulate(rotor(urdf), swing(0.9, 0.3))
    speed, effort = result.audit.limit_warnings
    peak = np.abs(result["v"].values[:, 0]).max()
    assert f"joint 'a' had a speed of {peak:.4g} rad/s at t = 0.15" in speed
    assert "beyond its limit of 4 rad/s (first at 0.09" in speed
    assert "an effort of" in effort
    assert "beyond its limit of 0.5 N m" in effort
    assert set(result.audit.limit_warnings) <= set(result.audit.warnings)


@pytest.mark.filterwarnings("ignore:the motion asks")
@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_efforts_can_be_cut_to_their_limits(urdf, integrator):
    result = jp.simulate(rotor(urdf), swing(0.9, 0.3), limits="cut", integrator=integrator)
    effort = np.abs(result["drive"].values)
    assert effort.max() == 0.5
    assert (effort == 0.5).mean() > 0.2
    assert not any("effort" in text for text in result.audit.limit_warnings)
    assert result.audit.relative_energy_residual < 1e-5


def test_controllers_are_cut_too(urdf):
    loads = {"c": Controller(("a",), push, (3.0,))}
    options = {"drive": jp.loads.Free(), "duration": 0.02, "loads": loads}
    free = jp.simulate(rotor(urdf), **options)
    cut = jp.simulate(rotor(urdf), limits="cut", **options)
    assert float(free["v"][-1, 0]) == pytest.approx(3.0)
    assert float(cut["v"][-1, 0]) == pytest.approx(0.5)
    assert "effort of 3 N m" in free.audit.limit_warnings[0]
    assert cut.audit.limit_warnings == ()


def test_a_position_that_the_run_reaches_is_reported(urdf):
    result = jp.simulate(rotor(urdf), drive=jp.loads.Free(), duration=0.5, state={"a": (0.0, 3.0)})
    (text,) = result.audit.limit_warnings
    assert "joint 'a' was at 1.5 rad at t = 0.5 s, beyond its limits -1 to 1 rad" in text


@pytest.mark.parametrize(
    ("limits", "kind"),
    [
        ('lower="0" upper="0" effort="0" velocity="0"', "revolute"),
        ('effort="0" velocity="0"', "revolute"),
        ('lower="-1" upper="1" effort="0" velocity="0"', "continuous"),
    ],
)
def test_zeros_of_exporters_are_no_limits(urdf, limits, kind):
    result = jp.simulate(rotor(urdf, limits, kind), swing(1.5, 0.5))
    assert result.audit.limit_warnings == ()


def test_a_limit_that_is_no_number_and_a_word_unknown_are_refused(urdf):
    with pytest.raises(
        jp.JointplayError, match="joint 'a': limit effort must be a number, got 'strong'"
    ):
        rotor(urdf, 'effort="strong" velocity="1"')
    with pytest.raises(jp.JointplayError, match="available: report, cut, ignore"):
        jp.simulate(rotor(urdf), swing(0.5), limits="clip")
