"""The multi-rate method against rk4 with smaller steps, and its velocity solve against scipy."""

from dataclasses import replace
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, gaps, joint, journal_axis
from physics.test_loops import RPM, slider_crank, turning
from scipy.optimize import root

import jointplay as jp
from jointplay.physics.contact import BrownMcPhee, Coulomb, LuGre
from jointplay.physics.kernel import Status

STEP = 1e-5


def scara(clearance, **options):
    """The shipped SCARA, its weight balanced, with clearance in joint B."""
    friction = options.pop("friction", jp.contact.Ambrosio(0.1))
    bearing = jp.RevoluteClearance(
        radial_clearance=clearance, axial_clearance=clearance, friction=friction
    )
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    return jp.simulate(robot, motion, **options)


def largest(a, b, name):
    """Largest distance between two runs of the vectors `name`."""
    return np.linalg.norm(a[name].values - b[name].values, axis=-1).max()


# Against rk4


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(0.2e-3, id="0.2 mm"),
        pytest.param(0.5e-3, id="0.5 mm", marks=pytest.mark.thorough),
    ],
)
def start_up(request):
    """Clearance, and the first 0.1 s by rk4 at 1 us: converged to 1 nm, eight contacts or more."""
    clearance = request.param
    finest = {"duration": 0.1, "seed": 0, "integrator": "rk4", "step": 1e-6, "record_every": 200}
    result = scara(clearance, **finest)
    assert result.audit.impacts >= 8
    return clearance, result


def test_scara_at_the_default_step_is_that_of_rk4_at_a_tenth_of_it(start_up):
    """Measured: journal 0.03 and 0.09 um, tool 0.04 and 0.14 um; of a clearance, 2e-4."""
    clearance, exact = start_up
    result = scara(clearance, duration=0.1, seed=0, record_every=20)
    assert result.simulation.integrator == "multi-rate"
    assert result.audit.impacts == exact.audit.impacts
    assert largest(result, exact, "journal_centre") < 4e-4 * clearance
    assert largest(result, exact, "tool_position") < 6e-4 * clearance


def test_short_macro_and_micro_steps_converge_to_rk4(start_up):
    clearance, exact = start_up
    result = scara(clearance, duration=0.1, seed=0, step=1e-6, macro_step=5e-5, record_every=200)
    assert largest(result, exact, "journal_centre") < 5e-5 * clearance


@pytest.mark.parametrize(
    ("clearance", "mu", "peak"), [(0.2e-3, 0.1, 477.0), (0.5e-3, 0.1, 776.0), (0.3e-3, 0.15, 677.0)]
)
def test_peak_joint_force_at_the_default_step_is_the_converged_one(clearance, mu, peak):
    """First 1.5 s of the shipped motion; the converged force is rk4's at 1 us."""
    result = scara(clearance, friction=jp.contact.Ambrosio(mu), duration=1.5)
    force = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1).max()
    assert force == pytest.approx(peak, rel=0.02)


def test_friction_that_falls_with_speed_is_solved_in_every_step():
    """Newton's steps overshoot where the coefficient falls; without shorter ones, 56 miss."""
    result = scara(0.5e-3, friction=jp.contact.BrownMcPhee(mu_d=0.1), duration=1.0)
    assert result.audit.unsolved == 0


def test_loop_cut_at_its_worn_joint_strikes_as_hard_as_by_rk4():
    """Slider-crank at 5000 rpm: first impact; the pose follows the predicted path."""
    found = []
    for integrator in ("rk4", "multi-rate"):
        worn = jp.RevoluteClearance.planar(radial_clearance=0.5e-3)
        result = turning(
            slider_crank(worn), 5000 * RPM, 1e-3, integrator=integrator, step=1e-6, record_every=1
        )
        force = result["normal_force"].values[:, 0, 0]
        start = np.flatnonzero(force > 0.0)[0]
        end = start + np.flatnonzero(force[start:] == 0.0)[0]
        found.append((result.time[start], force[start:end].max(), result.time[end]))
    (begin, force, end), multi = found
    assert force > 1e4
    assert multi[0] == pytest.approx(begin, abs=1.5e-6)
    assert multi[1] == pytest.approx(force, rel=1e-3)
    assert multi[2] == pytest.approx(end, abs=3e-6)


def shipped(name, **options):
    """A shipped scenario's mechanism with 0.2 mm."""
    simulation = jp.Scenario.load(f"jointplay:{name}.toml").simulation("0.2 mm")
    return replace(simulation, **options)


@pytest.mark.thorough
def test_four_bar_loses_what_finer_steps_find_wherever_its_journal_starts():
    """Its rebounds magnify errors: coarser macro steps add or drop impacts, and 2 % of the loss."""

    def loss(aside, **options):
        run = jp.Run(shipped("four_bar", duration=0.3, record_every=5000, **options))
        run.workspace.q[-1] += aside
        result = run.finish()
        lost = result["normal_dissipation"] + result["friction_dissipation"]
        return float(lost[-1])

    fine = loss(0.0, step=1e-6, macro_step=2e-5)
    for aside in np.linspace(-1e-8, 1e-8, 5):
        assert loss(aside) == pytest.approx(fine, rel=5e-3)


# Order


SWING = jp.Motion(["a", "b"], [0, 0.16, 0.32], [[0, 0], [1.0, -1.5], [0.3, 0.6]])


@pytest.fixture
def led(urdf):
    """Two links led along `SWING` by computed torque with PD, so softly that they lag."""
    path = urdf(
        body("one", 3.0, "0.15 0 0"),
        body("two", 2.0, "0.1 0.02 0"),
        joint("a", "base", "one", axis="0 1 0"),
        joint("b", "one", "two", axis="0 0.6 0.8", at="0.3 0 0"),
    )
    robot = jp.Mechanism(path)

    def run(step, **options):
        result = jp.simulate(
            robot, SWING, drive=jp.loads.ComputedTorque(bandwidth=60.0, damping_ratio=0.4),
            step=step, record_every=round(1.6e-4 / step),
            joint_friction={"a": jp.loads.JointFriction(0.0, 0.5)},
            **options,
        )  # fmt: skip
        return np.concatenate([result["q"].values, 1e-2 * result["v"].values], axis=1)

    return run


@pytest.mark.parametrize("micro_steps", [5, 20])
def test_order_with_pd_drives_and_viscous_friction_is_two(led, micro_steps):
    """Steps and macro steps halved together."""
    exact = led(5e-6, integrator="rk4")
    steps = np.array([8e-5, 4e-5, 2e-5, 1e-5])
    errors = [np.abs(led(step, macro_step=micro_steps * step) - exact).max() for step in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.1)


def test_chosen_macro_steps_are_no_longer_than_accuracy_bears(led):
    """An error estimate chooses them, whatever the step."""
    exact = led(5e-6, integrator="rk4")
    errors = [np.abs(led(step) - exact).max() for step in (8e-5, 1e-5)]
    assert max(errors) < 1e-5


def test_macro_steps_follow_inertia_through_impacts_of_a_fast_machine():
    """Measured: 8e-4; 0.05 where what velocities add to the acceleration stays after an impact."""
    shipped = jp.Scenario.load(jp.shipped("slider_crank.toml"))
    simulation = replace(
        shipped.simulation("0.2 mm", {"integration": {"start": "centred"}}),
        **{"step": 1e-6, "duration": 6e-4, "record_every": 10},
    )
    long, short = (replace(simulation, macro_step=span).run() for span in (2e-4, 2e-6))
    assert short.audit.impacts == 3
    assert largest(long, short, "journal_centre") < 4e-3 * 0.2e-3


# Friction with bristles


def test_damped_bristles_do_not_break_a_light_corner_out():
    """sigma1 = 600 s/m: the explicit methods blow up at this step, friction implicit does not."""
    law = LuGre(sigma1=600.0)
    result = scara(0.2e-3, friction=law, duration=0.3)
    assert result.status == Status.COMPLETED
    assert result.audit.relative_energy_residual < 1e-3
    with pytest.warns(RuntimeWarning, match="broke out"):
        scara(0.2e-3, friction=law, duration=0.3, integrator="semi-implicit-euler")


# The velocity solve


class Bearing:
    """Contacts of one body in a fixed bearing, written out once more: Lankarani-Nikravesh, Hertz.

    Args:
        bearing: the joint with clearance.
        mass: whose impacts damping at rest is referred to [kg].
    """

    def __init__(self, bearing, mass):
        self.bearing, self.friction, self.mass = bearing, bearing.friction, mass
        self.sizes = bearing.ri, bearing.li, bearing.rj, bearing.lj

    def push(self, q, v):
        """Generalised force of all contacts that touch, and how many do."""
        yaw, pitch = q[3:5]
        (cy, sy), (cp, sp) = ((np.cos(x), np.sin(x)) for x in (yaw, pitch))
        axes = np.array([[0, -sy, cy * cp], [0, cy, sy * cp], [1, 0, -sp]])
        omega = axes @ v[3:]
        gap, point, normal = gaps(q[:3], journal_axis(q[3:]), *self.sizes)
        total = np.zeros(6)
        touching = np.flatnonzero(gap < 0.0)
        for k in touching:
            stiffness, factor = self.bearing.normal.parameters(self.bearing.contact_properties(k))
            arm, n = point[k] - q[:3], normal[k]
            speed = v[:3] + np.cross(omega, arm)
            rate = -n @ speed
            slip = speed + rate * n
            sliding = np.linalg.norm(slip)
            elastic = stiffness * (-gap[k]) ** 1.5
            approach = max(abs(rate), np.sqrt(-0.8 * elastic * gap[k] / self.mass))
            load = max(elastic * (1.0 + factor * rate / approach), 0.0)
            mu = self.friction.function(sliding, *self.friction.parameters())
            force = load * (n - mu * slip / max(sliding, 1e-300))
            total[:3] += force
            total[3:] += axes.T @ np.cross(arm, force)
        return total, len(touching)


FRICTIONS = [
    jp.contact.Ambrosio(0.3, 0.0, 1e-3),
    jp.contact.Ambrosio(0.2),
    Coulomb(0.2),
    BrownMcPhee(),
]
POSES = {
    "one rim": [1.5e-4, 1.4e-4, 0.0, 0.3, 1e-3, 0.0],
    "both rims": [0.3e-4, 0.0, 0.0, 0.3, 2.5e-2, 1e-3],
    "rim and wall": [1.9e-4, 0.8e-4, 2.02e-4, 0.1, 1e-4, 2e-4],
}


@pytest.mark.parametrize("friction", FRICTIONS, ids=["ramp", "eq 21", "Coulomb", "falling"])
@pytest.mark.parametrize("pace", [1.0, 0.1, 0.01], ids=["sliding", "slow", "creeping"])
@pytest.mark.parametrize("pose", POSES)
def test_velocity_solve_finds_what_a_brute_force_solution_finds(free_mass, friction, pace, pose):
    """v = v_half + dt/2 (a_free + M^-1 tau_c(q, v)), tau_c written out here, solved by scipy."""
    random = np.random.default_rng(0)
    speed = pace * random.uniform(-1.0, 1.0, 6) * [5e-2, 5e-2, 2e-2, 1.0, 0.5, 0.5]
    run = free_mass(
        offset=POSES[pose], velocity=speed, com="0.02 0.03 0.04", friction=friction,
        restitution=0.9,
        step=STEP, gravity=(1.0, -2.0, -9.81), integrator="multi-rate", duration=10 * STEP,
    )  # fmt: skip
    run.begin()
    w, robot = run.workspace, run.mechanism
    half, q = w.half.copy(), w.q.copy()
    assert run.advance(1)
    model, data = robot.model, robot.data
    inverse = np.linalg.inv(pin.crba(model, data, q))
    free = -inverse @ pin.nle(model, data, q, speed)
    contact = Bearing(robot.clearance["pin"], float(w.joints["rest_mass"][0]))
    h = 0.5 * STEP
    scale = np.sqrt(np.diag(inverse))

    def lacking(x):
        v = scale * x
        return (v - half - h * (free + inverse @ contact.push(q, v)[0])) / scale

    starts = (half / scale, (half + h * free) / scale, speed / scale, np.zeros(6))
    tries = []
    for start, name in product(starts, ("hybr", "lm")):
        tries.append(root(lacking, start, method=name, tol=1e-13))
        best = min(tries, key=lambda one: np.abs(one.fun).max())
        if np.abs(best.fun).max() < 1e-9 * np.abs(best.x - half / scale).max():
            break
    found = run.workspace.recorded("v")[0] / scale
    push, touching = contact.push(q, scale * best.x)
    assert touching >= (1 if pose == "one rim" else 2)
    assert np.abs(push).max() > 10.0
    moved = np.abs(best.x - half / scale).max()
    assert np.abs(best.fun).max() < 1e-9 * moved
    assert np.abs(lacking(found)).max() < 1e-6 * moved
    if not isinstance(friction, BrownMcPhee):  # which falls with speed: several solutions
        assert np.abs(found - best.x).max() < 1e-5 * moved
