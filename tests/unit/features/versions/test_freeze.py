from __future__ import annotations

from dataclasses import replace

import pytest
from sqlalchemy import delete, func, select, text, update

from app.db.log import LogModel
from app.errors import ConflictError, InputError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.replay import replay_log
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import import_groups
from app.features.policies.service import change_policy
from app.features.queue.service import list_groups
from app.features.queue.tables import QueueModel
from app.features.solutions.queries import SolutionModel
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset, plan_freeze
from app.features.versions.membership import make_version_manifest
from app.features.versions.queries import FrozenModel, VersionGroupModel, VersionModel, read_rows
from app.features.versions.service import list_versions, read_frozen_groups
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import Media
from app.soccer.policy import STRICT
from app.soccer.split import Split
from tests.databases import content, said_for_sqlite

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))


def judge(store, group_id, state, reason=None, note=None, actor="ann"):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, note, if_match=etag, actor=actor)


def frozen(store, name="v1", **options):
    return freeze_dataset(store, "demo", FreezeRequest(name, **options), actor="ann")


def rows_of(store, version):
    with store.read() as session:
        return list(read_rows(session, version.id))


def without_markings(solution):
    """What a version needs of a solution."""
    views = tuple(
        replace(view, calibration=replace(view.calibration, markings=())) for view in solution.views
    )
    return replace(solution, views=views)


@pytest.fixture
def judged(store, once, fill, make_group):
    """Accepted, rejected, accepted against a gate, failing, unreviewed."""

    def make():
        ids = fill(
            make_group(7),
            make_group(8),
            make_group(9, shift=80.0),
            make_group(10, shift=80.0),
            make_group(11),
        )
        judge(store, ids[0], "accepted")
        judge(store, ids[1], "rejected", "bad_calibration", "look at the box")
        judge(store, ids[2], "accepted", note="seen on video")
        return ids

    return once("judged", make)


@pytest.fixture
def elsewhere(there, make_group):
    """Another home with the same content: another order, name, people, folder and history."""
    store = there
    groups = [make_group(11), make_group(9, shift=80.0), make_group(8), make_group(7)]
    groups = [moved(group) for group in [make_group(10, shift=80.0), *groups]]
    import_groups(store, "other", groups, source="somewhere", actor="zoe")
    solve_dataset(store, "other")
    ids = {row.key.rpartition("/")[2]: row.id for row in list_groups(store, 1, limit=9).items}
    judge(store, ids["9.png"], "accepted", note="seen on video", actor="zoe")
    judge(store, ids["8.png"], "rejected", "bad_calibration", "look at the box", actor="zoe")
    judge(store, ids["7.png"], "deferred", actor="zoe")
    judge(store, ids["7.png"], "accepted", actor="yan")
    return store


def moved(group):
    """The same group with its frames in another place, or nowhere."""
    views = tuple(
        replace(view, media=None if number else Media(f"/elsewhere/{view.key}"))
        for number, view in enumerate(group.views)
    )
    return replace(group, views=views)


class TestFreeze:
    def test_without_a_name_it_is_the_next_number_that_is_free(self, store, judged) -> None:
        frozen(store, "v2")
        assert [frozen(store, None).name for _ in range(2)] == ["v1", "v3"]

    def test_policy_and_verdict_decide_and_everything_else_says_why_not(
        self, store, judged
    ) -> None:
        version = frozen(store)
        rows = {row.key.rpartition("/")[2]: row for row in rows_of(store, version)}
        assert {key for key, row in rows.items() if row.member} == {"7.png", "9.png"}
        assert rows["8.png"].why == "rejected: bad_calibration"
        assert rows["11.png"].why == rows["10.png"].why == "unreviewed"
        assert rows["9.png"].verdict["override"] == "reprojection"
        assert (version.counts["groups"], version.counts["overrides"]) == (2, 1)

    @pytest.mark.parametrize("rule", ["accepted", "passing"])
    def test_a_group_that_passes_by_now_overrides_nothing(self, store, judged, rule: str) -> None:
        loose = replace(STRICT, name="loose", tau_percent=50.0, min_p_value=0.0, max_sigma_m=50.0)
        change_policy(store, "demo", loose, if_match=None, actor="ann")
        solve_dataset(store, "demo")
        version = frozen(store, groups=rule)
        row = next(row for row in rows_of(store, version) if row.key.endswith("9.png"))
        assert row.member
        assert (row.verdict["state"], row.verdict["override"]) == ("accepted", None)
        assert version.counts["overrides"] == 0
        assert make_version_manifest(store, version.id)["overrides"] == []

    def test_its_manifest_names_verdicts_overrides_and_what_was_refused(
        self, store, judged
    ) -> None:
        version = frozen(store, groups="passing", note="second try")
        manifest = make_version_manifest(store, version.id)
        assert manifest["verdicts"] == {"accepted": 2, "unreviewed": 1}
        (override,) = manifest["overrides"]
        assert override["group"].endswith("9.png")
        assert (override["gate"], override["reason"]) == (
            "reprojection",
            "overrides reprojection: seen on video",
        )
        (rejected,) = manifest["frozen"]["rejected"]
        assert rejected["group"].endswith("8.png")
        assert (rejected["reason"], rejected["note"]) == ("bad_calibration", "look at the box")
        assert (manifest["version"], manifest["frozen"]["note"]) == ("v1", "second try")
        assert manifest["settings"]["policy_hash"] == version.policy.hash

    def test_passing_takes_what_the_policy_passes_and_nobody_refused(self, store, judged) -> None:
        version = frozen(store, groups="passing")
        rows = {row.key.rpartition("/")[2]: row for row in rows_of(store, version)}
        assert {key for key, row in rows.items() if row.member} == {"7.png", "9.png", "11.png"}
        assert rows["10.png"].why == "fails reprojection"

    def test_a_ball_that_cannot_be_used_passes_only_with_the_word_of_a_person(
        self, store, judged
    ) -> None:
        with store.write() as session:
            unusable = {"findings": ",implausible_ball,", "passes": True}
            chosen = QueueModel.group_id.in_((judged[0], judged[4]))
            session.execute(update(QueueModel).where(chosen).values(unusable))
        request = FreezeRequest("v1", groups="passing")
        assert plan_freeze(store, "demo", request).left_out["unusable ball"] == 1
        rows = {
            row.key.rpartition("/")[2]: row
            for row in rows_of(store, frozen(store, groups="passing"))
        }
        assert (rows["7.png"].member, rows["11.png"].member) == (True, False)
        assert rows["11.png"].why == "unusable ball"

    def test_a_group_that_changed_after_its_verdict_stays_out(self, store, judged) -> None:
        etag = load_group_state(store, judged[0]).etag
        submit_edit(store, judged[0], make_set_ball_edit("7.png", BALL), if_match=etag, actor="ben")
        assert rows_of(store, frozen(store))[0].why == "changed after its verdict"

    def test_two_homes_freeze_the_same_hash(self, store, judged, elsewhere) -> None:
        here = frozen(store, note="here")
        there = freeze_dataset(elsewhere, "other", FreezeRequest("w", licence="mine"), actor="zoe")
        assert here.hash == there.hash
        assert len(here.hash) == 64

    @pytest.mark.parametrize("change", ["ball", "verdict", "reason", "policy", "split"])
    def test_the_hash_covers_annotations_verdicts_policy_and_split(
        self, store, judged, change: str
    ) -> None:
        first = frozen(store)
        match change:
            case "ball":
                etag = load_group_state(store, judged[0]).etag
                submit_edit(
                    store, judged[0], make_set_ball_edit("7.png", BALL), if_match=etag, actor="ben"
                )
                judge(store, judged[0], "accepted", note="all the same")
            case "verdict":
                judge(store, judged[4], "accepted")
            case "reason":
                judge(store, judged[1], "rejected", "sides_confused", "look at the box")
            case "policy":
                change_policy(
                    store, "demo", replace(STRICT, max_height_m=39.0), if_match=None, actor="ann"
                )
                solve_dataset(store, "demo")
                judge(store, judged[2], "accepted", note="seen on video")
        split = Split("camera", test_cameras=("7.png",)) if change == "split" else Split()
        assert frozen(store, "v2", split=split).hash != first.hash

    def test_the_same_state_has_the_same_hash_and_costs_no_second_copy(self, store, judged) -> None:
        first = frozen(store)
        with store.read() as session:
            before = session.scalar(select(func.count()).select_from(FrozenModel))
        judge(store, judged[0], "accepted", actor="ben")
        second = frozen(store, "v2")
        with store.read() as session:
            assert session.scalar(select(func.count()).select_from(FrozenModel)) == before
        assert (second.hash, second.previous) == (first.hash, first.id)

    def test_later_edits_and_deleted_solutions_do_not_reach_a_version(self, store, judged) -> None:
        before, version = load_group_state(store, judged[0]), frozen(store)
        submit_edit(
            store, judged[0], make_set_ball_edit("7.png", BALL), if_match=before.etag, actor="ben"
        )
        with store.write() as session:
            session.execute(delete(SolutionModel))
            session.execute(text("DELETE FROM calibration"))
        with store.read() as session:
            (row, _) = read_rows(session, version.id, members=True)
            (item,) = read_frozen_groups(session, version, [row])
        assert item.group == before.group
        assert item.solution == without_markings(before.solution)

    def test_a_shared_camera_is_frozen_once(self, store, fill, make_static) -> None:
        fill(*(make_static(frame) for frame in (10, 11, 12)))
        version = frozen(store, groups="passing")
        with store.read() as session:
            keys = list(session.scalars(select(FrozenModel.key)))
            rows = list(read_rows(session, version.id))
            groups = [item.group for item in read_frozen_groups(session, version, rows)]
        assert sum(key.startswith("station:") for key in keys) == 3
        assert groups == [make_static(frame) for frame in (10, 11, 12)]

    def test_groups_lie_in_the_order_of_their_numbers(self, store, fill, make_static) -> None:
        fill(*(make_static(frame) for frame in (100, 9, 20)))
        rows = rows_of(store, frozen(store, groups="passing"))
        assert [row.key for row in rows] == ["9", "20", "100"]

    def test_cameras_split_views(self, store, fill, make_static) -> None:
        fill(make_static(10))
        version = frozen(store, groups="passing", split=Split("camera"))
        (row,) = rows_of(store, version)
        assert row.splits == {"cam1": "test", "cam2": "test", "cam3": "train"}
        assert version.counts["splits"]["test"] == {"groups": 0, "views": 2, "balls": 2}

    def test_a_split_by_a_camera_that_nobody_has_is_refused(self, store, judged) -> None:
        with pytest.raises(InputError, match="test camera"):
            frozen(store, split=Split("camera"))

    def test_a_dataset_with_unsolved_groups_is_not_frozen(self, store, judged) -> None:
        with store.write() as session:
            session.execute(delete(SolutionModel))
        change_policy(store, "demo", STRICT, if_match=None, actor="ann")
        with pytest.raises(ConflictError, match="2 groups that may take part are not solved yet"):
            frozen(store)

    def test_what_an_earlier_solver_solved_waits_and_how_to_solve_it_is_said(
        self, store, judged, upgrade_solver
    ) -> None:
        upgrade_solver()
        with pytest.raises(
            ConflictError, match="2 groups that may take part are not solved yet"
        ) as refused:
            frozen(store)
        assert 'touchline solve --dataset "demo"' in str(refused.value.hint)
        assert plan_freeze(store, "demo", FreezeRequest()).unsolved == 2
        solve_dataset(store, "demo")
        assert plan_freeze(store, "demo", FreezeRequest(), strict=True).groups == 2

    def test_a_name_is_taken_once(self, store, judged) -> None:
        frozen(store)
        with pytest.raises(ConflictError, match='has a version "v1"'):
            frozen(store)

    @pytest.mark.parametrize("name", ["", "../v1", "12", "a" * 101, "v1\n"])
    def test_a_name_that_no_file_could_have_is_refused(self, store, judged, name: str) -> None:
        with pytest.raises(InputError) as caught:
            frozen(store, name)
        assert caught.value.pointer == "/name"

    def test_nothing_to_freeze_is_one_sentence(self, store, fill, make_group) -> None:
        fill(make_group(7))
        with pytest.raises(
            InputError, match=r"no group of \"demo\" can be in the version \(1 unrev"
        ):
            frozen(store)
        assert list_versions(store, "demo") == []

    def test_stopped_midway_it_has_not_happened_and_can_be_done_again(self, store, judged) -> None:
        def stop(*_: object) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            freeze_dataset(store, "demo", FreezeRequest("v1"), actor="ann", progress=stop)
        assert list_versions(store, "demo") == []
        frozen(store)

    def test_a_version_whose_entry_cannot_be_logged_is_not_there(
        self, store, judged, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        before = content(store)

        def stop(*_: object) -> None:
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr("app.features.versions.freeze.append_entries", stop)
            with pytest.raises(KeyboardInterrupt):
                frozen(store)
        after = content(store)
        assert (after["version"], after["log"]) == (before["version"], before["log"])
        assert list_versions(store, "demo") == []
        frozen(store)

    def test_it_is_logged_and_the_log_replays(self, store, judged) -> None:
        version = frozen(store)
        with store.read() as session:
            entry = session.execute(select(LogModel.kind).order_by(LogModel.id.desc())).first()
            replay_log(session)
        assert entry.kind == "freeze"
        assert version.licence.startswith("SoccerNet annotations")


class TestPlanFreeze:
    def test_counts_and_saves_nothing(self, store, judged) -> None:
        before = content(store)
        plan = plan_freeze(store, "demo", FreezeRequest("v1"))
        assert (plan.groups, plan.unsolved) == (2, 0)
        assert plan.left_out == {"rejected: bad_calibration": 1, "unreviewed": 2}
        assert content(store) == before

    @pytest.mark.parametrize(
        "split", [Split(), Split("match", seed=3, test_share=0.2), Split("camera")], ids=str
    )
    def test_it_foretells_how_many_groups_and_views_each_split_has(
        self, store, fill, make_group, split
    ) -> None:
        fill(*(replace(make_group(at), match=f"league/2020/{at % 3}") for at in range(7)))
        if split.kind == "camera":
            split = replace(split, test_cameras=("1.png", "2.png"))
        request = FreezeRequest("v1", split=split, groups="passing")
        plan = plan_freeze(store, "demo", request)
        version = freeze_dataset(store, "demo", request, actor="ann")
        counts = {side: of["groups"] for side, of in version.counts["splits"].items()}
        assert plan.splits == {side: n for side, n in counts.items() if n}
        assert sum(plan.splits.values()) == plan.groups > 0
        views = {side: of["views"] for side, of in version.counts["splits"].items()}
        assert plan.views == {side: n for side, n in views.items() if n}

    def test_it_names_test_cameras_without_a_view(self, store, fill, make_group) -> None:
        fill(*map(make_group, range(3)))
        request = FreezeRequest(
            split=Split("camera", test_cameras=("1.png", "x")), groups="passing"
        )
        assert plan_freeze(store, "demo", request).unknown_cameras == ("x",)
        request = replace(request, split=Split("camera", test_cameras=("x", "y")))
        with pytest.raises(InputError, match=r"test camera \(x, y\)"):
            plan_freeze(store, "demo", request)

    def test_a_strict_plan_refuses_what_freezing_refuses(self, store, fill, make_group) -> None:
        fill(make_group(7))
        with pytest.raises(InputError):
            plan_freeze(store, "demo", FreezeRequest("v1"), strict=True)


class TestTriggers:
    @pytest.mark.parametrize(
        "statement",
        [
            "UPDATE version SET note = 'x'",
            "UPDATE version_group SET split = 'test'",
            "UPDATE frozen SET body = x'00'",
            "UPDATE frozen SET key = 'calibration:x' WHERE body IS NULL",
            "DELETE FROM version",
            "DELETE FROM version_group",
            "DELETE FROM frozen",
            "INSERT OR REPLACE INTO version SELECT * FROM version",
            "INSERT OR REPLACE INTO version_group SELECT * FROM version_group",
            "INSERT INTO version_group SELECT version_id, 99, 'x', match, member, why, split, "
            "splits, verdict, said, solution, ball, frames FROM version_group LIMIT 1",
        ],
    )
    def test_the_database_refuses_to_change_a_version(self, store, judged, statement) -> None:
        frozen(store)
        with store.write() as session, said_for_sqlite(session):
            with pytest.raises(Exception, match="never changed"):
                session.execute(text(statement))
            session.rollback()

    def test_frozen_content_is_not_replaced(self, store, judged) -> None:
        frozen(store)
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("INSERT OR REPLACE INTO frozen SELECT 1, key, x'00' FROM frozen"))
            assert not session.scalar(text("SELECT count(*) FROM frozen WHERE body = x'00'"))

    def test_versions_go_with_their_dataset_alone(self, store, judged) -> None:
        frozen(store)
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("PRAGMA defer_foreign_keys = ON"))
            session.execute(text("DELETE FROM dataset"))
            for model in (VersionModel, VersionGroupModel, FrozenModel):
                assert session.scalar(select(func.count()).select_from(model)) == 0
            session.rollback()
