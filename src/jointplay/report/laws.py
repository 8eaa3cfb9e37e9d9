"""The text of users' own laws, as results bring it: it is shown, and never run."""

from __future__ import annotations

from collections.abc import Sequence

from jointplay import analysis
from jointplay.report.cases import Case
from jointplay.report.html import Html, details, joined, markup


def own_laws(cases: Sequence[Case]) -> Html:
    """Each law once, and where it is used."""
    users: dict[tuple[str, str], list[str]] = {}
    for case in cases:
        for joint, fields in analysis.clearance_inputs(case.result).items():
            for law in fields.values():
                if isinstance(law, dict) and law.get("source"):
                    user = f"{case.label}, {joint}" if len(cases) > 1 else joint
                    known = users.setdefault((str(law["function"]), str(law["source"])), [])
                    known += [] if user in known else [user]
    return joined(
        details(f"Law {name} ({'; '.join(where)})", markup("<pre>{}</pre>", text))
        for (name, text), where in users.items()
    )
