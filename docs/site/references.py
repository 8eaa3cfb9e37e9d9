"""The page of references, written from docs/references.bib."""

import re
import unicodedata
from pathlib import Path

BIBLIOGRAPHY = Path(__file__).parents[1] / "references.bib"
ACCENTS = {'"': "\u0308", "'": "\u0301", "`": "\u0300", "^": "\u0302", "~": "\u0303", "v": "\u030c"}
_BRACES = r"\{((?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*)\}"


def plain(value):
    """Text of a BibTeX value: accents as letters, braces and escapes gone."""
    value = value.replace(r"\AA", "\u00c5").replace(r"\&", "&").replace(" -- ", " \u2013 ")
    value = re.sub(
        r"""\\(["'`^~v])\{?([A-Za-z])\}?""", lambda m: m.group(2) + ACCENTS[m.group(1)], value
    )
    return unicodedata.normalize("NFC", re.sub(r"[{}]", "", value)).replace("--", "-")


def entries(text=None):
    """Every entry by its key: its fields as plain text, and its `kind`."""
    text = BIBLIOGRAPHY.read_text(encoding="utf-8") if text is None else text
    words = dict(re.findall(rf"@string\{{(\w+) = {_BRACES}\}}", text))
    found = {}
    for kind, key, body in re.findall(r"^@(\w+)\{(\w+),\n(.*?)^\}", text, re.M | re.S):
        fields = {"kind": kind}
        for name, value, word in re.findall(rf"(\w+) = (?:{_BRACES}|(\w+))", body):
            fields[name] = plain(words[word] if word else value)
        if key in found:
            raise ValueError(f"{key} is declared twice")
        found[key] = fields
    return found


def authors(entry):
    """Names with their initials, in order."""
    names = []
    for one in filter(None, entry.get("author", "").split(" and ")):
        family, _, given = one.partition(", ")
        initials = re.sub(r"(\w)\w*\.?", r"\1.", given).replace(". -", ".-")
        names.append(f"{initials} {family}".strip())
    return names


def shown(entry):
    """One entry as it is printed."""
    parts = [", ".join(authors(entry)), f"*{entry['title']}*"]
    if "journal" in entry:
        volume = " ".join(filter(None, [entry["journal"], entry.get("volume")]))
        parts.append(" ".join([volume, f"({entry['year']})", entry.get("pages", "")]).strip())
    else:
        editors = " and ".join(authors({"author": entry.get("editor", "")}))
        source = [
            entry.get("booktitle", "") + (f" (ed. {editors})" if editors else ""),
            entry.get("institution") or entry.get("publisher") or entry.get("school"),
            entry.get("number") or entry.get("howpublished"),
            f"arXiv {entry['eprint']}" if "eprint" in entry else "",
            entry["year"],
            entry.get("pages"),
        ]
        parts.append(", ".join(filter(None, source)))
    doi = f" [doi {entry['doi']}](https://doi.org/{entry['doi']})" if "doi" in entry else ""
    note = f" ({entry['note']})" if "note" in entry else ""
    return f"{', '.join(filter(None, parts))}{note}.{doi}"


def page():
    """The page, by author and year."""
    found = sorted(
        entries().items(), key=lambda item: (item[1].get("author", "~"), item[1]["year"])
    )
    lines = [
        "# References",
        "",
        "Everything that code and pages cite, and which part of it was read. *Seen in* names where "
        "it was read; what was *not seen* is from memory or from works that cite it. This page is "
        "generated from `docs/references.bib`.",
        "",
        "| reference | read |",
        "| --- | --- |",
    ]
    lines += [f"| {shown(entry)} | {entry['seen']} |".replace("\n", " ") for _, entry in found]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(page())
