"""A four-bar with three clearances under control, against the result of its authors' program."""

import numpy as np
import pytest
from truth.four_bar_control import REFERENCE, crank, machine


def differences(corrected):
    """Of the crank's angle [rad] and speed [rad/s], at the times of the reference."""
    result = machine(corrected).run(progress=False, estimate=False)
    return np.column_stack(crank(result.completed())) - np.array(REFERENCE)[:, 1:]


def test_the_crank_follows_as_siconos_has_it():
    found = differences(corrected=False)
    assert np.abs(found[:, 0]).max() < 1e-3
    assert np.sqrt(np.mean(found[:, 1] ** 2)) == pytest.approx(0.0, abs=0.08)


def test_the_controllers_slip_shows():
    assert np.abs(differences(corrected=True)[:, 0]).max() > 3e-3
