"""What a query can ask, statistics, timeline, progress; and documents of the queue."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field, model_validator

from app.db.log import LogEntry
from app.features.datasets.service import dataset_id
from app.features.findings.service import GroupFindings
from app.features.groups import submit
from app.features.groups.history import STATION_EDITS
from app.features.groups.schemas import url_of_image
from app.features.groups.solution_schemas import (
    XY,
    DismissalDocument,
    EditOfferDocument,
    FailingGate,
    FindingDocument,
    FixGuideDocument,
    Jac,
)
from app.features.groups.submit import find_view_location
from app.features.groups.suggested_edits import MarkingInfluence, measure_marking_influences
from app.features.groups.suggestions import Suggestion, find_suggestions
from app.features.people.visibility_queries import has_hidden_groups
from app.features.queue.fields import FIELDS, ORDERS, FieldKind
from app.features.queue.service import GroupRow as QueueRow
from app.features.queue.statistics import (
    BallPositionCounts,
    MatchSplitCounts,
    Measure,
    MeasureCountsOfSplit,
    MeasureHistogram,
    Statistics,
    Timeline,
    read_statistics,
    read_timeline,
)
from app.http.cursor import paged
from app.http.deps import AppServices, AppStore, DatasetPath, Id, QueryText
from app.http.documents import Document, ListDocument
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.soccer.choices import VerdictState
from app.soccer.finding import Dismissal, Finding, SuggestedFix

THUMBNAIL_WIDTH = 208
KINDS_WITH_BODY = frozenset(STATION_EDITS) | frozenset(
    {
        "edit",
        "undo",
        "redo",
        "verdict",
        "pitch",
        "position",
        "noise",
        "paint",
        "comment",
        "dismissal",
    }
    | {"take", "agreement", "work"}
)


def url_of_thumbnail(view_id: int | None) -> str | None:
    """Where the small picture of a group's main view is served."""
    if view_id is None:
        return None
    return f"{url_of_image(view_id)}?width={THUMBNAIL_WIDTH}"


class GroupRow(Document):
    """One group in a list."""

    id: int
    number: int
    key: str
    label: str
    match: str
    split: str
    status: VerdictState
    stale: bool
    passes: bool | None = Field(description="null while it is not solved.")
    first_failing: FailingGate | None
    margin: float | None = Field(
        description="Of the first failing gate, else of the gate nearest to failing: how far its "
        "value is from its threshold, as a share of the threshold (0.1 is 10 %), negative when "
        "the gate fails; null where there is no such share."
    )
    min_jac: float | None
    error_px: float | None = Field(
        description="Larger reprojection error of the best pair, as the gate `reprojection` judges "
        "it, pixels; null where there is no pair to judge."
    )
    error_percent: float | None
    sigma_m: float | None
    parallax_degrees: float | None
    size_ratio: float | None
    height_m: float | None
    distance_m: float | None = Field(
        description="Distance of the ball from the camera of the first view that it comes from."
    )
    box_px: float | None = Field(
        description="Diameter of the ball there: annotated, or, of a point, as optimised."
    )
    agreement: float | None = Field(
        description=(
            "Lowest agreement of a camera with its paint among the views in use: supported times "
            "explained; null: no paint was read."
        )
    )
    x_m: float | None
    y_m: float | None
    views: int
    pictures: int = Field(description="Views that have a picture; 0: nothing to look at.")
    findings: list[str] = Field(description="Kinds that are open.")
    dismissed: list[str] = Field(description="Kinds of dismissed findings.")
    reviewer: str | None
    reason: str | None
    override: str | None = Field(description="The gate that was overridden with a reason.")
    fixed: bool
    comments: int = Field(description="Threads of comments that are open.")
    submissions: int | None = Field(
        description="How many people submitted an independent annotation; null: shown to reviewers only."
    )
    annotations: Literal["agreed", "open", "decided"] | None = Field(
        description="Outcome of comparing them; `open`: they differ, and a reviewer has to decide."
    )
    changed: datetime
    thumbnail: str | None

    @staticmethod
    def of(row: QueueRow, judges: bool = True) -> GroupRow:
        """The document of a row of the queue; ``judges``: its reader may know what others made of it."""
        values: dict[str, Any] = {name: getattr(row, name) for name in _SAME}
        if not judges:
            values |= dict.fromkeys(("submissions", "annotations"))
        failing = None
        if row.gate is not None:
            failing = FailingGate(
                gate=row.gate, view=row.gate_view, sentence=row.gate_sentence or row.gate
            )
        return GroupRow.model_construct(
            **values,
            label=row.label or row.key,
            changed=datetime.fromisoformat(row.changed),
            first_failing=failing,
            findings=list(row.findings),
            dismissed=list(row.dismissed),
            thumbnail=url_of_thumbnail(row.main_view),
        )


_SAME = tuple(
    name
    for name in GroupRow.model_fields
    if name not in ("label", "changed", "first_failing", "findings", "dismissed", "thumbnail")
)


class GroupPage(ListDocument[GroupRow]):
    """Groups that match, in order; `next` is the cursor of the page after this one."""

    total: int = Field(description="How many match in all.")


class FindingRow(Document):
    """A finding and where it was found; `group` is the group's key."""

    kind: str
    group: str
    group_id: int
    view: str | None
    marking: str | None
    suggested: str | None
    number: float | None
    threshold: float | None
    confidence: float | None
    sentence: str
    fix: SuggestedFix | None
    offers: list[EditOfferDocument] = Field(description="Edits that correct it.")
    guide: FixGuideDocument | None = Field(
        description="Where a person has to look or draw; null if edits are offered, or nothing."
    )
    dismissed: DismissalDocument | None = Field(
        description="Person who dismissed the finding; null: not dismissed."
    )

    @staticmethod
    def of(found: GroupFindings, finding: Finding, dismissed: Dismissal | None) -> FindingRow:
        """The row of a finding in a group."""
        document = FindingDocument.of(finding, found.group, dismissed)
        return FindingRow(group=found.group.key, group_id=found.group_id, **dict(document))


class FindingList(ListDocument[FindingRow]):
    """Findings of a dataset, by number of the group."""

    total: int = Field(description="How many groups have findings.")


class LogEntryDocument(Document):
    """One entry of a group's history."""

    id: int
    at: datetime
    actor: str
    kind: str
    body: dict[str, Any] | None = Field(
        description="The edit, pitch, position or verdict as it was given, a comment without its "
        "text; null for imports."
    )

    @staticmethod
    def of(entry: LogEntry) -> LogEntryDocument:
        """The document of an entry."""
        has_body = entry.kind in KINDS_WITH_BODY and isinstance(entry.body, dict)
        body = {**entry.body} if has_body else None
        if body is not None and entry.kind == "comment":
            # Its writer may have deleted it since.
            body.pop("text", None)
        # The annotation as it was submitted is in the log for what is measured, not for reading.
        unshown = {"submitted", "inputs_hash"} if entry.kind == "take" else set[str]()
        body = None if body is None else {k: v for k, v in body.items() if k not in unshown}
        return LogEntryDocument.model_validate({**vars(entry), "body": body})


class GroupHistory(ListDocument[LogEntryDocument]):
    """What people and imports did to a group, oldest first."""


class QueryFieldDocument(Document):
    """One field of a query."""

    name: str
    kind: FieldKind = Field(
        description="`number` compares, `flag` is yes or no, `choice` is one of `values`, `text` is "
        "any text, `ids` are numbers of groups, `order` says how groups are listed."
    )
    meaning: str
    unit: str = Field(description="Of a number; empty: it has none.")
    operators: list[str] = Field(description="All that it has; `:` and `=` mean the same.")
    values: list[str] = Field(
        description="What it can be; of a number or a text, words with a meaning of their own."
    )
    several: bool = Field(description="Whether `a,b` means either.")
    also: list[str] = Field(description="Other names that are understood.")


class QueryOrderDocument(Document):
    """One order of a list; its name with `-desc` is the reverse, and what has no value comes last."""

    name: str
    meaning: str


class QueryFieldList(ListDocument[QueryFieldDocument]):
    """All that a query can ask."""

    sorts: list[QueryOrderDocument]


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
    series: list[MeasureCountsOfSplit]

    @model_validator(mode="before")
    @classmethod
    def _merge_measure_fields(cls, value: Any) -> Any:
        return (
            {**vars(value), **vars(value.measure)} if isinstance(value, MeasureHistogram) else value
        )


class SplitGroupCounts(Document):
    """Groups of a split."""

    split: str
    groups: int
    passing: int
    accepted: int


class StatisticsDocument(Document):
    """Statistics over the groups that a query matches."""

    groups: int
    histograms: list[StatisticsHistogram]
    positions: BallPositionCounts
    matches: list[MatchSplitCounts]
    splits: list[SplitGroupCounts]


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


class SuggestedEdit(Document, shows=SuggestedFix):
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
    offers: list[EditOfferDocument] = Field(
        description="Edits that carry it out; none where a person has to look or draw."
    )
    guide: FixGuideDocument | None = Field(
        description="Where that person is led; null where edits are offered."
    )
    value: float | None = Field(
        description="The gate's value after the edit; null where the paint would have to be read again "
        "to know."
    )
    passes: bool = Field(
        description="Whether the whole group would pass after the edit; false where the paint would "
        "have to be read again to know."
    )

    @model_validator(mode="before")
    @classmethod
    def _add_point_to_edit(cls, value: Any) -> Any:
        if isinstance(value, Suggestion):
            return {**vars(value), "edit": {**vars(value.fix), "point": value.point}}
        return value


class GroupFixSuggestions(ListDocument[SuggestionDocument]):
    """What would make a group pass, the gentlest first; empty when it passes."""


class MarkingInfluenceDocument(Document, shows=MarkingInfluence):
    """What the camera would be without one marking."""

    jac: Jac | None = Field(description="JaC of the view as it is, by gamma in per cent.")
    jac_without: Jac | None = Field(
        description="JaC of the other markings, with a camera that is calibrated without this one."
    )
    largest_px_without: float | None = Field(
        description="Distance of its points from the marking, with a camera that is calibrated "
        "without them."
    )


class MarkingInfluences(ListDocument[MarkingInfluenceDocument]):
    """The influence of every annotated marking of a view."""


@query_fields_router.get("/query-fields")
@may(Action.READ, where=RoleScope.SOMEWHERE)
@paged()
def list_query_fields() -> QueryFieldList:
    """Every field of a query with its operators, unit and values, and every order."""
    return QueryFieldList(items=FIELDS, sorts=ORDERS)


@statistics_router.get("", response_model=StatisticsDocument)
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_statistics(
    dataset: DatasetPath, services: AppServices, query: QueryText = ""
) -> Statistics:
    """Distances, parallax, uncertainty, sizes, heights and positions, per match and split.

    Of groups that are hidden from whoever asks nothing is counted. Every bar carries the query that opens the queue with the groups that it counts.
    """
    found = dataset_id(services.store, dataset)
    if query.strip() or has_hidden_groups(found):
        return read_statistics(services.store, found, query)
    return services.statistics.get_statistics(found)


@timeline_router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_timeline(
    dataset: DatasetPath, store: AppStore, query: QueryText = "", match: MatchName = None
) -> TimelineDocument:
    """All groups that a query matches, in the order of their numbers, column by column."""
    return TimelineDocument.of(read_timeline(store, dataset_id(store, dataset), query, match))


@insight_router.get("/groups/{group}/suggestions")
@may(Action.READ, group=OwnedKind.GROUP)
@limit(COMPUTE)
@paged()
def get_suggestions(group: Id, store: AppStore) -> GroupFixSuggestions:
    """Small edits with which a group that fails would pass, each tried out; saves nothing."""
    state = submit.load_solved_group(store, group)
    if state.solution is None:
        return GroupFixSuggestions(items=[])
    found = find_suggestions(state.group, state.policy, state.solution)
    return GroupFixSuggestions(items=found)


@insight_router.get("/views/{view}/influence")
@may(Action.READ, view=OwnedKind.VIEW)
@limit(COMPUTE)
@paged()
def get_influence(view: Id, store: AppStore) -> MarkingInfluences:
    """What the camera of a view would be without each of its markings; saves nothing."""
    found = find_view_location(store, view)
    state = submit.load_group_state(store, found.group_id)
    seen = next(item for item in state.group.views if state.view_ids[item.key] == view)
    items = measure_marking_influences(seen.station, state.group.pitch, state.policy.calibration)
    return MarkingInfluences(items=items)
