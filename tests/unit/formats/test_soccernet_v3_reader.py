from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.soccer.group import Group, Media

Write = Callable[[Any], Path]


def _read(root: Path, report: ReaderReport) -> list[Group]:
    return list(read_soccernet_v3(root, report))


class TestReadSoccernetV3:
    def test_an_action_and_its_linked_replays_are_a_group(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, match: str
    ) -> None:
        seven, eight = _read(write_labels(labels), report)
        assert (seven.key, eight.key) == (f"{match}/7.png", f"{match}/8.png")
        assert [view.key for view in seven.views] == ["7.png", "7_1.png", "7_0.png"]
        assert [view.key for view in eight.views] == ["8.png"]
        assert seven.views[1].station.key == f"{match}/7_1.png"
        assert (seven.match, seven.split) == (match, "train")
        assert seven.label == "Alder Town 3 – 1 Birch Rovers · 12:41 · first half"
        assert report.problems == []
        assert (report.read, report.imported) == (2, 2)

    @pytest.mark.parametrize("bad", ["NaN", "1e999"])
    def test_a_number_that_is_none_costs_its_own_line_alone(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, bad: str
    ) -> None:
        root = write_labels(labels)
        (file,) = root.rglob("Labels-v3.json")
        text = file.read_text()
        line = text.index('"points": [', text.index('"lines"')) + len('"points": [')
        file.write_text(text[:line] + bad + text[text.index(",", line) :])
        assert len(_read(root, report)) == 2
        # The number with its place in the file, and the line that it costs.
        (number,), (line,) = report.remarks, report.problems
        assert "read as missing" in number
        assert (line.record, line.field) == ("7.png", "lines[0].points")

    @pytest.mark.parametrize("depth", [0, 1, 2, 3])
    def test_any_folder_down_to_the_match_will_do(
        self,
        labels: dict[str, Any],
        write_labels: Write,
        report: ReaderReport,
        match: str,
        depth: int,
    ) -> None:
        root = write_labels(labels).joinpath(*match.split("/")[:depth])
        del labels["GameMetadata"]["UrlLocal"]
        assert _read(root, report)[0].key == f"{match}/7.png"

    def test_a_zip_of_the_tree_will_do(
        self,
        labels: dict[str, Any],
        make_zip: Callable[..., Path],
        report: ReaderReport,
        match: str,
    ) -> None:
        path = make_zip({f"data/{match}/Labels-v3.json": json.dumps(labels)})
        assert [group.match for group in _read(path, report)] == [match, match]

    def test_frames_are_referred_to_where_they_are(
        self,
        labels: dict[str, Any],
        write_labels: Write,
        make_zip: Callable[..., Path],
        report: ReaderReport,
        match: str,
    ) -> None:
        root = write_labels(labels)
        members = {"7.png": b"", "7_1.png": b"", "8.png": b""}
        path = make_zip(members, root / match / "Frames-v3.zip")
        seven, _ = _read(root, report)
        assert seven.views[1].media == Media(str(path), "7_1.png")
        assert seven.views[2].media is None
        assert [problem.problem for problem in report.problems] == [
            "1 image has no frame file: 7_0.png"
        ]

    def test_labels_without_frames_are_fine(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport
    ) -> None:
        _read(write_labels(labels), report)
        assert report.problems == []
        assert report.counts["views without frame"] == 4

    def test_a_truncated_frames_archive_is_one_message_and_loses_no_group(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, match: str
    ) -> None:
        root = write_labels(labels)
        (root / match / "Frames-v3.zip").write_bytes(b"PK\x03\x04 cut off")
        groups = _read(root, report)
        assert len(groups) == 2
        assert all(view.media is None for group in groups for view in group.views)
        assert len(report.problems) == 1
        assert "Frames-v3.zip: is not a complete zip file" in str(report.problems[0])

    def test_a_link_to_a_missing_replay_is_reported(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport
    ) -> None:
        labels["actions"]["8.png"]["linked_replays"] = ["8_1.png"]
        groups = _read(write_labels(labels), report)
        assert [len(group.views) for group in groups] == [3, 1]
        assert str(report.problems[0]).endswith(
            "8.png, linked_replays: names 8_1.png, which this file does not contain"
        )

    def test_a_replay_without_its_action_is_reported(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, image: Any
    ) -> None:
        labels["replays"]["9_1.png"] = image(linked_action="9.png")
        labels["replays"]["9_2.png"] = image()
        assert len(_read(write_labels(labels), report)) == 2
        assert [problem.record for problem in report.problems] == ["9_1.png", "9_2.png"]

    def test_a_replay_that_only_names_its_action_joins_it(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport
    ) -> None:
        del labels["actions"]["7.png"]["linked_replays"]
        seven, _ = _read(write_labels(labels), report)
        assert len(seven.views) == 3
        assert report.problems == []

    def test_a_replay_of_two_actions_stays_with_the_first(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport
    ) -> None:
        labels["actions"]["8.png"]["linked_replays"] = ["7_1.png"]
        groups = _read(write_labels(labels), report)
        assert [len(group.views) for group in groups] == [3, 1]
        assert "already belongs to 7.png" in str(report.problems[0])

    def test_a_bad_image_loses_itself_alone(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport
    ) -> None:
        labels["replays"]["7_1.png"]["imageMetadata"] = {"width": "wide"}
        labels["actions"]["8.png"] = []
        (seven,) = _read(write_labels(labels), report)
        assert [view.key for view in seven.views] == ["7.png", "7_0.png"]
        assert [problem.record for problem in report.problems] == ["7_1.png", "8.png"]
        assert (report.read, report.imported) == (2, 1)

    @pytest.mark.parametrize(
        "text", ["{", "[]", '"text"', "5", '{"actions": []}', '{"actions": {}, "replays": 5}']
    )
    def test_a_labels_file_of_wrong_type_is_reported(
        self, write_labels: Write, report: ReaderReport, text: str
    ) -> None:
        assert _read(write_labels(text), report) == []
        assert len(report.problems) == 1

    def test_a_name_that_is_no_image_is_reported(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, image: Any
    ) -> None:
        labels["actions"]["../../etc.png"] = image()
        assert len(_read(write_labels(labels), report)) == 2
        assert "is not an image name" in str(report.problems[0])

    def test_a_second_file_of_a_match_is_reported(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, match: str
    ) -> None:
        root = write_labels(labels)
        again = root / "train" / match
        again.mkdir(parents=True)
        (again / "Labels-v3.json").write_text(json.dumps(labels))
        assert len(_read(root, report)) == 2
        assert "second file of match" in str(report.problems[0])

    def test_a_folder_without_labels_is_reported(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        assert _read(tmp_path, report) == []
        assert "contains no Labels-v3.json" in str(report.problems[0])
