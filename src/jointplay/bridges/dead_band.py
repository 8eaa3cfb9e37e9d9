"""Joints' play as an actuator model: the torque that motors exert on links through a dead band.

It goes with a model of the robot without play, in any simulator: the simulator's joints are the
links, and the motors' angles are kept here. At each step of the simulator call

    torque, motor, speed = PLAY.step(drive, motor, speed, link, link_speed, dt)

with the motors' own torques `drive` (a controller whose encoder is on the motor reads `motor`) and
the links' angles and speeds from the simulator; there `torque` acts on the joints in place of their
own actuators. A motor that moves as commanded needs no state: ``PLAY.torque(command,
command_speed, link, link_speed)``. Steps longer than `STEP` do not resolve the teeth.

Arrays are those of NumPy, JAX or PyTorch, of shape (joints,), or (copies, joints) for many robots
at once, whose numbers may differ. Friction and damping of the links belong in the simulator's
model, as no torque set once a step can make them stick; `for_mujoco` puts them there:

    rows = for_mujoco(model)                  # once
    data.qfrc_applied[rows.speeds] = torque   # each step, before mujoco.mj_step(model, data)

SI units. To try it in MuJoCo: ``python THIS_FILE robot.xml`` reverses the motors of a robot.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class DeadBand(NamedTuple):
    """Parameters of the joints' play, an array each."""

    half: Any
    """Half of the dead band [rad]."""
    stiffness: Any
    """Stiffness of the teeth beyond the dead band [N m/rad]."""
    damping: Any
    """Damping between motor and link [N m s/rad]."""
    rotor: Any
    """Inertia of the motor, on the joint's side of the gear [kg m^2]."""
    friction: Any
    """Dry friction of the link [N m]."""
    viscous: Any
    """Viscous friction of the link [N m s/rad]."""

    def torque(self, motor: Any, motor_speed: Any, link: Any, link_speed: Any) -> Any:
        """Torque on the links [N m] at angles [rad] and speeds [rad/s]; motors get the opposite."""
        twist = motor - link
        deflection = twist - twist.clip(-self.half, self.half)
        return self.stiffness * deflection + self.damping * (motor_speed - link_speed)

    def step(
        self, drive: Any, motor: Any, motor_speed: Any, link: Any, link_speed: Any, dt: float
    ) -> tuple[Any, Any, Any]:
        """Torque on the links over a step of dt [s], and the motors' angles and speeds after it.

        The step is implicit in the motors' speeds, so that light rotors are stable; `drive` is the
        motors' torque.
        """
        twist = motor - link
        deflection = twist - twist.clip(-self.half, self.half)
        slope = self.damping + dt * self.stiffness * (deflection != 0.0)
        momentum = self.rotor * motor_speed + dt * (drive - self.stiffness * deflection)
        speed = (momentum + dt * slope * link_speed) / (self.rotor + dt * slope)
        torque = self.stiffness * deflection + slope * (speed - link_speed)
        return torque, motor + dt * speed, speed


JOINTS: tuple[str, ...] = ()
PLAY = DeadBand(*np.zeros((6, 0)))
STEP = 1e-3


class Rows(NamedTuple):
    """Indices of joints in the vectors of a MuJoCo model."""

    angles: list[int]
    """Indices in qpos."""
    speeds: list[int]
    """Indices in qvel and qfrc_applied."""


def for_mujoco(
    model: Any, play: DeadBand = PLAY, joints: tuple[str, ...] = JOINTS, dt: float = STEP
) -> Rows:
    """Prepare a MuJoCo model of a robot without play for the torques of this actuator.

    The links get their friction and damping, and the time step becomes at most dt [s]; the joints'
    rotors and actuators are removed, as they are the `rotor` and the `drive` of `step`.
    """
    import mujoco

    hinges = [model.joint(name) for name in joints]
    rows = Rows([int(j.qposadr[0]) for j in hinges], [int(j.dofadr[0]) for j in hinges])
    model.opt.timestep = min(model.opt.timestep, dt)
    model.dof_armature[rows.speeds] = 0.0
    model.dof_frictionloss[rows.speeds] = play.friction
    model.dof_damping.reshape(model.nv, -1)[rows.speeds, 0] = play.viscous
    turns = np.isin(model.actuator_trnid[:, 0], [j.id for j in hinges])
    joint_driven = model.actuator_trntype <= int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    model.actuator_gear[turns & joint_driven] = 0.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return rows


def main(path: str) -> None:
    """Move the motors to and fro by 0.1 rad in MuJoCo, without gravity; print how far links lag."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(path)
    rows = for_mujoco(model)
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    lag = np.zeros(len(JOINTS))
    while data.time < 2.0:
        motor = 0.05 * (1.0 - np.cos(np.pi * data.time)) * np.ones(len(JOINTS))
        speed = 0.05 * np.pi * np.sin(np.pi * data.time) * np.ones(len(JOINTS))
        link = data.qpos[rows.angles]
        data.qfrc_applied[rows.speeds] = PLAY.torque(motor, speed, link, data.qvel[rows.speeds])
        lag = np.maximum(lag, abs(motor - link))
        mujoco.mj_step(model, data)
    for name, far, half in zip(JOINTS, lag, PLAY.half, strict=True):
        print(f"{name}: motor and link up to {1e3 * far:.4g} mrad apart, {1e3 * half:.4g} free")


if __name__ == "__main__":
    import sys

    main(*sys.argv[1:])
