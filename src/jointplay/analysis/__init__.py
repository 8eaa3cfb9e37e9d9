"""What results say: accuracy, contacts, spectra, numerical error, wear."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.analysis.allocation import allocate as allocate
    from jointplay.analysis.certification import certify as certify
    from jointplay.analysis.contact_statistics import Contacts as Contacts
    from jointplay.analysis.contact_statistics import contacts as contacts
    from jointplay.analysis.contact_statistics import shares as shares
    from jointplay.analysis.identify import plan_measurement as plan_measurement
    from jointplay.analysis.reduce import reduce_joint as reduce_joint
    from jointplay.analysis.spectra import spectrum as spectrum
    from jointplay.analysis.static_budget import budget as budget
    from jointplay.analysis.tool_error import COMPONENTS as COMPONENTS
    from jointplay.analysis.tool_error import Accuracy as Accuracy
    from jointplay.analysis.tool_error import Stop as Stop
    from jointplay.analysis.tool_error import accuracy as accuracy
    from jointplay.analysis.tool_error import deviation as deviation
    from jointplay.analysis.tool_error import error_at as error_at
    from jointplay.analysis.tool_error import stops as stops
    from jointplay.analysis.twins import clearance_inputs as clearance_inputs
    from jointplay.analysis.twins import clearance_outline as clearance_outline
    from jointplay.analysis.twins import has_play as has_play
    from jointplay.analysis.twins import ideal_simulation as ideal_simulation
    from jointplay.analysis.twins import inputs as inputs
    from jointplay.analysis.twins import is_twin as is_twin
    from jointplay.analysis.twins import places as places
    from jointplay.analysis.twins import task as task
    from jointplay.analysis.twins import twin as twin
    from jointplay.analysis.wear import wear_life as wear_life
    from jointplay.analysis.wear import worn_depth as worn_depth

_HOMES = {
    "contact_statistics": "Contacts contacts shares",
    "spectra": "spectrum",
    "tool_error": "COMPONENTS Accuracy Stop accuracy deviation error_at stops",
    "twins": "clearance_inputs clearance_outline has_play ideal_simulation inputs "
    "is_twin places task twin",
    "allocation": "allocate",
    "certification": "certify",
    "identify": "plan_measurement",
    "reduce": "reduce_joint",
    "static_budget": "budget",
    "wear": "wear_life worn_depth",
}

__getattr__ = offering(
    __name__, {name: module for module, names in _HOMES.items() for name in names.split()}
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
