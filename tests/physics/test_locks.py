"""Joints that close loops and lock what nothing else in the loop holds."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.loop import SHARE, Loop, misfit

LENGTH, REACH = 0.1, 0.3
SLIDER = jp.PrismaticClearance(clearance=2e-4, clearance_y=3e-4, lock_tilt=True)
START = {"crank": 0.5}
CRANK = (
    body("crank", 1.0, "0 0 0.05", 1e-3),
    joint("crank", "base", "crank", axis="0 1 0"),
    body("rod", 1.0, "0 0 0.15", 1e-3),
    joint("rod", "crank", "rod", axis="0 1 0", at=f"0 0 {LENGTH}"),
    body("block", 0.5, "0.01 0 0.01", 1e-3),
)
FREE = {"record_every": 50, "drive": {}, "start": "centred"}


def cut_at_the_slider(urdf, **fields):
    path = urdf(*CRANK, joint("wrist", "rod", "block", axis="0 1 0", at=f"0 0 {REACH}"))
    given = {"bearing_link": "base", "journal_link": "block", "bearing_xyz": (0, 0, 0.4)} | fields
    return jp.Mechanism(path, {"slide": SLIDER}, loops={"slide": Loop(**given)}, tool="block")


def cut_at_the_pin(urdf):
    path = urdf(*CRANK, joint("slide", "base", "block", kind="prismatic", at="0 0 0.4"))
    turned = (-np.pi / 2, 0.0, 0.0)
    pin = Loop("rod", "block", (0, 0, REACH), turned, journal_rpy=turned)
    return jp.Mechanism(path, {"slide": SLIDER}, loops={"wrist": pin}, tool="block")


def thrown(mechanism, **options):
    state = START | {"crank": (START.get("crank"), 5.0)}
    options = {"state": state, "duration": 0.05} | FREE | options
    return jp.simulate(mechanism, **options)


def pushed(speeds):
    """A state of speeds alone."""
    return {name: (None, speed) for name, speed in speeds.items()}


def apart(one, other, name="tool_position"):
    return float(np.abs(one[name].values - other[name].values).max())


@pytest.mark.thorough
def test_a_slider_that_closes_a_loop_is_the_one_in_the_tree(urdf):
    options = {"integrator": "rk4", "step": 5e-6, "duration": 0.1}
    loop = thrown(cut_at_the_slider(urdf), **options)
    tree = thrown(cut_at_the_pin(urdf), **options)
    assert loop.audit.impacts == tree.audit.impacts >= 3
    assert apart(loop, tree) < 1e-9
    assert apart(loop, tree, "joint_force") < 1e-3
    assert float(loop["tilt"].max()) < 1e-12
    assert loop.audit.warnings == []
    assert list(loop["loop_drift"]["loop"].values) == ["slide (lock)"]


@pytest.mark.parametrize(
    "macro_step", [None, *(pytest.param(step, marks=pytest.mark.thorough) for step in (5e-6, 2e-5))]
)
def test_by_the_multi_rate_method_too(macro_step, urdf):
    """Contact beside constraints, at every length of macro step."""
    options = {"step": 5e-6, "macro_step": macro_step}
    loop = thrown(cut_at_the_slider(urdf), **options)
    tree = thrown(cut_at_the_pin(urdf), **options)
    exact = thrown(cut_at_the_slider(urdf), integrator="rk4", step=5e-6)
    for result in (loop, tree):
        assert result.audit.warnings == []
        assert result.audit.relative_energy_residual < 3e-5
        assert apart(result, exact) < 1e-6


def gantry(urdf, turns, clearance, loop=None, slides="xyz", **fields):
    """A block on crossed slides, with wrist joints about `turns`; the rest is fixed."""
    parts = []
    for name, parent, axis in (("x", "base", "1 0 0"), ("y", "x", "0 1 0"), ("z", "y", "0 0 1")):
        kind = "prismatic" if name in slides else "fixed"
        parts += [body(name, 0.3), joint(f"along_{name}", parent, name, kind, axis)]
    parent = "z"
    for k, axis in enumerate(("0 0 1", "0 1 0", "1 0 0")):
        name = "block" if k == 2 else f"wrist{k}"
        kind = "revolute" if axis in turns else "fixed"
        parts += [body(name, 0.4, "0.02 0.01 0.03"), joint(f"turn{k}", parent, name, kind, axis)]
        parent = name
    given = loop or {"bearing_link": "base", "journal_link": "block"}
    return jp.Mechanism(
        urdf(*parts), {"end": clearance}, loops={"end": Loop(**given)}, tool="block", **fields
    )


ALL = ("0 0 1", "0 1 0", "1 0 0")
REVOLUTE = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
PUSHED = {"along_x": 0.06, "along_y": -0.1, "along_z": 0.04}


@pytest.mark.parametrize(
    ("clearance", "slides", "turns"),
    [
        (SLIDER, "xyz", ()),
        (replace(SLIDER, exchanged=True), "xyz", ()),
        (jp.RevoluteClearance(**REVOLUTE, lock_tilt=True), "xyz", ("0 0 1",)),
        (jp.RevoluteClearance(**REVOLUTE, lock_tilt=True, exchanged=True), "xyz", ("0 0 1",)),
        (jp.RevoluteClearance.planar(radial_clearance=2e-4), "xy", ("0 0 1",)),
    ],
)
def test_locked_joints_of_an_arm_are_as_if_they_were_not_there(clearance, slides, turns, urdf):
    speeds = {name: speed for name, speed in PUSHED.items() if name[-1] in slides}
    if turns:
        speeds["turn0"] = 3.0
    options = {"integrator": "rk4", "step": 1e-5, "duration": 0.03, "state": pushed(speeds), **FREE}
    held = jp.simulate(gantry(urdf, ALL, clearance), **options)
    alone = jp.simulate(gantry(urdf, turns, clearance, slides=slides), **options)
    assert held.simulation.mechanism.locks
    assert not alone.simulation.mechanism.locks
    assert held.audit.impacts == alone.audit.impacts > 0
    assert apart(held, alone) < 1e-9
    assert float(held["tilt"].max()) < 1e-9


def test_momentum_and_energy_survive_a_frictionless_lock_in_flight(urdf):
    """No contact, no gravity: what flies with a lock keeps its momentum along all three axes."""
    wide = jp.PrismaticClearance(clearance=5e-3, lock_tilt=True)
    mechanism = gantry(urdf, ALL, wide, gravity=(0, 0, 0))
    result = jp.simulate(mechanism, duration=0.02, integrator="rk4", state=pushed(PUSHED), **FREE)
    speed = result["tool_velocity"].values
    assert np.abs(speed - [0.06, -0.1, 0.04]).max() < 1e-9
    assert result.audit.relative_energy_residual < 1e-9


def test_a_carriage_takes_inertia_and_adds_none(urdf):
    with_lock, without = (gantry(urdf, turns, SLIDER).model for turns in (ALL, ()))
    mass = [sum(body.mass for body in model.inertias) for model in (with_lock, without)]
    assert mass[0] == pytest.approx(mass[1], rel=1e-12)
    carriage = with_lock.inertias[with_lock.getJointId("end")]
    assert carriage.mass == pytest.approx(SHARE * 0.4)


def test_a_journal_on_the_ground_carries_the_carriage(urdf):
    """Bearing and journal change roles: without tilt, walls and faces are alike."""
    swapped = {"bearing_link": "block", "journal_link": "base"}
    options = {"integrator": "rk4", "step": 1e-5, "duration": 0.03, "state": pushed(PUSHED), **FREE}
    results = [jp.simulate(gantry(urdf, ALL, SLIDER, loop), **options) for loop in (None, swapped)]
    assert results[0].audit.impacts == results[1].audit.impacts > 0
    assert apart(*results) < 1e-9
    axial = jp.RevoluteClearance(**REVOLUTE, lock_axial=True)
    with pytest.raises(jp.JointplayError, match="exchange bearing_link and journal_link"):
        gantry(urdf, ALL, axial, swapped)


def test_a_block_that_starts_askew_is_put_straight(urdf):
    mechanism = cut_at_the_slider(urdf)
    run = jp.Run(jp.Simulation(mechanism, state={"crank": 0.7}, duration=1e-3, drive={}))
    q = run.workspace.q
    assert max(np.abs(part).max() for part in misfit(mechanism, q).values()) < 1e-9
    turns = sum(q[mechanism.coordinate(name)] for name in ("crank", "rod", "wrist"))
    assert abs(turns) < 1e-9
    with pytest.raises(jp.JointplayError, match="moving joint 'slide'"):
        mechanism.coordinate("slide")


def test_what_a_mechanism_holds_itself_needs_no_lock(urdf):
    assert gantry(urdf, (), SLIDER).locks == {}
    planar = jp.RevoluteClearance.planar(radial_clearance=1e-4)
    crank = jp.Mechanism(
        jp.shipped("slider_crank.urdf"),
        {"pin": planar},
        loops={"pin": Loop("rod", "slider", (0.12, 0, 0))},
    )
    assert crank.locks == {}


def test_a_payload_taken_by_a_locked_link_does_not_turn_it(urdf):
    mechanism = cut_at_the_slider(urdf)
    load = jp.Payload("block", 0.4, pick=0.01, release=0.03, centre=(0.05, 0.0, 0.0))
    result = thrown(mechanism, payloads=[load], integrator="rk4", step=5e-6)
    assert float(result["tilt"].max()) < 1e-9
    assert result.audit.loop_drift < 1e-9
    assert result.audit.warnings == []


@pytest.mark.thorough
def test_a_locked_loop_is_saved_and_run_again(urdf, tmp_path):
    result = thrown(cut_at_the_slider(urdf), duration=2e-3)
    loaded = jp.Result.load(result.save(tmp_path / "locked.nc"))
    again = loaded.simulation.run()
    assert again["q"].identical(result["q"])
