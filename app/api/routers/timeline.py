"""Timeline: every group of a dataset in the few numbers that a curve over time needs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.deps import AppStore, DatasetPath, QueryText
from app.api.problem import responses
from app.api.schemas.timeline import TimelineDocument
from app.review.datasets.dataset import dataset_id
from app.review.queue.timeline import read_timeline

router = APIRouter(prefix="/datasets/{dataset}/timeline", tags=["datasets"])

MatchName = Annotated[
    str | None, Query(max_length=500, description="Groups of this match alone; default: of all.")
]


@router.get("", operation_id="getTimeline", responses=responses(404))
def get_timeline(
    dataset: DatasetPath, store: AppStore, query: QueryText = "", match: MatchName = None
) -> TimelineDocument:
    """All groups that a query matches, in the order of their numbers, column by column."""
    return TimelineDocument.of(read_timeline(store, dataset_id(store, dataset), query, match))
