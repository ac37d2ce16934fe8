"""What is carried between installations is read as somebody else's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from app.errors import DatasetFormatError, InputError
from app.features.imports.body import MAX_POINTS
from app.features.imports.edits_export import group_to_export_json
from app.features.imports.merge_parse import (
    FORMAT,
    FORMAT_VERSION,
    HEAD,
    _parse_station_record,
    parse_group,
    read_merge_header,
)
from app.formats.report import ReaderReport
from app.formats.trees import open_tree
from app.soccer.codec import policy_to_json, station_to_json
from app.soccer.frames import ImageSize
from app.soccer.group import Station
from app.soccer.policy import PAPER
from tests.scenes import make_scenes


class TestReadHead:
    @pytest.mark.parametrize(
        ("threshold", "value", "said"),
        [
            ("point", "xyz", "point is "),
            ("min_p_value", "a", "min_p_value must be a number"),
            ("tau_percent", -1.0, "tau_percent must lie between"),
        ],
    )
    def test_an_impossible_threshold_is_named(
        self, tmp_path: Path, threshold: str, value: Any, said: str
    ) -> None:
        policy = {**policy_to_json(PAPER), "name": "theirs", threshold: value}
        head = {"format": FORMAT, "version": FORMAT_VERSION, "dataset": "demo", "policy": policy}
        (tmp_path / HEAD).write_text(json.dumps(head))
        tree = open_tree(tmp_path, ReaderReport())
        assert tree is not None
        with pytest.raises(DatasetFormatError, match=f"is not a policy: {said}"):
            read_merge_header(tree)

    @pytest.mark.parametrize("policy", [{"calibration": 12}, {"calibration": None}, 5, None])
    def test_a_policy_that_is_none_is_named(self, tmp_path: Path, policy: Any) -> None:
        head = {"format": FORMAT, "version": FORMAT_VERSION, "dataset": "demo", "policy": policy}
        (tmp_path / HEAD).write_text(json.dumps(head))
        tree = open_tree(tmp_path, ReaderReport())
        assert tree is not None
        with pytest.raises(DatasetFormatError, match=r"touchline\.json, policy: is not a policy"):
            read_merge_header(tree)


class TestStation:
    def test_lines_that_were_proposed_are_lines_that_it_has(self) -> None:
        lines = {"Middle line": [[1, 2], [3, 4]]}
        value = {**station_to_json(Station("cam1", ImageSize(96, 54))), "lines": lines}
        assert _parse_station_record({**value, "proposed": ["Middle line"]}).proposed == (
            "Middle line",
        )
        for wrong in (["Circle left"], "Middle line", ["Middle line", "Middle line"], [7]):
            with pytest.raises(
                InputError, match="names lines as proposed that the view does not have"
            ):
                _parse_station_record({**value, "proposed": wrong})

    def test_lines_have_no_more_points_than_those_of_other_imports(self) -> None:
        points = [[float(place), 2.0] for place in range(MAX_POINTS // 2)]
        value = station_to_json(Station("cam1", ImageSize(96, 54)))
        lines = {"Middle line": points, "Side line top": points}
        assert len(_parse_station_record({**value, "lines": lines}).lines) == 2
        with pytest.raises(
            InputError, match="1,001 points in the lines of cam1; the limit is 1,000"
        ):
            _parse_station_record({**value, "lines": {**lines, "Side line left": points[:1]}})


class TestParseGroup:
    @pytest.mark.parametrize(
        ("shared", "said"),
        [(True, "contains the whole static camera"), ("yes", "not true or false")],
    )
    def test_a_static_camera_is_named_by_a_view_and_never_stands_in_it(
        self, shared: Any, said: str
    ) -> None:
        group = group_to_export_json(make_scenes(groups=1, seed=3, faults=False)[0].group)
        more = {"base": None, "views": {}, "stations": {}, "log": [], "verdicts": []}
        value = {"group": group, "pitches": [], "bases": [], **more}
        assert len(parse_group(value, {}).group.views) == 2
        group["views"][0]["station"]["shared"] = shared
        with pytest.raises(InputError, match=said):
            parse_group(value, {})
