from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.errors import ConflictError, NotFoundError
from app.features.groups.edit import SetLines, SetPictureGeometry
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.ingest import import_groups
from app.features.match_estimates import positions as editing
from app.features.match_estimates import queries as positions_in_store
from app.features.match_estimates.positions import (
    get_main_camera_positions,
    share_positions,
    undo_position_sharing,
)
from app.features.pitches.service import change_pitches
from app.features.policies.service import change_policy
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.verify import verify_version
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.soccer.picture import OPEN
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, CalibrationPolicy
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEND, click

MATCH = "a_match"
STAND = (1.0, 62.0, -16.0)
SHARING = replace(PAPER, name="sharing", calibration=CalibrationPolicy(share_position=True))


@cache
def match() -> tuple[Group, ...]:
    """Six groups of a match; the main camera stands where it stands, a replay stands elsewhere."""
    groups = []
    for number in range(6):
        target = (-20.0 + 8.0 * number, -4.0, 0.0)
        views = []
        for name, stand in (("", STAND), ("_1", (30.0, 55.0, -9.0))):
            camera = looking(stand, target, 1200.0, bend=BEND)
            key = f"{MATCH}/{number}{name}.png"
            station = Station(key, SIZE, lines=click(camera, 1.0, number, Pitch()))
            at = ImagePoint(*camera.project(np.array([[*target[:2], -1.0]]))[0].tolist())
            ball = BallAnnotation(point=at)
            views.append(View(f"{number}{name}.png", station, (ball,)))
        groups.append(Group(f"{MATCH}/{number}.png", tuple(views), match=MATCH))
    return tuple(groups)


@pytest.fixture
def shared(store, once):
    """The match, its positions shared, and solved."""

    def fill():
        import_groups(store, "demo", match(), source="files", actor="ann")
        solve_dataset(store, "demo")
        change_policy(store, "demo", SHARING, if_match=None, actor="ann")
        share_positions(store, "demo", actor="ann")
        solve_dataset(store, "demo")

    once("shared positions", fill)
    return store


def state(store):
    (item,) = get_main_camera_positions(store, "demo").items
    return item


def stand(store, number):
    return load_group_state(store, number).solution.views[0].calibration.camera.position


def keys(store):
    """Which calibration the main camera of each group has."""
    solved = [load_group_state(store, number).solution.views[0] for number in range(1, 7)]
    return [view.calibration_key for view in solved]


def draw(store, number):
    """Edit the lines of a group's main camera."""
    at = load_group_state(store, number)
    view = at.group.views[0].key
    edit = SetLines(view, {"Circle central": None, "Middle line": None})
    return submit_edit(store, number, edit, if_match=at.etag, actor="ann")


class TestSharePositions:
    def test_is_refused_where_the_policy_would_not_use_it(self, store):
        import_groups(store, "demo", match(), source="files", actor="ann")
        with pytest.raises(ConflictError, match="does not use"):
            share_positions(store, "demo", actor="ann")

    def test_each_picture_of_the_main_camera_gets_what_the_others_say(self, shared):
        item = state(shared)
        assert (item.groups, item.views, item.shared, item.current) == (6, 6, 6, True)
        assert np.linalg.norm(np.subtract(item.mean, STAND)) < 0.5
        for number in range(1, 7):
            group = load_group_state(shared, number).group
            assert list(group.positions) == [group.views[0].key]

    def test_its_own_lines_have_no_part_in_it(self, shared):
        (before,) = load_group_state(shared, 1).group.positions.values()
        draw(shared, 1)
        share_positions(shared, "demo", [MATCH], actor="ann")
        (after,) = load_group_state(shared, 1).group.positions.values()
        # They say where it looks, and frames that look the same way count more.
        assert after.mean == pytest.approx(before.mean, abs=0.02)

    def test_cameras_stand_closer_together(self, shared):
        apart = [np.linalg.norm(stand(shared, number) - STAND) for number in range(1, 7)]
        change_policy(shared, "demo", PAPER, if_match=None, actor="ann")
        solve_dataset(shared, "demo")
        alone = [np.linalg.norm(stand(shared, number) - STAND) for number in range(1, 7)]
        assert np.mean(apart) < 0.9 * np.mean(alone)

    def test_another_policy_than_one_that_shares_gives_what_was_before(self, shared, store):
        replay_view = load_group_state(shared, 1).solution.views[1].calibration_key
        with_position = load_group_state(shared, 1).solution.views[0].calibration_key
        change_policy(shared, "demo", PAPER, if_match=None, actor="ann")
        solve_dataset(shared, "demo")
        after = load_group_state(shared, 1).solution.views
        assert after[1].calibration_key == replay_view
        assert after[0].calibration_key != with_position

    def test_an_edit_solves_its_group_at_once_and_no_other(self, shared):
        draw(shared, 1)
        assert load_group_state(shared, 1).solution is not None
        assert list_stale_groups(shared, "demo") == []
        assert state(shared).current is False
        assert "the data that it was estimated from has changed" in state(shared).sentence
        assert "share it again" in state(shared).sentence

    def test_it_is_renewed_when_somebody_asks_and_the_others_follow(self, shared):
        draw(shared, 1)
        share_positions(shared, "demo", actor="ben")
        assert state(shared).current is True
        assert {2, 3, 4, 5, 6} <= set(list_stale_groups(shared, "demo"))

    def test_what_is_current_is_left_alone(self, shared):
        share_positions(shared, "demo", actor="ann")
        assert [entry.kind for entry in read_history(shared, 1)] == ["import", "position"]

    def test_another_size_of_the_pitch_makes_it_old(self, shared):
        with shared.write() as session:
            wanted = {MATCH: Pitch(103.0, 66.0)}
            change_pitches(session, "demo", wanted, if_match=None, actor="ann")
        assert state(shared).current is False

    def test_too_few_pictures_share_nothing(self, store):
        import_groups(store, "demo", match()[:3], source="files", actor="ann")
        change_policy(store, "demo", SHARING, if_match=None, actor="ann")
        share_positions(store, "demo", actor="ann")
        assert (state(store).shared, state(store).current) == (0, True)

    def test_an_unknown_match_is_refused(self, shared):
        with pytest.raises(NotFoundError, match="no match nowhere"):
            share_positions(shared, "demo", ["nowhere"], actor="ann")

    def test_the_log_tells_it_again(self, shared):
        with shared.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        before = [load_group_state(shared, number).stored for number in (1, 4)]
        rebuild_tables(shared)
        assert [load_group_state(shared, number).stored for number in (1, 4)] == before

    def test_undo_of_a_group_takes_back_its_own_edits_alone(self, shared):
        draw(shared, 1)
        positions = load_group_state(shared, 1).group.positions
        after = undo_group_edit(shared, 1, if_match=load_group_state(shared, 1).etag, actor="ann")
        assert after.group.positions == positions
        assert state(shared).current is True

    def test_an_import_keeps_it(self, shared):
        first, *_ = match()
        changed = replace(first, label="the source says more of it now")
        import_groups(shared, "demo", (changed,), source="files", actor="ann")
        assert load_group_state(shared, 1).group.label == changed.label
        assert len(load_group_state(shared, 1).group.positions) == 1
        with shared.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_off_it_is_kept_not_used_and_as_current_as_before(self, shared):
        change_policy(shared, "demo", PAPER, if_match=None, actor="ann")
        assert state(shared).current is True
        assert "keep a shared position" in state(shared).sentence
        assert state(shared).sentence.endswith("the policy does not use it")
        draw(shared, 1)
        assert (
            "does not use it, and the data that it was estimated from has" in state(shared).sentence
        )

    def test_a_view_whose_picture_was_changed_takes_no_part(self, shared):
        edit = SetPictureGeometry(load_group_state(shared, 1).group.views[0].key, OPEN)
        submit_edit(shared, 1, edit, if_match=load_group_state(shared, 1).etag, actor="ann")
        share_positions(shared, "demo", actor="ann")
        assert load_group_state(shared, 1).group.positions == {}
        assert (state(shared).shared, state(shared).current) == (5, True)

    def test_looking_reads_one_entry_a_match(self, shared, monkeypatch):
        asked = []
        whole = positions_in_store.read_entries

        def counting(session, ids):
            asked.append(len(ids))
            return whole(session, ids)

        monkeypatch.setattr(positions_in_store, "read_entries", counting)
        assert state(shared).current is True
        assert asked == [1]
        take_back(shared, MATCH)
        assert max(asked) > 1
        assert state(shared).shared == 0

    def test_a_group_that_comes_from_another_match_brings_nothing_said_there(self, shared):
        first, *_ = match()
        import_groups(shared, "demo", (replace(first, match="b"),), source="files", actor="ann")
        assert {
            item.match: item.current for item in get_main_camera_positions(shared, "demo").items
        } == {
            MATCH: False,
            "b": None,
        }

    def test_where_a_newer_group_came_from_elsewhere_its_own_share_counts(self, shared):
        *_, fifth, sixth = match()
        import_groups(shared, "demo", (replace(fifth, match="b"),), source="files", actor="ann")
        share_positions(shared, "demo", ["b"], actor="ann")
        draw(shared, 1)
        share_positions(shared, "demo", [MATCH], actor="ann")
        import_groups(shared, "demo", (replace(sixth, match="b"),), source="files", actor="ann")
        (other,) = [
            item for item in get_main_camera_positions(shared, "demo").items if item.match == "b"
        ]
        assert other.current is False

    def test_a_group_that_leaves_while_it_is_estimated_gets_nothing(self, shared, monkeypatch):
        whole = editing._run_position_task
        first, *_ = match()

        def estimate(task):
            import_groups(shared, "demo", (replace(first, match="b"),), source="files", actor="ann")
            return whole(task)

        monkeypatch.setattr(editing, "_run_position_task", estimate)
        share_positions(shared, "demo", [MATCH], actor="ann")
        assert load_group_state(shared, 1).group.positions == {}

    def test_an_import_into_another_match_leaves_it_behind(self, shared):
        first, *_ = match()
        import_groups(shared, "demo", (replace(first, match="b"),), source="files", actor="ann")
        assert load_group_state(shared, 1).group.positions == {}

    def test_a_version_holds_it_and_is_verified_bit_for_bit(self, shared):
        version = freeze_dataset(
            shared, "demo", FreezeRequest("one", groups="passing"), actor="ann"
        )
        take_back(shared, MATCH)
        report = verify_version(shared, version.id)
        assert (report.ok, report.groups) == (True, 6)


def take_back(store, name):
    with store.write() as session:
        undo_position_sharing(session, "demo", name, actor="ann")


class TestTakeBackPositions:
    def test_cameras_are_again_what_their_lines_alone_make_them(self, shared):
        shared_keys = keys(shared)
        take_back(shared, MATCH)
        assert (state(shared).shared, state(shared).current) == (0, None)
        solve_dataset(shared, "demo")
        alone = keys(shared)
        change_policy(shared, "demo", PAPER, if_match=None, actor="ann")
        assert keys(shared) == alone != shared_keys

    def test_a_take_back_is_not_taken_back(self, shared):
        take_back(shared, MATCH)
        with pytest.raises(ConflictError, match="share no camera position"):
            take_back(shared, MATCH)
        assert (state(shared).shared, state(shared).current) == (0, None)

    def test_each_share_is_taken_back_once_the_newest_first(self, shared):
        first = load_group_state(shared, 2).group.positions
        draw(shared, 1)
        share_positions(shared, "demo", actor="ann")
        assert load_group_state(shared, 2).group.positions != first
        take_back(shared, MATCH)
        assert (load_group_state(shared, 2).group.positions, state(shared).current) == (
            first,
            False,
        )
        take_back(shared, MATCH)
        assert (state(shared).shared, state(shared).current) == (0, None)
        share_positions(shared, "demo", actor="ann")
        take_back(shared, MATCH)
        with pytest.raises(ConflictError, match="share no camera position"):
            take_back(shared, MATCH)

    def test_what_a_group_had_in_another_match_is_not_taken_back(self, shared):
        first, *_ = match()
        import_groups(shared, "demo", (replace(first, match="b"),), source="files", actor="ann")
        with pytest.raises(ConflictError, match="the frames of b share no camera position"):
            take_back(shared, "b")

    def test_where_nothing_was_shared_it_is_refused(self, store):
        import_groups(store, "demo", match(), source="files", actor="ann")
        with pytest.raises(ConflictError, match="share no camera position"):
            take_back(store, MATCH)
