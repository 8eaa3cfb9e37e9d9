"""A drive of one's own: torque against the swing, as the joint's encoder sees it."""

from jointplay.simulation.loads import Controller


def braked(time, q, v, p, out):
    out[0] = -p[0] * v[0]


BRAKE = Controller(("swing",), braked, (0.5,))
