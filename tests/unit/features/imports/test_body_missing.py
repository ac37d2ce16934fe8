from __future__ import annotations

from dataclasses import replace

import pytest

from app.features.groups.edit import make_set_ball_edit
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.body import GONE
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box


def bring(store, groups, **options):
    return import_groups(store, "demo", groups, source="test", actor="ann", **options)


def told(store, group_id: int) -> list[str]:
    solve_dataset(store, "demo")
    return [item.sentence for item in load_group_state(store, group_id).solution.findings]


@pytest.fixture
def three(fill, make_group, make_static):
    return fill(make_group(7), make_group(8), make_static(10))


class TestNoteGone:
    def test_a_group_that_its_source_dropped_stays_and_says_so(
        self, store, three, make_group
    ) -> None:
        report = bring(store, [make_group(7)])
        assert (report.missing, report.findings) == (2, 1)
        assert GONE in told(store, three[1])
        assert GONE not in told(store, three[0])

    def test_groups_of_a_match_that_was_not_imported_are_not_missing(
        self, store, three, make_group
    ) -> None:
        bring(store, [make_group(7)])
        assert GONE not in told(store, three[2])

    def test_a_second_import_does_not_repeat_the_finding(self, store, three, make_group) -> None:
        bring(store, [make_group(7)])
        assert bring(store, [make_group(7)]).findings == 0
        assert told(store, three[1]).count(GONE) == 1

    def test_a_group_that_comes_back_loses_its_finding(self, store, three, make_group) -> None:
        bring(store, [make_group(7)])
        bring(store, [make_group(7), make_group(8)])
        assert GONE not in told(store, three[1])
        assert bring(store, [make_group(7), make_group(8)]).changed == 0

    def test_a_dry_run_says_nothing_to_others(self, store, three, make_group) -> None:
        assert bring(store, [make_group(7)], dry_run=True).missing == 2
        assert GONE not in told(store, three[1])

    def test_a_dry_run_counts_the_findings_that_the_import_saves(
        self, store, three, make_group
    ) -> None:
        for groups in ([make_group(7)], [make_group(9)]):
            dry = bring(store, groups, dry_run=True)
            done = bring(store, groups)
            assert (dry.findings, dry.missing) == (done.findings, done.missing)
            assert done.findings == 1

    def test_other_pictures_of_no_match_in_a_file_of_the_same_name_make_nothing_missing(
        self, store, fill, make_group
    ) -> None:
        plain = [replace(make_group(number), match="") for number in (1, 2, 3, 4)]
        ids = fill(*plain[:2])
        report = bring(store, plain[2:])
        assert (report.missing, report.findings) == (2, 0)
        assert GONE not in told(store, ids[0])

    def test_a_picture_of_no_match_that_left_its_series_is_missing(
        self, store, fill, make_group
    ) -> None:
        plain = [replace(make_group(number), match="") for number in (1, 2, 3)]
        ids = fill(*plain[:2])
        assert bring(store, plain[1:]).findings == 1
        assert GONE in told(store, ids[0])

    def test_an_edit_stays_and_the_log_replays(self, store, three, make_group) -> None:
        ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
        etag = load_group_state(store, three[1]).etag
        submit_edit(store, three[1], make_set_ball_edit("8.png", ball), if_match=etag, actor="ben")
        bring(store, [make_group(7)])
        state = load_group_state(store, three[1])
        assert (state.group.view("8.png").ball, state.stored.edited_views) == (ball, {"8.png"})
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
