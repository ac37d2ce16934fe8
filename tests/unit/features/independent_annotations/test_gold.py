from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random

import numpy as np
import pytest

from app.errors import ConflictError, InputError, NotFoundError
from app.evaluation.annotation_distance import measure_marking_distance
from app.features.groups.edit import SetLines, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.submit import load_group_state, submit_edit
from app.features.independent_annotations.adopt import return_annotation
from app.features.independent_annotations.gold import (
    mark_gold_group,
    median_interval,
    read_gold_report,
    set_gold_start,
    unmark_gold_group,
    wilson_interval,
)
from app.features.independent_annotations.known_truth import (
    BatchAnnotationTerms,
    begin_next_annotation,
)
from app.features.independent_annotations.queries import read_gold_truth
from app.features.independent_annotations.service import submit_annotation
from app.features.verdicts.service import set_verdict
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint


def judge(store, group_id, state="accepted", actor="lea", reason=None):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, "seen", if_match=etag, actor=actor)


def change(store, group_id, edit, actor):
    return submit_edit(
        store, group_id, edit, if_match=load_group_state(store, group_id).etag, actor=actor
    )


@pytest.fixture
def terms(store, fill, make_group) -> BatchAnnotationTerms:
    """A batch of two groups of three; the third one is gold."""
    groups = fill(*(make_group(number) for number in (1, 2, 3)))
    judge(store, groups[2])
    mark_gold_group(store, groups[2], "imported", actor="lea")
    dataset_id = load_group_state(store, groups[0]).dataset_id
    return BatchAnnotationTerms(4, dataset_id, groups[:2], 2, True, "2000", gold_every=2)


class TestMark:
    def test_only_a_group_with_a_verdict_is_made_gold(self, store, state) -> None:
        with pytest.raises(ConflictError):
            mark_gold_group(store, state.id, "bare", actor="lea")
        with pytest.raises(InputError):
            mark_gold_group(store, state.id, "half", actor="lea")
        judge(store, state.id)
        assert mark_gold_group(store, state.id, "bare", actor="lea").start == "bare"
        assert unmark_gold_group(store, state.id, actor="lea").group == state.id
        with pytest.raises(NotFoundError):
            unmark_gold_group(store, state.id, actor="lea")

    def test_the_history_of_a_group_does_not_tell_that_it_is_gold(self, store, state) -> None:
        judge(store, state.id)
        before = [entry.kind for entry in read_history(store, state.id)]
        etag = load_group_state(store, state.id).etag
        mark_gold_group(store, state.id, "bare", actor="lea")
        assert [entry.kind for entry in read_history(store, state.id)] == before
        assert load_group_state(store, state.id).etag == etag


class TestStartWith:
    def test_what_is_true_stays_although_the_group_is_another_by_now(self, store, state) -> None:
        judge(store, state.id)
        marked = mark_gold_group(store, state.id, "bare", actor="lea")
        with store.read() as session:
            truth = read_gold_truth(session, state.id)
        view = state.group.views[0]
        change(
            store,
            state.id,
            make_set_ball_edit(view.key, BallAnnotation(box=Box(1, 1, 9, 9))),
            "ann",
        )
        changed = set_gold_start(store, state.id, "without_balls", actor="max")
        assert changed == replace(marked, start="without_balls")
        assert read_gold_report(store, state.dataset_id).groups == (changed,)
        with store.read() as session:
            assert read_gold_truth(session, state.id) == truth

    def test_of_an_ordinary_group_there_is_nothing_to_begin_with(self, store, state) -> None:
        with pytest.raises(NotFoundError, match="not a gold group"):
            set_gold_start(store, state.id, "bare", actor="lea")
        with pytest.raises(NotFoundError, match="there is no group 99"):
            set_gold_start(store, 99, "bare", actor="lea")
        judge(store, state.id)
        mark_gold_group(store, state.id, "bare", actor="lea")
        with pytest.raises(InputError) as refused:
            set_gold_start(store, state.id, "half", actor="lea")
        assert refused.value.pointer == "/start"


class TestMixing:
    def test_each_gold_group_once_and_it_looks_like_the_others(self, store, terms) -> None:
        copies, kinds = [], []
        while (
            take := begin_next_annotation(store, terms, person="ann", chance=Random(1))
        ) is not None:
            copies.append(load_group_state(store, take.copy_id))
            kinds.append(take.kind)
            judge(store, take.copy_id, actor="ann")
        assert sorted(kinds) == ["gold", "independent", "independent"]
        shapes = {
            (copy.group.match, copy.group.split, tuple(copy.view_ids), copy.can_undo)
            for copy in copies
        }
        assert len(shapes) == 1
        assert [copy.group.label for copy in copies] == ["Group 1", "Group 2", "Group 3"]
        kinds_of = {tuple(e.kind for e in read_history(store, copy.id)) for copy in copies}
        assert kinds_of == {("import", "verdict", "take")}

    @pytest.mark.parametrize(
        ("start", "balls", "lines"), [("without_balls", 0, True), ("bare", 0, False)]
    )
    def test_it_is_stripped_of_what_is_measured(self, store, terms, start, balls, lines) -> None:
        gold = read_gold_report(store, terms.dataset_id).groups[0]
        mark_gold_group(store, gold.group, start, actor="lea")
        chance = Random(1)
        takes = []
        while (
            take := begin_next_annotation(store, terms, person="ann", chance=chance)
        ) is not None:
            takes.append(take)
            judge(store, take.copy_id, actor="ann")
        (found,) = [take for take in takes if take.kind == "gold"]
        for view in load_group_state(store, found.copy_id).group.views:
            assert len(view.balls) == balls and bool(view.station.lines) == lines


class TestReadReport:
    def test_it_says_how_far_somebody_is_from_the_truth(self, store, terms) -> None:
        while (take := begin_next_annotation(store, terms, person="ann")) is not None:
            if take.kind == "gold":
                group = load_group_state(store, take.copy_id).group
                view = group.views[0]
                box = view.balls[0].box
                moved = BallAnnotation(box=Box(box.x + 3.0, box.y + 4.0, box.width, box.height))
                change(store, take.copy_id, make_set_ball_edit(view.key, moved), "ann")
                name = next(iter(view.station.lines))
                gone = SetLines(view.key, {name: None})
                change(store, take.copy_id, gone, "ann")
            reject = ("rejected", "ann", "bad_field_lines")
            state, actor, reason = reject if take.kind == "gold" else ("accepted", "ann", None)
            judge(store, take.copy_id, state, actor, reason)
        (person,) = read_gold_report(store, terms.dataset_id).people
        (result,) = person.results
        assert (result.verdict, result.true_verdict, result.right) == (
            "rejected",
            "accepted",
            False,
        )
        assert result.error.ball_px == pytest.approx(5.0)
        assert (result.error.line_px, result.error.lines_missing) == (0.0, 1)
        assert result.error.ball_m is not None and result.error.ball_m > 0.0
        assert (person.line_px.count, person.line_px.low) == (1, None)

    def test_what_was_submitted_first_is_measured_whatever_a_lead_returned_since(
        self, store, terms
    ) -> None:
        take = next(
            one
            for one in iter(
                lambda: begin_next_annotation(store, terms, person="ann", chance=Random(1)), None
            )
            if one.kind == "gold" or not submit_annotation(store, one.id, actor="ann")
        )
        view = load_group_state(store, take.copy_id).group.views[0]
        box = view.balls[0].box
        wrong = BallAnnotation(box=Box(box.x + 30.0, box.y, box.width, box.height))
        change(store, take.copy_id, make_set_ball_edit(view.key, wrong), "ann")
        submit_annotation(store, take.id, actor="ann")
        (first,) = read_gold_report(store, terms.dataset_id).people[0].results
        assert (first.error.ball_px, first.submissions) == (pytest.approx(30.0), 1)
        return_annotation(store, take.id, "look again", actor="lea")
        assert read_gold_report(store, terms.dataset_id).people[0].results == (first,)
        change(store, take.copy_id, make_set_ball_edit(view.key, view.balls[0]), "ann")
        judge(store, take.copy_id, actor="ann")
        (second,) = read_gold_report(store, terms.dataset_id).people[0].results
        assert second == replace(first, submissions=2)


class TestNumbers:
    def test_distances_go_both_ways(self) -> None:
        long = (ImagePoint(0.0, 0.0), ImagePoint(10.0, 0.0))
        short = (ImagePoint(0.0, 2.0), ImagePoint(5.0, 2.0))
        both = [2.0, 2.0, 2.0, float(np.hypot(5.0, 2.0))]
        measure = partial(measure_marking_distance, "Middle line")
        assert measure(long, short) == pytest.approx(np.mean(both))
        assert measure(short, long) == measure(long, short)
        assert measure(long[:1], short[:1]) == 2.0

    def test_an_interval_holds_the_median_as_often_as_it_says(self) -> None:
        chance = np.random.default_rng(5)
        held = 0
        for _ in range(400):
            found = median_interval([float(x) for x in chance.exponential(1.0, 9)])
            held += found.low <= np.log(2.0) <= found.high
        assert held >= 0.95 * 400
        assert median_interval([1.0] * 5).low is None

    def test_of_nothing_there_is_no_share(self) -> None:
        assert wilson_interval(0, 0) == (None, None)
        low, high = wilson_interval(10, 10)
        assert low == pytest.approx(0.722, abs=1e-3) and high == pytest.approx(1.0)
