from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.errors import InputError
from app.formats.frame_names import (
    ExportKeyAssigner,
    folder_name_of_split,
    frame_path_by_match,
    frame_path_in_split,
    guess_frame_suffix,
    map_frame_names_to_owners,
    normalize_file_name,
    strip_image_suffix,
)
from app.soccer.group import Group, Media, View

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
        assert [folder_name_of_split(split) for split in splits] == [
            "train", "val", "test", "test", "train",
        ]  # fmt: skip

    def test_held_out_data_do_not_train_however_their_split_is_spelled(self) -> None:
        splits = ("val", "Validation", "Test", "testing", "fold-3", "../x", "Train")
        assert [folder_name_of_split(split) for split in splits] == [
            "val", "val", "test", "test", "other", "other", "train",
        ]  # fmt: skip


class TestLikelySuffix:
    def test_follows_the_frame_and_is_jpeg_for_videos(self, soccer_group: Make) -> None:
        view = soccer_group().views[0]
        assert guess_frame_suffix(view) == ".jpg"
        assert guess_frame_suffix(replace(view, media=Media("a.zip", "7.PNG"))) == ".png"
        assert guess_frame_suffix(replace(view, media=Media("cam3.mp4", frame=3))) == ".jpg"


class TestViewStem:
    def test_only_the_ending_of_an_image_is_cut(self) -> None:
        assert [strip_image_suffix(key) for key in ("7_1.png", "cam3", "00002")] == [
            "7_1",
            "cam3",
            "00002",
        ]


@pytest.fixture
def view(soccer_group: Make) -> View:
    return soccer_group().views[0]


def called(names: ExportKeyAssigner, *groups: Group) -> list[str]:
    return [
        names.assign_keys(group, {}).get(view.key, view.key)
        for group in groups
        for view in group.views
    ]


def groups_of(view: View, *keys: tuple[str, str]) -> list[Group]:
    return [Group(group, (replace(view, key=key),)) for group, key in keys]


class TestExportNames:
    def test_a_name_that_several_frames_want_has_the_group_before_it_in_each(
        self, view: View
    ) -> None:
        groups = groups_of(view, ("a", "north"), ("b", "north"), ("c", "south"))
        for order in (groups, groups[::-1]):
            names = ExportKeyAssigner(map_frame_names_to_owners, [(group, {}) for group in order])
            assert sorted(called(names, *order)) == ["a/north", "b/north", "south"]

    def test_a_name_of_a_group_is_no_other_frames_own(self, view: View) -> None:
        groups = groups_of(view, ("a", "7.png"), ("b", "7.png"), ("c", "a/7.png"))
        names = ExportKeyAssigner(map_frame_names_to_owners, [(group, {}) for group in groups])
        first, second, third = called(names, *groups)
        assert (second, third) == ("b/7.png", "a/7.png")
        assert first.startswith("7_") and first.endswith(".png")

    def test_a_frame_that_was_not_announced_takes_nobodys_name(self, view: View) -> None:
        names = ExportKeyAssigner(map_frame_names_to_owners)
        assert called(names, *groups_of(view, ("a", "N"), ("b", "n"))) == ["N", "b/n"]

    def test_one_picture_that_two_groups_show_keeps_one_name(self, view: View) -> None:
        shown = replace(view, media=Media("/frames/7.png"))
        groups = groups_of(shown, ("a", "7.png"), ("b", "7.png"))
        names = ExportKeyAssigner(map_frame_names_to_owners, [(group, {}) for group in groups])
        assert called(names, *groups) == ["7.png", "7.png"]

    def test_a_view_without_a_free_name_is_refused_by_its_names(self, view: View) -> None:
        names = ExportKeyAssigner(lambda group, view, split: {"always": (group.key, view.key)})
        first, second = groups_of(view, ("a", "north"), ("b", "north"))
        assert names.assign_keys(first, {}) == {}
        with pytest.raises(
            InputError, match="view north of group b and another view would have the same name"
        ):
            names.assign_keys(second, {})


class TestFolded:
    def test_case_and_composition_make_no_other_name(self) -> None:
        assert normalize_file_name("Caf\u00c9") == normalize_file_name("cafe\u0301")
        assert normalize_file_name("cafe") != normalize_file_name("caf\u00e9")
