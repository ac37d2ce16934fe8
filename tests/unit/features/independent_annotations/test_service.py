from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from app.db.log import find_newest_entry_id, verify_chain
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError
from app.features.batches.own_annotations import count_own_groups_left
from app.features.batches.service import NewBatch, make_batch
from app.features.datasets.service import delete_dataset, insert_dataset, list_datasets
from app.features.groups.edit import SetLines, SetStationLines, SetViewInclusion, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables
from app.features.groups.state import GroupState
from app.features.groups.submit import load_group_state, solve_and_store_group, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.independent_annotations.adopt import adopt_annotation, return_annotation
from app.features.independent_annotations.gold import mark_gold_group
from app.features.independent_annotations.known_truth import (
    BatchAnnotationTerms,
    begin_next_annotation,
    count_gold_left,
    is_next_annotation_gold,
)
from app.features.independent_annotations.queries import GOLD, INDEPENDENT
from app.features.independent_annotations.service import (
    get_annotation,
    get_annotation_of_copy,
    list_annotations,
    submit_annotation,
)
from app.features.integrity.checks import examine_database
from app.features.people.logins import read_roles
from app.features.people.roles import Role
from app.features.people.service import give_role, invite
from app.features.people.visibility_queries import COPIES, READER, RestrictedReader, Visibility
from app.features.policies.service import change_policy
from app.features.queue.changes import read_new_changes
from app.features.stations.service import load_station, submit_station_edit
from app.features.verdicts.bulk import give_verdicts, list_bulk_verdicts, plan_verdicts
from app.features.verdicts.bulk_undo import undo_bulk_verdict
from app.features.verdicts.service import set_verdict
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.policy import STRICT
from tests.unit.features.independent_annotations.begun import begin_for_batch, begin_take

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
HERE = (ImagePoint(1.5, 2.5), ImagePoint(3.0, 4.0))
THERE = (ImagePoint(5.0, 6.0), ImagePoint(7.0, 8.0))
ELSEWHERE = (ImagePoint(9.0, 10.0), ImagePoint(11.0, 12.0))


def change(store, group_id, edit, actor="ann") -> GroupState:
    return submit_edit(
        store, group_id, edit, if_match=load_group_state(store, group_id).etag, actor=actor
    )


def judge(store, group_id, state="accepted", actor="ann", reason=None, note="as it is"):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, note, if_match=etag, actor=actor)


def faults(store) -> list[str]:
    return [str(check) for check in examine_database(store) if not check.ok]


class TestBeginTake:
    def test_a_copy_is_exact(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        copy = load_group_state(store, take.copy_id)
        assert copy.group == state.group
        assert copy.stored.inputs_hash == state.stored.inputs_hash
        assert (
            copy.solution is not None
            and copy.solution.ball == solve_and_store_group(store, state.id).solution.ball
        )
        assert copy.dataset_id > COPIES and copy.policy == state.policy
        assert copy.verdicts == [] and not copy.can_undo

    def test_it_is_judged_by_the_policy_of_the_moment(self, store, fill, make_group) -> None:
        first, second = fill(make_group(1), make_group(2))
        one = begin_take(store, first, person="ann")
        assert load_group_state(store, one.copy_id).policy == load_group_state(store, first).policy
        change_policy(
            store, load_group_state(store, first).dataset, STRICT, if_match=None, actor="lea"
        )
        two = begin_take(store, second, person="ann")
        assert (
            load_group_state(store, two.copy_id).dataset_id
            == load_group_state(store, one.copy_id).dataset_id
        )
        assert load_group_state(store, two.copy_id).policy == STRICT

    def test_a_copy_has_static_cameras_of_its_own_until_it_is_adopted(
        self, store, fill, make_static
    ) -> None:
        first, second = fill(make_static(10), make_static(11))
        one = begin_take(store, first, person="ann")
        camera = load_group_state(store, one.copy_id).station_ids["cam1"]
        line = next(iter(load_station(store, camera).station.lines))
        etag = load_station(store, camera).etag
        submit_station_edit(
            store, camera, SetStationLines({line: HERE}), if_match=etag, actor="ann"
        )
        two = begin_take(store, second, person="ann")
        assert load_group_state(store, two.copy_id).group.views[0].station.lines[line] == HERE
        assert faults(store) == []
        assert load_group_state(store, second).group.views[0].station.lines[line] != HERE
        assert load_group_state(store, first).group.views[0].station.lines[line] != HERE
        submit_annotation(store, one.id, actor="ann")
        adopt_annotation(store, one.id, actor="lea")
        assert load_group_state(store, second).group.views[0].station.lines[line] == HERE
        assert faults(store) == []

    def test_the_log_has_it_and_makes_it_again(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        change(store, take.copy_id, make_set_ball_edit(state.group.views[0].key, BALL))
        before = load_group_state(store, take.copy_id)
        assert faults(store) == []
        rebuild_tables(store)
        assert load_group_state(store, take.copy_id).etag == before.etag
        with store.read() as session:
            verify_chain(session)

    def test_it_begins_once_a_person(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann (token deploy)")
        assert begin_take(store, state.id, person="ann") == take
        assert begin_take(store, state.id, person="ben").copy_id != take.copy_id
        with pytest.raises(ConflictError):
            begin_take(store, take.copy_id, person="ann")
        with pytest.raises(NotFoundError):
            begin_take(store, 999, person="ann")

    def test_scripts_have_their_own_too(self, store, state) -> None:
        names = ("script:nightly import", "script:a@b+c", "script:a+b@c")
        takes = [begin_take(store, state.id, person=name) for name in names]
        assert [take.person for take in takes] == list(names)
        assert len({load_group_state(store, take.copy_id).dataset for take in takes}) == 3
        assert faults(store) == []

    def test_a_blind_copy_begins_with_the_group_as_it_was_when_the_batch_began(
        self, store, state
    ) -> None:
        since = "2999-01-01"
        view = state.group.views[0].key
        change(store, state.id, make_set_ball_edit(view, None), actor="eve")
        late = begin_for_batch(store, state.id, "ann", batch_id=1, since=since)
        assert load_group_state(store, late.copy_id).group.view(view).balls == ()
        early = begin_for_batch(store, state.id, "ann", batch_id=2, since="2000-01-01")
        assert load_group_state(store, early.copy_id).group == state.group

    def test_a_copy_that_is_not_blind_begins_with_what_the_person_before_left(
        self, store, state
    ) -> None:
        view = state.group.views[0].key
        first = begin_for_batch(store, state.id, "ann", batch_id=1)
        change(store, first.copy_id, make_set_ball_edit(view, BALL))
        submit_annotation(store, first.id, actor="ann")
        blind = begin_for_batch(store, state.id, "ben", batch_id=1)
        assert load_group_state(store, blind.copy_id).group == state.group
        seeing = begin_for_batch(store, state.id, "cleo", batch_id=1, blind=False)
        assert load_group_state(store, seeing.copy_id).group.view(view).balls == (BALL,)

    def test_a_nameless_copy_says_nowhere_which_group_it_is_of(self, store, state) -> None:
        take = begin_for_batch(store, state.id, "ann", batch_id=3, nameless=True)
        copy = load_group_state(store, take.copy_id)
        said = repr(replace(copy.group, views=())) + repr(copy.view_ids) + repr(copy.station_ids)
        assert copy.group.label == "Group 1" and copy.group.match == ""
        for word in ("north", "Alder", ".png"):
            assert word not in said
        change(store, take.copy_id, make_set_ball_edit("view 1", BALL))
        submit_annotation(store, take.id, actor="ann")
        adopted = adopt_annotation(store, take.id, actor="lea")
        assert adopted.group.views[0].balls == (BALL,)

    @pytest.mark.parametrize("kind", [INDEPENDENT, GOLD])
    def test_its_person_is_told_nothing_of_what_became_of_a_nameless_copy_also_later(
        self, store, state, kind
    ) -> None:
        take = begin_for_batch(store, state.id, "ann", batch_id=3, nameless=True, kind=kind)
        submit_annotation(store, take.id, actor="ann")
        if kind == INDEPENDENT:
            adopt_annotation(store, take.id, actor="lea")
        own, leads = (told_to(store, state, take, name) for name in ("ann", "lea"))
        # The batch is closed: nothing is hidden blind any more.
        assert (own.of, own.number, own.title, own.settled) == (None, None, "Group 1", None)
        assert (leads.of, leads.number, leads.title) == (state.id, 1, state.group.label)
        assert (leads.settled is None) == (kind == GOLD)


def told_to(store, state, take, name):
    """A take as somebody sees it who works in no open batch."""
    token = READER.set(RestrictedReader(name, {}, lambda _dataset: True))
    try:
        (view,) = list_annotations(store, state.dataset_id, lambda _dataset: True, person=name)
    finally:
        READER.reset(token)
    assert view.id == take.id
    return view


class TestStart:
    @pytest.mark.parametrize(
        ("starts", "balls", "lines"),
        [
            (("imported", "imported"), True, True),
            (("imported", "without_balls"), False, True),
            (("bare", "imported"), False, False),
        ],
    )
    def test_every_copy_of_a_batch_with_gold_groups_begins_alike(
        self, store, fill, make_group, starts, balls, lines
    ) -> None:
        groups = fill(*(make_group(number) for number in range(1, 6)))
        for group, start in zip(groups[3:], starts, strict=True):
            judge(store, group, actor="lea")
            mark_gold_group(store, group, start, actor="lea")
        terms = BatchAnnotationTerms(
            7, load_group_state(store, groups[0]).dataset_id, groups[:3], 1, True, "2000", 2
        )
        kinds = []
        while (
            take := begin_next_annotation(store, terms, person="ann", chance=Random(3))
        ) is not None:
            kinds.append(take.kind)
            copy = load_group_state(store, take.copy_id).group
            assert [bool(view.balls) for view in copy.views] == [balls] * len(copy.views)
            assert [bool(view.station.lines) for view in copy.views] == [lines] * len(copy.views)
            submit_annotation(store, take.id, actor="ann")
        assert sorted(kinds) == ["gold", "gold", "independent", "independent", "independent"]


class TestHandIn:
    def test_it_changes_no_more(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        assert submit_annotation(store, take.id, actor="ann").submitted is not None
        with pytest.raises(ConflictError):
            change(store, take.copy_id, make_set_ball_edit(state.group.views[0].key, BALL))
        return_annotation(store, take.id, "the ball", actor="lea")
        change(store, take.copy_id, make_set_ball_edit(state.group.views[0].key, BALL))

    def test_nobody_hands_in_the_copy_of_somebody_else(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        with pytest.raises(ForbiddenError):
            submit_annotation(store, take.id, actor="ben")

    def test_a_verdict_does_it_and_is_not_taken_back(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        judge(store, take.copy_id, "rejected", reason="other")
        found = get_annotation_of_copy(store, take.copy_id)
        assert (found.verdict, found.submitted is not None) == ("rejected", True)
        for verdict in ("unreviewed", "accepted", "deferred"):
            with pytest.raises(ConflictError, match="submitted"):
                judge(store, take.copy_id, verdict)
        assert get_annotation(store, take.id) == found

    def test_only_its_person_judges_it(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        with pytest.raises(ForbiddenError, match="only ann"):
            judge(store, take.copy_id, actor="ben")
        dataset = load_group_state(store, take.copy_id).dataset_id
        with pytest.raises(ForbiddenError, match="only ann"):
            give_verdicts(store, dataset, "", "deferred", actor="ben")
        give_verdicts(store, dataset, "", "deferred", actor="ann")
        (batch,) = list_bulk_verdicts(store, dataset)
        with pytest.raises(ConflictError, match="submitted"):
            undo_bulk_verdict(store, batch.id, actor="ann")
        assert get_annotation(store, take.id).verdict == "deferred"

    def test_nobody_else_takes_back_the_verdict_of_a_copy_that_was_returned(
        self, store, state
    ) -> None:
        take = begin_take(store, state.id, person="ann")
        judge(store, take.copy_id, "rejected", reason="other")
        return_annotation(store, take.id, "the ball", actor="lea")
        with pytest.raises(ForbiddenError, match="only ann"):
            judge(store, take.copy_id, "unreviewed", actor="lea")
        assert get_annotation(store, take.id).verdict == "rejected"
        judge(store, take.copy_id, "unreviewed")
        assert get_annotation(store, take.id).verdict is None

    def test_a_submitted_one_among_many_is_counted_and_the_others_are_judged(
        self, store, fill, make_group
    ) -> None:
        takes = [
            begin_take(store, number, person="ann")
            for number in fill(make_group(7), make_group(8), make_group(9))
        ]
        submit_annotation(store, takes[1].id, actor="ann")
        dataset = load_group_state(store, takes[0].copy_id).dataset_id
        refused = [("submitted", 1)]
        for verdict in ("deferred", "accepted"):
            plan = plan_verdicts(store, dataset, "", verdict, note="seen")
            assert [(item.reason, item.groups) for item in plan.refused] == refused
            assert plan.would_change == 2
        report = give_verdicts(store, dataset, "", "deferred", actor="ann", expected=2)
        assert report.changed == 2
        assert [(item.reason, item.groups) for item in report.refused] == refused
        said = [get_annotation(store, take.id).verdict for take in takes]
        assert said == ["deferred", None, "deferred"]

    def test_a_lead_returns_it_with_a_reason_and_each_step_is_in_the_log(
        self, store, state
    ) -> None:
        take = begin_take(store, state.id, person="ann")
        submit_annotation(store, take.id, actor="ann")
        with pytest.raises(ConflictError, match="submitted"):
            submit_annotation(store, take.id, actor="ann")
        with pytest.raises(InputError) as refused:
            return_annotation(store, take.id, "  ", actor="lea")
        assert refused.value.pointer == "/reason"
        return_annotation(store, take.id, "the ball", actor="lea")
        submit_annotation(store, take.id, actor="ann")
        said = [(one.actor, one.body["did"]) for one in read_history(store, take.copy_id)[1:]]
        assert said == [("ann", "handed in"), ("lea", "handed back"), ("ann", "handed in")]
        assert faults(store) == []


class TestAdoptTake:
    def test_it_is_one_edit_of_its_person_and_undo_takes_it_back(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        views = [view.key for view in state.group.views]
        line = next(iter(state.group.views[1].station.lines))
        change(store, take.copy_id, make_set_ball_edit(views[0], BALL))
        change(store, take.copy_id, SetLines(views[1], {line: HERE}))
        judge(store, take.copy_id)
        after = adopt_annotation(store, take.id, actor="lea")
        copy = load_group_state(store, take.copy_id)
        assert after.group == copy.group
        assert (after.verdict.state, after.verdict.actor) == ("accepted", "ann")
        said = [(entry.kind, entry.actor) for entry in read_history(store, state.id)][1:]
        assert said == [("edit", "ann"), ("verdict", "ann"), ("take", "lea")]
        assert get_annotation(store, take.id).settled is not None
        with pytest.raises(ConflictError):
            adopt_annotation(store, take.id, actor="lea")
        with pytest.raises(ConflictError):
            judge(store, take.copy_id, "deferred")
        assert faults(store) == []
        back = undo_group_edit(store, state.id, if_match=after.etag, actor="lea")
        assert back.group == state.group

    def test_what_its_person_left_alone_stays_as_it_was_corrected_meanwhile(
        self, store, state
    ) -> None:
        take = begin_take(store, state.id, person="ann")
        first, second = (view.key for view in state.group.views[:2])
        mine, theirs, other = list(state.group.views[1].station.lines)[:3]
        change(store, state.id, make_set_ball_edit(first, BALL), actor="lea")
        change(store, state.id, SetLines(second, {theirs: HERE}), actor="lea")
        change(store, state.id, SetViewInclusion(first, False), actor="lea")
        change(store, take.copy_id, SetLines(second, {mine: HERE, other: None}))
        submit_annotation(store, take.id, actor="ann")
        after = adopt_annotation(store, take.id, actor="lea", decided=False).group
        assert after.view(first).balls == (BALL,) and not after.view(first).included
        lines = after.view(second).station.lines
        assert (lines[mine], lines[theirs], other in lines) == (HERE, HERE, False)
        assert faults(store) == []

    @pytest.mark.parametrize("batch", [None, "blind"])
    def test_it_is_not_taken_over_by_itself_where_others_changed_the_same(
        self, store, state, batch
    ) -> None:
        view = state.group.views[0].key
        terms = {}
        if batch is not None:
            made = make_batch(store, state.dataset_id, NewBatch("a", verdicts=2), actor="lea")
            terms = {"batch_id": made.id, "since": made.created}
            # Who annotates blind does not see what others changed since.
            change(store, state.id, make_set_ball_edit(view, None), actor="lea")
        take = begin_for_batch(store, state.id, "ann", **terms)
        if batch is None:
            change(store, state.id, make_set_ball_edit(view, None), actor="lea")
        change(store, take.copy_id, make_set_ball_edit(view, BALL))
        submit_annotation(store, take.id, actor="ann")
        with pytest.raises(ConflictError, match=f"ann and others changed the ball of {view}"):
            adopt_annotation(store, take.id, actor="ann", decided=False)
        assert load_group_state(store, state.id).group.view(view).balls == ()
        after = adopt_annotation(store, take.id, actor="lea")
        assert after.group.view(view).balls == (BALL,)

    def test_what_was_imported_again_meanwhile_stays(self, store, fill, make_group) -> None:
        group = make_group(1)
        (original,) = fill(group)
        take = begin_take(store, original, person="ann")
        views = (replace(group.views[0], balls=(BALL,)), *group.views[1:])
        fill(replace(group, views=views))
        submit_annotation(store, take.id, actor="ann")
        after = adopt_annotation(store, take.id, actor="lea", decided=False)
        assert after.group.views[0].balls == (BALL,)

    def test_a_view_that_was_left_out_is_left_out_then(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        view = state.group.views[0].key
        change(store, take.copy_id, SetViewInclusion(view, False))
        submit_annotation(store, take.id, actor="ann")
        after = adopt_annotation(store, take.id, actor="lea")
        assert [one.key for one in after.group.views if not one.included] == [view]

    def test_a_gold_group_whose_truth_is_known_adopts_no_gold_copy(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        gold = begin_for_batch(store, state.id, "ben", kind=GOLD)
        for one in (take, gold):
            submit_annotation(store, one.id, actor=one.person)
        with pytest.raises(ConflictError, match="gold"):
            adopt_annotation(store, gold.id, actor="lea")
        assert adopt_annotation(store, take.id, actor="lea").id == state.id

    def test_only_a_copy_that_was_handed_in_is_adopted(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        with pytest.raises(ConflictError):
            adopt_annotation(store, take.id, actor="lea")
        submit_annotation(store, take.id, actor="ann")
        after = adopt_annotation(store, take.id, actor="lea")
        assert after.group == state.group and after.verdict.state == "unreviewed"


class TestAdoptStation:
    """What becomes of static cameras, which all groups of a dataset share."""

    @pytest.fixture
    def camera(self, store, fill, make_static):
        return Camera(store, fill(*(make_static(number) for number in (10, 11, 12))))

    def test_what_a_lead_corrected_stays(self, camera) -> None:
        take = begin_take(camera.store, camera.groups[0], person="ann")
        camera.draw(camera.groups[0], HERE, "lea")
        assert camera.adopt(take, decided=False) == HERE
        assert faults(camera.store) == []

    def test_what_somebody_else_corrected_stays(self, camera) -> None:
        ann, bo = (
            begin_take(camera.store, camera.groups[0], person=name) for name in ("ann", "bo")
        )
        camera.draw(ann.copy_id, HERE, "ann")
        assert camera.adopt(ann, decided=False) == HERE
        later = begin_take(camera.store, camera.groups[1], person="bo")
        assert camera.line(later.copy_id) != HERE
        assert [camera.adopt(take, decided=False) for take in (bo, later)] == [HERE, HERE]
        history = read_history(camera.store, camera.groups[0])
        assert [one.actor for one in history if one.kind == "station_edit"] == ["ann"]

    def test_what_was_taken_over_is_not_again_after_a_lead_corrected_it(self, camera) -> None:
        takes = [begin_take(camera.store, group, person="ann") for group in camera.groups]
        camera.draw(takes[0].copy_id, THERE, "ann")
        assert camera.adopt(takes[0], decided=False) == THERE
        camera.draw(camera.groups[0], HERE, "lea")
        assert camera.adopt(takes[1], decided=False) == HERE
        # What she changes after that is taken over again.
        camera.draw(takes[2].copy_id, ELSEWHERE, "ann")
        assert camera.adopt(takes[2], decided=False) == ELSEWHERE
        assert faults(camera.store) == []

    def test_it_is_not_taken_over_by_itself_where_others_changed_the_same(self, camera) -> None:
        take = begin_take(camera.store, camera.groups[0], person="ann")
        camera.draw(take.copy_id, THERE, "ann")
        camera.draw(camera.groups[0], HERE, "lea")
        with pytest.raises(ConflictError, match="ann and others changed"):
            camera.adopt(take, decided=False)
        assert camera.line(camera.groups[0]) == HERE
        return_annotation(camera.store, take.id, "the line", actor="lea")
        assert camera.adopt(take) == THERE


class Camera:
    """A line of a static camera that a few groups share."""

    def __init__(self, store, groups) -> None:
        self.store, self.groups = store, groups
        self.name = next(iter(self._station(groups[0]).station.lines))

    def _station(self, group_id: int):
        return load_station(self.store, load_group_state(self.store, group_id).station_ids["cam1"])

    def line(self, group_id: int):
        return self._station(group_id).station.lines[self.name]

    def draw(self, group_id: int, points, actor: str) -> None:
        stored = self._station(group_id)
        edit = SetStationLines({self.name: points})
        submit_station_edit(self.store, stored.id, edit, if_match=stored.etag, actor=actor)

    def adopt(self, take, **how):
        submit_annotation(self.store, take.id, actor=take.person)
        adopt_annotation(self.store, take.id, actor="lea", **how)
        return self.line(self.groups[0])


class TestCopies:
    def test_the_list_of_datasets_has_no_copies(self, store, state) -> None:
        begin_take(store, state.id, person="ann")
        assert [one.name for one in list_datasets(store)] == [state.dataset]

    def test_they_go_with_what_they_are_of(self, store, state) -> None:
        take = begin_take(store, state.id, person="ann")
        delete_dataset(store, state.dataset, confirm=state.dataset, actor="lea")
        with pytest.raises(NotFoundError):
            load_group_state(store, take.copy_id)
        assert faults(store) == []
        with store.write() as session:
            assert insert_dataset(session, "next", state.policy, "ann") < COPIES

    def test_their_person_and_the_leads_of_what_they_are_of_see_them_alone(
        self, store, state
    ) -> None:
        people = {
            name: (invite(store, name, role, actor="local")[0].id, role)
            for name, role in (
                ("ann", Role.ANNOTATOR),
                ("ben", Role.REVIEWER),
                ("lea", Role.LEAD),
                ("here", Role.VIEWER),
                ("elsewhere", Role.LEAD),
            )
        }
        give_role(store, state.dataset, people["here"][0], Role.LEAD, actor="local")
        give_role(store, state.dataset, people["elsewhere"][0], Role.VIEWER, actor="local")
        copies = load_group_state(
            store, begin_take(store, state.id, person="ann").copy_id
        ).dataset_id
        with store.read() as session:
            roles = {name: read_roles(session, *who) for name, who in people.items()}
        assert {name: str(one.find_role_in(copies)) for name, one in roles.items()} == {
            "ann": "annotator",
            "ben": "none",
            "lea": "lead",
            "here": "lead",
            "elsewhere": "none",
        }

    def test_one_that_is_made_later_is_hidden_from_the_first_entry_on(self, store, state) -> None:
        reader = Visibility(True, frozenset(), "ben", frozenset())
        with store.read() as session:
            last = find_newest_entry_id(session)
        begin_take(store, state.id, person="ann")
        changes = read_new_changes(store, [(last, 0)]).changes[last]
        assert changes and not [one for one in changes if reader.sees(one.dataset_id)]


class TestBeginNext:
    def test_what_is_left_is_what_will_come(self, store, fill, make_group) -> None:
        groups = fill(make_group(1), make_group(2), make_group(3))
        dataset = load_group_state(store, groups[0]).dataset_id
        batch = make_batch(store, dataset, NewBatch("a", verdicts=2), actor="lea")
        terms = BatchAnnotationTerms(batch.id, dataset, groups, 2, True, batch.created)

        def left(person: str) -> int:
            with store.read() as session:
                return count_own_groups_left(session, batch, person)

        for person, comes in (("ann", 3), ("ben", 3), ("cleo", 0)):
            assert left(person) == comes
            for rest in range(comes, 0, -1):
                take = begin_next_annotation(store, terms, person=person)
                assert left(person) == rest
                submit_annotation(store, take.id, actor=person)
            assert left(person) == 0

    def test_each_group_as_often_as_the_batch_asks(self, store, fill, make_group) -> None:
        groups = fill(make_group(1), make_group(2))
        terms = BatchAnnotationTerms(
            5, load_group_state(store, groups[0]).dataset_id, groups, 2, True, "2000"
        )
        had = []
        for person in ("ann", "ben", "cleo"):
            while (take := begin_next_annotation(store, terms, person=person)) is not None:
                had.append((person, take.group_id))
                assert begin_next_annotation(store, terms, person=person) == take
                submit_annotation(store, take.id, actor=person)
        assert had == [(name, group) for name in ("ann", "ben") for group in groups]
        assert len(list_annotations(store, terms.dataset_id, lambda _: False, person="ann")) == 2
        assert len(list_annotations(store, terms.dataset_id, lambda _: True, person="ann")) == 4

    def test_one_of_each_block_is_gold_and_nobody_knows_which(self) -> None:
        every, chance, kinds = 5, Random(4), list[str]()
        for _ in range(every * 100):
            kinds.append(
                "gold" if is_next_annotation_gold(kinds, every, 1000, chance) else "independent"
            )
        blocks = [kinds[at : at + every] for at in range(0, len(kinds), every)]
        assert all(block.count("gold") == 1 for block in blocks)
        assert len({block.index("gold") for block in blocks}) == every

    @pytest.mark.parametrize(
        ("every", "groups", "fresh", "runs_out"),
        [(4, 10, 99, False), (2, 7, 3, True), (1, 3, 5, True), (5, 2, 1, False)],
    )
    def test_the_last_one_is_gold_as_often_and_what_is_left_falls_by_one(
        self, every: int, groups: int, fresh: int, runs_out: bool
    ) -> None:
        chance, last = Random(8), set()
        for _ in range(60):
            kinds, free, gold = list[str](), groups, fresh
            while True:
                left = free + count_gold_left(kinds, every, free, gold)
                if gold and is_next_annotation_gold(kinds, every, free, chance):
                    kinds, gold = [*kinds, "gold"], gold - 1
                elif free:
                    kinds, free = [*kinds, "independent"], free - 1
                else:
                    break
                assert free + count_gold_left(kinds, every, free, gold) == left - 1
            assert left == 0
            last.add(kinds[-1])
        # Where gold groups run out, ordinary ones are left.
        assert last == ({"independent"} if runs_out else {"independent", "gold"})
