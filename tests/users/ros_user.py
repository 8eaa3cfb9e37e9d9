"""A ROS 2 user: a trajectory from a bag, the play's effect along it, and a trajectory back."""

import yaml

import jointplay as jp

bearing = jp.RevoluteClearance(radial_clearance="0.2 mm", axial_clearance="0.2 mm")
ideal = jp.Mechanism(jp.shipped("scara.urdf"), gravity=(0, 0, 0))
given = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
jp.simulate(ideal, given, duration=0.1).export("recorded.mcap", overwrite=True)

motion = jp.Motion.from_mcap("recorded.mcap")
loose = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
result = jp.simulate(loose, motion)
print(result)
print(f"the tool is up to {1e3 * result.tool_error.peak:.2f} mm off")
result.export("played.mcap", every=10, overwrite=True)
path = result.export("played.yaml", every=10, overwrite=True)
message = yaml.safe_load(path.read_text())
assert message["joint_names"] == list(motion.joints)
assert len(message["points"]) > 10
