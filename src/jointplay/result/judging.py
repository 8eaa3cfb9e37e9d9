"""From when on a run is judged."""

from __future__ import annotations

STARTS = ("rest", "centred")
"""Where journals begin: where they lie under load, or in the middle of their bearings."""

START_UP = 0.15
"""Start of a run that is not judged, while released journals fall into their bearings [s]."""
