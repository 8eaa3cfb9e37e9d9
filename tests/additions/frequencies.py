"""A kind of measurement of one's own: how fast an arm swings on its gear, with several payloads."""

import numpy as np

from jointplay.estimate import LeastSquares, Unknown

REACH = 0.5
"""Of the payload from the joint [m]."""


def frequency(stiffness, inertia, payload):
    """Of an arm on a torsion spring [Hz]."""
    return np.sqrt(stiffness / (inertia + payload * REACH**2)) / (2.0 * np.pi)


def measured(joint, payloads, frequencies, error):
    """What n frequencies [Hz] with n payloads [kg] say of the gear's stiffness and the inertia."""
    unknowns = (
        Unknown(joint, "gear_stiffness", "N*m/rad", 1e3, 1e3),
        Unknown(joint, "inertia", "kg*m^2", 0.5, 0.5),
    )
    return LeastSquares(
        unknowns,
        lambda theta: frequency(*theta, np.asarray(payloads)),
        np.asarray(frequencies),
        np.full(len(payloads), error),
    )
