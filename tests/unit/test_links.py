"""Every link between the documents leads somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

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
    @pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
    def test_each_leads_to_a_file_and_a_heading_that_are_there(self, page: Path) -> None:
        assert broken(page) == []

    def test_one_that_leads_nowhere_is_found(self, tmp_path: Path) -> None:
        page = tmp_path / "page.md"
        page.write_text("# One two\n[a](#one-two) [b](#three) [c](gone.md) [d](https://x.org)\n")
        assert broken(page) == ["#three", "gone.md"]


class TestDecisions:
    @pytest.mark.parametrize(
        "note", sorted((ROOT / "docs/decisions").glob("*.md")), ids=lambda note: note.name
    )
    def test_each_has_the_same_form(self, note: Path) -> None:
        title, status, *rest = note.read_text(encoding="utf-8").splitlines()
        assert title.startswith(f"# {note.name[:4]} ")
        assert re.match(r"Status: .+   Area: .+", status)
        headings = [line for line in rest if line.startswith("## ")]
        assert headings == [
            "## Context",
            "## Decision",
            "## Consequences",
            "## Alternatives",
            "## References",
        ]
