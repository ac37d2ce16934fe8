"""Counts in a sentence: one thing, or several."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import app
from app.wording import (
    format_degrees,
    format_metres,
    format_named_count,
    format_percent,
    format_pixels,
    plural,
)

BY_HAND = re.compile(
    r"""(["'])(1 |the 1 |)[a-z ]*\1 if [^"'\n]{1,40} [=!]= 1 else f?["'](s["']|[^"'\n]*s\b)"""
)
"""A choice between one thing and several in the middle of a sentence."""


class TestPlural:
    def test_is_singular_for_one_thing_alone(self):
        told = [plural(count, "group") for count in (0, 1, 2, 12764)]
        assert told == ["0 groups", "1 group", "2 groups", "12,764 groups"]

    def test_takes_the_words_of_several_where_an_s_is_not_all(self):
        told = [plural(count, "view has", "views have") for count in (1, 2)]
        assert told == ["1 view has", "2 views have"]


class TestCounted:
    @pytest.mark.parametrize(
        ("name", "one"),
        [
            ("groups", "1 group"),
            ("images_missing", "1 image missing"),
            ("boxes", "1 box"),
            ("views_without_ball", "1 view without ball"),
        ],
    )
    def test_names_one_thing_in_the_singular(self, name, one):
        assert format_named_count(1, name) == one
        assert format_named_count(3, name) == f"3 {name.replace('_', ' ')}"


class TestProduct:
    def test_counts_nothing_by_hand(self):
        root = Path(app.__file__).parent
        found = {
            f"{path.relative_to(root)}: {match.group()}"
            for path in root.rglob("*.py")
            if path.name != "wording.py"
            for match in BY_HAND.finditer(path.read_text())
        }
        assert not found


class TestNumbers:
    @pytest.mark.parametrize(
        ("value", "shown"),
        [
            (0.04, "0.0 px"),
            (7.26, "7.3 px"),
            (99.94, "99.9 px"),
            (99.96, "100 px"),
            (241.1, "241 px"),
            (1720.0, "1,720 px"),
            (9960.0, "9,960 px"),
            (25_000.0, ">20,000 px"),
        ],
    )
    def test_pixels_need_four_characters(self, value: float, shown: str) -> None:
        assert format_pixels(value) == shown

    def test_per_cent_need_four_characters(self) -> None:
        assert [format_percent(value) for value in (0.057, 9.994, 16.42, 113.2)] == [
            "0.06",
            "9.99",
            "16.4",
            "113",
        ]

    def test_metres_and_degrees_have_one_rounding_each(self) -> None:
        assert (format_metres(0.067), format_metres(64.6), format_degrees(44.46)) == (
            "0.07 m",
            "64.60 m",
            "44.5°",
        )
