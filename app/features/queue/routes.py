"""What a query can ask, statistics, timeline, progress."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field, model_validator

from app.features.datasets.service import dataset_id
from app.features.groups import submit
from app.features.groups.solution_schemas import XY, FixDocument, GuideDocument, Jac, OfferDocument
from app.features.groups.submit import find_view
from app.features.groups.suggested_edits import Influence, marking_influences
from app.features.groups.suggestions import Suggestion, find_suggestions
from app.features.people.visibility_queries import is_blind
from app.features.queue.fields import FIELDS, ORDERS
from app.features.queue.schemas import QueryFieldList
from app.features.queue.statistics import (
    Measure,
    MeasureHistogram,
    MeasureSeries,
    Positions,
    Share,
    Statistics,
    Timeline,
    read_statistics,
    read_timeline,
)
from app.http.cursor import paged
from app.http.deps import AppServices, AppStore, DatasetPath, Id, QueryText
from app.http.documents import Document, ListDocument
from app.http.permissions import Action, OwnedKind, Where, may
from app.http.problem import responses
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route

Place = Annotated[list[float], Field(min_length=3, max_length=3)]
"""x, y, z. No tuple: in lists the checkers of OpenAPI documents stumble over them."""
query_fields_router = APIRouter(tags=["queue"], route_class=Route)
statistics_router = APIRouter(
    prefix="/datasets/{dataset}/statistics", tags=["datasets"], route_class=Route
)
timeline_router = APIRouter(
    prefix="/datasets/{dataset}/timeline", tags=["datasets"], route_class=Route
)
MatchName = Annotated[
    str | None, Query(max_length=500, description="Groups of this match alone; default: of all.")
]
insight_router = APIRouter(tags=["insight"], route_class=Route)


class StatisticsHistogram(Document, shows=Measure):
    """How one number is spread over the groups that match."""

    field: str = Field(description="Name of the field in queries.")
    edges: list[float] = Field(description="One more than there are bars.")
    open_low: bool = Field(description="The first bar also holds what lies below.")
    open_high: bool = Field(description="The last bar also holds what lies beyond.")
    log: bool = Field(
        description="The bars are equally wide on a logarithmic scale, but the first: it holds 0 "
        "and all that is smaller than the second edge.",
    )
    queries: list[str] = Field(description="For each bar, the query that finds its groups.")
    series: list[MeasureSeries]

    @model_validator(mode="before")
    @classmethod
    def _with_measure(cls, value: Any) -> Any:
        return (
            {**vars(value), **vars(value.measure)} if isinstance(value, MeasureHistogram) else value
        )


class SplitShare(Document):
    """Groups of a split."""

    split: str
    groups: int
    passing: int
    accepted: int


class StatisticsDocument(Document):
    """Statistics over the groups that a query matches."""

    groups: int
    histograms: list[StatisticsHistogram]
    positions: Positions
    matches: list[Share]
    splits: list[SplitShare]


class TimelineDocument(BaseModel):
    """Groups in the order of their numbers; the values of one group stand at one index."""

    total: int
    id: list[int]
    number: list[int]
    frame: list[int | None] = Field(
        description="Number of the video frame; null where the key of the group is none."
    )
    error_px: list[float | None] = Field(
        description="The larger reprojection error of the best pair, with or without a ball."
    )
    passes: list[bool | None] = Field(description="null while the group is not solved.")
    gate: list[str | None] = Field(description="The first failing gate.")
    status: list[str]
    stale: list[bool] = Field(description="Whether the inputs changed after the verdict.")
    sigma_m: list[float | None]
    point: list[Place | None] = Field(description="The 3D ball; pitch frame, metres, z down.")

    @staticmethod
    def of(timeline: Timeline) -> TimelineDocument:
        """The document of a timeline."""
        points = [None if point is None else list(point) for point in timeline.point]
        values = {**vars(timeline), "point": points}
        return TimelineDocument.model_construct(total=len(timeline.id), **values)


class SuggestedEdit(FixDocument):
    """An edit as findings propose it, or a point moved."""

    point: XY | None = Field(
        description="Where `move_point` puts its point, or where the ball of `look_ball` would be."
    )


class SuggestionDocument(Document):
    """What the solver has tried out: an edit, or where a person should look and draw."""

    gate: str = Field(description="The gate that fails now.")
    view: str | None
    sentence: str = Field(description='Reads on after "would pass if".')
    edit: SuggestedEdit
    offers: list[OfferDocument] = Field(
        description="Edits that carry it out; none where a person has to look or draw."
    )
    guide: GuideDocument | None = Field(
        description="Where that person is led; null where edits are offered."
    )
    value: float | None = Field(description="The gate's value after the edit.")
    passes: bool = Field(description="Whether the whole group would pass after the edit.")

    @model_validator(mode="before")
    @classmethod
    def _with_point(cls, value: Any) -> Any:
        if isinstance(value, Suggestion):
            return {**vars(value), "edit": {**vars(value.fix), "point": value.point}}
        return value


class Suggestions(ListDocument[SuggestionDocument]):
    """What would make a group pass, the gentlest first; empty when it passes."""


class InfluenceDocument(Document, shows=Influence):
    """What the camera would be without one marking."""

    jac: Jac | None = Field(description="JaC of the view as it is, by gamma in per cent.")
    jac_without: Jac | None = Field(
        description="JaC of the other markings, with a camera that is calibrated without this one."
    )
    largest_px_without: float | None = Field(
        description="Distance of its points from the marking, with a camera that is calibrated "
        "without them."
    )


class Influences(ListDocument[InfluenceDocument]):
    """The influence of every annotated marking of a view."""


@query_fields_router.get("/query-fields", operation_id="listQueryFields", responses=responses())
@may(Action.READ, where=Where.SOMEWHERE)
@paged()
def list_query_fields() -> QueryFieldList:
    """Every field of a query with its operators, unit and values, and every order."""
    return QueryFieldList(items=FIELDS, sorts=ORDERS)


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
        return read_statistics(services.store, found, query)
    return services.statistics.statistics(found)


@timeline_router.get("", operation_id="getTimeline", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_timeline(
    dataset: DatasetPath, store: AppStore, query: QueryText = "", match: MatchName = None
) -> TimelineDocument:
    """All groups that a query matches, in the order of their numbers, column by column."""
    return TimelineDocument.of(read_timeline(store, dataset_id(store, dataset), query, match))


@insight_router.get(
    "/groups/{group}/suggestions", operation_id="getSuggestions", responses=responses(404)
)
@may(Action.READ, group=OwnedKind.GROUP)
@limit(COMPUTE)
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
@limit(COMPUTE)
@paged()
def get_influence(view: Id, store: AppStore) -> Influences:
    """What the camera of a view would be without each of its markings; saves nothing."""
    found = find_view(store, view)
    state = submit.load(store, found.group_id)
    seen = next(item for item in state.group.views if state.view_ids[item.key] == view)
    items = marking_influences(seen.station, state.group.pitch, state.policy.calibration)
    return Influences(items=items)
