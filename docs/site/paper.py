"""Take the page of a study, `jointplay scara --out DIR`, into these pages: `paper.py DIR`."""

import re
import sys
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).parents[1]
PICTURES = "images/paper"
WIDTH, COLOURS = 800, 64
"""Of the pictures [px], which few colours are enough for."""


def main(study: Path) -> None:
    """Copy the page and its pictures."""
    text = (study / "paper.md").read_text(encoding="utf-8")
    folder = DOCS / PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    for name in re.findall(r"\]\((fig\w+\.png)\)", text):
        picture = Image.open(study / name).convert("RGB")
        size = (WIDTH, round(picture.height * WIDTH / picture.width))
        small = picture.resize(size, Image.Resampling.LANCZOS)
        small = small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=0)
        small.save(folder / name, optimize=True)
    (DOCS / "paper.md").write_text(linked(text), encoding="utf-8")


def linked(text: str) -> str:
    """The text with links to the pictures and to the pages that it names."""
    text = re.sub(r"docs/(\w+\.md)", r"[\1](\1)", text)
    return text.replace("](fig", f"]({PICTURES}/fig")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
