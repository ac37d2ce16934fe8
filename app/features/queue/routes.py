"""What a query can ask, statistics, timeline, progress."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from app.features.datasets.service import dataset_id
from app.features.groups import submit
from app.features.groups.submit import find_view
from app.features.groups.suggested_edits import marking_influences
from app.features.groups.suggestions import find_suggestions
from app.features.people.visibility_queries import is_blind
from app.features.queue.fields import FIELDS, ORDERS
from app.features.queue.schemas import QueryFieldList
from app.features.queue.statistics import Statistics, read_timeline, statistics
from app.features.queue.statistics_schemas import (
    Influences,
    StatisticsDocument,
    Suggestions,
    TimelineDocument,
)
from app.http.cursor import paged
from app.http.deps import AppServices, AppStore, DatasetPath, Id, QueryText
from app.http.permissions import Action, OwnedKind, Where, may
from app.http.problem import responses
from app.http.request_limits import QUESTIONS, limit
from app.http.route import Route

query_fields_router = APIRouter(tags=["queue"], route_class=Route)


@query_fields_router.get("/query-fields", operation_id="listQueryFields", responses=responses())
@may(Action.READ, where=Where.SOMEWHERE)
@paged()
def list_query_fields() -> QueryFieldList:
    """Every field of a query with its operators, unit and values, and every order."""
    return QueryFieldList(items=FIELDS, sorts=ORDERS)


statistics_router = APIRouter(
    prefix="/datasets/{dataset}/statistics", tags=["datasets"], route_class=Route
)


@statistics_router.get(
    "",
    operation_id="getStatistics",
    response_model=StatisticsDocument,
    responses=responses(404),
)
@may(Action.READ, dataset=OwnedKind.DATASET)
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


timeline_router = APIRouter(
    prefix="/datasets/{dataset}/timeline", tags=["datasets"], route_class=Route
)

MatchName = Annotated[
    str | None, Query(max_length=500, description="Groups of this match alone; default: of all.")
]


@timeline_router.get("", operation_id="getTimeline", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_timeline(
    dataset: DatasetPath, store: AppStore, query: QueryText = "", match: MatchName = None
) -> TimelineDocument:
    """All groups that a query matches, in the order of their numbers, column by column."""
    return TimelineDocument.of(read_timeline(store, dataset_id(store, dataset), query, match))


insight_router = APIRouter(tags=["insight"], route_class=Route)


@insight_router.get(
    "/groups/{group}/suggestions", operation_id="getSuggestions", responses=responses(404)
)
@may(Action.READ, group=OwnedKind.GROUP)
@limit(QUESTIONS)
@paged()
def get_suggestions(group: Id, store: AppStore) -> Suggestions:
    """Small edits with which a group that fails would pass, each tried out; saves nothing."""
    state = submit.load_solved(store, group)
    if state.solution is None:
        return Suggestions(items=[])
    found = find_suggestions(state.group, state.policy, state.solution)
    return Suggestions(items=found)


@insight_router.get(
    "/views/{view}/influence", operation_id="getInfluence", responses=responses(404)
)
@may(Action.READ, view=OwnedKind.VIEW)
@limit(QUESTIONS)
@paged()
def get_influence(view: Id, store: AppStore) -> Influences:
    """What the camera of a view would be without each of its markings; saves nothing."""
    found = find_view(store, view)
    state = submit.load(store, found.group_id)
    seen = next(item for item in state.group.views if state.view_ids[item.key] == view)
    items = marking_influences(seen.station, state.group.pitch, state.policy.calibration)
    return Influences(items=items)
