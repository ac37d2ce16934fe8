"""The terminal: results as tables."""

from __future__ import annotations

import json

import pytest

from app.commands.terminal import MAX_MISSING, print_export

REPORT = {
    "out": "out",
    "counts": {"groups": 2},
    "missing_images": [f"match, {number}.png: is no image" for number in range(MAX_MISSING + 3)],
}


class TestPrintExport:
    def test_names_the_first_missing_images_and_counts_the_others(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        print_export(REPORT, False)
        lines = capsys.readouterr().out.splitlines()
        assert lines[2].split() == ["missing", "images", str(MAX_MISSING + 3)]
        assert lines[3] == "  match, 0.png: is no image"
        assert lines[-2] == f"  match, {MAX_MISSING - 1}.png: is no image"
        assert lines[-1] == "  and 3 more; --json names them all"

    def test_json_is_one_document_with_all_of_them(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        print_export(REPORT, True)
        assert json.loads(capsys.readouterr().out) == REPORT

    def test_nothing_missing_adds_no_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        print_export({**REPORT, "missing_images": ()}, False)
        assert len(capsys.readouterr().out.splitlines()) == len(REPORT)
