"""The live page as a widget in a notebook: the same front end, with messages for HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.base.imports import extra
from jointplay.scenario.reading import Scenario
from jointplay.show.live import server
from jointplay.show.live.server import plain, style, values_of
from jointplay.show.live.state import State
from jointplay.show.live.workers import Workers
from jointplay.show.player.pages import viewer


def module() -> str:
    """The front end as the module that a notebook loads."""
    bundle = f"const bundle = {{exports: {{}}}};\n(function (module, exports) {{{viewer()}\n}})"
    bundle += ".call(globalThis, bundle, bundle.exports);\nconst MeshCat = bundle.exports;"
    return "\n".join((bundle, server.front(), server.own("comm.js")))


def widget(scenario: Scenario | str | Path, case: str | None = None) -> Any:
    """The live page for a notebook, an ``anywidget.AnyWidget``: the last value of a cell.

    Its processes end with ``close()`` or with the kernel.

    Args:
        scenario: a file, or what `Scenario.load` or `robot_scenario` gave.
        case: its label; may be left out if there is only one.

    Raises:
        JointplayError: the extra jointplay[notebook] is missing; see also `Scenario.simulation`.
    """
    with extra("notebook", "anywidget"):
        import anywidget
        import traitlets
    chosen = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
    simulation = chosen.simulation(case)
    state = State.of(chosen, chosen.cases[0] if case is None else case, simulation)
    said, block = server.contents(state, simulation, chosen.title.rpartition(":")[2])
    workers = Workers(state)

    class LiveWidget(anywidget.AnyWidget):  # type: ignore[misc]
        """One machine, its controls and its answers."""

        _esm = module()
        _css = style()
        contents = traitlets.Dict().tag(sync=True)
        block = traitlets.Bytes().tag(sync=True)

        def close(self) -> None:
            workers.close()
            super().close()

    made = LiveWidget(contents=plain(said), block=block)
    made.on_msg(lambda shown, asked, buffers: _reply(shown, asked, state, workers))
    return made


def _reply(shown: Any, asked: Any, state: State, workers: Workers) -> None:
    if not isinstance(asked, dict):
        return
    to = asked.get("to")
    try:
        values = values_of(asked)
        if asked.get("what") == "scenario":
            shown.send({"to": to, "kind": "scenario", "text": state.text(values)})
            return
    except JointplayError as error:
        shown.send({"to": to, "kind": "error", "error": str(error), "at": None})
        shown.send({"to": to, "kind": "end", "superseded": False})
        return
    workers.ask(values, lambda head, block: shown.send(plain({**head, "to": to}), [block]))
