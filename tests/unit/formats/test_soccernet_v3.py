from __future__ import annotations

from typing import Any

import pytest

from app.formats.soccernet_v3 import group_label, image_numbers


class TestGroupLabel:
    @pytest.mark.parametrize(
        ("metadata", "time"),
        [
            ({"gameTime": "2 - 05:09"}, " · 05:09 · second half"),
            ({"gameTime": "05:09", "half": 1}, " · 05:09 · first half"),
            ({"gameTime": "05:09"}, " · 05:09"),
            ({}, " · 7"),
            ({"gameTime": [1]}, " · 7"),
        ],
    )
    def test_teams_and_time_of_play(self, match: str, metadata: dict[str, Any], time: str) -> None:
        expected = "Alder Town 3 – 1 Birch Rovers" + time
        assert group_label(match, "7.png", metadata) == expected

    def test_another_folder_name_is_shown_as_it_is(self) -> None:
        assert group_label("a/b/Final", "7.png", {}) == "Final · 7"


class TestImageNumbers:
    def test_actions_and_replays(self) -> None:
        assert image_numbers("7.png") == (7, None)
        assert image_numbers("12_0.png") == (12, 0)
        assert image_numbers("cam3") is None
