"""Self-contained web pages with meshcat's viewer, and the content security policy of all pages.

The policy lets a browser run a page's own scripts, known by their hashes, and nothing else. A page
holds names from files of unknown origin. They are escaped; should one ever get through, it still
cannot run as a script, nor send anything anywhere.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from jointplay.show.player.playback import Packed
from jointplay.show.plots.names import MODE_MEANINGS, MODE_TERMS, MODES
from jointplay.show.plots.palette import MODE_COLOURS


def policy(scripts: Iterable[str], connect: str = "") -> Markup:
    """The content security policy of a page with these scripts; `connect` lists what it may fetch,
    such as ``data:``."""
    digests = (hashlib.sha256(script.encode("utf-8")).digest() for script in scripts)
    hashes = " ".join(f"'sha256-{base64.b64encode(digest).decode('ascii')}'" for digest in digests)
    rules = {
        "default-src": "'none'",
        "script-src": hashes,
        "style-src": "'unsafe-inline'",
        "img-src": "data: blob:",
        "connect-src": connect or "'none'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return Markup("; ".join(f"{name} {value}" for name, value in rules.items()))


def as_script(source: str) -> Markup:
    """A script's or style sheet's source for its element in a page, with no end tag in it."""
    return Markup(
        source.replace("\r\n", "\n").replace("\r", "\n").replace("</script", "<\\/script")
    )


def as_data(json: str) -> Markup:
    """JSON for a script element, without "<", which alone could end the element."""
    return Markup(json.replace("<", "\\u003c"))


_COMPONENTS = ("page.js", "tracks.js", "stage.js", "closeup.js", "rolling.js")
_PACKAGE = "jointplay.show.player"
_SHARED = resources.files(_PACKAGE) / "static"
_VIEWER = resources.files("meshcat") / "viewer" / "dist"


def static(name: str, folder: Traversable = _SHARED) -> str:
    """The text of a page's file, by default one that several pages share."""
    return (folder / name).read_text("utf-8")


def components() -> str:
    """The scripts that draw robots and close-ups, without the player, and the table of modes."""
    modes = [
        {"name": name, "term": term, "meaning": meaning, "colour": int(colour[1:], 16)}
        for name, term, meaning, colour in zip(
            MODES, MODE_TERMS, MODE_MEANINGS, MODE_COLOURS, strict=True
        )
    ]
    return "\n".join((f"const MODES = {json.dumps(modes)};", *map(static, _COMPONENTS)))


def render(scene: Packed, title: str) -> bytes:
    """The page that plays `scene`, HTML in UTF-8, with everything inside: viewer, tracks, meshes,
    licences. Its policy forbids the browser any request to a server.
    """
    player = "\n".join((components(), static("player.js")))
    script = f'"use strict";\n{{\nconst {{THREE}} = MeshCat;\n{player}\n}}'
    look = static("player.css")
    return filled(_PACKAGE, title, look, scene.contents, scene.block, script, "data: blob:")


def filled(
    package: str, title: str, style: str, contents: Any, block: bytes, script: str, more: str
) -> bytes:
    """The page by the template of `package`, whose script runs after meshcat's viewer (which
    includes three.js); `more` is what it may fetch."""
    loader = ChoiceLoader([PackageLoader(name, "static") for name in (package, _PACKAGE)])
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined)
    run = [as_script(static("main.min.js", _VIEWER)), as_script(script)]
    page = environment.get_template("page.html").render(
        policy=policy(run, connect=more),
        title=title,
        style=as_script(style),
        contents=as_data(json.dumps(contents, separators=(",", ":"))),
        block=base64.b64encode(block).decode("ascii"),
        licences=licences(),
        scripts=run,
    )
    return page.encode("utf-8")


def licences() -> Markup:
    """Licences of meshcat's viewer and of the packages in it, for a comment in a page."""
    packages = json.loads((_VIEWER / "main.min.js.THIRD_PARTY_LICENSES.json").read_text("utf-8"))
    texts = (_VIEWER / "main.min.js.LICENSE.txt").read_text("utf-8") + "\n\n".join(
        f"{package.get('name')} {package.get('version')}\n"
        f"{package.get('licenseText') or package.get('license') or ''}"
        for package in packages
    )
    return Markup(texts.replace("--", "- -"))
