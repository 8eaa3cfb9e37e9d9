"""Hooks of the documentation site: links that leave docs/, formulas as MathML, lines that wrap."""

import html
import re
from pathlib import Path

import latex2mathml.converter

PAGES = {
    "SECURITY.md": "reference/security.md",
    "CHANGELOG.md": "reference/changes.md",
    "benchmarks/README.md": "reference/benchmarks.md",
}
"""Files outside docs/ that have a page of the site."""

_LINK = re.compile(r"\]\((?:\.\./)+((?:SECURITY|CHANGELOG|benchmarks/)[^)#]*)(#[^)]*)?\)")
_FILE = re.compile(r"\[\w+\.md\]\(([^)#]+\.md)")
_STRANGE = re.compile(
    r"<script[^>]*>(?:(?!</script>).)*?https?://cdnjs(?:(?!</script>).)*?</script>", re.S
)
_SOURCE = re.compile(r'(<a href="(?:\.\./)+\w+)\.md(?=["#])')
_FORMULA = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.S)
_PRINTED = re.compile(
    r'(<div class="language-(?:text|console) highlight"><pre><span></span><code>)(.*?)(</code>)',
    re.S,
)
_COLUMNS = re.compile(r"[^\s>] {2,}\S")
"""Two spaces within a line: it is aligned with others and must not wrap."""
_INLINE = re.compile(r"<code>[^<]*</code>")
_TYPED = re.compile(r'<div class="language-(?:sh|console) highlight">.*?</div>', re.S)
_OPTION = re.compile(r"(?<=[ >])--\w[\w-]*")


DOORS = {"reference/": "reference.md", "law_cards/": "reference.md"}
"""Pages that programs write, by folder, and the door behind which they are."""
_PLACE = re.compile(r"\]\(([^)#]+\.(?:md|ipynb))[#)]")


def on_nav(nav, files, **_):
    """Pages that are not in the navigation are behind the first door whose page links to them."""
    for door in filter(lambda item: item.is_section, nav.items):
        index = door.children[0].file
        linked = set(_PLACE.findall(Path(index.abs_src_path).read_text("utf-8")))
        for file in files.documentation_pages():
            written = any(DOORS[it] == index.src_uri for it in DOORS if file.src_uri.startswith(it))
            if file.page.parent is None and (file.src_uri in linked or written):
                file.page.parent = door
    return nav


def on_page_markdown(markdown, page, **_):
    """Links out of docs/ go to the page that shows the file; names of pages become their titles."""
    if page.is_homepage:
        page.meta["hide"] = ["navigation", "toc"]
    folder = Path(page.file.abs_src_path or "").parent

    def titled(link):
        file = folder / link[1]
        if not file.exists():
            return link[0]
        heading = file.read_text("utf-8").partition("\n")[0].lstrip("# ")
        return f"[{heading.partition(':')[0]}]({link[1]}"

    up = "../" * page.file.src_uri.count("/")

    def inside(link):
        target, anchor = link[1], link[2] or ""
        if target in PAGES:
            return f"]({up}{PAGES[target]}{anchor})"
        return f"]({up}{PAGES['benchmarks/README.md']})"

    return _LINK.sub(inside, _FILE.sub(titled, markdown))


def on_page_content(content, **_):
    """Formulas become MathML, which browsers draw without any script; options stay in one line."""

    def drawn(formula):
        block = formula[1] == "div"
        text = html.unescape(formula[2].strip())[2:-2]
        return latex2mathml.converter.convert(text, display="block" if block else "inline")

    def sentences(block):
        lines = block[2].split("\n")
        wrapped = (
            line if _COLUMNS.search(line) else f'<span class="prints">{line}</span>'
            for line in lines
        )
        return block[1] + "\n".join(wrapped) + block[3]

    def whole(code):
        return _OPTION.sub(lambda one: f'<span class="option">{one[0]}</span>', code[0])

    content = _PRINTED.sub(sentences, _FORMULA.sub(drawn, content))
    return _TYPED.sub(whole, _INLINE.sub(whole, content))


def on_post_page(output, page, **_):
    """Pages of notebooks: without a script that fetches another one, links to pages as built."""
    if page.file.src_uri.endswith(".ipynb"):
        output = _SOURCE.sub(r"\1.html", output)
    return _STRANGE.sub("", output)
