"""Draws docs/images/architecture.svg from the code: python docs/site/architecture.py

Rooms (packages under src/jointplay) from the command line down to the base, what each is for, and
which others it imports, late imports counted.
"""

from __future__ import annotations

import ast
import html
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "jointplay"
PICTURE = ROOT / "docs" / "images" / "architecture.svg"

ROW, TOP, LEFT, CELL, SIZE = 34, 96, 610, 27, 13
INK, LINE, DOT, BOX = "#222222", "#bbbbbb", "#0072B2", "#e8f0f8"


def rooms() -> list[str]:
    """Packages, the one that imports all others first: the layers that are enforced."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    return [name.removeprefix("jointplay.") for name in contracts[0]["layers"]]


def purpose(room: str) -> str:
    """The first sentence of its docstring."""
    text = (SOURCE / room / "__init__.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").split("\n\n")[0].replace("\n", " ")


def imports(room: str) -> set[str]:
    """Other rooms that it imports, in functions too; not what types alone need."""
    found: set[str] = set()
    for path in (SOURCE / room).rglob("*.py"):
        _collect(ast.parse(path.read_text(encoding="utf-8")), found)
    return found - {room}


def _collect(node: ast.AST, found: set[str]) -> None:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            continue
        if isinstance(child, ast.ImportFrom) and child.module:
            parts = child.module.split(".")
            if parts[0] == "jointplay":
                found |= {parts[1]} if len(parts) > 1 else {one.name for one in child.names}
        _collect(child, found)


def picture() -> str:
    """The picture as SVG."""
    names = rooms()
    width, height = LEFT + CELL * len(names) + 20, TOP + ROW * len(names) + 16
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'font-family="sans-serif" font-size="{SIZE}" fill="{INK}">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
        f'<text x="12" y="{TOP - 14}" font-weight="bold">package, and what it is for</text>',
    ]
    for column, name in enumerate(names):
        x = LEFT + CELL * column + CELL // 2
        parts.append(f'<text transform="translate({x + 4},{TOP - 10}) rotate(-60)">{name}</text>')
    for row, name in enumerate(names):
        y = TOP + ROW * row
        words = html.escape(purpose(name))
        parts += [
            f'<rect x="8" y="{y}" width="{LEFT - 16}" height="{ROW - 6}" rx="4" fill="{BOX}"/>',
            f'<text x="16" y="{y + 18}" font-weight="bold">{name}</text>',
            f'<text x="92" y="{y + 18}" font-size="{SIZE - 2}">{words}</text>',
        ]
        needed = imports(name)
        for column, other in enumerate(names):
            x = LEFT + CELL * column + CELL // 2
            if other in needed:
                parts.append(f'<circle cx="{x}" cy="{y + 14}" r="6" fill="{DOT}"/>')
            elif column > row:
                parts.append(f'<circle cx="{x}" cy="{y + 14}" r="2" fill="{LINE}"/>')
            elif column == row:
                parts.append(
                    f'<rect x="{x - 6}" y="{y + 8}" width="12" height="12" fill="{LINE}"/>'
                )
    return "\n".join([*parts, "</svg>", ""])


def main() -> None:
    PICTURE.write_text(picture(), encoding="utf-8")
    print(f"written: {PICTURE}")


if __name__ == "__main__":
    main()
