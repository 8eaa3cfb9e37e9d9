"""A MuJoCo user: the play of an arm's gear, put into the arm's own MJCF, and stepped there."""

from pathlib import Path

import mujoco

import jointplay as jp

ARM = """<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="upper">
<joint name="shoulder" axis="0 0 1" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" mass="2"/>
<site name="tip" pos="0.4 0 0"/></body></worldbody></mujoco>"""
Path("arm.xml").write_text(ARM)

gear = jp.Gear(play="0.5 deg", stiffness="2000 N*m/rad", rotor_inertia="0.1 kg*m^2")
robot = jp.Mechanism("arm.xml", gears={"shoulder": gear}, tool="tip")
print(jp.budget(robot).sentence)
joint = jp.reduce(robot, "shoulder", amplitude=0.02, period=0.5)

spec = mujoco.MjSpec.from_file("arm.xml")
half = 0.5 * joint.dead_band
link = spec.joint("shoulder").parent
link.add_joint(name="play", axis=[0, 0, 1], range=[-half, half], armature=1e-3)
spec.joint("shoulder").armature = joint.rotor_inertia
model = spec.compile()
model.opt.timestep = joint.timestep
data = mujoco.MjData(model)
data.qvel[model.joint("play").dofadr[0]] = 0.2
seen = []
while data.time < 0.5:
    mujoco.mj_step(model, data)
    seen.append(data.joint("play").qpos[0])
print(f"the link turns freely by {max(seen) - min(seen):.4g} rad, of {joint.dead_band:.4g}")
assert max(seen) - min(seen) > 0.9 * joint.dead_band
