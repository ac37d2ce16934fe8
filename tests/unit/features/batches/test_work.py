"""Batches and leases in a real database: nobody meets anybody by accident."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

import pytest

from app.db.session import Session
from app.errors import ConflictError, HeldGroupError, InputError, NotFoundError
from app.features.agreement.service import compare_or_adopt_submission, compare_uncompared_groups
from app.features.audit.queries import AuditQuery
from app.features.audit.service import read_audit
from app.features.batches import leases as leases_module
from app.features.batches.leases import LASTS, BatchMember, Lease, LeaseService
from app.features.batches.progress import list_own_batches, list_team_batches
from app.features.batches.service import (
    BatchRole,
    NewBatch,
    change_batch,
    get_batch,
    list_batch_groups,
    list_batches,
    make_batch,
    read_batch,
    remove_batch,
)
from app.features.groups.replay import replay_log
from app.features.groups.submit import load_group_state
from app.features.independent_annotations.gold import mark_gold_group, unmark_gold_group
from app.features.independent_annotations.queries import (
    INDEPENDENT,
    find_annotation_of_copy,
)
from app.features.notifications.queries import select_notifications
from app.features.people.queries import find_person_by_name, find_rights
from app.features.people.roles import Role
from app.features.people.service import change_person, find_person, invite
from app.features.people.visibility_queries import EVERYTHING
from app.features.queue.service import list_groups
from app.features.verdicts.service import set_verdict
from tests.unit.features.pending import stored_by

ADA, BO, CY = (BatchMember(name) for name in ("ada", "bo", "cy"))
NOTED = "looked at"


class Clock:
    def __init__(self) -> None:
        self.at = datetime.now(UTC)

    def __call__(self) -> datetime:
        return self.at


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def groups(store, fill, make_group) -> list[int]:
    """Six groups of a dataset, and three people."""
    ids = fill(*(make_group(number) for number in range(1, 7)), solved=False)
    for name, role in (("ada", Role.ANNOTATOR), ("bo", Role.REVIEWER), ("cy", Role.REVIEWER)):
        invite(store, name, role, actor="local")
    return ids


@pytest.fixture
def dataset(groups, store) -> int:
    return load_group_state(store, groups[0]).dataset_id


@pytest.fixture
def leases(store, clock) -> LeaseService:
    return LeaseService(store, clock)


def make_gold(store, group: int) -> None:
    judge(store, group, "cy")
    mark_gold_group(store, group, "imported", actor="cy")


def judge(store, group: int, actor: str, state: str = "rejected") -> None:
    reason = "ball_hidden" if state == "rejected" else None
    etag = load_group_state(store, group).etag
    set_verdict(store, group, state, reason and "other", NOTED, if_match=etag, actor=actor)


def originals(
    store, leases: LeaseService, batch: int, member: BatchMember, state=None
) -> list[int]:
    """The groups of which somebody gets copies until nothing is left; each is judged, or submitted."""
    found = []
    while (copy := leases.lease_next_group(batch, member).group) is not None:
        with store.read() as session:
            annotation = find_annotation_of_copy(session, copy)
        if annotation.kind == INDEPENDENT:
            found.append(annotation.group_id)
        if state is None:
            leases.submit_group(batch, copy, member, actor=member.name)
        else:
            judge(store, copy, member.name, state)
        compare_or_adopt_submission(store, copy)
    return found


class TestBatch:
    def test_holds_what_its_query_finds_in_its_order_and_leaves_out_what_is_given(
        self, store, dataset, groups
    ):
        first = make_batch(store, dataset, NewBatch("a", "sort:number-desc", 2), actor="lead")
        rest = make_batch(store, dataset, NewBatch("b"), actor="lead")
        assert [one.group for one in list_batch_groups(store, first.id)] == groups[:-3:-1]
        assert [one.group for one in list_batch_groups(store, rest.id)] == groups[:4]
        with pytest.raises(InputError, match="open batch already"):
            make_batch(store, dataset, NewBatch("c"), actor="lead")
        again = make_batch(store, dataset, NewBatch("c", skip_given=False), actor="lead")
        assert (again.groups, again.waiting) == (6, 6)

    def test_is_made_with_the_answer_that_is_kept_of_it_or_not_at_all(self, store, dataset):
        def stop(session, made):
            assert read_batch(session, made.id) == made
            raise OSError("the power went")

        with pytest.raises(OSError, match="power"), stored_by(stop):
            make_batch(store, dataset, NewBatch("a"), actor="lead")
        assert list_batches(store, dataset) == []

    def test_is_a_query_in_its_own_order(self, store, dataset, groups):
        batch = make_batch(store, dataset, NewBatch("a", "sort:number-desc", 4), actor="lead")
        page = list_groups(store, dataset, f"batch:{batch.id}", limit=3)
        assert [row.id for row in page.items] == groups[:-4:-1]
        rest = list_groups(store, dataset, f"batch:{batch.id}", limit=3, cursor=page.next)
        assert [row.id for row in rest.items] == [groups[2]]
        other = list_groups(store, dataset, f"batch:{batch.id} sort:number", limit=1)
        assert other.items[0].id == groups[2]
        assert list_groups(store, dataset, f"-batch:{batch.id}").total == 2

    def test_is_given_to_those_alone_who_may(self, store, dataset):
        with pytest.raises(InputError, match="ada does not have the role reviewer") as refused:
            make_batch(store, dataset, NewBatch("a", reviewers=["ada"]), actor="lead")
        assert refused.value.pointer == "/reviewers"
        batch = make_batch(store, dataset, NewBatch("a", annotators=["ada"]), actor="lead")
        given = change_batch(store, batch.id, actor="lead", annotators=["bo"], state="closed")
        assert (given.annotators, given.is_open) == (["bo"], False)
        remove_batch(store, batch.id, actor="lead")
        with pytest.raises(NotFoundError):
            get_batch(store, batch.id)
        with store.read() as session:
            replay_log(session)

    @pytest.mark.parametrize("left", [{"disabled": True}, {"role": Role.VIEWER}])
    def test_is_reassigned_beside_a_person_who_left_and_to_nobody_who_left(
        self, store, dataset, left
    ):
        new = NewBatch("a", annotators=["ada", "bo"], reviewers=["bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        for name in ("ada", "bo"):
            change_person(store, find_person(store, name).id, actor="lead", **left)
        given = change_batch(
            store, batch, actor="lead", annotators=["ada", "bo", "cy"], reviewers=["bo"]
        )
        assert (given.annotators, given.reviewers) == (["ada", "bo", "cy"], ["bo"])
        given = change_batch(store, batch, actor="lead", annotators=["cy"])
        assert given.annotators == ["cy"]
        why = "is disabled or has no account" if "disabled" in left else "does not have the role"
        for part, name in (("annotators", "ada"), ("reviewers", "ada")):
            with pytest.raises(InputError, match=f"{name} {why}"):
                change_batch(store, batch, actor="lead", **{part: [name]})


class TestGoldGroups:
    """What a batch asks for that mixes gold groups in, and what its people are told."""

    def test_none_are_mixed_in_where_none_is_marked(self, store, dataset, groups):
        plain = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        new = NewBatch("b", skip_given=False, gold_every=2)
        for ask in (
            lambda: make_batch(store, dataset, new, actor="lead"),
            lambda: change_batch(store, plain, gold_every=2, actor="lead"),
        ):
            with pytest.raises(ConflictError, match="no group of this dataset is") as refused:
                ask()
            assert "Mark gold groups first" in refused.value.hint
        assert [(one.id, one.gold_every) for one in list_batches(store, dataset)] == [(plain, None)]
        make_gold(store, groups[5])
        change_batch(store, plain, gold_every=2, actor="lead")
        unmark_gold_group(store, groups[5], actor="cy")
        assert change_batch(store, plain, gold_every=2, name="c", actor="lead").name == "c"

    @pytest.mark.parametrize(
        ("every", "said"),
        [(None, "assigned you work: a, 3 groups of"), (2, "assigned you work: a, groups of")],
    )
    def test_no_message_counts_the_groups_without_the_gold_ones(
        self, store, dataset, groups, every, said
    ):
        make_gold(store, groups[5])
        new = NewBatch("a", size=3, annotators=["ada"], gold_every=every)
        make_batch(store, dataset, new, actor="lead")
        with store.read() as session:
            (ring,) = select_notifications(
                session, find_person_by_name(session, "ada").id, EVERYTHING, "", 9
            )
        assert said in ring.sentence


class TestLeases:
    def test_the_next_group_is_one_write_that_nobody_waits_for_the_disk_for(
        self, store, dataset, leases, counted
    ):
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        with counted(store) as cost:
            assert leases.lease_next_group(batch, BO).group is not None
        assert (cost.reads, cost.commits) == (0, 0)

    def test_two_people_are_given_two_groups(self, store, dataset, groups, leases):
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        assert leases.lease_next_group(batch, BO).group == groups[0]
        assert leases.lease_next_group(batch, CY).group == groups[1]
        assert leases.lease_next_group(batch, BO).group == groups[0]
        assert leases.lease_next_group(batch, BO, after=groups[0]).group == groups[2]
        few = make_batch(store, dataset, NewBatch("b", size=1, skip_given=False), actor="lead").id
        assert leases.lease_next_group(few, BO, after=groups[0]).group is None

    def test_no_group_is_given_to_two_of_many_who_ask_at_once(self, store, dataset, groups):
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        people = [BatchMember(f"person{number}") for number in range(8)]
        with ThreadPoolExecutor(8) as pool:
            given = list(
                pool.map(lambda one: LeaseService(store).lease_next_group(batch, one).group, people)
            )
        assert sorted(one for one in given if one) == sorted(groups)
        assert given.count(None) == 2

    def test_one_that_is_not_kept_runs_out(self, store, dataset, groups, leases, clock):
        batch = make_batch(store, dataset, NewBatch("a", size=1), actor="lead").id
        leases.lease_next_group(batch, BO)
        clock.at += LASTS * 0.9
        leases.lease_group(batch, groups[0], BO)
        clock.at += LASTS * 0.9
        assert leases.lease_next_group(batch, CY).group is None
        clock.at += LASTS * 0.2
        assert leases.lease_next_group(batch, CY).group == groups[0]

    def test_one_is_given_back_and_taken_over(self, store, dataset, groups, leases):
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        leases.lease_next_group(batch, BO)
        with pytest.raises(HeldGroupError, match="bo has this group open") as held:
            leases.lease_group(batch, groups[0], CY)
        assert [one.person for one in held.value.here] == ["bo"]
        over = leases.lease_group(batch, groups[0], CY, take_over=True)
        assert [one.person for one in over.here] == ["cy"]
        with pytest.raises(ConflictError, match="cy has this group open"):
            leases.lease_group(batch, groups[0], BO)
        assert leases.release_group(batch, groups[0], CY).here == ()
        assert leases.lease_next_group(batch, BO).group == groups[0]

    def test_giving_back_a_group_that_the_batch_does_not_have_tells_nothing_of_it(
        self, store, dataset, groups, leases
    ):
        other = make_batch(store, dataset, NewBatch("a", size=1), actor="lead").id
        batch = make_batch(store, dataset, NewBatch("b", size=1), actor="lead").id
        assert leases.lease_next_group(other, BO).group == groups[0]
        told = leases.release_group(batch, groups[0], CY)
        assert (told.batch.id, told.group, told.here) == (batch, None, ())
        assert told == leases.release_group(batch, 88888888, CY)
        with pytest.raises(HeldGroupError, match="bo has this group open"):
            leases.lease_group(other, groups[0], CY)

    def test_what_a_window_left_open_that_is_gone_comes_back_once_nothing_else_waits(
        self, store, dataset, groups, leases
    ):
        batch = make_batch(store, dataset, NewBatch("a", size=3), actor="lead").id
        # The window of the first group crashes: it says nothing, and another one goes on.
        assert leases.lease_next_group(batch, BO).group == groups[0]
        leases.lease_group(batch, groups[1], BO)
        judge(store, groups[1], "bo")
        assert leases.lease_next_group(batch, BO, after=groups[1]).group == groups[2]
        assert leases.lease_next_group(batch, CY, after=groups[1]).group is None
        judge(store, groups[2], "bo")
        assert leases.lease_next_group(batch, BO, after=groups[2]).group == groups[0]
        assert leases.lease_next_group(batch, BO, after=groups[0]).group is None

    def test_a_verdict_ends_the_lease_and_the_work_and_unreviewing_makes_it_work_again(
        self, store, dataset, groups, leases
    ):
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        leases.lease_next_group(batch, BO)
        judge(store, groups[0], "bo")
        assert get_batch(store, batch).settled == 1
        assert get_batch(store, batch).here == []
        assert leases.lease_next_group(batch, CY).group == groups[1]
        judge(store, groups[0], "bo", "unreviewed")
        assert get_batch(store, batch).settled == 0
        judge(store, groups[0], "bo", "deferred")
        assert leases.lease_next_group(batch, BO, after=groups[1]).group == groups[2]

    def test_verdicts_that_were_given_and_undone_while_a_batch_was_closed_count_once_it_is_open(
        self, store, dataset, groups, leases
    ):
        judge(store, groups[3], "bo")
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        judge(store, groups[0], "bo")
        change_batch(store, batch, actor="lead", state="closed")
        judge(store, groups[0], "bo", "unreviewed")
        judge(store, groups[1], "bo")
        judge(store, groups[2], "bo", "deferred")
        assert change_batch(store, batch, actor="lead", state="open").settled == 1
        settled = {one.group: one.settled for one in list_batch_groups(store, batch)}
        # What was judged before the batch was made is judged in it once more.
        assert [group for group in groups if settled[group]] == [groups[1]]
        assert leases.lease_next_group(batch, BO).group == groups[0]

    def test_an_annotator_hands_in_and_a_reviewer_gets_it(self, store, dataset, groups, leases):
        new = NewBatch("a", annotators=["ada"], reviewers=["bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        assert leases.lease_next_group(batch, BO).group is None
        lease = leases.lease_next_group(batch, ADA)
        assert (lease.group, lease.part) == (groups[0], BatchRole.ANNOTATOR)
        assert leases.submit_group(batch, groups[0], ADA, actor="ada").batch.submitted == 1
        assert leases.lease_next_group(batch, ADA, after=groups[0]).group == groups[1]
        review = leases.lease_next_group(batch, BO)
        assert (review.group, review.part) == (groups[0], BatchRole.REVIEWER)
        with pytest.raises(ConflictError):
            leases.submit_group(batch, groups[1], BO, actor="bo")
        with pytest.raises(ConflictError, match="assigned to other people"):
            leases.lease_next_group(batch, CY)
        with pytest.raises(NotFoundError):
            leases.lease_group(batch, 99, BO)
        leases.submit_group(batch, groups[0], ADA, actor="ada", done=False)
        assert get_batch(store, batch).submitted == 0

    @pytest.mark.parametrize("done", [True, False])
    def test_a_hand_in_keeps_its_answer_in_its_transaction(
        self, store, dataset, groups, leases, done
    ):
        new = NewBatch("a", annotators=["ada"])
        batch = make_batch(store, dataset, new, actor="lead").id
        kept = []

        def keep(session: Session, lease: Lease) -> None:
            kept.append((lease, read_batch(session, batch).submitted))

        with stored_by(keep):
            lease = leases.submit_group(batch, groups[0], ADA, actor="ada", done=done)
        assert kept == [(lease, int(done))]

    def test_what_is_handed_back_waits_for_its_annotator_first_and_says_why(
        self, store, dataset, groups, leases
    ):
        invite(store, "dan", Role.ANNOTATOR, actor="local")
        dan = BatchMember("dan")
        new = NewBatch("a", annotators=["ada", "dan"], reviewers=["bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        with pytest.raises(ConflictError, match="is not submitted"):
            leases.return_group(batch, groups[3], BO, actor="bo")
        leases.submit_group(batch, groups[3], ADA, actor="ada")
        assert leases.lease_next_group(batch, BO).group == groups[3]
        back = leases.return_group(batch, groups[3], BO, "the far goal  line", actor="bo")
        assert (back.batch.submitted, back.here) == (0, ())
        (mine,) = list_own_batches(store, lambda _: ADA)
        said = [(one.group, one.by, one.reason) for one in mine.returned]
        assert said == [(groups[3], "bo", "the far goal line")]
        assert list_own_batches(store, lambda _: dan)[0].returned == []
        with store.read() as session:
            person = find_person_by_name(session, "ada")
            rings = select_notifications(session, person.id, EVERYTHING, "", 9)
        assert rings[0].sentence.endswith(" to you: the far goal line")
        told = read_audit(store, AuditQuery(), EVERYTHING).items[0]
        assert told.sentence == "returned to ada: the far goal line"
        assert leases.lease_next_group(batch, dan).group == groups[0]
        assert leases.lease_next_group(batch, dan, after=groups[2]).group == groups[4]
        lease = leases.lease_next_group(batch, ADA)
        assert lease.group == groups[3] and lease.returned is not None
        lease = leases.submit_group(batch, groups[3], ADA, actor="ada")
        assert (
            lease.batch.submitted == 1 and list_own_batches(store, lambda _: ADA)[0].returned == []
        )
        with store.read() as session:
            assert groups[3] in replay_log(session).groups

    @pytest.mark.parametrize("every", [0, 1001])
    def test_gold_groups_come_at_least_once_in_a_thousand(self, store, dataset, groups, every):
        make_gold(store, groups[5])
        kept = make_batch(store, dataset, NewBatch("a", size=1, gold_every=1000), actor="lead").id
        with pytest.raises(InputError, match="gold_every must be from 1 to 1000") as refused:
            make_batch(store, dataset, NewBatch("b", size=1, gold_every=every), actor="lead")
        assert refused.value.pointer == "/gold_every"
        with pytest.raises(InputError, match="from 1 to 1000"):
            change_batch(store, kept, gold_every=every, actor="lead")
        assert [(one.id, one.gold_every) for one in list_batches(store, dataset)] == [(kept, 1000)]

    def test_what_is_annotated_among_gold_waits_for_its_reviewer_who_may_hand_it_back(
        self, store, dataset, groups, leases
    ):
        make_gold(store, groups[5])
        new = NewBatch("a", size=2, annotators=["ada"], reviewers=["bo"], gold_every=2)
        batch = make_batch(store, dataset, new, actor="lead").id
        had = 0
        while (copy := leases.lease_next_group(batch, ADA).group) is not None:
            # What is left falls by one with each, whatever it is a copy of.
            assert [one.left for one in list_own_batches(store, lambda _: ADA)] == [3 - had]
            leases.submit_group(batch, copy, ADA, actor="ada")
            had += 1
            (mine,) = list_own_batches(store, lambda _: ADA)
            seen = mine.batch
            assert (mine.left, seen.groups, seen.settled, seen.waiting) == (
                3 - had,
                3,
                had,
                3 - had,
            )
        assert had == 3
        assert get_batch(store, batch).submitted == 2
        found = leases.lease_next_group(batch, BO)
        assert (found.group, found.part, found.submitted_by) == (
            groups[0],
            BatchRole.REVIEWER,
            "ada",
        )
        leases.return_group(batch, groups[0], BO, "too wide", actor="bo")
        (mine,) = list_own_batches(store, lambda _: ADA)
        assert (mine.left, [one.group for one in mine.returned]) == (1, [groups[0]])
        assert (mine.batch.groups, mine.batch.settled, mine.batch.waiting) == (3, 2, 1)
        change_batch(store, batch, actor="lead", annotators=["ada", "cy"], no_gold=True)
        change_batch(store, batch, actor="lead", gold_every=1000)
        assert groups[0] not in originals(store, leases, batch, CY)
        back = leases.lease_next_group(batch, ADA)
        assert (back.group, back.returned.reason) == (groups[0], "too wide")
        leases.submit_group(batch, groups[0], ADA, actor="ada")
        assert leases.lease_next_group(batch, ADA).group is None
        judge(store, groups[0], "bo")
        assert leases.lease_next_group(batch, BO).group == groups[1]

    @pytest.mark.parametrize("state", ["deferred", None])
    def test_what_nobody_settled_among_gold_waits_for_the_next_one(
        self, store, dataset, groups, leases, state
    ):
        make_gold(store, groups[5])
        new = NewBatch("a", size=2, gold_every=1000)
        batch = make_batch(store, dataset, new, actor="lead").id
        assert sorted(originals(store, leases, batch, BO, state)) == groups[:2]
        assert get_batch(store, batch).settled == 0
        (mine,) = list_own_batches(store, lambda _: CY)
        assert mine.left == 3
        assert sorted(originals(store, leases, batch, CY, "rejected")) == groups[:2]
        assert get_batch(store, batch).settled == 2

    def test_what_was_submitted_before_a_stop_is_taken_over_when_the_server_starts(
        self, store, dataset, groups, leases
    ):
        make_gold(store, groups[5])
        new = NewBatch("a", size=1, annotators=["ada"], reviewers=["bo"], gold_every=1000)
        batch = make_batch(store, dataset, new, actor="lead").id
        # The copy of gold, of no use here, may come first.
        ordinary = False
        while not ordinary:
            copy = leases.lease_next_group(batch, ADA).group
            with store.read() as session:
                ordinary = find_annotation_of_copy(session, copy).kind == INDEPENDENT
            leases.submit_group(batch, copy, ADA, actor="ada")
        assert get_batch(store, batch).submitted == 0
        compare_uncompared_groups(store)
        assert get_batch(store, batch).submitted == 1

    def test_nothing_is_given_out_of_a_closed_one(self, store, dataset, groups, leases):
        batch = make_batch(store, dataset, NewBatch("a"), actor="lead").id
        change_batch(store, batch, actor="lead", state="closed")
        with pytest.raises(ConflictError, match="closed"):
            leases.lease_next_group(batch, BO)
        with pytest.raises(ConflictError, match="closed"):
            leases.lease_group(batch, groups[0], BO)

    def test_nothing_is_handed_in_of_one_that_is_closed_meanwhile(
        self, store, dataset, groups, leases, monkeypatch
    ):
        batch = make_batch(store, dataset, NewBatch("a", annotators=["ada"]), actor="lead").id
        look = leases_module.find_own_annotation

        def closing(*arguments):
            found = look(*arguments)
            monkeypatch.undo()
            change_batch(store, batch, actor="lead", state="closed")
            return found

        monkeypatch.setattr(leases_module, "find_own_annotation", closing)
        with pytest.raises(ConflictError, match="closed"):
            leases.submit_group(batch, groups[0], ADA, actor="ada")

    @pytest.mark.parametrize("done", [True, False])
    def test_what_somebody_else_handed_in_stays_theirs(self, store, dataset, groups, leases, done):
        new = NewBatch("a", annotators=["ada", "bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        leases.submit_group(batch, groups[0], ADA, actor="ada")
        with pytest.raises(ConflictError, match="ada has submitted this group"):
            leases.submit_group(batch, groups[0], BO, actor="bo", done=done)
        (row,) = [one for one in list_batch_groups(store, batch) if one.group == groups[0]]
        assert row.submitted_by == "ada"

    def test_a_group_that_was_judged_is_not_handed_back(self, store, dataset, groups, leases):
        new = NewBatch("a", annotators=["ada"], reviewers=["bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        leases.submit_group(batch, groups[0], ADA, actor="ada")
        judge(store, groups[0], "bo")
        with pytest.raises(ConflictError, match="already has a verdict"):
            leases.return_group(batch, groups[0], BO, "once more", actor="bo")

    def test_it_says_that_it_has_a_verdict_to_who_submits_it_too_late(
        self, store, dataset, groups, leases
    ):
        batch = make_batch(store, dataset, NewBatch("a", annotators=["ada"]), actor="lead").id
        judge(store, groups[0], "bo")
        with pytest.raises(ConflictError, match="this group already has a verdict"):
            leases.submit_group(batch, groups[0], ADA, actor="ada")

    def test_the_named_reviewers_and_leads_return_a_group_and_nobody_else(
        self, store, dataset, groups, leases
    ):
        new = NewBatch("a", annotators=["ada"], reviewers=["bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        for member in (BO, BatchMember("lea", leads=True)):
            leases.submit_group(batch, groups[0], ADA, actor="ada")
            with pytest.raises(ConflictError, match='not a reviewer of the batch "a"'):
                leases.return_group(batch, groups[0], CY, "the ball", actor="cy")
            leases.return_group(batch, groups[0], member, "the ball", actor=member.name)


class TestOwnPlace:
    """A copy is in no queue: its place is among those of its person."""

    def test_it_counts_what_is_done_and_what_is_left(self, store, dataset, groups):
        new = NewBatch("a", size=3, annotators=["ada", "bo"], reviewers=["cy"], verdicts=2)
        batch = make_batch(store, dataset, new, actor="lead").id
        told = []
        for _ in range(3):
            lease = LeaseService(store).lease_next_group(batch, ADA)
            again = LeaseService(store).lease_group(batch, lease.group, ADA)
            assert (again.place, again.of) == (lease.place, lease.of)
            told.append((lease.place, lease.of))
            judge(store, lease.group, "ada")
        assert told == [(1, 3), (2, 3), (3, 3)]

    def test_no_count_tells_gold_groups_from_others(self, store, dataset, groups):
        make_gold(store, groups[5])
        new = NewBatch("a", size=3, annotators=["ada"], gold_every=2)
        batch = make_batch(store, dataset, new, actor="lead").id
        lease = LeaseService(store).lease_next_group(batch, ADA)
        assert (lease.place, lease.of) == (1, None)

    def test_who_works_on_the_groups_themselves_is_told_none(self, store, dataset, groups):
        batch = make_batch(store, dataset, NewBatch("a", annotators=["ada"]), actor="lead").id
        lease = LeaseService(store).lease_next_group(batch, ADA)
        assert (lease.place, lease.of) == (None, None)


class TestWhoLeft:
    """A copy that somebody began and left keeps nobody else from the group."""

    @pytest.mark.parametrize("disabled", [True, False])
    def test_its_place_is_somebody_elses(self, store, dataset, groups, leases, disabled):
        people = ["ada", "bo", "cy"]
        new = NewBatch("a", size=1, annotators=people, verdicts=2)
        batch = make_batch(store, dataset, new, actor="lead").id
        for member in (ADA, BO):
            assert leases.lease_next_group(batch, member).group is not None
        assert leases.lease_next_group(batch, CY).group is None
        assert self.waits_for_cy(store, batch) == (0, False)
        if disabled:
            ada = find_person(store, "ada").id
            change_person(store, ada, disabled=True, actor="lead")
        else:
            change_batch(store, batch, actor="lead", annotators=people[1:])
        assert self.waits_for_cy(store, batch) == (1, True)
        copy = leases.lease_next_group(batch, CY).group
        assert copy is not None
        for member, mine in ((BO, leases.lease_next_group(batch, BO).group), (CY, copy)):
            leases.submit_group(batch, mine, member, actor=member.name)
        assert compare_or_adopt_submission(store, copy) == "agreed"
        assert get_batch(store, batch).settled == 1

    def test_what_they_submitted_counts(self, store, dataset, groups, leases):
        new = NewBatch("a", size=1, annotators=["ada", "cy"], verdicts=1, gold_every=2)
        make_gold(store, groups[5])
        batch = make_batch(store, dataset, new, actor="lead").id
        assert originals(store, leases, batch, ADA) == [groups[0]]
        change_person(store, find_person(store, "ada").id, disabled=True, actor="lead")
        assert originals(store, leases, batch, CY) == []

    def waits_for_cy(self, store, batch) -> tuple[int, bool]:
        """How many groups are left for cy, and whether their session is told that some are."""
        (mine,) = [one for one in list_own_batches(store, lambda _: CY) if one.batch.id == batch]
        with store.read() as session:
            cy = find_person_by_name(session, "cy").id
            ((_, _, waits),) = find_rights(session, cy, ["lead"]).blind
        return mine.left, waits


class TestProgress:
    def test_work_is_of_those_to_whom_it_is_given(self, store, dataset, groups, leases):
        new = NewBatch("a", size=3, annotators=["ada"], reviewers=["bo"])
        batch = make_batch(store, dataset, new, actor="lead").id
        leases.submit_group(batch, groups[0], ADA, actor="ada")
        left = {
            one.name: [
                (item.parts, item.left) for item in list_own_batches(store, lambda _, one=one: one)
            ]
            for one in (ADA, BO, CY)
        }
        assert left == {
            "ada": [([BatchRole.ANNOTATOR], 2)],
            "bo": [([BatchRole.REVIEWER], 1)],
            "cy": [],
        }

    def test_pace_comes_of_what_was_done_and_pauses_are_none_of_it(
        self, store, dataset, groups, clock
    ):
        new = NewBatch("a", annotators=["ada"])
        batch = make_batch(store, dataset, new, actor="lead").id
        for minutes, group in ((1, groups[0]), (4, groups[1]), (90, groups[2]), (96, groups[3])):
            at = clock.at + timedelta(minutes=minutes)
            LeaseService(store, lambda at=at: at).submit_group(batch, group, ADA, actor="ada")
        (team,) = list_team_batches(store, dataset, at=clock.at + timedelta(hours=2))
        (pace,) = team.people
        assert (pace.name, pace.submitted, pace.minutes) == ("ada", 4, pytest.approx(9))
        assert pace.groups_an_hour == pytest.approx(60 * 4 / 9)
        assert team.stalled is None
        (later,) = list_team_batches(store, dataset, at=clock.at + timedelta(hours=27))
        assert later.stalled is not None
        change_batch(store, batch, actor="lead", state="closed")
        (closed,) = list_team_batches(store, dataset, at=clock.at + timedelta(hours=27))
        assert closed.stalled is None

    def test_own_annotations_count_on_the_copies_and_not_again_where_they_are_taken_over(
        self, store, dataset, groups, clock, monkeypatch
    ):
        new = NewBatch("a", size=2, annotators=["ada", "bo"], reviewers=["cy"], verdicts=2)
        batch = make_batch(store, dataset, new, actor="lead").id
        copies = {}
        for minutes, who in ((1, ADA), (5, ADA), (20, BO)):
            copies[minutes] = LeaseService(store).lease_next_group(batch, who).group
            at = (clock.at + timedelta(minutes=minutes)).isoformat(timespec="microseconds")
            monkeypatch.setattr("app.features.verdicts.service.now", lambda at=at: at)
            judge(store, copies[minutes], who.name)
        (team,) = list_team_batches(store, dataset, at=clock.at + timedelta(hours=2))
        paces = {one.name: (one.submitted, one.judged, one.groups) for one in team.people}
        assert paces == {"ada": (2, 2, 2), "bo": (1, 1, 1)}
        assert team.people[0].minutes_a_group == pytest.approx(2)
        # Ada's comes into the group under her name, an hour later: she did not work then.
        monkeypatch.setattr(
            "app.features.independent_annotations.adopt.now",
            lambda: (clock.at + timedelta(minutes=9)).isoformat(),
        )
        assert compare_or_adopt_submission(store, copies[20]) == "agreed"
        (team,) = list_team_batches(store, dataset, at=clock.at + timedelta(hours=2))
        assert (team.people[0].groups, team.people[0].minutes) == (2, pytest.approx(4))
        (later,) = list_team_batches(store, dataset, at=clock.at + timedelta(hours=25))
        assert later.stalled is not None
