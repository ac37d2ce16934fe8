"""The audit: everything that was said and done, with who did it, for whom it is for."""

from __future__ import annotations

from contextlib import closing

import pytest

from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.audit.queries import AuditQuery
from app.features.audit.service import (
    KINDS,
    AuditTopic,
    assign_local_work,
    find_owner_of_local_work,
    iterate_audit_entries,
    read_audit,
    record_audit_event,
)
from app.features.batches.service import NewBatch, change_batch, make_batch, remove_batch
from app.features.comments.service import begin_thread
from app.features.groups.edit import SetLines, SetViewInclusion, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.replay import _STEPS, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit, submit_edits
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.features.imports.ingest import import_groups
from app.features.jobs.queries import NewJob, insert_job, read_jobs
from app.features.jobs.service import Jobs
from app.features.people.links import set_password_by_link
from app.features.people.logins import LoginSessions
from app.features.people.roles import DatasetRoles, Role
from app.features.people.service import find_person, give_role, invite
from app.features.people.visibility_queries import EVERYTHING
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import list_reviewers, set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.queries import list_all_versions
from tests.scenes import make_scenes
from tests.waiting import SECONDS

ALL = AuditQuery()


@pytest.fixture
def said(store: Store, fill, make_group) -> int:
    """A group of which anna and a token of hers have said something, and bob was let in."""
    (group,) = fill(make_group())
    bob, link = invite(store, "bob", Role.NONE, actor="anna")
    set_password_by_link(store, link.token, "three plain words")
    LoginSessions(store).log_in("bob", "three plain words", address="192.0.2.7")
    give_role(store, "demo", bob.id, Role.LEAD, actor="anna")
    begin_thread(store, group, "Behind the post?", actor="anna (token lens)")
    state = load_group_state(store, group)
    set_verdict(store, group, "deferred", None, "unsure", if_match=state.etag, actor="anna")
    return group


def lines(store: Store, asked: AuditQuery = ALL, sight=EVERYTHING, search: str = "") -> list[str]:
    found = read_audit(store, asked, sight, search=search).items
    return [f"{one.actor}: {one.sentence}" for one in found]


class TestAudit:
    def test_everything_is_told_the_newest_first_with_who_did_it(
        self, store: Store, said: int
    ) -> None:
        assert lines(store)[:6] == [
            "anna: deferred: unsure",
            "anna (token lens): commented: Behind the post?",
            "anna: bob: role in dataset (lead)",
            "bob: bob: logged in",
            "bob: bob: password chosen",
            "anna: bob: invited",
        ]
        login = read_audit(store, ALL, EVERYTHING, search="logged in").items[0]
        assert (login.network, login.address) == ("192.0.2.7", "/people")
        assert read_audit(store, ALL, EVERYTHING).items[1].address == f"/review/{said}?thread=1"

    def test_it_is_filtered_by_person_kind_group_time_and_words(
        self, store: Store, said: int
    ) -> None:
        assert len(lines(store, AuditQuery(person="anna"))) == 4
        assert len(lines(store, AuditQuery(person="anna (token lens)"))) == 1
        assert len(lines(store, AuditQuery(kinds=KINDS[AuditTopic.VERDICT]))) == 1
        assert len(lines(store, AuditQuery(group_id=said))) == 3
        at = read_audit(store, ALL, EVERYTHING).items[0].at
        assert len(lines(store, AuditQuery(since=at))) == 1
        assert len(lines(store, AuditQuery(until=at))) == len(lines(store)) - 1
        assert lines(store, search="POST behind") == [
            "anna (token lens): commented: Behind the post?"
        ]

    def test_a_lead_reads_of_their_datasets_alone_rights_there_too(
        self, store: Store, said: int
    ) -> None:
        lead = DatasetRoles(Role.NONE, {1: Role.LEAD}).visibility_of_led_datasets()
        assert lines(store, sight=lead)[2] == "anna: bob: role in dataset (lead)"
        assert not any("logged in" in line for line in lines(store, sight=lead))
        for roles in (DatasetRoles(Role.REVIEWER), DatasetRoles(Role.LEAD, {1: Role.VIEWER})):
            assert lines(store, sight=roles.visibility_of_led_datasets()) == []

    def test_pages_follow_each_other_and_hold_each_entry_once(
        self, store: Store, said: int
    ) -> None:
        every = [one.id for one in iterate_audit_entries(store, ALL, EVERYTHING)]
        for search in ("", "e"):
            ids, before = [], None
            while True:
                page = read_audit(store, ALL, EVERYTHING, before=before, limit=2, search=search)
                ids += [one.id for one in page.items]
                if page.next is None:
                    break
                before = page.next
            assert ids == every

    def test_what_cannot_be_read_is_refused_before_the_first_entry_is_given(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_asked: object) -> None:
            raise InputError("a text contains a character that the database cannot store")

        monkeypatch.setattr("app.features.audit.service.list_audit_rows", refuse)
        with pytest.raises(InputError):
            iterate_audit_entries(store, ALL, EVERYTHING)

    def test_every_kind_that_the_log_knows_has_its_family(self) -> None:
        assert {kind for kinds in KINDS.values() for kind in kinds} == set(_STEPS) | {"import"}

    def test_edits_of_several_views_at_once_are_told_one_by_one(
        self, store: Store, said: int
    ) -> None:
        state = load_group_state(store, said)
        one, two = (view.key for view in state.group.views[:2])
        edits = [SetLines(one, {"Middle line": None}), make_set_ball_edit(two, None)]
        state = submit_edits(store, said, edits, if_match=state.etag, actor="anna")
        undo_group_edit(store, said, if_match=state.etag, actor="anna")
        told = f"lines of view {one}: Middle line; balls of view {two}"
        assert lines(store)[1] == f"anna: {told}"
        # What takes them back begins with the last.
        assert lines(store)[0].startswith(f"anna: undid: balls of view {two}; lines of view {one}")

    def test_edits_are_told_by_what_they_set_where_and_whether_they_were_taken_back(
        self, store: Store, said: int
    ) -> None:
        state = load_group_state(store, said)
        key = state.group.views[0].key
        edits = (
            SetLines(key, {"Middle line": None}),
            make_set_ball_edit(key, None),
            SetViewInclusion(key, False),
            SetViewInclusion(key, True),
        )
        for edit in edits:
            state = submit_edit(store, said, edit, if_match=state.etag, actor="anna")
        state = undo_group_edit(store, said, if_match=state.etag, actor="anna")
        redo_group_edit(store, said, if_match=state.etag, actor="anna")
        assert lines(store)[:6] == [
            f"anna: redid: use of view {key}",
            f"anna: undid: leaving out of view {key}",
            f"anna: use of view {key}",
            f"anna: leaving out of view {key}",
            f"anna: balls of view {key}",
            f"anna: lines of view {key}: Middle line",
        ]

    def test_a_job_is_told_by_its_title_and_leads_to_the_jobs(
        self, store: Store, said: int
    ) -> None:
        with closing(Jobs(store)) as jobs:
            job = jobs.submit("solve", "Solve demo", lambda _: None, actor="anna")
            jobs.wait(job.id, SECONDS)
        (entry,) = read_audit(store, AuditQuery(kinds=("job",)), EVERYTHING).items
        assert (entry.sentence, entry.address) == ("requested: Solve demo", "/jobs")

    def test_what_became_of_a_batch_is_said_in_words(self, store: Store, said: int) -> None:
        batch = make_batch(store, "demo", NewBatch("first look"), actor="bob")
        change_batch(store, batch.id, state="closed", actor="bob")
        remove_batch(store, batch.id, actor="bob")
        did = ("deleted", "closed", "assigned")
        assert lines(store)[:3] == [f"bob: {verb} the batch “first look”" for verb in did]

    def test_what_has_no_words_of_its_own_names_its_person(self, store: Store, said: int) -> None:
        record_audit_event(store, "bob", "webhook deleted", 1, url="https://hooks.example.org/")
        assert lines(store)[0] == "bob: webhook deleted: https://hooks.example.org/"


def judge(store: Store, state: str, actor: str) -> None:
    said = load_group_state(store, 1)
    reason = "duplicate_view" if state == "rejected" else None
    set_verdict(store, 1, state, reason, None, if_match=said.etag, actor=actor)


def shown(store: Store) -> tuple[str, str | None, list[str]]:
    """Who gave the verdict that counts: in the group, in the queue, and who reviewed at all."""
    state = load_group_state(store, 1).verdict
    assert state is not None
    row = list_groups(store, 1, "", 10, None, None).items[0]
    return state.actor, row.reviewer, [one.name for one in list_reviewers(store, 1)]


def made_by(store: Store) -> list[str]:
    """Who froze the version and made the jobs, the oldest first."""
    with store.read() as session:
        (version,) = list_all_versions(session)
        jobs = read_jobs(session)
    return [version.actor, *(job.actor for job in reversed(jobs))]


def test_the_work_of_before_is_shown_as_theirs_and_the_log_keeps_its_name(store: Store) -> None:
    scene = make_scenes(groups=1, seed=3, faults=False)[0].group
    import_groups(store, "d", [scene], source="files", actor="local")
    solve_dataset(store, "d")
    freeze_dataset(store, "d", FreezeRequest(name="v1", groups="passing"), actor="local")
    judge(store, "deferred", "local")
    with store.write() as session:
        insert_job(session, NewJob("export", "before", "local", 1))
    assert made_by(store) == ["local", "local"]
    invite(store, "anna", Role.LEAD, actor="local")
    anna = find_person(store, "anna").id
    assert shown(store) == ("local", "local", ["local"])
    assert assign_local_work(store, anna, actor="ada") == "anna"
    assert shown(store) == ("anna", "anna", ["anna"])
    assert {entry.actor for entry in read_history(store, 1)} == {"anna"}
    assert list_groups(store, 1, "reviewer:anna", 10, None, None).total == 1

    with store.read() as session:
        assert replay_log(session) == read_state_snapshot(session), (
            "the log, its chain and the tables"
        )
    with pytest.raises(ConflictError, match="already assigned to"):
        assign_local_work(store, anna, actor="ada")
    assert find_owner_of_local_work(store) == "anna"

    judge(store, "rejected", "local")
    with store.write() as session:
        insert_job(session, NewJob("export", "after", "local", 1))
    assert made_by(store) == ["anna", "anna", "local"]
    assert shown(store) == ("local", "local", ["local", "anna"]), "what came after is nobody's"
