"""Numbers in sentences are rounded as those of the interface (static/lib/format.js)."""

from __future__ import annotations

import pytest

from app.solving.numbers import format_degrees, format_metres, format_percent, format_pixels


class TestNumbers:
    @pytest.mark.parametrize(
        ("value", "shown"),
        [
            (0.04, "0.0 px"),
            (7.26, "7.3 px"),
            (99.94, "99.9 px"),
            (99.96, "100 px"),
            (241.1, "241 px"),
            (1720.0, "1.7k px"),
            (9960.0, "10k px"),
            (25_000.0, ">20k px"),
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
