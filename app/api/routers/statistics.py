"""Statistics: how the numbers of a dataset are spread."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import AppServices, DatasetPath, QueryText
from app.api.problem import responses
from app.api.schemas.statistics import StatisticsDocument
from app.review.datasets.dataset import dataset_id
from app.review.queue.statistics import Statistics, is_blind, statistics

router = APIRouter(prefix="/datasets/{dataset}/statistics", tags=["datasets"])


@router.get(
    "",
    operation_id="getStatistics",
    response_model=StatisticsDocument,
    responses=responses(404),
)
def get_statistics(
    dataset: DatasetPath, services: AppServices, query: QueryText = ""
) -> Statistics:
    """Distances, parallax, uncertainty, sizes, heights and positions, per match and split.

    Of groups that are hidden from whoever asks nothing is counted. Every bar carries the query that opens the queue with the groups that it counts.
    """
    found = dataset_id(services.store, dataset)
    if query.strip() or is_blind(found):
        return statistics(services.store, found, query)
    return services.statistics.statistics(found)
