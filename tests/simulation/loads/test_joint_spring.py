"""Springs and stops at a joint, against closed forms."""

import numpy as np
import pytest
from machines import QUIET, rotor

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import Stop, TorsionSpring


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_disc_on_a_torsion_spring_swings_as_it_must(urdf, integrator):
    loads = {"s": TorsionSpring("a", 8.0, rest=0.2)}
    result = jp.simulate(
        rotor(urdf), duration=0.5, state={"a": 0.5}, loads=loads, integrator=integrator, **QUIET
    )
    exact = 0.2 + 0.3 * np.cos(20.0 * result.time)
    limit = 1e-4 if integrator == "semi-implicit-euler" else 1e-7
    assert result["q"].values[:, 0] == pytest.approx(exact, abs=limit)
    torque = result["load_record"].sel(load_part="s.torque").values
    assert torque == pytest.approx(-8.0 * (result["q"].values[:, 0] - 0.2), abs=1e-9)


def restitution(inertia, stiffness, damping):
    """Of a linear spring and damper that never pull: T. Schwager, T. Poeschel, Granular Matter 9
    (2007) 465-469, eq. 21 for small damping."""
    beta = damping / (2.0 * inertia)
    w = np.sqrt(stiffness / inertia - beta**2)
    return np.exp(-beta / w * (np.pi - np.arctan(2.0 * beta * w / (w**2 - beta**2))))


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
@pytest.mark.parametrize("damping", [0.0, 0.4, 1.5])
def test_a_disc_comes_back_from_its_stop_as_it_must(urdf, integrator, damping):
    inertia, stiffness = 0.02, 2000.0
    loads = {"stop": Stop("a", stiffness, damping, upper=0.1)}
    result = jp.simulate(
        rotor(urdf, inertia),
        duration=0.15,
        state={"a": (0.0, 2.0)},
        loads=loads,
        integrator=integrator,
        step=2e-6,
        record_every=50,
        **QUIET,
    )
    back = -float(result["v"][-1, 0]) / 2.0
    assert back == pytest.approx(restitution(inertia, stiffness, damping), rel=2e-4)
    assert result.audit.relative_energy_residual < 1e-4
    assert float(result["load_energy"].max()) > 0.01


def test_a_stop_never_pulls_and_stands_at_the_urdf_limits(urdf):
    stop = Stop("a", 500.0, 50.0)
    assert stop.ends(rotor(urdf)) == (-9.0, 9.0)
    loads = {"stop": Stop("a", 500.0, 50.0, lower=-0.1, upper=0.1)}
    speed = {"state": {"a": (0.0, 3.0)}}
    result = jp.simulate(rotor(urdf), duration=0.5, loads=loads, **speed, **QUIET)
    torque = result["load_record"].sel(load_part="stop.torque").values
    q = result["q"].values[:, 0]
    assert (torque[q > 0.0] <= 0.0).all()
    assert (torque[q < 0.0] >= 0.0).all()
    assert torque.min() < -5.0


def test_without_limits_a_stop_must_say_where(urdf):
    with pytest.raises(jp.JointplayError, match="needs lower or upper: the URDF gives no limits"):
        jp.simulate(
            rotor(urdf, kind="continuous"), duration=0.1, loads={"s": Stop("a", 1.0)}, **QUIET
        )
    with pytest.raises(jp.JointplayError, match="lower stop must be below the upper one"):
        Stop("a", 1.0, lower=0.2, upper=0.1)


def test_a_spring_acts_at_a_joint_with_clearance(urdf):
    """The yaw of its virtual link swings like the ideal joint's coordinate."""
    play = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    robot = rotor(urdf, clearance={"a": play})
    loads = {"s": TorsionSpring("a", 8.0)}
    result = jp.simulate(robot, duration=0.2, state={"a": 0.3}, loads=loads, **QUIET)
    yaw = result["q"].sel(coordinate="a.yaw").values
    assert yaw == pytest.approx(0.3 * np.cos(20.0 * result.time), abs=1e-6)
