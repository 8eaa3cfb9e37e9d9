"""Every citation in the tree is declared in docs/references.bib, with what of it was read."""

import io
import re
import runpy
import tokenize
import unicodedata
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = runpy.run_path(str(ROOT / "docs" / "site" / "references.py"))
DECLARED = SCRIPT["entries"]()
NEEDED = {
    "article": {"journal"},
    "book": {"publisher"},
    "incollection": {"booktitle", "editor"},
    "inproceedings": {"booktitle"},
    "misc": set(),
    "phdthesis": {"school"},
    "techreport": {"institution", "number"},
}
PLACES = ("src", "docs", "benchmarks", "tests", "urdf", "paper")
SUFFIXES = {".py", ".md", ".toml", ".urdf"}
YEAR = r"(?:18[5-9]|19\d|20[0-2])\d"
NO_CITATION = re.compile(
    r"RecurDyn 2023|(?:May|November) 20\d\d|seed 20\d\d|Browsers of 20\d\d|urdf2webots 2025"
)


def bare(text):
    """Letters without accents, and Poeschel as Pöschel."""
    kept = unicodedata.normalize("NFKD", text.replace("oe", "o").replace("ß", "ss"))
    return "".join(c for c in kept if not unicodedata.combining(c)).lower()


def families(entry):
    return [name.partition(", ")[0] for name in entry.get("author", "").split(" and ") if name]


def names_of(key):
    """What in a text can stand for it."""
    entry = DECLARED[key]
    known = [*families(entry), entry["title"], entry.get("number"), entry.get("doi")]
    return [bare(word) for word in known if word]


FAMILIES = {bare(name) for entry in DECLARED.values() for name in families(entry)}
DOIS = {entry["doi"]: key for key, entry in DECLARED.items() if "doi" in entry}


def prose(path):
    """What a person reads of a file: of code its comments and strings, on one line."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        kept = (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", -1))
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        text = "".join(one.string if one.type in kept else "\n" for one in tokens)
        text = re.sub(r"\n\s+", "\n", text)
        text = re.sub(r'["\'][ \t]*\nf?["\']', "", text)
    text = re.sub(r"\n[ \t]*#", "\n", text)
    return NO_CITATION.sub("", re.sub(r"[\s*_]+", " ", text))


def problems(text):
    """Citations in a text that are not declared; and the keys of those that are."""
    found, cited = [], set()

    def of(year, volume=None, first=None, last=None):
        """Keys of what has these."""
        for key, entry in DECLARED.items():
            start, _, end = entry.get("pages", "").partition("-")
            number = re.split(r"[ -]", entry.get("number", ""))[-1]  # of a report
            if entry["year"] != year or volume not in (None, entry.get("volume"), number):
                continue
            if first in (None, start) and last in (None, end):
                yield key

    def need(keys, what):
        keys = list(keys)
        cited.update(keys)
        if not keys:
            found.append(what)

    # 42 (1975) 440-445, and 2023, 13(4), 2211, and 181, 259-270
    for m in re.finditer(rf"(?<!\.)\b(\d+) \(({YEAR})\)(?:,? (\d+)(?:-(\d+))?)?", text):
        need(of(m[2], m[1], m[3], m[4]), m[0])
    for m in re.finditer(rf"\b({YEAR}), (\d+)\(\d+\), (\d+)", text):
        need(of(m[1], m[2], m[3]), m[0])
    # a year in the manner of a citation, after its authors
    for m in re.finditer(rf"(?:\(|, |[a-z.] )({YEAR})(?=\s?[).,;:(\"']| at | for |$)", text):
        near = bare(text[max(0, m.start() - 260) : m.end() + 60])
        by_name = [key for key in of(m[1]) if any(word in near for word in names_of(key))]
        need(by_name, text[max(0, m.start() - 60) : m.end() + 5])
    # initials and a family name
    person = r"\b(?:[A-Z]\.[- ]?)+ ?([A-Z][\w'-]+(?: de Wit| Kamphorst)?)"
    for m in re.finditer(rf"{person}(?=[,;)(']| and [A-Z]| et al)", text):
        if bare(m[1]).removesuffix("'s") not in FAMILIES:
            found.append(m[0])
    for m in re.finditer(r"\b10\.\d{4,}/[\w./()-]*\w", text):
        doi = m[0] if m[0] in DOIS else m[0].rstrip(")")
        need([DOIS[doi]] if doi in DOIS else [], m[0])
    for m in re.finditer(r"arXiv:? ?(\d{4}\.\d{5})", text):
        need([k for k, e in DECLARED.items() if e.get("eprint") == m[1]], m[0])
    standard = r"\b(?:ISO|ASTM|NACA|ESDU|DIN|VDI) (?:TN |Technical Note )?(D?\d{3,})"
    for m in re.finditer(standard, text):
        need([k for k, e in DECLARED.items() if e.get("number", "").endswith(m[1])], m[0])
    cited.update(key for key in DECLARED if f"@{key}" in text)
    cited.update(key for key, entry in DECLARED.items() if entry.get("url", "?") in text)
    return found, cited


def files():
    for place in PLACES:
        for path in sorted((ROOT / place).rglob("*")):
            if path.suffix in SUFFIXES and path.name != Path(__file__).name:
                yield path
    yield from sorted(ROOT.glob("*.md"))


@pytest.fixture(scope="module")
def tree():
    return {path: problems(prose(path)) for path in files() if path.name != "CHANGELOG.md"}


def test_every_citation_is_declared(tree):
    wrong = [f"{path.relative_to(ROOT)}: {what}" for path, (bad, _) in tree.items() for what in bad]
    assert wrong == [], "declare it in docs/references.bib:\n" + "\n".join(wrong)


def test_what_is_declared_is_cited(tree):
    cited = set().union(*(keys for _, keys in tree.values()))
    assert set(DECLARED) - cited == set()


@pytest.mark.parametrize("key", DECLARED)
def test_every_reference_says_what_of_it_was_read(key):
    entry = DECLARED[key]
    assert re.match(r"(seen in|not seen)\b", entry["seen"])
    assert entry["title"]
    assert re.fullmatch(YEAR, entry["year"])
    assert NEEDED[entry["kind"]] <= set(entry)
    assert "author" in entry or "note" in entry or "abstract" in entry["seen"]
    assert entry["seen"] in SCRIPT["page"]()


@pytest.mark.parametrize(
    "text",
    [
        "J. Doe, J. Appl. Mech. 42 (1976) 440-445",
        "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-446",
        "a new law (Doe and Roe, 2019), for all",
        "Doe et al. (2011)",
        "A. Nobody, On nothing, in press",
        "see doi 10.1000/182",
        "arXiv 2312.03909",
        "by ISO 9284",
        "Appl. Sci. 2023, 13(4), 2212",
    ],
)
def test_a_citation_that_nobody_declared_is_found(text):
    assert problems(text)[0]


def test_the_citation_file_names_the_paper_as_it_is_declared():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    paper = DECLARED["wang2023"]
    assert f"doi: {paper['doi']}" in text
    for name in families(paper):
        assert f"family-names: {name}\n" in text
