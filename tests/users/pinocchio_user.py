"""A Pinocchio user: a model and a trajectory of one's own, and what play does to the tool."""

import numpy as np
import pinocchio as pin

import jointplay as jp

model = pin.buildModelFromUrdf(jp.shipped("scara.urdf"))
time = np.linspace(0.0, 0.2, 41)
way = 0.5 - 0.5 * np.cos(np.pi * time / time[-1])
positions = np.outer(way, [0.4, 0.3, -0.05, 0.2])  # a stroke between turning joints [rad, m]

bearing = jp.RevoluteClearance(radial_clearance="0.2 mm", axial_clearance="0.1 mm")
robot = jp.Mechanism(model, {"joint_b": bearing}, tool=model.frames[-1].name)
motion = jp.Motion(list(model.names)[1:], time, positions, "spline")
result = jp.simulate(robot, motion, step="20 us")

# The same error by the model itself: where its tool is against where the result has it.
data, tool = model.createData(), model.getFrameId(robot.tool)
ideal = []
for q in motion(result.time)[0]:
    pin.framesForwardKinematics(model, data, q)
    ideal.append(data.oMf[tool].translation.copy())
error = np.linalg.norm(result["tool_position"].values - ideal, axis=1)
print(result)
print(f"largest {1e3 * error.max():.3f} mm, {1e3 * float(result['tool_error'].max()):.3f} mm")
assert np.allclose(error, result["tool_error"], atol=1e-6)
