"""Take the page of a study, `jointplay scara --out DIR`, into these pages: `paper.py DIR`."""

import re
import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).parents[1]
PICTURES = "images/paper"


def main(study: Path) -> None:
    """Copy the page, its pictures and the claims."""
    text = (study / "paper.md").read_text(encoding="utf-8")
    folder = DOCS / PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    for name in re.findall(r"\]\((fig\w+\.png)\)", text):
        shutil.copyfile(study / name, folder / name)
    (DOCS / "paper.md").write_text(text.replace("](fig", f"]({PICTURES}/fig"), encoding="utf-8")
    shutil.copyfile(study / "claims.md", DOCS / "claims.md")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
