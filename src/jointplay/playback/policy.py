"""What a page may do, as browsers enforce: run its own scripts, told by hashes, and no others.

A page holds names from files of others. They are escaped; should one ever get through, it still
cannot run as a script, nor send anything anywhere.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable

from markupsafe import Markup


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
