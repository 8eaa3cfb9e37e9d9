"""A Jupyter user: what cells show of a machine, its budget and a result, and figures."""

import jointplay as jp

bearing = jp.RevoluteClearance(radial_clearance="0.2 mm", axial_clearance="0.2 mm")
robot = jp.Mechanism("jointplay:scara.urdf", {"joint_b": bearing}, gravity=(0, 0, 0))
motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
budget = jp.budget(robot)
result = jp.simulate(robot, motion, duration=0.05)
print(result.summary())
for shown in (robot, motion, budget, result):
    print(repr(shown))
    assert len(repr(shown).splitlines()) < 8
for shown in (robot, budget, result):
    assert "<table" in shown._repr_html_()
assert "tool error up to" in repr(result)
figure = result.plot.deviation(axis="total")
figure.savefig("deviation.png")
result.save("result.nc")
