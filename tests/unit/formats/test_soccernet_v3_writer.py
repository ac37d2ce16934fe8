from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.errors import InputError, UnsafePathError
from app.formats.report import Report
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.formats.soccernet_v3_writer import labels_to_json, split_key, write_soccernet_v3
from app.soccer.group import Group

Write = Callable[[Any], Path]


def _read(root: Path, report: Report) -> list[Group]:
    return list(read_soccernet_v3(root, report))


class TestWriteSoccernetV3:
    def test_import_export_import_gives_the_same_groups(
        self, labels: dict[str, Any], write_labels: Write, report: Report, tmp_path: Path
    ) -> None:
        labels["version"] = 3
        labels["actions"]["7.png"]["extra"] = [1]
        first = _read(write_labels(labels), report)
        (tmp_path / "out").mkdir()
        write_soccernet_v3(tmp_path / "out", first)
        assert _read(tmp_path / "out", report) == first
        assert report.problems == []

    def test_what_readers_of_the_format_follow_is_there(
        self, labels: dict[str, Any], write_labels: Write, report: Report, match: str
    ) -> None:
        value = labels_to_json(match, _read(write_labels(labels), report))
        assert value["GameMetadata"] == {
            "UrlLocal": match,
            "gameHomeTeam": "Alder Town",
            "list_actions": ["7.png", "8.png"],
            "list_replays": ["7_1.png", "7_0.png"],
        }
        assert value["actions"]["7.png"]["linked_replays"] == ["7_1.png", "7_0.png"]
        assert value["replays"]["7_0.png"]["linked_action"] == "7.png"

    def test_a_match_that_comes_again_is_added_to_its_file(
        self, soccer_group: Callable[..., Group], tmp_path: Path, report: Report, match: str
    ) -> None:
        other = match.replace("Alder", "Cedar")
        groups = [soccer_group("7.png"), soccer_group("7.png", match=other), soccer_group("8.png")]
        write_soccernet_v3(tmp_path, groups)
        again = _read(tmp_path, report)
        assert [group.key for group in again] == [
            f"{match}/7.png", f"{match}/8.png", f"{other}/7.png",
        ]  # fmt: skip
        path = tmp_path / match / "Labels-v3.json"
        game = json.loads(path.read_text())["GameMetadata"]
        assert game["list_actions"] == ["7.png", "8.png"]
        assert game["list_replays"] == ["7_1.png", "8_1.png"]

    def test_groups_of_other_datasets_are_refused(
        self, issia_group: Callable[..., Group], tmp_path: Path
    ) -> None:
        with pytest.raises(InputError, match="is not from SoccerNet"):
            write_soccernet_v3(tmp_path, [issia_group()])

    def test_a_key_that_leaves_the_folder_is_refused(
        self, soccer_group: Callable[..., Group], tmp_path: Path
    ) -> None:
        with pytest.raises(UnsafePathError):
            write_soccernet_v3(tmp_path, [soccer_group(match="../../x")])


class TestSplitKey:
    def test_league_season_and_match(self, soccer_group: Callable[..., Group], match: str) -> None:
        assert "/".join(split_key(soccer_group())) == match
