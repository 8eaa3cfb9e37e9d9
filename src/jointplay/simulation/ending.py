"""How a run ended, in words."""

from __future__ import annotations

from collections.abc import Sequence

from jointplay.kernel import Status
from jointplay.kernel.workspace import Workspace
from jointplay.mechanism.mechanism import Mechanism


def message(
    mechanism: Mechanism, workspace: Workspace, status: Status, loads: Sequence[str] = ()
) -> str:
    """One line on how a run ended; `loads` are their names."""
    at = f"at t = {workspace.time:.6g} s (step {workspace.steps})"
    if status == Status.COMPLETED:
        return f"completed {workspace.time:g} s in {workspace.steps} steps"
    if status == Status.INTERRUPTED:
        return f"interrupted {at}; {workspace.rows} records kept"
    state = ", ".join(
        f"{name} = {q:.6g} ({v:.4g}/s)"
        for name, q, v in zip(mechanism.coordinates, workspace.q, workspace.v, strict=True)
    )
    joint, contact = workspace.bad_contact
    if status == Status.BAD_LOAD:
        what, remedy = f"the load {loads[joint]!r} gave a non-finite value", "correct it"
    elif status == Status.RUN_AWAY:
        what = "the state ran away or is not a number"
        remedy = "reduce the step or the drive's bandwidth"
    else:
        name = list(mechanism.clearance)[joint]
        law = mechanism.clearance[name]
        place = law.contacts[contact]
        if status == Status.BROKE_OUT:
            what = f"the journal of {name!r} broke out of its bearing ({place})"
            remedy = "reduce the step or check stiffness and loads"
        elif status == Status.FILM_BROKE:
            what = f"the journal of {name!r} touched its bore through the film ({place})"
            remedy = "let the film be hybrid, or take a more viscous oil"
        else:
            laws = [law.normal, law.friction] + ([law.film[0]] if law.film else [])
            what = (
                f"law {' or '.join(repr(one.name) for one in laws)} of {name!r} "
                f"returned a non-finite value ({place})"
            )
            remedy = "correct the law"
    return f"stopped {at}: {what}; {remedy}. State: {state}"
