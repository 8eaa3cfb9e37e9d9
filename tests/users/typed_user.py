"""A user who checks types: quantities are numbers in SI, or text with a unit."""

import jointplay as jp


def largest(clearance: str | float) -> float:
    """Largest error of a SCARA's tool [m]."""
    bearing = jp.RevoluteClearance(radial_clearance=clearance, axial_clearance="0.2 mm")
    gear = jp.Gear(play="2 arcmin", stiffness="2e4 N*m/rad", rotor_inertia=0.1)
    robot = jp.Mechanism(
        jp.shipped("scara.urdf"), {"joint_b": bearing}, gears={"joint_a": gear}, gravity=(0, 0, 0)
    )
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    result = jp.simulate(robot, motion, step="20 us", duration="50 ms")
    play: float = bearing.radial_clearance + 0.5 * gear.play
    return result.tool_error.peak / play


if __name__ == "__main__":
    print(largest("0.2 mm"))
