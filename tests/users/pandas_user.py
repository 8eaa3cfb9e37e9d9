"""A pandas user: load a result, describe, resample and draw it, and count impacts."""

import pandas as pd

import jointplay as jp

bearing = jp.RevoluteClearance(radial_clearance=0.2e-3, axial_clearance=0.2e-3)
robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
jp.simulate(robot, motion, duration=0.2).save("run.nc", overwrite=True)

result = jp.Result.load("run.nc")
result["tool_error"]  # here, if the run was made without
table = result.to_dataframe()
assert table.index.name == "time"
print(table[["tool_error", "tool_turn"]].describe())
coarse = table.set_index(pd.to_timedelta(table.index, "s"))["tool_error"].resample("10ms").max()
assert len(coarse) == 21
axes = table.plot(y="tool_error", ylabel=f"tool error [{table.attrs['units']['tool_error']}]")
assert axes.get_xlabel() == "time"

force = table["joint_force.joint_b.x"].abs() + table["joint_force.joint_b.y"].abs()
touches = force > 0.0
number = (touches & ~touches.shift(fill_value=False)).cumsum()
impacts = table[touches].reset_index().groupby(number[touches].to_numpy())["time"]
print(impacts.agg(["min", "max", "count"]).head())
assert impacts.ngroups > 1
