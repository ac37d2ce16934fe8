"""What was done before there were accounts, shown as a person's."""

from __future__ import annotations

import pytest

from app.db.store import Store
from app.errors import ConflictError
from app.features.audit.audit_events import assign_local_work, find_owner_of_local_work
from app.features.groups.history import read_history
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot import read_state_snapshot
from app.features.groups.submit import load
from app.features.imports.ingest import ingest
from app.features.jobs.queries import NewJob, insert_job, read_jobs
from app.features.people.roles import Role
from app.features.people.service import find_person, invite
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import list_reviewers, set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.queries import all_versions
from tests.scenes import make_scenes


def judge(store: Store, state: str, actor: str) -> None:
    said = load(store, 1)
    reason = "duplicate_view" if state == "rejected" else None
    set_verdict(store, 1, state, reason, None, if_match=said.etag, actor=actor)


def shown(store: Store) -> tuple[str, str | None, list[str]]:
    """Who gave the verdict that counts: in the group, in the queue, and who reviewed at all."""
    state = load(store, 1).verdict
    assert state is not None
    row = list_groups(store, 1, "", 10, None, None).items[0]
    return state.actor, row.reviewer, [one.name for one in list_reviewers(store, 1)]


def made_by(store: Store) -> list[str]:
    """Who froze the version and made the jobs, the oldest first."""
    with store.read() as session:
        (version,) = all_versions(session)
        jobs = read_jobs(session)
    return [version.actor, *(job.actor for job in reversed(jobs))]


def test_the_work_of_before_is_shown_as_theirs_and_the_log_keeps_its_name(store: Store) -> None:
    scene = make_scenes(groups=1, seed=3, faults=False)[0].group
    ingest(store, "d", [scene], source="files", actor="local")
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
    with pytest.raises(ConflictError, match=r"shown as .* already"):
        assign_local_work(store, anna, actor="ada")
    assert find_owner_of_local_work(store) == "anna"

    judge(store, "rejected", "local")
    with store.write() as session:
        insert_job(session, NewJob("export", "after", "local", 1))
    assert made_by(store) == ["anna", "anna", "local"]
    assert shown(store) == ("local", "local", ["local", "anna"]), "what came after is nobody's"
