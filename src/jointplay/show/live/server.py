"""The live page and its server, on this machine only: page, questions, streamed answers."""

from __future__ import annotations

import json
import queue
import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from importlib import resources
from typing import Any

from jointplay.base.errors import JointplayError, require_finite
from jointplay.base.tables import for_json
from jointplay.show.live.state import State
from jointplay.show.live.workers import Workers
from jointplay.show.player import playback
from jointplay.show.player.pages import components, filled, static
from jointplay.show.player.server import PORT
from jointplay.show.player.server import serve as serve_page
from jointplay.simulation.simulation import Simulation
from jointplay.simulation.values import assumed_table

_FRONT = resources.files("jointplay.show.live") / "static"


def front() -> str:
    """The front end's script: a function of meshcat's viewer that returns ``mount``."""
    parts = "\n".join(
        (components(), static("chart.js"), static("robot.js", _FRONT), static("live.js", _FRONT))
    )
    body = f'"use strict";\nconst {{THREE}} = MeshCat;\n{parts}\nreturn {{mount}};'
    return f"function jointplayLive(MeshCat) {{\n{body}\n}}"


def style() -> str:
    """The front end's style sheet, which affects nothing outside its own element."""
    return f"{static('live.css', _FRONT)}\n.jp-live {{\n{static('chart.css')}}}"


def contents(state: State, simulation: Simulation, title: str) -> tuple[dict[str, Any], bytes]:
    """What the front end starts from: controls, assumptions, and the bodies of the machine."""
    bodies = playback.bodies(simulation.mechanism)
    assumed = assumed_table(simulation, state.scenario.origins(state.case))
    rows = zip(*(column.values for column in assumed.columns), strict=True)
    start = {
        "title": title,
        "controls": state.described(),
        "assumptions": [*state.scenario.assumptions, *state.scenario.notes],
        # Assumed values: name, value, the rule that assumed it, what another value would change.
        "assumed": [list(row) for row in rows],
        "bodies": bodies.contents | {"notes": bodies.notes},
        "joints": list(simulation.mechanism.clearance),
    }
    return start, bodies.block


def page(contents: Mapping[str, Any], block: bytes) -> bytes:
    """The page, HTML in UTF-8; its policy lets it ask the server that it comes from."""
    start = (
        'window.jointplay = jointplayLive(MeshCat).mount(document.getElementById("live"), '
        'JSON.parse(document.getElementById("contents").textContent), '
        'document.getElementById("block").textContent);'
    )
    package, more = "jointplay.show.live", "'self' data: blob:"
    title = f"{contents['title']}: jointplay live"
    return filled(package, title, style(), contents, block, f"{front()}\n{start}", more)


def frame(head: Mapping[str, Any], block: bytes = b"") -> bytes:
    """A part of an answer as bytes: two lengths, plain data (JSON), the block."""
    text = json.dumps(for_json(head), separators=(",", ":")).encode()
    return struct.pack("<II", len(text), len(block)) + text + block


class Routes:
    """The page's questions, and the functions that answer them."""

    def __init__(self, state: State, workers: Workers) -> None:
        self._state, self._workers = state, workers
        self._lock = threading.Lock()
        self._newest = ("", 0)

    @property
    def posts(self) -> dict[str, Callable[[bytes], Iterator[bytes]]]:
        return {"ask": self._ask, "scenario": self._scenario}

    def _read(self, body: bytes) -> tuple[dict[str, float], tuple[str, int]]:
        """The values of a question, its page and its number."""
        try:
            asked = json.loads(body)
        except (ValueError, RecursionError) as error:
            raise JointplayError(f"the question cannot be read: {error}") from None
        values = asked.get("values") if isinstance(asked, dict) else None
        if not isinstance(values, dict):
            raise JointplayError("a question has values, numbers by control")
        values = {name: require_finite(name, value, "") for name, value in values.items()}
        page, number = asked.get("page", ""), asked.get("number", 0)
        if not isinstance(page, str) or not isinstance(number, int):
            raise JointplayError("a question's page is text, and its number a whole one")
        return values, (page, number)

    def _ask(self, body: bytes) -> Iterator[bytes]:
        values, question = self._read(body)
        parts: queue.SimpleQueue[tuple[dict[str, Any], bytes]] = queue.SimpleQueue()

        def answer() -> Iterator[bytes]:
            page, number = question
            with self._lock:  # requests may overtake each other: an older question is dropped
                newest = page != self._newest[0] or number >= self._newest[1]
                if newest:
                    self._newest = question
                    self._workers.ask(values, lambda head, block: parts.put((head, block)))
            if not newest:
                yield frame({"kind": "end", "superseded": True})
                return
            while True:
                head, block = parts.get()
                yield frame(head, block)
                if head["kind"] == "end":
                    return

        return answer()

    def _scenario(self, body: bytes) -> Iterator[bytes]:
        text = self._state.text(self._read(body)[0])
        return (part for part in [text.encode()])


def serve(
    state: State,
    simulation: Simulation,
    title: str,
    *,
    port: int = PORT,
    browser: bool = True,
    say: Callable[[str], None] = print,
) -> None:
    """Serve the page and open it in the browser, until Ctrl-C; errors are those of `Server`.

    `say` receives notes for the user, a line each.
    """
    workers = Workers(state)
    try:
        posts = Routes(state, workers).posts
        serve_page(
            lambda: page(*contents(state, simulation, title)),
            "live", port=port, posts=posts, browser=browser, say=say,
        )  # fmt: skip
    except KeyboardInterrupt:
        say("")
    finally:
        workers.close()
