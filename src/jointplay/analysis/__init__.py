"""What results say: accuracy, contacts, spectra, numerical error, wear."""

from typing import TYPE_CHECKING

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
from jointplay.analysis.twins import (
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
from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.analysis.allocation import allocate as allocate
    from jointplay.analysis.certification import certify as certify
    from jointplay.analysis.identify import plan_measurement as plan_measurement
    from jointplay.analysis.reduce import reduce_joint as reduce_joint
    from jointplay.analysis.static_budget import budget as budget
    from jointplay.analysis.wear import wear_life as wear_life
    from jointplay.analysis.wear import worn_depth as worn_depth

# They are loaded when first used: few programs need them.
__getattr__ = offering(
    __name__,
    {
        "allocate": "allocation",
        "budget": "static_budget",
        "certify": "certification",
        "plan_measurement": "identify",
        "reduce_joint": "reduce",
        "wear_life": "wear",
        "worn_depth": "wear",
    },
)

__all__ = [
    "COMPONENTS",
    "Accuracy",
    "Contacts",
    "Stop",
    "accuracy",
    "allocate",
    "budget",
    "certify",
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
    "plan_measurement",
    "reduce_joint",
    "shares",
    "spectrum",
    "stops",
    "task",
    "twin",
    "wear_life",
    "worn_depth",
]
