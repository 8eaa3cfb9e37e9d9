"""A scene as one self-contained web page: no server, no network."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable
from functools import cache
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from jointplay.show.player.scene import Packed
from jointplay.show.plots.names import MODE_MEANINGS, MODE_TERMS, MODES
from jointplay.show.plots.palette import MODE_COLOURS

# What a page may do, as browsers enforce: run its own scripts, told by hashes, and no others.
#
# A page holds names from files of others. They are escaped; should one ever get through, it still
# cannot run as a script, nor send anything anywhere.


def policy(scripts: Iterable[str], connect: str = "") -> Markup:
    """The content security policy of a page with just these scripts.

    Args:
        scripts: text of each of its script elements that is run.
        connect: what it may fetch besides: schemes of its own content, such as ``data:``.
    """
    hashes = " ".join(f"'sha256-{_digest(script)}'" for script in scripts)
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


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def as_script(source: str) -> Markup:
    """Source of ours to stand in a script element, which nothing in it may end."""
    return Markup(
        source.replace("\r\n", "\n").replace("\r", "\n").replace("</script", "<\\/script")
    )


def as_data(json: str) -> Markup:
    """JSON to stand in a script element: in it only "<" could end the element."""
    return Markup(json.replace("<", "\\u003c"))


_COMPONENTS = ("tracks.js", "stage.js", "closeup.js", "rolling.js")
_OWN = resources.files("jointplay.show.player") / "static"


def components() -> str:
    """Scripts that show robots and close-ups, without a player: tracks, stage, close-ups.

    With what they share with figures and reports: the modes of joints, by name and colour.
    """
    modes = [
        {"name": name, "term": term, "meaning": meaning, "colour": int(colour[1:], 16)}
        for name, term, meaning, colour in zip(
            MODES, MODE_TERMS, MODE_MEANINGS, MODE_COLOURS, strict=True
        )
    ]
    sources = ((_OWN / name).read_text("utf-8") for name in _COMPONENTS)
    return "\n".join((f"const MODES = {json.dumps(modes)};", *sources))


def render(scene: Packed, title: str) -> bytes:
    """The page that plays `scene`, HTML in UTF-8.

    Everything is inside: meshcat's viewer with three.js, tracks, meshes, licences. Its content
    security policy forbids the browser any request.
    """
    bundle = resources.files("meshcat") / "viewer" / "dist"
    player = "\n".join((components(), (_OWN / "player.js").read_text("utf-8")))
    scripts = [
        as_script((bundle / "main.min.js").read_text("utf-8")),
        as_script(f'"use strict";\n{{\nconst {{THREE}} = MeshCat;\n{player}\n}}'),
    ]
    page = _template().render(
        policy=policy(scripts, connect="data: blob:"),
        title=title,
        style=as_script((_OWN / "player.css").read_text("utf-8")),
        contents=as_data(json.dumps(scene.contents, separators=(",", ":"))),
        block=base64.b64encode(scene.block).decode("ascii"),
        licences=licences(),
        scripts=scripts,
    )
    return page.encode("utf-8")


@cache
def _template() -> Template:
    made = Environment(
        loader=PackageLoader("jointplay.show.player", "static"),
        autoescape=True,
        undefined=StrictUndefined,
    )
    return made.get_template("page.html")


def licences() -> Markup:
    """Licences of meshcat's viewer and what it bundles, to stand in a comment of a page."""
    bundle = resources.files("meshcat") / "viewer" / "dist"
    texts = (bundle / "main.min.js.LICENSE.txt").read_text("utf-8") + _licence_texts(
        (bundle / "main.min.js.THIRD_PARTY_LICENSES.json").read_text("utf-8")
    )
    return Markup(texts.replace("--", "- -"))


def _licence_texts(text: str) -> str:
    """Each bundled package with its licence, which asks to be passed on."""
    blocks = []
    for package in json.loads(text):
        words = package.get("licenseText") or package.get("license") or ""
        blocks.append(f"{package.get('name')} {package.get('version')}\n{words}")
    return "\n\n".join(blocks)
