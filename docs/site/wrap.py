"""Prose of the documentation in lines of at most 100 columns: `python docs/site/wrap.py` wraps it.

Code, formulas, tables, HTML and links that are longer stay as they are; so does the paper's study,
which a program writes.
"""

import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[2]
WIDTH = 99
WRITTEN = ("paper.md",)
"""Pages that programs write."""
_WHOLE = re.compile(r"`[^`\n]+`|\$[^$\n]+\$|!?\[[^\]\n]*\]\([^)\n]*\)")
_ITEM = re.compile(r"^(\s*)([-*+]|\d+[.)])\s+")
_FENCE = re.compile(r"^\s*(```|~~~|\$\$)")
_KEPT = re.compile(r"^\s*(\||#|<|!\[|\[[^\]]+\]:|>|\$\$)|^ {4,}\S|^---$")


def pages():
    """All pages whose prose is wrapped."""
    every = (ROOT / "docs").rglob("*.md")
    found = [one for one in every if one.name not in WRITTEN]
    return [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
        *sorted(found),
        ROOT / "benchmarks" / "README.md",
    ]


def blocks(text):
    """Runs of lines: (whether they are prose, the lines)."""
    run, prose, fence = [], None, ""
    for line in text.split("\n"):
        bare, border = line.strip(), _FENCE.match(line)
        inside = bool(fence or border)
        if fence:  # a formula may end behind its last line
            closes = bare.endswith("$$") if fence == "$$" else bool(border) and border[1] == fence
            fence = "" if closes else fence
        elif border and not (border[1] == "$$" and bare != "$$" and bare.endswith("$$")):
            fence = border[1]
        kind = not inside and bool(line.strip()) and not _KEPT.match(line)
        if kind and run and prose and _ITEM.match(line):
            yield True, run
            run = []
        if prose is not None and kind != prose:
            yield prose, run
            run = []
        prose = kind
        run.append(line)
    yield bool(prose), run


def wrapped(lines):
    """The same prose in lines of `WIDTH`; what belongs together stays together."""
    found = _ITEM.match(lines[0])
    first = found[0] if found else re.match(r"\s*", lines[0])[0]
    rest = " " * len(first)
    if len(lines) > 1 and not found:
        rest = first
    words = " ".join([lines[0][len(first) :], *(line.strip() for line in lines[1:])])
    words = _WHOLE.sub(lambda m: m[0].replace(" ", "\0"), words)
    made = textwrap.wrap(
        words, WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    # A line that begins like an item, a title or a quotation would become one.
    if any(re.match(r"\s*([-*+>#]|\d+[.)])\s", line) for line in made[1:]):
        return lines
    return [line.replace("\0", " ") for line in made]


def long_lines(text):
    """Lines of prose that are too long, and could be shorter."""
    found = []
    for prose, lines in blocks(text):
        if prose and any(len(line) > WIDTH + 1 for line in lines) and wrapped(lines) != lines:
            found += [line for line in lines if len(line) > WIDTH + 1]
    return found


def rewritten(text):
    """The text with blocks wrapped that have a line that is too long."""
    out = []
    for prose, lines in blocks(text):
        long = prose and any(len(line) > WIDTH + 1 for line in lines)
        out += wrapped(lines) if long else lines
    return "\n".join(out)


def main():
    for page in pages():
        text = page.read_text(encoding="utf-8")
        made = rewritten(text)
        if made != text:
            page.write_text(made, encoding="utf-8")
            print(page.relative_to(ROOT), file=sys.stderr)


if __name__ == "__main__":
    main()
