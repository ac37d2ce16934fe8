"""Ids are given once and for all, whatever is deleted in between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import func, select

from app.db.session import Session
from app.db.store import Store
from app.features.batches.own_annotations import begin_next_own_annotation, count_own_groups_left
from app.features.batches.service import NewBatch, make_batch, remove_batch
from app.features.comments.queries import CommentModel, ThreadModel, delete_thread
from app.features.groups.insert_queries import find_next_row_id
from app.features.independent_annotations.service import submit_annotation
from app.features.jobs.queries import JobModel, delete_job, delete_old_jobs, delete_oldest_jobs
from app.features.people.login_queries import delete_access_token, delete_access_tokens
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.people.tables import AccessTokenModel
from app.features.predictions.queries import delete_evaluation, delete_prediction_set
from app.features.predictions.tables import EvaluationModel, PredictionSetModel
from app.features.saved_views.queries import SavedViewModel, delete_saved_view
from app.features.tracks.queries import delete_tracks
from app.features.tracks.tables import TrackModel
from app.features.webhooks.queries import delete_webhook, insert_webhook
from app.features.webhooks.tables import WebhookModel
from tests.unit.stores import insert_row

DELETIONS: list[tuple[Any, Callable[[Session, int], object]]] = [
    (AccessTokenModel, delete_access_token),
    (AccessTokenModel, lambda session, _: delete_access_tokens(session, 1)),
    (CommentModel, lambda session, _: delete_thread(session, 1)),
    (EvaluationModel, delete_evaluation),
    (JobModel, delete_job),
    (JobModel, lambda session, _: delete_oldest_jobs(session, "x", 0)),
    (JobModel, lambda session, _: delete_old_jobs(session, -1)),
    (PredictionSetModel, delete_prediction_set),
    (SavedViewModel, delete_saved_view),
    (ThreadModel, delete_thread),
    (TrackModel, lambda session, number: delete_tracks(session, [number])),
    (WebhookModel, delete_webhook),
]


class TestFindNextRowId:
    @pytest.mark.parametrize(("model", "delete_row"), DELETIONS)
    def test_is_beyond_that_of_a_row_that_was_deleted(
        self,
        store: Store,
        fill,
        make_group,
        model: Any,
        delete_row: Callable[[Session, int], object],
    ) -> None:
        fill(make_group(1))
        ended = {"ended": "2026-01-01"} if model is JobModel else {}
        with store.write() as session:
            insert_row(session, model.__table__, **ended)
            number = session.scalar(select(func.max(model.id)))
            delete_row(session, number)
            assert session.scalar(select(func.count(model.id))) == 0
            assert find_next_row_id(session, model) == number + 1

    def test_is_that_of_a_new_webhook(self, store: Store, fill, make_group) -> None:
        fill(make_group(1))
        with store.write() as session:
            hook = insert_webhook(session, 1, "u", (), salt="", by="ann")
            delete_webhook(session, hook)
            assert insert_webhook(session, 1, "u", (), salt="", by="ann") == hook + 1


class TestBatches:
    def test_a_new_one_has_no_annotations_of_one_that_was_deleted(
        self, store: Store, fill, make_group
    ) -> None:
        fill(make_group(1), make_group(2))
        for name in ("ann", "ben", "lea"):
            invite(store, name, Role.LEAD, actor="lea")
        new = NewBatch(name="first", query="", verdicts=2, annotators=("ann", "ben"))
        first = make_batch(store, "demo", new, actor="lea")
        for _ in range(2):
            begun = begin_next_own_annotation(store, first, "ann")
            assert begun is not None
            submit_annotation(store, begun.id, actor="ann")
        remove_batch(store, first.id, actor="lea")
        second = make_batch(store, "demo", new, actor="lea")
        assert second.id > first.id
        with store.read() as session:
            assert count_own_groups_left(session, second, "ann") == 2
