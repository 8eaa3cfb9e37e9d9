"""What the pages show: their blocks of code, the commands in them, and what those print."""

import re
from collections import namedtuple
from itertools import zip_longest
from pathlib import Path
from textwrap import dedent

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]

FENCE = re.compile(r"^( *)```(python|sh|text|console|xml)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
Block = namedtuple("Block", "language text start line")


def blocks(page, *languages):
    """Blocks of code of a page, and where they are."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(m[2], dedent(m[3]), m.start(), text.count("\n", 0, m.start()) + 1)
        for m in FENCE.finditer(text)
        if m[2] in languages
    ]


def named(block, text):
    """The file that the line before a block says to save it as, if it does."""
    before = text[: block.start].rstrip().splitlines()[-1] if block.start else ""
    found = re.search(r"(?:[Ss]ave (?:it|this) as|Put it in) `([\w.]+)`", before)
    return found[1] if found and block.language != "sh" else None


def commands(text):
    """The commands of a block, comments and continuations gone."""
    lines = re.sub(r"\\\n|(?<=&&)\n", " ", text).splitlines()
    plain = [line.replace(".venv/bin/", "").removeprefix("$ ") for line in lines]
    whole = [re.sub(r"\s+#\s.*$", "", line).strip() for line in plain]
    return [line for line in whole if line and not line.startswith("#")]


def command(page, beginning):
    """The command of a page that begins so."""
    found = [
        " ".join(line.split())
        for block in blocks(page, "sh", "text", "console")
        for line in commands(block.text)
        if line.startswith(beginning)
    ]
    if not found:
        raise ValueError(f"{page} has no command that begins with {beginning!r}")
    return found[0]


def answers(page):
    """Commands of a page, each with the first line that it prints, if the page shows it.

    Below a dollar sign stands what a command prints; below a block of one command the next block.
    """
    every = blocks(page, "python", "sh", "text", "console")
    for block, after in zip_longest(every, every[1:]):
        lines = commands(block.text)
        if block.text.startswith("$ "):
            for part in block.text.removeprefix("$ ").split("\n$ "):
                typed, *printed = commands(part)
                yield typed, _first(printed)
        elif block.language == "sh" and len(lines) == 1 and after and after.language == "text":
            yield lines[0], _first(after.text.splitlines())
        elif block.language == "sh":
            yield from ((line, "") for line in lines)


def _first(lines):
    return next((line.strip() for line in lines if line.strip(" .")), "")
