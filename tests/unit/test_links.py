"""Every link between the documents leads somewhere."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
_LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]*))?\)")


def anchors(page: Path) -> set[str]:
    """Names of a page's headings, as they stand in links."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(page: Path) -> list[str]:
    """Links of a page to a file or a heading that is not there."""
    found = []
    for path, anchor in _LINK.findall(page.read_text(encoding="utf-8")):
        target = page.parent / path if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            found.append(f"{path}#{anchor}" if anchor else path)
    return found


class TestLinks:
    def test_each_leads_to_a_file_and_a_heading_that_are_there(self) -> None:
        found = {str(page.relative_to(ROOT)): links for page in PAGES if (links := broken(page))}
        assert found == {}

    def test_one_that_leads_nowhere_is_found(self, tmp_path: Path) -> None:
        page = tmp_path / "page.md"
        page.write_text("# One two\n[a](#one-two) [b](#three) [c](gone.md) [d](https://x.org)\n")
        assert broken(page) == ["#three", "gone.md"]


HEADINGS = [
    "## Context",
    "## Decision",
    "## Consequences",
    "## Alternatives",
    "## References",
]


class TestDecisions:
    def test_each_has_the_same_form(self) -> None:
        notes = sorted((ROOT / "docs/decisions").glob("*.md"))
        assert len(notes) > 60
        other = {}
        for note in notes:
            title, status, *rest = note.read_text(encoding="utf-8").splitlines()
            headings = [line for line in rest if line.startswith("## ")]
            well = title.startswith(f"# {note.name[:4]} ")
            if not well or not re.match(r"Status: .+   Area: .+", status) or headings != HEADINGS:
                other[note.name] = [title, status, *headings]
        assert other == {}
