from __future__ import annotations

import json
from pathlib import Path

from app.datasets.report import Report
from app.datasets.sn_calibration import DEFAULT_SIZE
from app.datasets.sn_calibration_groups import read_sn_calibration

LINES = json.dumps({"Goal left post left ": [{"x": 0.5, "y": 0.5}, {"x": 0.5, "y": 1.125}]})


class TestReadSnCalibration:
    def test_the_match_the_split_and_the_record_of_an_image(
        self, tmp_path: Path, report: Report
    ) -> None:
        for split in ("train", "test"):
            (tmp_path / split).mkdir()
            (tmp_path / split / "00001.json").write_text(LINES)
            info = {"00001.jpg": {"league": "l", "season": "s", "match": split, "half": 1}}
            (tmp_path / split / "match_info.json").write_text(json.dumps(info))
        groups = {group.key: group for group in read_sn_calibration(tmp_path, DEFAULT_SIZE, report)}
        assert set(groups) == {"train/00001", "test/00001"}
        first = groups["train/00001"]
        assert (first.match, first.split, first.label) == (
            "l/s/train",
            "train",
            "train · frame 00001",
        )
        assert first.views[0].extras.metadata["match_info"]["half"] == 1
        assert report.problems == []

    def test_the_name_with_a_space_and_points_outside_are_kept(
        self, tmp_path: Path, report: Report
    ) -> None:
        (tmp_path / "00001.json").write_text(LINES)
        (group,) = read_sn_calibration(tmp_path, DEFAULT_SIZE, report)
        (points,) = group.views[0].station.lines.values()
        assert list(group.views[0].station.lines) == ["Goal left post left"]
        assert points[1].y == 1.125 * 539
        assert (group.match, group.label) == ("", "Frame 00001")
