"""Make the pictures of the docs small: python docs/site/compress.py

A picture is drawn with at most 256 colours, which lines and letters do not show. Pictures that have
been through this, or would not get smaller, stay as they are.
"""

import io
import sys
from pathlib import Path

from PIL import Image, PngImagePlugin

COLOURS = 256
GAIN = 0.9
"""Only what gets smaller than this part of its size is written."""

DOCS = Path(__file__).parents[1]


def compressed(data: bytes) -> bytes:
    """The same picture with a palette, its remarks kept."""
    picture = Image.open(io.BytesIO(data))
    if picture.mode == "P":
        return data
    small = picture.convert("RGB").quantize(COLOURS, Image.Quantize.MEDIANCUT, dither=0)
    remarks = PngImagePlugin.PngInfo()
    for name, text in picture.info.items():
        if isinstance(text, str):
            remarks.add_text(name, text)
    out = io.BytesIO()
    small.save(out, "PNG", optimize=True, dpi=picture.info.get("dpi", (100, 100)), pnginfo=remarks)
    return out.getvalue()


def main() -> int:
    """Compress all, and say what it brought."""
    before = after = 0
    for path in sorted(DOCS.rglob("*.png")):
        data = path.read_bytes()
        small = compressed(data)
        if len(small) < GAIN * len(data):
            path.write_bytes(small)
            before, after = before + len(data), after + len(small)
    print(f"{before / 1e6:.2f} MB made {after / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
