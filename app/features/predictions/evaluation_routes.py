"""Evaluations: started, listed, read with their figures and frames, compared."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from pydantic import BeforeValidator, Field, model_validator

from app.errors import NotFoundError
from app.evaluation.comparison import FIELDS, CellDifference, FrameOfTwoRuns
from app.evaluation.result import (
    FIGURES,
    NUMBERS,
    TABLES,
    Cell,
    Chart,
    FrameResult,
    Table,
    figure_to_csv,
    figure_to_png,
    table_to_csv,
)
from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.predictions import evaluation as review
from app.features.predictions.evaluation import RunComparison, parse_tables
from app.features.predictions.evaluation_run import MAX_NAME, EvaluationRequest
from app.features.predictions.jobs import request_evaluation
from app.features.versions.routes import VersionId
from app.features.versions.service import find_version_id
from app.http.cursor import paged, parse_cursor
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    make_empty_response,
    respond_with,
)
from app.http.headers import make_content_disposition
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import Responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.choices import BoxKind, LiveRule

SetId = Annotated[int, Field(strict=True, ge=1, le=MAX_ID)]


_HEADLINE = (
    ("detection", "all", "ap_50"),
    ("localization", "oracle", "mae_m"),
    ("localization", "oracle", "mae_percent"),
    ("localization", "oracle", "p_2m"),
    ("tracks", "all", "mae_m"),
    ("tracks", "all", "p_2m"),
    ("track_events", "any", "f1"),
)
router = APIRouter(tags=["evaluations"], route_class=Route)
FigureName = StrEnum("FigureName", list(FIGURES))  # type: ignore[misc]
TableName = StrEnum("TableName", list(TABLES))  # type: ignore[misc]
FrameField = StrEnum("FrameField", list(NUMBERS))  # type: ignore[misc]
CompareField = StrEnum("CompareField", list(FIELDS))  # type: ignore[misc]
SortField = StrEnum("SortField", [*NUMBERS, *(f"{name}-desc" for name in NUMBERS)])  # type: ignore[misc]
PLACE_ERROR = CompareField("error_m")
Limit = Annotated[int, Query(ge=1, le=review.MAX_PAGE)]
Cursor = Annotated[str | None, Query(max_length=20, description="`next` of the page before.")]
Bound = Annotated[float | None, Query(ge=-1e9, le=1e9, allow_inf_nan=False)]
JSON_FILE, CSV_FILE, PNG_FILE = "application/json", "text/csv", "image/png"


class EvaluationBody(RequestBody, examples=[{"predictions": 3, "version": 1, "split": "test"}]):
    """What to evaluate, and against what."""

    name: Annotated[str, Field(max_length=MAX_NAME)] = ""
    predictions: SetId | None = Field(
        default=None, description="Boxes, cameras or both; or tracks."
    )
    careful: SetId | None = Field(
        default=None, description="Reference boxes, for the table of boxes (the paper's table 1)."
    )
    version: VersionId | None = Field(
        default=None,
        description="Id, name or hash of a frozen version; null: the dataset as it is now.",
    )
    groups: LiveRule = Field(
        default="passing", description="Without a version: which groups take part."
    )
    split: Annotated[str, Field(max_length=50)] | None = Field(
        default=None, description="Frames of this split alone."
    )
    boxes: BoxKind = Field(
        default="optimized", description="Which box of the dataset is the truth."
    )
    min_score: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="Detections with a lower score take no part in localisation."
    )

    @model_validator(mode="after")
    def _require_predictions_or_boxes(self) -> EvaluationBody:
        if self.predictions is None and self.careful is None:
            raise ValueError("give predictions, reference boxes, or both")
        return self

    def to_evaluation_request(self, version: int | None) -> EvaluationRequest:
        """The request as the review floor takes it; ``version`` is the id of the one it names."""
        return EvaluationRequest(**{**self.model_dump(), "version": version})


def _select_headline_numbers(tables: list[Any]) -> dict[str, Cell | None]:
    found = {table.name: table for table in parse_tables(tables)}
    return {
        column: found[name].cell(row, column) for name, row, column in _HEADLINE if name in found
    }


class EvaluationRow(Document):
    """A run in a list, with its headline numbers."""

    id: int
    name: str
    dataset: str
    created: datetime
    actor: str
    predictions: int | None = Field(validation_alias="prediction_set_id")
    careful: int | None = Field(validation_alias="careful_set_id")
    version: int | None = Field(validation_alias="version_id")
    counts: dict[str, int]
    headline: Annotated[dict[str, Cell], BeforeValidator(_select_headline_numbers)] = Field(
        validation_alias="tables",
        description="ap_50, mae_m, mae_percent, p_2m and f1 (of events), those that the run has.",
    )


class EvaluationList(ListDocument[EvaluationRow]):
    """The runs of a dataset, the newest first."""


class EvaluationDocument(EvaluationRow):
    """A run, complete but for its figures and frames."""

    pins: dict[str, Any] = Field(
        description="What makes it repeatable: version or digest of the state, policy, solver and "
        "software version, digests of the predictions, seed."
    )
    tables: list[Table]
    figures: list[str] = Field(description="Names for `/evaluations/{id}/figures/{name}.json`.")


class FrameList(ListDocument[FrameResult]):
    """Frames behind a number; `next` is the cursor of the page after this one."""

    next: Annotated[str, Field(coerce_numbers_to_str=True)] | None
    total: int


class DifferenceDocument(Document, shows=CellDifference):
    """One number of both runs; `change` is the second minus the first."""

    first: Cell | None
    second: Cell | None
    change: float | None


class ComparisonDocument(Document):
    """Two runs of one dataset, number by number and frame by frame."""

    first: EvaluationRow
    second: EvaluationRow
    same_truth: bool = Field(
        description="Same frames, policy, solver, options and reference boxes: the numbers can be "
        "compared."
    )
    differs: list[str] = Field(
        description="Pins in which the runs differ: those of `same_truth`, and `software_version`."
    )
    numbers: list[DifferenceDocument]
    field: str
    shared: int = Field(description="Frames that both runs judged.")
    better: int
    worse: int
    gained: int = Field(description="Frames that only the second run has a value for.")
    lost: int
    mean_change: float | None
    frames: list[FrameOfTwoRuns] = Field(
        description="Frames that differ: gained and lost ones, then the largest change first."
    )
    next: str | None
    total: int

    @staticmethod
    def of(found: RunComparison, limit: int, offset: int) -> ComparisonDocument:
        """The document of a comparison, with one page of its frames."""
        frames = found.frames.frames
        shown = frames[offset : offset + limit]
        more = offset + len(shown) < len(frames)
        return ComparisonDocument.model_validate(
            {
                **vars(found),
                **vars(found.frames),
                "frames": shown,
                "next": str(offset + len(shown)) if more else None,
                "total": len(frames),
            }
        )


def _describe_file_responses(description: str, document: type[object], *others: str) -> Responses:
    """What a route answers that gives a document as JSON, and as files of other types."""
    content: dict[str, object] = {}
    for kind in others:
        text = {"type": "string"}
        content[kind] = {"schema": text if kind == CSV_FILE else {**text, "format": "binary"}}
    return {200: {"description": description, "model": document, "content": content}}


FIGURE_FILES = _describe_file_responses(
    "The figure: its values as JSON or CSV, or drawn as PNG.", Chart, CSV_FILE, PNG_FILE
)
TABLE_FILES = _describe_file_responses(
    "The table: as JSON, or as CSV with intervals and denominators.", Table, CSV_FILE
)


@router.get("/datasets/{dataset}/evaluations")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_evaluations(dataset: DatasetPath, store: AppStore) -> EvaluationList:
    """The evaluations of a dataset, the newest first."""
    found = review.list_evaluations(store, dataset)
    return EvaluationList(items=found)


@router.post("/datasets/{dataset}/evaluations", **describe_job_response_for_openapi(409))
@may(
    Action.LEAD,
    dataset=OwnedKind.DATASET,
    body={"predictions": OwnedKind.PREDICTIONS, "careful": OwnedKind.PREDICTIONS},
)
@respond_with(make_job_response)
def start_evaluation(
    dataset: DatasetPath, request: EvaluationBody, services: AppServices, actor: Actor
) -> Job:
    """Evaluate predictions against a frozen version, or the dataset as it is now.

    The job's result names the evaluation.
    """
    store, named = services.store, request.version
    version = None if named is None else find_version_id(store, str(named), dataset)
    wanted = request.to_evaluation_request(version)
    return request_evaluation(services.jobs, store, dataset, wanted, actor=actor)


@router.get("/evaluations/{evaluation}", response_model=EvaluationDocument)
@may(Action.READ, evaluation=OwnedKind.EVALUATION)
def get_evaluation(evaluation: Id, store: AppStore) -> review.StoredEvaluation:
    """One evaluation: what it pins, its tables, and the names of its figures."""
    return review.get_evaluation(store, evaluation)


@router.delete("/evaluations/{evaluation}", status_code=204)
@may(Action.LEAD, evaluation=OwnedKind.EVALUATION)
@respond_with(make_empty_response)
def delete_evaluation(evaluation: Id, store: AppStore, actor: Actor) -> None:
    """Delete an evaluation; its predictions stay."""
    review.remove_evaluation(store, evaluation, actor=actor)


@router.get(
    "/evaluations/{evaluation}/figures/{figure}.{ending}",
    response_class=Response,
    responses=FIGURE_FILES,
)
@may(Action.READ, evaluation=OwnedKind.EVALUATION)
@limit(TRANSFER)
def get_figure(
    evaluation: Id,
    figure: FigureName,
    ending: Literal["json", "csv", "png"],
    store: AppStore,
) -> Response:
    """One figure of an evaluation; 404 where the evaluation has no such figure."""
    found = review.get_chart(store, evaluation, str(figure))
    name = f"touchline-{evaluation}-{figure}.{ending}"
    if ending == "json":
        return make_document_response(found)
    if ending == "csv":
        return _csv_response(figure_to_csv(found), name)
    shown = {"Content-Disposition": make_content_disposition(name, "inline")}
    return Response(figure_to_png(found), media_type=PNG_FILE, headers=shown)


@router.get(
    "/evaluations/{evaluation}/tables/{table}.{ending}",
    response_class=Response,
    responses=TABLE_FILES,
)
@may(Action.READ, evaluation=OwnedKind.EVALUATION)
def get_table(
    evaluation: Id, table: TableName, ending: Literal["json", "csv"], store: AppStore
) -> Response:
    """One table of an evaluation; 404 where the evaluation has no such table."""
    tables = {
        item.name: item
        for item in review.parse_run_tables(review.get_evaluation(store, evaluation))
    }
    found = tables.get(str(table))
    if found is None:
        raise NotFoundError(
            f'evaluation {evaluation} has no table "{table}"', hint=f"It has {', '.join(tables)}."
        )
    if ending == "json":
        return make_document_response(found)
    return _csv_response(table_to_csv(found), f"touchline-{evaluation}-{table}.csv")


@router.get("/evaluations/{evaluation}/frames", response_model=FrameList)
@may(Action.READ, evaluation=OwnedKind.EVALUATION)
def list_evaluation_frames(
    evaluation: Id,
    store: AppStore,
    field: Annotated[
        FrameField | None, Query(description="Frames with a value here, in [low, high).")
    ] = None,
    low: Bound = None,
    high: Bound = None,
    missing: Annotated[
        bool, Query(description="Frames with a ball and without a value in `field` instead.")
    ] = False,
    match: Annotated[str | None, Query(max_length=500)] = None,
    sort: Annotated[SortField | None, Query()] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> review.FramePage:
    """The frames behind a number: a row's `frames` are parameters of this address."""
    query = review.FrameQuery(
        None if field is None else str(field), low, high, missing, match, str(sort or "")
    )
    return review.list_frames(store, evaluation, query, limit, parse_cursor(cursor) or 0)


@router.get("/evaluations/{evaluation}/compare")
@may(Action.READ, evaluation=OwnedKind.EVALUATION, with_=OwnedKind.EVALUATION)
def compare_evaluations(
    evaluation: Id,
    store: AppStore,
    other: Annotated[
        int,
        Query(alias="with", ge=1, le=MAX_ID, description="The evaluation to compare with."),
    ],
    field: Annotated[CompareField, Query(description="Compared frame by frame.")] = PLACE_ERROR,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> ComparisonDocument:
    """How this evaluation differs from another of the same dataset; changes are this minus that."""
    found = review.compare_runs(store, other, evaluation, str(field))
    return ComparisonDocument.of(found, limit, parse_cursor(cursor) or 0)


def _csv_response(text: str, name: str) -> Response:
    saved = {"Content-Disposition": make_content_disposition(name)}
    return Response(text, media_type=f"{CSV_FILE}; charset=utf-8", headers=saved)
