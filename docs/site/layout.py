"""Whether every page of the built site can be read at the widths of a laptop and of a phone.

python docs/site/layout.py SITE

Names the pages that scroll sideways as a whole, what leaves the text's column, and text that is cut
without a way to reach it. Needs playwright and Chromium; without Chromium it says so and passes.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

WIDTHS_PX = (1280, 400)
FAULTS = """() => {
    const found = [], wide = document.documentElement;
    if (wide.scrollWidth > wide.clientWidth + 1) found.push(`is ${wide.scrollWidth} px wide`);
    const text = document.querySelector("article");
    const words = e => `<${e.tagName.toLowerCase()}> ${(e.textContent || "").trim().slice(0, 40)}`;
    for (const e of text ? text.querySelectorAll("*") : []) {
        const style = getComputedStyle(e);
        if (e.clientWidth > 5 && style.overflowX === "hidden" && e.scrollWidth > e.clientWidth + 2)
            found.push(`cuts ${words(e)}`);
    }
    return found;
}"""


def faults(page, site):
    """Of each page of the site, at the width that `page` has: what cannot be read."""
    for file in sorted(site.rglob("*.html")):
        page.goto(file.as_uri())
        for fault in page.evaluate(FAULTS):
            yield f"{file.relative_to(site)} {fault}"


def main(site):
    """Print what is wrong; returns the number of faults."""
    chromium = shutil.which("chromium")
    if chromium is None:
        print("no chromium: the layout of the pages is not checked")
        return 0
    found = []
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for width in WIDTHS_PX:
            page = browser.new_page(viewport={"width": width, "height": 900})
            found += [f"at {width} px {fault}" for fault in faults(page, site)]
        browser.close()
    print("\n".join(found) or "every page can be read at every width")
    return len(found)


if __name__ == "__main__":
    sys.exit(bool(main(Path(sys.argv[1]).resolve())))
