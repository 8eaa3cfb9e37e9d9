"""What results say: accuracy, contacts, spectra, numerical error, wear."""

from typing import TYPE_CHECKING

from jointplay.host.late import lazily

if TYPE_CHECKING:
    from jointplay.analysis.contact_statistics import Contacts as Contacts
    from jointplay.analysis.contact_statistics import contacts as contacts
    from jointplay.analysis.contact_statistics import shares as shares
    from jointplay.analysis.spectra import spectrum as spectrum
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

_HOMES = {
    "contact_statistics": "Contacts contacts shares",
    "spectra": "spectrum",
    "tool_error": "COMPONENTS Accuracy Stop accuracy deviation error_at stops",
    "twins": "clearance_inputs clearance_outline has_play ideal_simulation inputs is_twin places "
    "task twin",
}

__getattr__ = lazily(
    __name__, {name: module for module, names in _HOMES.items() for name in names.split()}
)
