"""Play for robot learning: hinges, tendon and actuator in MuJoCo, MJX and Warp, and the full model.

    python benchmarks learners [--period 2]

A SCARA's joint with bearing and gear is reduced (`jointplay export simulator`) and written in three
ways: two hinges with limits, two hinges with a tendon, and the actuator of dead_band.py on a robot
without play. Each is run through the reversals of the full model, motor as there: error of the lag
is the largest and the RMS difference of the link's angle. Then the link is pushed to and fro while
its motor stands: error of the play is that of the angle in which it turns freely. A step's cost is
beside that of a bare mj_step of the robot without play. MJX and Warp join in if they are installed
(on a CPU, for one robot: their compilation is not counted); with --quick they do not.
"""

from __future__ import annotations

import importlib.util
import math
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import numpy as np
from common import JOINT, Benchmark, require

import jointplay as jp
from jointplay.bridges.dead_band import DeadBand
from jointplay.bridges.reduced_files import actuator
from jointplay.bridges.reduced_mjcf import follow
from jointplay.bridges.reduced_robot import ReducedRobot
from jointplay.bridges.reduction import Reduction, reduce
from jointplay.model.mjcf_whole import compile_text

GEAR = jp.Gear(play=2e-3, rotor_inertia=0.02, stiffness=2e3, damping=1.0)
HELD = 1e4
"""Inertia of what is held or moves as prescribed [kg m^2]; small enough for single precision."""


def with_limits(text: str, one: Reduction) -> str:
    """The MJCF with limits of the second hinge instead of the tendon's dead band."""
    root = ElementTree.fromstring(text)
    tendon = root.find("tendon")
    assert tendon is not None
    spring = next(e for e in tendon if e.get("name") == f"{one.joint}.play")
    spring.attrib |= {"stiffness": "0", "damping": "0"}
    (play,) = (e for e in root.iter("joint") if e.get("name") == f"{one.joint}_play")
    half = 0.5 * one.dead_band
    play.attrib |= {
        "limited": "true",
        "range": f"{-half} {half}",
        "damping": f"{one.damping}",
        "solreflimit": f"{-one.stiffness} {-one.damping}",
    }
    return ElementTree.tostring(root, encoding="unicode")


def loaded(text: str):
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model


def turns_freely(text: str, one: Reduction, play: DeadBand | None) -> float:
    """Angle in which the link turns freely while its motor stands, pushed by two torques [rad]."""
    import mujoco

    model = loaded(text)
    for numbers in (model.opt.gravity, model.tendon_frictionloss, model.dof_frictionloss):
        numbers[:] = 0.0
    row = int(model.joint(one.joint if play else f"{one.joint}_play").dofadr[0])
    model.dof_armature[np.arange(model.nv) != row] = HELD
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    inertia = 1.0 / float(model.dof_invweight0[row])
    model.dof_damping.reshape(model.nv, -1)[row, 0] = 2.0 * math.sqrt(one.stiffness * inertia)
    push, ends = 0.1 * one.stiffness * one.dead_band, []
    for torque in (push, -push, 2.0 * push, -2.0 * push):
        mujoco.mj_resetData(model, data)
        for _ in range(math.ceil(60.0 * math.sqrt(inertia / one.stiffness) / model.opt.timestep)):
            q, v = data.qpos[[row]], data.qvel[[row]]
            data.qfrc_applied[[row]] = torque + (play.torque(0.0, 0.0, q, v) if play else 0.0)
            mujoco.mj_step(model, data)
        ends.append(float(data.qpos[row]))
    return 2.0 * (ends[0] - ends[1]) - (ends[2] - ends[3])


def cost(text: str, play: DeadBand | None = None) -> float:
    """Of a step, called from Python, beyond which nothing is done but what the way needs [s]."""
    import mujoco

    model = loaded(text)
    data, row = mujoco.MjData(model), int(model.joint(JOINT).dofadr[0])
    rows, zero, spent = [row], np.zeros(1), math.inf
    for _ in range(15):
        mujoco.mj_resetData(model, data)
        begun = time.process_time()
        for _ in range(1000):
            if play:
                turning = play.torque(zero, zero, data.qpos[rows], data.qvel[rows])
                data.qfrc_applied[rows] = turning
            mujoco.mj_step(model, data)
        spent = min(spent, (time.process_time() - begun) / 1000)
    return spent


Followed = tuple[np.ndarray, np.ndarray, float]
"""Times [s], angles of the link [rad], cost of a step [s]."""


class Course:
    """What a batched simulator is given: a model, where its joints are, and the motor's motion."""

    def __init__(self, text: str, one: Reduction, play: DeadBand | None) -> None:
        import mujoco

        self.play, past, self.model = play, one.history, loaded(text)
        self.step = float(self.model.opt.timestep)
        self.time = np.arange(past["time"][0], past["time"][-1], self.step)
        self.motor = np.interp(self.time, past["time"], past["motor"])
        self.goal = np.zeros((len(self.time), self.model.nv))
        self.row = int(self.model.joint(one.joint).dofadr[0])
        self.link = [self.row]
        free = self.row
        if play is None:
            free = int(self.model.joint(f"{one.joint}_play").dofadr[0])
            self.link.append(free)
            self.goal[:, self.row] = self.motor
        self.held = np.arange(self.model.nv) != free
        self.model.dof_armature[self.held] = HELD
        self.data = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.data)
        self.data.qpos[:] = self.goal[0]
        self.data.qpos[free] += past["full"][0] - (self.motor[0] if play is None else 0.0)
        self.speed = np.gradient(self.motor, self.step)
        self.data.qvel[self.held] = np.gradient(self.goal, self.step, axis=0)[0][self.held]
        turned = (past["full"][1] - past["full"][0]) / (past["time"][1] - past["time"][0])
        self.data.qvel[free] = turned - (self.speed[0] if play is None else 0.0)

    def forces(self, q, v, goal, motor, speed):
        """Of all joints at angles q and speeds v, of the arrays' own library (nv,)."""
        applied = self.held * HELD * ((goal - q) / self.step - v) / self.step
        if self.play is None:
            return applied
        there = np.arange(self.model.nv) == self.row
        return applied + there * self.play.torque(motor, speed, q, v)


def by_mjx(course: Course) -> Followed:
    import jax

    jax.config.update("jax_enable_x64", True)
    from mujoco import mjx

    model = mjx.put_model(course.model)
    data = mjx.put_data(course.model, course.data)

    def advance(state, row):
        (q, v, warm), (goal, motor, speed) = state, row
        applied = course.forces(q, v, goal, motor, speed)
        now = data.replace(qpos=q, qvel=v, qacc_warmstart=warm, qfrc_applied=applied)
        now = mjx.step(model, now)
        return (now.qpos, now.qvel, now.qacc_warmstart), now.qpos

    run = jax.jit(lambda state, rows: jax.lax.scan(advance, state, rows)[1])
    state = (data.qpos, data.qvel, data.qacc_warmstart)
    rows = (course.goal[1:], course.motor[:-1], course.speed[:-1])
    run(state, rows).block_until_ready()
    begun = time.perf_counter()
    q = np.array(run(state, rows).block_until_ready())
    spent = (time.perf_counter() - begun) / len(q)
    return course.time[1:], q[:, course.link].sum(axis=1), spent


def by_warp(course: Course) -> Followed:
    import mujoco_warp

    model = mujoco_warp.put_model(course.model)
    data = mujoco_warp.put_data(course.model, course.data)
    q, v, force = (one.numpy() for one in (data.qpos, data.qvel, data.qfrc_applied))  # views
    found = np.empty((len(course.time) - 1, course.model.nv))
    begun = time.perf_counter()
    for i in range(len(found)):
        if i == 10:
            begun = time.perf_counter()
        applied = course.forces(q[0], v[0], course.goal[i + 1], course.motor[i], course.speed[i])
        force[0] = applied
        mujoco_warp.step(model, data)
        found[i] = q[0]
    spent = (time.perf_counter() - begun) / (len(found) - 10)
    return course.time[1:], found[:, course.link].sum(axis=1), spent


BATCHED: dict[str, tuple[str, Callable[[Course], Followed]]] = {
    "MJX": ("mujoco.mjx", by_mjx),
    "MuJoCo Warp": ("mujoco_warp", by_warp),
}


def main() -> None:
    bench = Benchmark("learners", __doc__, runs=0, period=(2.0, "of a reversal [s]"))
    args = bench.parse()
    require(args.quick, mujoco="pip install '.[simulators]'")
    bearing = jp.RevoluteClearance(radial_clearance=5e-5, axial_clearance=5e-5)
    mechanism = jp.Mechanism(jp.shipped("scara.urdf"), {JOINT: bearing}, gears={JOINT: GEAR})
    one = reduce(mechanism, JOINT, period=min(args.period, 0.8) if args.quick else args.period)
    robot = ReducedRobot(mechanism, [one], {}, ["mjcf", "py"])
    tendon, bare = robot.files("r")["r.xml"], robot.without_play()
    _, play = actuator([one])
    past, plain = one.history, cost(bare)
    ways: dict[str, tuple[str, DeadBand | None]] = {
        "two hinges, limits": (with_limits(tendon, one), None),
        "two hinges, tendon": (tendon, None),
        "actuator": (bare, play),
    }
    stiff = past["motor"] - past["full"]
    rows = [["no play", one.dead_band, np.abs(stiff).max(), np.sqrt(np.mean(stiff**2)), plain]]
    for name, (text, way) in ways.items():
        seen, free = (
            follow(compile_text(text, robot.meshes), one, way),
            turns_freely(text, one, way),
        )
        rows.append([name, abs(free - one.dead_band), seen.error, seen.rms, cost(text, way)])
    for library, (module, run) in BATCHED.items():
        if args.quick or importlib.util.find_spec(module) is None:
            print(f"{library}: left out ({'--quick' if args.quick else 'not installed'})")
            continue
        for name in ("two hinges, tendon", "actuator"):
            when, angle, spent = run(Course(ways[name][0], one, ways[name][1]))
            off = angle - np.interp(when, past["time"], past["full"])
            lags = np.abs(off).max(), np.sqrt(np.mean(off**2))
            rows.append([f"{library}: {name}", math.nan, *lags, spent])
    print(
        f"dead band {1e6 * one.dead_band:.4g} µrad, stated error {1e6 * one.angle_error:.4g} µrad"
    )
    heads = ["way", "error of play [µrad]", "error of lag [µrad]", "RMS [µrad]", "step [µs]"]
    texts = [
        [name, *("" if math.isnan(x) else f"{1e6 * x:.3g}" for x in numbers)]
        for name, *numbers in rows
    ]
    shown = [[*row, f"{numbers[-1] / plain:.2f}"] for row, numbers in zip(texts, rows, strict=True)]
    heads.append("by bare mj_step")
    bench.finish(heads, shown, [dict(zip(heads, row, strict=True)) for row in shown])


if __name__ == "__main__":
    main()
