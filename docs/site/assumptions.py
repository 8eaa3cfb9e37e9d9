"""Write into docs/assumptions.md what reports assume: `show/reports/assumptions.toml`."""

from pathlib import Path

from jointplay.show.reports.sections import page_section

PAGE = Path(__file__).parents[1] / "assumptions.md"
BEGIN, END = "<!-- begin: written by docs/site/assumptions.py -->\n", "<!-- end -->\n"


def renewed(text):
    """The page with its table as it should be."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{page_section()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
