"""Friction with bristles against independent integrations and closed forms.

A block of 2 kg lies in a guide under gravity, pressed on one wall by its weight, and is pulled
along by a spring whose other end moves at constant speed: the drive, with its feed-forward of zero.
"""

from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.physics.contact import BristleLaw, CustomBristle, Dahl, GonthierFriction, LuGre

MASS = 2.0
WEIGHT = MASS * 9.81


def pulled(urdf, friction, speed, bandwidth, duration, *, damping=0.0, **options):
    """Run the block pulled at `speed` [m/s] by a spring of stiffness bandwidth^2 m."""
    path = urdf(body("block", MASS), joint("guide", "base", "block", "prismatic"))
    play = jp.PrismaticClearance(clearance=1e-4, planar=True, lock_tilt=True, friction=friction)
    robot = jp.Mechanism(path, {"guide": play}, gravity=(-9.81, 0, 0))
    motion = jp.Motion(["guide"], [0, 1], [[0], [speed]], "constant-speed")
    drive = jp.loads.ComputedTorque(bandwidth, damping)
    return jp.simulate(robot, motion, drive=drive, duration=duration, **options)


STICKY = {"mu_d": 0.15, "mu_s": 0.3, "v_s": 2e-3, "sigma0": 2e4, "sigma1": 20.0, "sigma2": 0.0}


@pytest.mark.parametrize(
    ("law", "mu"),
    [
        (Dahl(mu_d=0.2), 0.2),
        (LuGre(mu_d=0.2, mu_s=0.3, sigma2=0.4), 0.2 + 0.4 * 0.1),
        (GonthierFriction(mu_d=0.2, mu_s=0.3, sigma2=0.4), 0.2 + 0.4 * 0.1),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_steady_sliding_rubs_with_the_dynamic_coefficient(urdf, law, mu):
    result = pulled(urdf, law, 0.1, 200.0, 0.3, damping=1.0)
    last = result["friction_force"].values[-1].max()
    assert last == pytest.approx(mu * WEIGHT, rel=1e-3)


@pytest.mark.parametrize("law", [Dahl(), LuGre(), GonthierFriction()], ids=lambda law: law.name)
def test_a_block_that_sticks_bends_the_bristles_by_force_over_stiffness(urdf, law):
    """Pulled by less than friction can hold, it moves by F / (sigma0 F_n) and comes back."""
    path = urdf(body("block", MASS), joint("guide", "base", "block", "prismatic"))
    play = jp.PrismaticClearance(clearance=1e-4, planar=True, lock_tilt=True, friction=law)
    robot = jp.Mechanism(path, {"guide": play}, gravity=(-9.81, 0, 0))
    pull = 0.3 * law.mu_d * WEIGHT
    torque = jp.loads.Torque((0.0, 0.1, 0.3, 0.6, 0.8), (0.0, 0.0, pull, pull, 0.0))
    result = jp.simulate(robot, drive={"guide": torque}, duration=1.1, record_every=100)
    z = result["q"].sel(coordinate="guide.z").values
    held = np.interp([0.55, 1.05], result.time, z - z[0])
    stiffness = law.sigma0 * WEIGHT
    if isinstance(law, Dahl):  # bends, and slips a little: z of Dahl's curve, v dt = dz/(1 - F/F_c)
        assert held[0] == pytest.approx(-law.mu_d / law.sigma0 * np.log(1 - 0.3), rel=0.1)
    else:
        assert held[0] == pytest.approx(pull / stiffness, rel=0.5)
    assert abs(held[1]) < 0.6 * held[0]


def test_static_friction_grows_with_the_time_at_rest(urdf):
    """Gonthier et al.: the longer the block has stuck, the harder it is to pull loose."""
    law = GonthierFriction(mu_d=0.1, mu_s=0.3, dwell_time=0.5)
    peaks = []
    for bandwidth in (40.0, 8.0):  # a softer spring takes longer to pull it loose
        result = pulled(urdf, law, 0.05, bandwidth, 3.0, step=2e-5)
        landed = result["friction_force"].sel(time=slice(0.5, None))
        peaks.append(landed.max().item() / WEIGHT)
    assert 0.1 < peaks[0] < peaks[1] <= 0.3 * 1.001


def creep(speed, normal, dwell, p, out):
    """A user's own: Dahl's law, written out."""
    out[0], out[1], out[2] = 1.0, p[1] * speed / p[0], p[1] * normal
    out[3], out[4], out[5] = 0.0, 0.0, 1e300
    out[6], out[7] = 0.0, 0.0


def broken(speed, normal, dwell, p, out):
    """A law that returns nonsense."""
    for i in range(8):
        out[i] = 0.0 / (speed - speed)


def test_a_users_own_bristles_are_the_built_in_ones(urdf):
    own = CustomBristle(creep, (0.1, 1e5))
    assert isinstance(own, BristleLaw)
    found = [pulled(urdf, law, 0.05, 20.0, 0.2) for law in (own, Dahl(0.1, 1e5))]
    assert found[0]["q"].equals(found[1]["q"])
    again = found[0].simulation
    assert again.mechanism.clearance["guide"].friction.parameters() == (0.1, 1e5)


def test_broken_bristles_stop_the_run(urdf):
    with pytest.warns(RuntimeWarning, match="non-finite"):
        result = pulled(urdf, CustomBristle(broken), 0.05, 20.0, 0.2)
    assert result.status.name == "BAD_FORCE"


def test_wrong_bristles_are_refused():
    with pytest.raises(jp.JointplayError, match="dwell"):
        CustomBristle(lambda speed, p: 0.0)
    for law in (LuGre, GonthierFriction):
        with pytest.raises(jp.JointplayError, match="mu_s"):
            law(mu_d=0.2, mu_s=0.1)
    with pytest.raises(jp.JointplayError, match="sigma0"):
        Dahl(sigma0=0.0)


def lost(law, speeds, step):
    """Least energy that a LuGre contact has taken in up to any time, at unit normal force [J/N]."""
    z = work = least = 0.0
    for v in speeds:
        g = law.mu_d + (law.mu_s - law.mu_d) * np.exp(-((v / law.v_s) ** 2))
        dz = v - law.sigma0 * abs(v) / g * z
        work += step * v * (law.sigma0 * z + law.sigma1 * dz + law.sigma2 * v)
        z += step * dz
        least = min(least, work)
    return least


def test_lugre_feeds_energy_unless_it_is_passive():
    """Bent at rest, then torn off at 100 v_s and turned back before they have let go."""
    step = 1e-8
    creep = np.full(20000, 2e-3)
    fast = 1.0
    loose = LuGre(mu_d=0.1, mu_s=0.3, v_s=1e-2, sigma0=1e5, sigma1=10.0, sigma2=0.0)
    tight = LuGre(mu_d=0.1, mu_s=0.3, v_s=1e-2, sigma0=1e5, sigma1=10.0, sigma2=20.0)
    assert not loose.passive
    assert tight.passive
    assert not LuGre().passive
    bent = 0.3 / 1e5
    for law, feeds in ((loose, True), (tight, False)):
        # Power from a fully bent bristle at high speed, less what the bristle itself gives up.
        g = law.mu_d
        dz = fast - law.sigma0 * fast / g * bent
        power = fast * (law.sigma0 * bent + law.sigma1 * dz + law.sigma2 * fast)
        stored = law.sigma0 * bent * dz
        assert (power - stored < 0.0) == feeds
    rng = np.random.default_rng(3)
    speeds = np.concatenate([creep, np.repeat(rng.uniform(-0.3, 0.3, 300), 100)])
    assert lost(tight, speeds, step) > -1e-12


# Order of convergence

LAWS = [GonthierFriction(), Dahl(), LuGre()]


def order(steps, errors):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_pin_that_sticks_from_the_start_is_followed_in_second_order(law):
    """The four-bar's pin begins without sliding: coupler and rocker turn alike.

    Bent with velocities of half a step before, bristles left errors of 2e-5 rad, which fell with
    the half or the first power of the step.
    """
    crank = jp.Scenario.load("jointplay:four_bar.toml").simulation("0.2 mm")
    pin = replace(crank.mechanism.clearance["rocker_end"], friction=law)
    crank = replace(crank, mechanism=crank.mechanism.with_clearance({"rocker_end": pin}))

    def run(step, **options):
        records = round(2e-4 / step)
        options |= {"duration": 2.4e-2, "step": step, "record_every": records}
        return replace(crank, **options).run()["q"].values

    exact = run(1e-6, integrator="rk4")
    steps = np.array([1e-5, 5e-6, 2.5e-6])
    errors = [np.abs(run(step, macro_step=5 * step) - exact).max() for step in steps]
    assert order(steps, errors) == pytest.approx(2.0, abs=0.2)
    assert errors[0] < 2e-7


@pytest.fixture
def struck(free_mass):
    """The states (n, 12) of a spinning journal that strikes its bearing several times."""

    def states(law, step, **options):
        run = free_mass(
            offset=(0.9e-4, 0.3e-4, 0, 0, 0, 0), velocity=(5e-2, 1e-2, 0, 0, 0, 4.0), friction=law,
            restitution=0.7, duration=12.8e-3, step=step, record_every=round(1.6e-4 / step),
            **options,
        )  # fmt: skip
        result = run.finish()
        assert result.audit.impacts > 5
        return np.concatenate([result["q"].values, 1e-3 * result["v"].values], axis=1)

    return states


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_bristles_bend_from_the_onset_of_an_impact_on(struck, law):
    """Not for all of the step in which it begins, which left first order, and with a tolerance an
    error that no tolerance brought down."""
    exact = struck(law, 1e-6, integrator="rk4")
    steps = np.array([1e-5, 4e-6, 2e-6])
    errors = [np.abs(struck(law, step) - exact).max() for step in steps]
    assert order(steps, errors) == pytest.approx(2.0, abs=0.3)
    assert errors[-1] < 2e-6
    assert np.abs(struck(law, 1e-5, tolerance=2e-5) - exact).max() < 4e-6


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_rk4_follows_bristles_in_second_order(struck, law):
    """Smaller steps of the other method are the reference."""
    exact = struck(law, 2.5e-7)
    steps = np.array([1.6e-5, 8e-6, 4e-6, 2e-6])
    errors = [np.abs(struck(law, step, integrator="rk4") - exact).max() for step in steps]
    assert order(steps, errors) > 1.7
    assert errors[-1] < 1e-6


@pytest.mark.parametrize("method", ["multi-rate", "semi-implicit-euler"])
def test_bristles_of_a_journal_that_slides_from_the_start_are_bent_already(method):
    """Straight bristles at full speed would push by a hundred times the friction for a microsecond.

    The peak then depended on the step: 3 kN at 1 us, 33 kN at 0.1 us.
    """
    crank = jp.Scenario.load("jointplay:slider_crank.toml").simulation("0.1 mm")
    pin = replace(crank.mechanism.clearance["piston_pin"], friction=jp.contact.LuGre(0.04, 0.05))
    crank = replace(crank, mechanism=crank.mechanism.with_clearance({"piston_pin": pin}))
    result = replace(
        crank, integrator=method, duration=2e-5, step=1e-7, record_every=1, start="rest"
    ).run()
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
    assert force.max() < 1.1 * result.audit.start_load
