"""What results say: accuracy, contacts, spectra, numerical error, wear."""

from jointplay.analysis.contact_statistics import Contacts, contacts, shares
from jointplay.analysis.spectra import spectrum
from jointplay.analysis.tool_error import (
    COMPONENTS,
    Accuracy,
    Stop,
    accuracy,
    deviation,
    error_at,
    stops,
)
from jointplay.analysis.twin import (
    clearance_inputs,
    clearance_outline,
    has_play,
    ideal_simulation,
    inputs,
    is_twin,
    places,
    task,
    twin,
)

__all__ = [
    "COMPONENTS",
    "Accuracy",
    "Contacts",
    "Stop",
    "accuracy",
    "clearance_inputs",
    "clearance_outline",
    "contacts",
    "deviation",
    "error_at",
    "has_play",
    "ideal_simulation",
    "inputs",
    "is_twin",
    "places",
    "shares",
    "spectrum",
    "stops",
    "task",
    "twin",
]
