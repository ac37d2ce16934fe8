"""The terminal: results as tables."""

from __future__ import annotations

import io
import json
import re
import signal
from collections.abc import Iterator

import pytest

from app.terminal.terminal import (
    MAX_MISSING,
    escape_controls,
    escape_unencodable_output,
    hold_interrupts,
    print_error,
    print_export,
    print_import,
    print_json,
    print_values,
    show_progress,
)

STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
REPORT = {
    "out": "out",
    "counts": {"groups": 2},
    "missing_images": [f"match, {number}.png: is no image" for number in range(MAX_MISSING + 3)],
}


class TestHarmless:
    def test_what_steers_a_terminal_is_spelt_out(self, capsys: pytest.CaptureFixture[str]) -> None:
        name = "a\x1b]0;owned\x07\x1b[2J\x9b31m\r\u202egnp.7\x7f"
        print_import(
            {
                "skipped": [{"file": name, "record": None, "field": None, "problem": "is"}],
                "more_skipped": 0,
                "remarks": [name],
            },
            False,
        )
        print_error(f"there is no {name}", f"Look for {name}")
        found = capsys.readouterr()
        assert not STEERING.search(found.out + found.err)
        assert (
            found.out.count(r"a\u001b]0;owned\u0007\u001b[2J\u009b31m\u000d\u202egnp.7\u007f") == 2
        )
        assert found.err.count(r"\u001b") == 4

    def test_json_says_the_same_and_stays_json(self, capsys: pytest.CaptureFixture[str]) -> None:
        value = {"file": "a\x1b[2J\x9b31m\u202eMálaga\n\t", "more": ["\x7f"]}
        print_json(value)
        out = capsys.readouterr().out
        assert not STEERING.search(out)
        assert json.loads(out) == value

    def test_lines_and_letters_of_the_world_stay(self) -> None:
        text = "Málaga 1 - 0 Эльче\n  足球 ⚽"
        assert escape_controls(text) == text


@pytest.fixture
def default_ctrl_c() -> Iterator[None]:
    """Python's own way with Ctrl+C: processes that run tests side by side ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class TestHeldInterrupts:
    def test_ctrl_c_is_heard_and_is_no_exception_until_it_is_over(self, default_ctrl_c) -> None:
        with hold_interrupts() as interrupted:
            assert not interrupted()
            # To this thread: the kernel may give what the process gets to any other, and in its time.
            signal.raise_signal(signal.SIGINT)
            assert interrupted()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


class TestSpellOut:
    def test_what_an_encoding_lacks_is_spelt_as_json_spells_it(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        raw = io.BytesIO()
        monkeypatch.setattr("sys.stdout", io.TextIOWrapper(raw, encoding="ascii"))
        value = {"file": "Málaga – 1° ⚽ \udcff"}
        escape_unencodable_output()
        print_json(value)
        assert json.loads(raw.getvalue()) == value


class TestPrintValues:
    def test_numbers_are_printed_and_other_lists_counted(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        print_values({"sigma": [0.25, 1.0], "problems": ["a", "b", "c"], "none": []}, False)
        assert [line.split()[1:] for line in capsys.readouterr().out.splitlines()] == [
            ["0.25", "1"],
            ["3"],
            ["0"],
        ]


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


class TestShowProgress:
    def test_without_a_terminal_it_tells_lines(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.terminal.terminal.LINE_SECONDS", 0.0)
        with show_progress("Making the sample") as progress:
            progress(2, 1600, "Drawing the pictures.")
            progress(1600, 1600)
            progress(7)
        found = capsys.readouterr()
        assert found.err.splitlines() == [
            "Making the sample: Drawing the pictures (2 of 1,600)",
            "Making the sample: 1,600 of 1,600",
            "Making the sample: 7",
        ]
        assert found.out == ""

    def test_what_is_done_at_once_tells_nothing(self, capsys: pytest.CaptureFixture[str]) -> None:
        with show_progress("Exporting") as progress:
            progress(1, 2)
            progress(2, 2)
        assert capsys.readouterr().err == ""
