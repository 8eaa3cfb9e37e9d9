"""A scene as one self-contained web page: no server, no network."""

from __future__ import annotations

import base64
import html
import json
from importlib import resources
from pathlib import Path

from jointplay import files
from jointplay.playback.scene import Scene

_SCRIPTS = ("tracks.js", "stage.js", "closeup.js", "player.js")


def render(scene: Scene, title: str) -> bytes:
    """The page that plays `scene`, HTML in UTF-8.

    Everything is inside: meshcat's viewer with three.js, tracks, meshes, licences. Its content
    security policy forbids the browser any request.
    """
    own = resources.files("jointplay.playback") / "static"
    bundle = resources.files("meshcat") / "viewer" / "dist"
    # In JSON within a script element only "<" could end the element.
    contents = json.dumps(scene.contents, separators=(",", ":")).replace("<", "\\u003c")
    licences = (bundle / "main.min.js.LICENSE.txt").read_text("utf-8") + _licence_texts(
        (bundle / "main.min.js.THIRD_PARTY_LICENSES.json").read_text("utf-8")
    )
    parts = {
        "title": html.escape(title),
        "style": (own / "player.css").read_text("utf-8"),
        "contents": contents,
        "block": base64.b64encode(scene.block).decode("ascii"),
        "licences": licences.replace("--", "- -"),
        "meshcat": (bundle / "main.min.js").read_text("utf-8").replace("</script", "<\\/script"),
        "player": "\n".join((own / name).read_text("utf-8") for name in _SCRIPTS),
    }
    page = (own / "page.html").read_text("utf-8")
    pieces = page.split("@@")
    pieces[1::2] = [parts[name] for name in pieces[1::2]]
    return "".join(pieces).encode("utf-8")


def _licence_texts(text: str) -> str:
    """Each bundled package with its licence, which asks to be passed on."""
    blocks = []
    for package in json.loads(text):
        words = package.get("licenseText") or package.get("license") or ""
        blocks.append(f"{package.get('name')} {package.get('version')}\n{words}")
    return "\n\n".join(blocks)


def write(page: bytes, path: str | Path) -> Path:
    """Write a page to a new file.

    Raises:
        JointplayError: the file exists or cannot be written.
    """
    return files.write(path, page)
