"""What is computed here rather than by scipy, which takes long to import, has scipy's numbers."""

import numpy as np
import pytest
from scipy import signal

from jointplay.simulation.analysis.vibration import _welch

RANDOM = np.random.default_rng(7)


@pytest.mark.parametrize(("count", "length"), [(900, 256), (900, 257), (40, 40), (17, 16)])
def test_spectra(count, length):
    values = 3.0 + RANDOM.normal(size=(count, 3))
    ours = _welch(values, 1e-3, length)
    theirs = signal.welch(values, 1e3, "hann", length, detrend="constant", axis=0)
    for mine, its in zip(ours, theirs, strict=True):
        assert mine == pytest.approx(its, rel=1e-11, abs=1e-14)
