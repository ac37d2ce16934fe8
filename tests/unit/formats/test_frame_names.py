from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from app.formats.frame_names import (
    expected_frame_suffix,
    frame_path_by_match,
    frame_path_in_split,
    split_folder,
    view_stem,
)
from app.soccer.group import Group
from app.soccer.media import Media

Make = Callable[..., Group]


class TestMatchFrame:
    def test_a_frame_lies_beside_the_labels_of_its_match(
        self, soccer_group: Make, issia_group: Make
    ) -> None:
        group, static = soccer_group(match="l/s/m"), issia_group()
        assert (
            frame_path_by_match(group, group.views[1], "train", ".jpg") == "l/s/m/Frames-v3/7_1.png"
        )
        name = frame_path_by_match(static, static.views[0], "", ".jpg")
        assert name == "issia/Frames-v3/cam3/358.jpg"


class TestFlatFrame:
    def test_no_two_views_of_a_dataset_have_one_name(
        self, soccer_group: Make, issia_group: Make
    ) -> None:
        groups = [soccer_group(), soccer_group("8.png"), issia_group(), issia_group(359)]
        names = [frame_path_in_split(g, v, "valid", ".jpg") for g in groups for v in g.views]
        assert len(set(names)) == len(names) == 8
        assert all(name.startswith("images/val/") for name in names)

    def test_views_that_differ_in_their_ending_or_in_a_sign_have_labels_of_their_own(
        self, soccer_group: Make
    ) -> None:
        view = soccer_group().views[0]
        for keys in (("7.png", "7.jpg"), ("cam 1", "cam-1"), ("A.png", "a.png")):
            group = Group("g", tuple(replace(view, key=key) for key in keys))
            names = [frame_path_in_split(group, one, "", ".jpg") for one in group.views]
            labels = {name.rsplit(".", 1)[0].lower() for name in names}
            assert len(labels) == 2, names


class TestSplitFolder:
    def test_uses_the_names_of_yolo_and_trains_without_a_split(self) -> None:
        splits = ("train", "valid", "test", "challenge", "")
        assert [split_folder(split) for split in splits] == [
            "train", "val", "test", "test", "train",
        ]  # fmt: skip


class TestLikelySuffix:
    def test_follows_the_frame_and_is_jpeg_for_videos(self, soccer_group: Make) -> None:
        view = soccer_group().views[0]
        assert expected_frame_suffix(view) == ".jpg"
        assert expected_frame_suffix(replace(view, media=Media("a.zip", "7.PNG"))) == ".png"
        assert expected_frame_suffix(replace(view, media=Media("cam3.mp4", frame=3))) == ".jpg"


class TestViewStem:
    def test_only_the_ending_of_an_image_is_cut(self) -> None:
        assert [view_stem(key) for key in ("7_1.png", "cam3", "00002")] == ["7_1", "cam3", "00002"]
