"""Why a view was left out: data of its own, undone and done again with the edit that said it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.errors import InputError
from app.features.exports.service import export_dataset
from app.features.groups.edit import SetLines, SetViewInclusion, make_set_ball_edit
from app.features.groups.edit_codec import edit_from_json
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.features.imports.ingest import import_groups
from app.features.imports.merge import merge_edits
from app.features.queue.refresh_queries import refresh_queue
from app.features.queue.service import list_groups
from app.features.verdicts.bulk import give_verdicts
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.frozen_queries import freeze_annotations
from app.features.versions.verify import verify_version
from app.formats.file_tree import DEFAULT_LIMITS
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.codec import hash_group_inputs, hash_imported_group
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Station, View, ViewExclusion
from tests.balls import seen
from tests.cameras import SIZE
from tests.unit.stores import OPPOSITE, drawn

WHY = ViewExclusion("not_same_instant", "the foot is off the ball")
LEAVE = SetViewInclusion("7_1.png", False, WHY.reason, WHY.note)


def three_views(group: Group) -> Group:
    """The group with a third view, so that it passes without the second."""
    ball = BallAnnotation(box=Box.square(seen(OPPOSITE, (5.0, 2.0, -0.5)), 14.0))
    lines = make_lines(drawn(OPPOSITE))
    station = Station(f"{group.match}/7_2.png", SIZE, lines=lines, given=OPPOSITE)
    return replace(group, views=(*group.views, View("7_2.png", station, (ball,))))


@pytest.fixture
def state(store, fill, make_group):
    (number,) = fill(three_views(make_group(7)))
    return load_group_state(store, number)


def change(store, edit):
    return submit_edit(store, 1, edit, if_match=load_group_state(store, 1).etag, actor="ann")


def why(store) -> ViewExclusion | None:
    return load_group_state(store, 1).group.view("7_1.png").left_out


class TestIncludeView:
    @pytest.mark.parametrize(
        ("reason", "note", "sentence"),
        [
            ("bored", None, '"bored" is not a reason'),
            ("other", " ", "needs a note"),
            (None, "a note", "needs a reason"),
            ("other", "x" * 2001, "the limit is 2,000"),
        ],
    )
    def test_an_unknown_reason_is_refused(self, make_group, reason, note, sentence) -> None:
        with pytest.raises(InputError, match=sentence):
            SetViewInclusion("7_1.png", False, reason, note).apply(make_group(7))

    def test_only_a_view_that_is_left_out_has_a_reason(self, make_group) -> None:
        with pytest.raises(InputError, match="left-out"):
            SetViewInclusion("7_1.png", True, "duplicate_view").apply(make_group(7))

    def test_taking_the_view_in_again_removes_it(self, make_group) -> None:
        group = make_group(7)
        left = LEAVE.apply(group)
        assert left.view("7_1.png").left_out == WHY
        assert SetViewInclusion("7_1.png", True).apply(left) == group

    def test_the_inverse_brings_it_back_whole(self, make_group) -> None:
        left = LEAVE.apply(make_group(7))
        for edit in (
            SetViewInclusion("7_1.png", True),
            SetViewInclusion("7_1.png", False, "other", "no"),
        ):
            assert edit.inverse(left).apply(edit.apply(left)) == left

    def test_an_entry_of_the_log_from_before_reasons_is_read(self, make_group) -> None:
        edit = edit_from_json({"edit": "include_view", "view": "7_1.png", "included": False})
        assert edit.apply(make_group(7)).view("7_1.png").left_out is None


class TestUndo:
    def test_undo_takes_it_back_and_redo_brings_it_again(self, store, state) -> None:
        left = change(store, LEAVE)
        assert (why(store), left.verdict.note) == (WHY, None)
        back = undo_group_edit(store, 1, if_match=left.etag, actor="ann")
        assert back.group == state.group
        redo_group_edit(store, 1, if_match=back.etag, actor="ann")
        assert why(store) == WHY

    def test_the_log_alone_gives_it_again(self, store, state) -> None:
        change(store, LEAVE)
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        rebuild_tables(store)
        assert why(store) == WHY

    def test_another_reason_is_an_edit_that_computes_nothing_anew(self, store, state) -> None:
        left = change(store, LEAVE)
        judged = set_verdict(store, 1, "accepted", note="fine", if_match=left.etag, actor="ann")
        other = change(store, SetViewInclusion("7_1.png", False, "duplicate_view"))
        assert why(store) == ViewExclusion("duplicate_view")
        assert other.stored.inputs_hash == left.stored.inputs_hash
        assert (other.verdict.stale, judged.verdict.stale) == (False, False)
        undo_group_edit(store, 1, if_match=other.etag, actor="ann")
        assert why(store) == WHY


class TestDigests:
    def test_solving_does_not_read_the_reason(self, make_group) -> None:
        group = make_group(7)
        plain = SetViewInclusion("7_1.png", False).apply(group)
        assert hash_group_inputs(LEAVE.apply(group)) == hash_group_inputs(plain)

    def test_groups_without_a_reason_are_frozen_without_that_field(self, make_group) -> None:
        group = SetViewInclusion("7_1.png", False).apply(make_group(7))
        assert "left_out" not in "".join(freeze_annotations(group).texts.values())
        assert hash_imported_group(group) != hash_imported_group(LEAVE.apply(make_group(7)))


class TestVersions:
    def test_a_version_keeps_it_and_comes_out_the_same(self, store, state) -> None:
        change(store, LEAVE)
        version = freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
        change(store, SetViewInclusion("7_1.png", False))
        plain = freeze_dataset(store, "demo", FreezeRequest("v2", groups="passing"), actor="ann")
        assert version.hash != plain.hash
        assert verify_version(store, version.id).ok and verify_version(store, plain.id).ok


class TestImport:
    def test_the_dataset_brings_new_extras_and_it_stays(self, store, state, make_group) -> None:
        change(store, LEAVE)
        newer = replace(three_views(make_group(7)), label="another label")
        import_groups(store, "demo", [newer], source="again", actor="ann")
        assert (load_group_state(store, 1).group.label, why(store)) == ("another label", WHY)


class TestFixed:
    def fixed(self, store) -> tuple[bool, bool]:
        """In the group's document, and in the queue."""
        (row,) = list_groups(store, 1).items
        return load_group_state(store, 1).verdict.fixed, row.fixed

    def judge(self, store, verdict: str, **more) -> None:
        set_verdict(
            store, 1, verdict, if_match=load_group_state(store, 1).etag, actor="ann", **more
        )

    def test_an_edited_group_that_passes_is_fixed_once_it_is_accepted(self, store, state) -> None:
        change(store, LEAVE)
        assert self.fixed(store) == (False, False)
        self.judge(store, "accepted")
        assert self.fixed(store) == (True, True)

    def test_so_is_one_whose_own_lines_were_drawn(self, store, state) -> None:
        lines = state.group.view("7.png").station.lines
        name, points = next(iter(lines.items()))
        moved = tuple(ImagePoint(point.x + 0.2, point.y) for point in points)
        change(store, SetLines("7.png", {name: moved}))
        self.judge(store, "accepted")
        assert load_group_state(store, 1).solution.passes
        assert self.fixed(store) == (True, True)
        with store.write() as session:
            refresh_queue(session, [1])
        assert self.fixed(store) == (True, True)
        self.judge(store, "unreviewed")
        give_verdicts(store, 1, "", "accepted", actor="ben")
        assert self.fixed(store) == (True, True)

    def test_after_undo_of_all_edits_a_group_is_not_fixed(self, store, state) -> None:
        left = change(store, LEAVE)
        self.judge(store, "accepted")
        undo_group_edit(store, 1, if_match=load_group_state(store, 1).etag, actor="ann")
        assert self.fixed(store) == (False, False)
        redo_group_edit(store, 1, if_match=load_group_state(store, 1).etag, actor="ann")
        assert self.fixed(store) == (True, True)
        assert left.group == load_group_state(store, 1).group

    def test_a_rejected_group_is_not_fixed(self, store, state) -> None:
        change(store, LEAVE)
        self.judge(store, "rejected", reason="bad_calibration")
        assert self.fixed(store) == (False, False)

    def test_an_accepted_group_that_fails_is_not_fixed(self, store, state) -> None:
        change(store, LEAVE)
        change(store, SetViewInclusion("7_2.png", False))
        self.judge(store, "accepted", note="needed")
        assert self.fixed(store) == (False, False)
        give_verdicts(store, 1, "", "accepted", note="all", actor="ben")
        assert self.fixed(store) == (False, False)

    def test_a_group_that_an_edit_makes_fail_is_no_longer_fixed(self, store, state) -> None:
        change(store, LEAVE)
        self.judge(store, "accepted")
        change(store, make_set_ball_edit("7.png", None))
        assert self.fixed(store) == (False, False)


class TestCarried:
    def test_another_installation_learns_why(self, store, there, state, tmp_path) -> None:
        change(store, LEAVE)
        export_dataset(store, "demo", "touchline", tmp_path / "carried.zip")
        report = ReaderReport()
        carried = tmp_path / "carried.zip"
        merge_edits(there, "demo", carried, report, DEFAULT_LIMITS, source="here", actor="zoe")
        assert (why(there), report.problems) == (WHY, [])
