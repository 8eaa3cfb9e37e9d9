"""A small sweep: the SCARA for 20 ms."""

ARM = """
[robot]
urdf = "jointplay:scara.urdf"
tool = "suction_cup"
gravity = "loaded"

[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"
friction = { law = "ambrosio", mu_d = 0.1 }

[motion]
file = "jointplay:scara_motion.csv"
"""
"""The arm with play in one joint, and its motion."""

SCENARIO = (
    ARM.replace("{", "{{").replace("}", "}}")
    + """
[integration]
duration = "{duration}"

[sweep]
{options}

[sweep.axes]
{axes}
"""
)

GRID = """
clearance = { key = "joints.joint_b.radial_clearance", values = [0, "0.1 mm", "0.2 mm"] }
friction = { key = "joints.joint_b.friction.mu_d", from = 0.0, to = 0.1, number = 2 }
"""
