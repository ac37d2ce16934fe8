from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.errors import InputError
from app.formats.export_names import ExportNames, fold_file_name, frame_name_claims
from app.soccer.group import Group, View
from app.soccer.media import Media

Make = Callable[..., Group]


@pytest.fixture
def view(soccer_group: Make) -> View:
    return soccer_group().views[0]


def called(names: ExportNames, *groups: Group) -> list[str]:
    return [names.of(group, {}).get(view.key, view.key) for group in groups for view in group.views]


def groups_of(view: View, *keys: tuple[str, str]) -> list[Group]:
    return [Group(group, (replace(view, key=key),)) for group, key in keys]


class TestExportNames:
    def test_a_name_that_several_frames_want_has_the_group_before_it_in_each(
        self, view: View
    ) -> None:
        groups = groups_of(view, ("a", "north"), ("b", "north"), ("c", "south"))
        for order in (groups, groups[::-1]):
            names = ExportNames(frame_name_claims, [(group, {}) for group in order])
            assert sorted(called(names, *order)) == ["a/north", "b/north", "south"]

    def test_a_name_of_a_group_is_no_other_frames_own(self, view: View) -> None:
        groups = groups_of(view, ("a", "7.png"), ("b", "7.png"), ("c", "a/7.png"))
        names = ExportNames(frame_name_claims, [(group, {}) for group in groups])
        first, second, third = called(names, *groups)
        assert (second, third) == ("b/7.png", "a/7.png")
        assert first.startswith("7_") and first.endswith(".png")

    def test_a_frame_that_was_not_announced_takes_nobodys_name(self, view: View) -> None:
        names = ExportNames(frame_name_claims)
        assert called(names, *groups_of(view, ("a", "N"), ("b", "n"))) == ["N", "b/n"]

    def test_one_picture_that_two_groups_show_keeps_one_name(self, view: View) -> None:
        shown = replace(view, media=Media("/frames/7.png"))
        groups = groups_of(shown, ("a", "7.png"), ("b", "7.png"))
        names = ExportNames(frame_name_claims, [(group, {}) for group in groups])
        assert called(names, *groups) == ["7.png", "7.png"]

    def test_a_view_without_a_free_name_is_refused_by_its_names(self, view: View) -> None:
        names = ExportNames(lambda group, view, split: {"always": (group.key, view.key)})
        first, second = groups_of(view, ("a", "north"), ("b", "north"))
        assert names.of(first, {}) == {}
        with pytest.raises(InputError, match="the view north of group b has no name of its own"):
            names.of(second, {})


class TestFolded:
    def test_case_and_composition_make_no_other_name(self) -> None:
        assert fold_file_name("Caf\u00c9") == fold_file_name("cafe\u0301")
        assert fold_file_name("cafe") != fold_file_name("caf\u00e9")
