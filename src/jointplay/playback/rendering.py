"""A scene as one self-contained web page: no server, no network."""

from __future__ import annotations

import base64
import json
from functools import cache
from importlib import resources
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from jointplay.host import files
from jointplay.playback.policy import as_data, as_script, policy
from jointplay.playback.scene import Scene

_SCRIPTS = ("tracks.js", "stage.js", "closeup.js", "player.js")


def render(scene: Scene, title: str) -> bytes:
    """The page that plays `scene`, HTML in UTF-8.

    Everything is inside: meshcat's viewer with three.js, tracks, meshes, licences. Its content
    security policy forbids the browser any request.
    """
    own = resources.files("jointplay.playback") / "static"
    bundle = resources.files("meshcat") / "viewer" / "dist"
    licences = (bundle / "main.min.js.LICENSE.txt").read_text("utf-8") + _licence_texts(
        (bundle / "main.min.js.THIRD_PARTY_LICENSES.json").read_text("utf-8")
    )
    player = "\n".join((own / name).read_text("utf-8") for name in _SCRIPTS)
    scripts = [
        as_script((bundle / "main.min.js").read_text("utf-8")),
        as_script(f'"use strict";\n{{\nconst {{THREE}} = MeshCat;\n{player}\n}}'),
    ]
    page = _template().render(
        policy=policy(scripts, connect="data: blob:"),
        title=title,
        style=as_script((own / "player.css").read_text("utf-8")),
        contents=as_data(json.dumps(scene.contents, separators=(",", ":"))),
        block=base64.b64encode(scene.block).decode("ascii"),
        licences=Markup(licences.replace("--", "- -")),  # those of what is bundled
        scripts=scripts,
    )
    return page.encode("utf-8")


@cache
def _template() -> Template:
    made = Environment(
        loader=PackageLoader("jointplay.playback", "static"),
        autoescape=True,
        undefined=StrictUndefined,
    )
    return made.get_template("page.html")


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
