import json

import numpy as np
import pytest

from app.errors import DatasetFormatError
from app.features.file_tools.matches import (
    collect_camera_places_of_other_frames,
    read_match_of_each_frame,
)
from app.formats.sn_calibration import LineFile
from app.solving.match_position import FrameCameraPlace
from tests.cameras import SIZE


def files(*stems):
    return [LineFile(stem, SIZE, {}) for stem in stems]


def places(*ys):
    return [FrameCameraPlace(np.array([0.0, y, -15.0]), 0.01 * np.eye(3), 0.0) for y in ys]


class TestReadMatches:
    def test_json_and_csv_say_the_same(self, tmp_path):
        (tmp_path / "a.json").write_text(json.dumps({"00002": "cup", "x/1": "final"}))
        (tmp_path / "a.csv").write_text("frame,match\n00002,cup\nx/1,final\n")
        found = read_match_of_each_frame(tmp_path / "a.json")
        assert (
            found
            == read_match_of_each_frame(tmp_path / "a.csv")
            == {"00002": "cup", "x/1": "final"}
        )

    @pytest.mark.parametrize("text", ["[1]", '{"a": 1}', "{"])
    def test_other_json_is_refused(self, tmp_path, text):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(DatasetFormatError, match=r"a\.json"):
            read_match_of_each_frame(tmp_path / "a.json")


class TestSharesOf:
    def test_a_frame_takes_no_part_in_its_own_prior(self):
        four = files("1", "2", "3", "4")
        named = dict.fromkeys("1234", "cup")
        (first, *_) = collect_camera_places_of_other_frames(
            four, places(90.0, 60.0, 60.0, 60.0), named
        )
        assert first.match == "cup"
        assert first.others.position_prior(0.0).mean[1] == pytest.approx(60.0, abs=0.01)

    def test_the_places_of_a_match_are_held_once(self):
        four, named = files("1", "2", "3", "4"), dict.fromkeys("1234", "cup")
        shares = collect_camera_places_of_other_frames(
            four, [None, *places(90.0, 60.0, 60.0)], named
        )
        assert len({id(share.others._equations) for share in shares}) == 1
        assert len(shares[0].others._equations) == 3

    def test_matches_are_guessed_in_the_order_of_the_names(self):
        mixed = files("4", "1", "3", "2")
        found = collect_camera_places_of_other_frames(mixed, places(80.0, 60.0, 80.0, 60.0), None)
        assert [share.match for share in found] == ["1", "0", "1", "0"]

    def test_a_frame_that_is_not_named_gets_nothing(self):
        four = files("1", "2", "3", "4", "5")
        *_, last = collect_camera_places_of_other_frames(
            four, places(*[60.0] * 5), dict.fromkeys("1234", "cup")
        )
        assert last.others.position_prior(0.0) is None
