from __future__ import annotations

from dataclasses import replace

import pytest

from app.errors import InputError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import ensure_dataset, import_groups
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.features.versions.diff import (
    ChangedSetting,
    describe_diff,
    diff_versions,
    make_version_changelog,
)
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.split import Split


def judge(store, group_id, state, reason=None, note=None):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, note, if_match=etag, actor="ann")


def frozen(store, name, **options):
    return freeze_dataset(store, "demo", FreezeRequest(name, **options), actor="ann")


@pytest.fixture
def two(store, once, fill, make_group):
    """Two versions: a group moved, one rejected, one accepted, one new, one as it was."""

    def make():
        ids = fill(*(make_group(number) for number in (6, 7, 8, 9)))
        for number in ids[:3]:
            judge(store, number, "accepted")
        first = frozen(store, "v1")
        state = load_group_state(store, ids[1])
        box = state.group.view("7.png").ball.box
        ball = BallAnnotation(box=Box(box.x + 0.5, box.y, box.width, box.height))
        submit_edit(
            store, ids[1], make_set_ball_edit("7.png", ball), if_match=state.etag, actor="ben"
        )
        judge(store, ids[1], "accepted")
        judge(store, ids[2], "rejected", "sides_confused")
        judge(store, ids[3], "accepted")
        ids = fill(*(make_group(number) for number in (6, 7, 8, 9, 10)))
        judge(store, ids[4], "accepted")
        return first, frozen(store, "v2", split=Split("camera", test_cameras=("9.png",)))

    return once("two versions", make)


class TestDiffVersions:
    def test_groups_come_and_go_for_a_reason(self, store, two) -> None:
        diff = diff_versions(store, two[0].id, two[1].id)
        added = {item.group.rpartition("/")[2]: item.why for item in diff.added}
        assert added == {"9.png": "unreviewed", "10.png": "not in the dataset"}
        (dropped,) = diff.dropped
        assert dropped.why == "rejected: sides_confused"

    def test_balls_move_by_metres(self, store, two) -> None:
        diff = diff_versions(store, two[0].id, two[1].id)
        (moved,) = diff.moved
        assert moved.group.endswith("/7.png")
        assert 0.001 < moved.metres < 0.2
        assert [item.what for item in diff.changed if item.group == moved.group] == [
            ("annotations",)
        ]

    def test_settings_that_differ_are_named(self, store, two) -> None:
        (setting,) = diff_versions(store, two[0].id, two[1].id).settings
        assert (setting.name, setting.before) == ("split", {"kind": "given"})

    def test_settings_are_told_in_words(self, store, two) -> None:
        lines = describe_diff(diff_versions(store, two[0].id, two[1].id))
        (told,) = (line for line in lines if line.startswith("split"))
        assert told == "split: given before, camera (test cameras 9.png) now."

    @pytest.mark.parametrize(
        ("before", "after", "told"),
        [
            (True, None, "yes before, not set now"),
            ([], ["cam1", "cam2"], "none before, cam1, cam2 now"),
            (
                {"source": "lines", "weights": [1.0]},
                {},
                "source lines, weights 1.0 before, none now",
            ),
        ],
    )
    def test_no_value_is_told_as_a_program_writes_it(
        self, store, two, before: object, after: object, told: str
    ) -> None:
        diff = replace(
            diff_versions(store, two[0].id, two[0].id),
            settings=(ChangedSetting("policy x", before, after),),
        )
        assert describe_diff(diff)[1] == f"policy x: {told}."

    def test_backwards_it_is_the_other_way_round(self, store, two) -> None:
        there, back = (
            diff_versions(store, *pair) for pair in ((two[0].id, two[1].id), (two[1].id, two[0].id))
        )
        assert {item.group for item in there.added} == {item.group for item in back.dropped}

    def test_against_itself_nothing_changed(self, store, two) -> None:
        diff = diff_versions(store, two[0].id, two[0].id)
        assert (diff.unchanged, diff.to_values()["same"]) == (3, True)
        assert not (diff.added or diff.dropped or diff.moved or diff.changed or diff.settings)

    def test_lists_are_cut_and_counts_are_not(self, store, two) -> None:
        values = diff_versions(store, two[0].id, two[1].id).to_values(1)
        assert (len(values["added"]), values["counts"]["added"]) == (1, 2)

    def test_two_datasets_cannot_be_compared(self, store, two, make_group) -> None:
        ensure_dataset(store, "other", "ann")
        import_groups(store, "other", [make_group(7)], source="test", actor="ann")
        solve_dataset(store, "other")
        other = freeze_dataset(store, "other", FreezeRequest("v1", groups="passing"), actor="ann")
        with pytest.raises(InputError, match="two datasets"):
            diff_versions(store, two[0].id, other.id)


@pytest.fixture
def judged_and_moved(store, fill, make_group):
    """Two versions of whatever passes: two balls moved, one group accepted, one as it was."""
    ids = fill(*(make_group(number) for number in (7, 8, 9, 10)))
    first = frozen(store, "v1", groups="passing")
    for group, key, pixels in ((ids[0], "7.png", 0.25), (ids[1], "8.png", 0.75)):
        state = load_group_state(store, group)
        box = state.group.view(key).ball.box
        ball = BallAnnotation(box=Box(box.x + pixels, box.y, box.width, box.height))
        submit_edit(store, group, make_set_ball_edit(key, ball), if_match=state.etag, actor="ben")
    judge(store, ids[2], "accepted")
    return first, frozen(store, "v2", groups="passing")


class TestOfWhateverPasses:
    def test_a_group_is_counted_once_however_much_of_it_changed(
        self, store, judged_and_moved
    ) -> None:
        first, second = judged_and_moved
        diff = diff_versions(store, first.id, second.id)
        changed = {item.group.rpartition("/")[2]: item.what for item in diff.changed}
        assert changed == {
            "7.png": ("annotations",),
            "8.png": ("annotations",),
            "9.png": ("verdict",),
        }
        assert (len(diff.moved), diff.unchanged) == (2, 1)

    def test_the_ball_that_moved_most_comes_first_and_is_told(
        self, store, judged_and_moved
    ) -> None:
        first, second = judged_and_moved
        metres = [item.metres for item in diff_versions(store, first.id, second.id).moved]
        assert metres == sorted(metres, reverse=True)
        assert metres[0] > 2 * metres[1]
        lines = make_version_changelog(store, second.id)
        assert "1 group with another verdict." in lines
        assert any(line.endswith(f"{max(metres):.3f} m at most.") for line in lines)


class TestChangelog:
    def test_the_first_version_says_so(self, store, two) -> None:
        assert make_version_changelog(store, two[0].id) == [
            "First version: 3 groups, 6 balls in views."
        ]

    def test_the_next_one_says_what_changed(self, store, two) -> None:
        lines = make_version_changelog(store, two[1].id)
        assert lines[0] == "Since v1:"
        assert "2 groups added (before: 1 not in the dataset, 1 unreviewed)." in lines
        assert "1 group dropped (now: 1 rejected: sides_confused)." in lines
        assert any(line.startswith("1 ball moved, by 0.0") for line in lines)
        assert lines[-1].startswith("split: ")

    def test_no_change_is_one_sentence(self, store, two) -> None:
        again = frozen(store, "v3", split=two[1].split)
        assert make_version_changelog(store, again.id) == ["Nothing changed since v2."]
