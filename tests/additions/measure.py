"""A measure of one's own: how long the journal flies freely at a stretch, at most."""

import numpy as np

from jointplay.physics.geometry import Mode


def longest_flight(result):
    """Time [s]."""
    touches = result["mode"].values[:, 0] != Mode.FREE_FLIGHT
    moments = np.concatenate([[0.0], result.time[touches], result.time[-1:]])
    return float(np.diff(moments).max())
