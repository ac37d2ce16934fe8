from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, NotFoundError
from app.evaluation.rater_agreement import AgreementLimits
from app.features.agreement import adjudicate
from app.features.agreement import service as weigh
from app.features.agreement.adjudicate import (
    adjudicate_case,
    adopt_into_group,
    list_open_cases,
    read_case,
    return_for_correction,
)
from app.features.agreement.service import (
    BY_ITSELF,
    compare_or_adopt_submission,
    read_limits,
    set_limits,
)
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import ABOUT_COPIES, read_entry_changes, read_history
from app.features.groups.state import GroupState
from app.features.groups.submit import load_group_state, load_solved_group, submit_edit
from app.features.imports.ingest import import_groups
from app.features.independent_annotations.adopt import return_annotation
from app.features.independent_annotations.queries import IndependentAnnotation
from app.features.independent_annotations.service import (
    get_annotation,
    list_annotations,
    submit_annotation,
)
from app.features.integrity.checks import examine_database
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.people.visibility_queries import READER, RestrictedReader
from app.features.queue.service import list_groups
from app.features.verdicts.bulk import RefusedGroups, give_verdicts, plan_verdicts
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, plan_freeze
from tests.unit.features.independent_annotations.begun import begin_take


def judged(store: Store, group_id: int, person: str, moved: float = 0.0) -> IndependentAnnotation:
    """The take of a person who moves the ball of the first view and accepts."""
    take = begin_take(store, group_id, person=person)
    state = load_group_state(store, take.copy_id)
    if moved:
        state = move_ball(store, take.copy_id, person, moved)
    set_verdict(store, take.copy_id, "accepted", None, "seen", if_match=state.etag, actor=person)
    return get_annotation(store, take.id)


def move_ball(store: Store, group_id: int, person: str, moved: float) -> GroupState:
    """The group after somebody moved the ball of the first view."""
    state = load_group_state(store, group_id)
    view = next(view for view in state.group.views if view.ball is not None)
    assert view.ball is not None and view.ball.box is not None
    ball = replace(view.ball, box=replace(view.ball.box, x=view.ball.box.x + moved))
    edit = make_set_ball_edit(view.key, ball)
    return submit_edit(store, group_id, edit, if_match=state.etag, actor=person)


def ball_x(state: GroupState) -> float:
    view = next(view for view in state.group.views if view.ball is not None)
    assert view.ball is not None and view.ball.box is not None
    return view.ball.box.x


def kinds(store: Store, group_id: int) -> list[tuple[str, str]]:
    return [(entry.kind, entry.actor) for entry in read_history(store, group_id)]


class TestAfterHandIn:
    def test_two_who_agree_settle_the_group_by_themselves(self, store, state) -> None:
        first = judged(store, state.id, "ann", 1.0)
        assert compare_or_adopt_submission(store, first.copy_id) is None
        second = judged(store, state.id, "ben", 2.0)
        assert compare_or_adopt_submission(store, second.copy_id) == "agreed"
        after = load_group_state(store, state.id)
        assert ball_x(after) == ball_x(state) + 1
        assert (after.verdict.state, after.verdict.actor) == ("accepted", "ann")
        assert ("agreement", BY_ITSELF) in kinds(store, state.id)
        assert all(get_annotation(store, one.id).settled for one in (first, second))
        assert list_open_cases(store, state.dataset) == []
        assert [str(check) for check in examine_database(store) if not check.ok] == []

    def test_who_judges_nothing_is_not_told_by_the_history_whose_annotations_there_were(
        self, store, state
    ) -> None:
        for person, moved in (("ann", 1.0), ("ben", 2.0)):
            compare_or_adopt_submission(store, judged(store, state.id, person, moved).copy_id)
        everything = {one.id: one for one in read_history(store, state.id)}
        about = {one.id for one in everything.values() if one.kind in ABOUT_COPIES}
        assert {everything[number].kind for number in about} == ABOUT_COPIES
        assert {everything[number].body["person"] for number in about} == {"ann"}
        for judges in (False, True):
            token = READER.set(RestrictedReader("carl", {}, lambda _dataset, it=judges: it))
            try:
                listed = {one.id: one for one in read_history(store, state.id)}
                single = {
                    number: read_entry_changes(store, state.id, number).entry for number in listed
                }
            finally:
                READER.reset(token)
            assert listed == single
            assert listed == {
                number: one if judges or number not in about else replace(one, body=None)
                for number, one in everything.items()
            }

    @pytest.mark.parametrize(("moved", "comes_to"), [(2.0, "agreed"), (40.0, "open")])
    def test_what_a_stopped_server_left_is_compared_by_the_next_one(
        self, store, state, monkeypatch, moved, comes_to
    ) -> None:
        judged(store, state.id, "ann", 1.0)
        second = judged(store, state.id, "ben", moved)
        assert get_annotation(store, second.id).submitted is not None

        def fail(*_: object) -> None:
            raise OSError("the power went")

        with monkeypatch.context() as broken:
            broken.setattr(
                weigh,
                "complete_unchosen_annotations"
                if comes_to == "agreed"
                else "_announce_disagreement",
                fail,
            )
            with pytest.raises(OSError, match="power"):
                compare_or_adopt_submission(store, second.copy_id)
        assert load_group_state(store, state.id).etag == state.etag
        assert list_open_cases(store, state.dataset) == []
        assert (weigh.compare_uncompared_groups(store), weigh.compare_uncompared_groups(store)) == (
            1,
            0,
        )
        assert [one.group for one in list_open_cases(store, state.dataset)] == (
            [state.id] if comes_to == "open" else []
        )
        moved_by = ball_x(load_group_state(store, state.id)) - ball_x(state)
        assert moved_by == (1.0 if comes_to == "agreed" else 0.0)

    def test_what_cannot_be_taken_over_waits_for_a_decision(
        self, store, state, monkeypatch
    ) -> None:
        judged(store, state.id, "ann", 1.0)
        second = judged(store, state.id, "ben", 2.0)

        def faster(*_: object, **__: object) -> None:
            raise ConflictError("somebody was faster")

        with monkeypatch.context() as broken:
            broken.setattr(weigh, "adopt_annotation", faster)
            assert compare_or_adopt_submission(store, second.copy_id) == "open"
        assert [one.group for one in list_open_cases(store, state.dataset)] == [state.id]

    def test_of_two_who_agree_the_one_who_judged_is_taken(self, store, state) -> None:
        first = begin_take(store, state.id, person="ann")
        submit_annotation(store, first.id, actor="ann")
        second = judged(store, state.id, "ben", 1.0)
        assert compare_or_adopt_submission(store, second.copy_id) == "agreed"
        after = load_group_state(store, state.id)
        assert (after.verdict.state, after.verdict.actor) == ("accepted", "ben")
        assert ball_x(after) == ball_x(state) + 1

    def test_what_was_corrected_meanwhile_otherwise_waits_for_a_decision(
        self, store, state
    ) -> None:
        judged(store, state.id, "ann", 1.0)
        second = judged(store, state.id, "ben", 2.0)
        move_ball(store, state.id, "lea", 5.0)
        assert compare_or_adopt_submission(store, second.copy_id) == "open"
        assert ball_x(load_group_state(store, state.id)) == ball_x(state) + 5
        after = adjudicate_case(store, state.id, second.id, actor="lea")
        assert ball_x(after) == ball_x(state) + 2

    def test_two_who_do_not_wait_for_a_decision(self, store, state) -> None:
        judged(store, state.id, "ann")
        second = judged(store, state.id, "ben", 40.0)
        assert compare_or_adopt_submission(store, second.copy_id) == "open"
        assert load_group_state(store, state.id).etag == state.etag
        (waiting,) = list_open_cases(store, state.dataset)
        assert (waiting.group, waiting.people) == (state.id, ("ann", "ben"))
        assert waiting.worst > 10

    def test_wider_limits_let_them_agree(self, store, state) -> None:
        wide = AgreementLimits(ball_px=100, ball_m=100)
        set_limits(store, state.dataset, wide, actor="lea")
        with store.read() as session:
            assert read_limits(session, state.dataset_id) == wide
        judged(store, state.id, "ann")
        second = judged(store, state.id, "ben", 40.0)
        assert compare_or_adopt_submission(store, second.copy_id) == "agreed"

    def test_handing_in_the_copy_of_an_ordinary_group_compares_nothing(self, store, state) -> None:
        assert compare_or_adopt_submission(store, state.id) is None


class TestDecide:
    @pytest.fixture
    def takes(self, store, state) -> tuple[IndependentAnnotation, IndependentAnnotation]:
        found = judged(store, state.id, "ann"), judged(store, state.id, "ben", 40.0)
        assert compare_or_adopt_submission(store, found[1].copy_id) == "open"
        return found

    def test_takes_one_with_the_verdict_of_who_decided(self, store, state, takes) -> None:
        case = read_case(store, state.id, actor="lea")
        assert [take.person for take in case.annotations] == ["ann", "ben"]
        assert not case.own and case.refused is None
        after = adjudicate_case(store, state.id, takes[1].id, actor="lea")
        assert ball_x(after) == ball_x(state) + 40
        assert (after.verdict.state, after.verdict.actor) == ("accepted", "lea")
        said = kinds(store, state.id)
        assert ("edit", "ben") in said and ("agreement", "lea") in said
        with pytest.raises(NotFoundError, match="is not waiting for adjudication"):
            adjudicate_case(store, state.id, takes[0].id, actor="lea")
        assert [str(check) for check in examine_database(store) if not check.ok] == []

    def test_is_done_whole_or_not_at_all(self, store, state, takes, monkeypatch) -> None:
        before = kinds(store, state.id)

        def fail(*_: object, **__: object) -> None:
            raise OSError("the power went")

        with monkeypatch.context() as broken:
            broken.setattr(weigh, "copy_verdict_to_original", fail)
            with pytest.raises(OSError, match="power"):
                adjudicate_case(store, state.id, takes[1].id, actor="lea")
        assert load_group_state(store, state.id).etag == state.etag
        assert kinds(store, state.id) == before
        assert not any(get_annotation(store, one.id).settled for one in takes)
        assert [one.group for one in list_open_cases(store, state.dataset)] == [state.id]
        after = adjudicate_case(store, state.id, takes[1].id, actor="lea")
        assert (ball_x(after), after.verdict.actor) == (ball_x(state) + 40, "lea")

    def test_begins_a_third_one_without_a_verdict_of_who_decided(self, store, state, takes) -> None:
        after = adjudicate_case(store, state.id, takes[1].id, as_start=True, actor="lea")
        assert ball_x(after) == ball_x(state) + 40
        assert after.verdict.actor == "ben"
        assert list_open_cases(store, state.dataset) == []

    def test_nobody_decides_about_their_own_while_somebody_else_is_there(
        self, store, state, takes
    ) -> None:
        # Where nobody else is there they may, and it is said.
        case = read_case(store, state.id, actor="ann")
        assert case.own and case.refused is None
        invite(store, "rob", Role.REVIEWER, actor="lea")
        assert "rob can decide" in (read_case(store, state.id, actor="ann (token x)").refused or "")
        with pytest.raises(ForbiddenError, match="rob can decide"):
            adjudicate_case(store, state.id, takes[0].id, actor="ann")

    @pytest.mark.parametrize("again", [False, True])
    def test_decides_nothing_where_another_one_is_returned_at_the_same_moment(
        self, store, state, takes, monkeypatch, again
    ) -> None:
        look = adjudicate.read_case

        def returning(*arguments, **named):
            case = look(*arguments, **named)
            return_annotation(store, takes[0].id, "the ball", actor="lea")
            if again:
                submit_annotation(store, takes[0].id, actor="ann")
                compare_or_adopt_submission(store, takes[0].copy_id)
            return case

        monkeypatch.setattr(adjudicate, "read_case", returning)
        with pytest.raises(ConflictError, match="returned or decided about meanwhile"):
            adjudicate_case(store, state.id, takes[1].id, actor="lea")
        assert load_group_state(store, state.id).etag == state.etag
        assert not any(get_annotation(store, one.id).settled for one in takes)

    def test_takes_nothing_that_does_not_wait_here(self, store, state, takes) -> None:
        with pytest.raises(NotFoundError, match="annotation 99"):
            adjudicate_case(store, state.id, 99, actor="lea")


class TestVerdictMeanwhile:
    """A group whose annotations differ gets no verdict but by the decision."""

    @pytest.fixture
    def takes(self, store, state) -> tuple[IndependentAnnotation, IndependentAnnotation]:
        found = judged(store, state.id, "ann"), judged(store, state.id, "ben", 40.0)
        assert compare_or_adopt_submission(store, found[1].copy_id) == "open"
        return found

    @pytest.mark.parametrize("who", ["ann", "ann (token x)", "lea"])
    def test_is_refused_to_its_annotators_and_to_everybody_else(
        self, store, state, takes, who
    ) -> None:
        with pytest.raises(ConflictError, match="annotations of this group differ") as refused:
            set_verdict(store, state.id, "accepted", None, "x", if_match=state.etag, actor=who)
        assert f"/adjudicate/{state.id}" in refused.value.hint
        assert load_group_state(store, state.id).verdict.state == "unreviewed"

    def test_is_left_out_of_a_bulk_verdict_counted_and_named(
        self, store, state, takes, make_group
    ) -> None:
        import_groups(store, "demo", [make_group(8)], source="test", actor="ann")
        asked = (store, state.dataset_id, "", "rejected", "other", "x")
        plan = plan_verdicts(*asked)
        assert (plan.matches, plan.would_change) == (2, 1)
        done = give_verdicts(*asked, actor="ann")
        for refused in (plan.refused, done.refused):
            assert refused == (RefusedGroups("undecided", 1),)
        assert (done.changed, len(list_open_cases(store, state.dataset))) == (1, 1)
        assert load_group_state(store, state.id).verdict.state == "unreviewed"

    def test_is_given_once_somebody_has_decided(self, store, state, takes) -> None:
        etag = adjudicate_case(store, state.id, takes[1].id, as_start=True, actor="lea").etag
        after = set_verdict(store, state.id, "accepted", None, "x", if_match=etag, actor="lea")
        assert after.verdict.actor == "lea"

    def test_of_before_is_withdrawn_and_enters_no_version(self, store, state, make_group) -> None:
        import_groups(store, "demo", [make_group(8)], source="test", actor="ann")
        accepted = [
            set_verdict(store, one, "accepted", None, "x", if_match=etag, actor="lea")
            for one in (state.id, state.id + 1)
            for etag in [load_solved_group(store, one).etag]
        ]
        judged(store, state.id, "ann")
        compare_or_adopt_submission(store, judged(store, state.id, "ben", 40.0).copy_id)
        plan = plan_freeze(store, state.dataset, FreezeRequest())
        assert plan.groups + sum(plan.left_out.values()) == 2
        assert plan.left_out["independent annotations differ"] == 1
        etag = accepted[0].etag
        back = set_verdict(store, state.id, "unreviewed", None, None, if_match=etag, actor="lea")
        assert back.verdict.state == "unreviewed"


class TestHandBack:
    @pytest.fixture
    def takes(self, store, state) -> tuple[IndependentAnnotation, IndependentAnnotation]:
        found = judged(store, state.id, "ann"), judged(store, state.id, "ben", 40.0)
        assert compare_or_adopt_submission(store, found[1].copy_id) == "open"
        return found

    def test_tells_its_person_why_and_the_group_waits_for_them_alone(
        self, store, state, takes
    ) -> None:
        assert (
            return_for_correction(
                store, state.id, takes[1].id, " the  spot ", actor="lea"
            ).submitted
            is None
        )
        assert list_open_cases(store, state.dataset) == []
        shown = list_annotations(store, state.dataset, lambda _: True, person="lea")
        assert [one.returned and one.returned.reason for one in shown] == [None, "the spot"]
        again = load_group_state(store, takes[1].copy_id)
        set_verdict(
            store, takes[1].copy_id, "deferred", None, "x", if_match=again.etag, actor="ben"
        )
        assert compare_or_adopt_submission(store, takes[1].copy_id) == "open"
        (waiting,) = list_open_cases(store, state.dataset)
        assert waiting.people == ("ann", "ben")
        shown = list_annotations(store, state.dataset, lambda _: True, person="lea")
        assert [one.returned for one in shown] == [None, None]

    def test_the_queue_finds_it_and_says_what_it_came_to(
        self, store, state, takes, make_group
    ) -> None:
        import_groups(store, "demo", [make_group(8)], source="test", actor="ann")

        def found(query: str) -> int:
            return list_groups(store, state.dataset_id, query).total

        every = found("")
        assert every == 2
        (row,) = list_groups(store, state.dataset_id, "annotations:waiting").items
        assert (row.id, row.submissions, row.annotations) == (state.id, 2, "open")
        asked = {
            "annotations:any": 1, "annotations:none": every - 1, "annotations:agreed": 0,
            "-annotations:waiting": every - 1, "submissions:2": 1, "submissions>2": 0, "submissions<2": every - 1,
            "submissions:none": every - 1, "submissions>=0": every,
        }  # fmt: skip
        assert {query: found(query) for query in asked} == asked
        adjudicate_case(store, state.id, takes[1].id, actor="lea")
        assert [found(f"annotations:{one}") for one in ("waiting", "decided")] == [0, 1]
        assert (
            list_groups(store, state.dataset_id, "submissions:2").items[0].annotations == "decided"
        )

    def test_what_a_lead_returned_leaves_nothing_that_waits(self, store, state, takes) -> None:
        return_annotation(store, takes[0].id, "the ball", actor="lea")
        assert list_open_cases(store, state.dataset) == []

    def test_nobody_hands_back_where_others_have_to_decide(self, store, state, takes) -> None:
        invite(store, "rob", Role.REVIEWER, actor="lea")
        with pytest.raises(ForbiddenError, match="rob can decide"):
            return_for_correction(store, state.id, takes[1].id, actor="ann")
        with pytest.raises(NotFoundError, match="annotation 99"):
            return_for_correction(store, state.id, 99, actor="rob")

    def test_a_lead_who_takes_one_over_has_decided(self, store, state, takes) -> None:
        after = adopt_into_group(store, takes[1], actor="lea")
        assert ball_x(after) == ball_x(state) + 40
        assert list_open_cases(store, state.dataset) == []
        assert ("agreement", "lea") in kinds(store, state.id)
        assert get_annotation(store, takes[0].id).settled
