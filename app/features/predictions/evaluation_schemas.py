"""Evaluations: what to evaluate, and the tables, figures and frames that come of it."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from app.evaluation.comparison import Difference, FrameOfTwoRuns
from app.evaluation.result import Cell, FrameResult, Table
from app.features.predictions.evaluation import RunComparison, read_tables
from app.features.predictions.evaluation_run import MAX_NAME, EvaluationRequest
from app.features.versions.schemas import VersionId
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.soccer.choices import BoxKind, LiveRule

SetId = Annotated[int, Field(strict=True, ge=1, le=MAX_ID)]


class EvaluationBody(BaseModel):
    """What to evaluate, and against what."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"predictions": 3, "version": 1, "split": "test"}]},
    )

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
    def _something(self) -> EvaluationBody:
        if self.predictions is None and self.careful is None:
            raise ValueError("give predictions, reference boxes, or both")
        return self

    def value(self, version: int | None) -> EvaluationRequest:
        """The request as the review floor takes it; ``version`` is the id of the one it names."""
        return EvaluationRequest(**{**self.model_dump(), "version": version})


_HEADLINE = (
    ("detection", "all", "ap_50"),
    ("localization", "oracle", "mae_m"),
    ("localization", "oracle", "mae_percent"),
    ("localization", "oracle", "p_2m"),
    ("tracks", "all", "mae_m"),
    ("tracks", "all", "p_2m"),
    ("track_events", "any", "f1"),
)


def _headline(tables: list[Any]) -> dict[str, Cell | None]:
    found = {table.name: table for table in read_tables(tables)}
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
    headline: Annotated[dict[str, Cell], BeforeValidator(_headline)] = Field(
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


class DifferenceDocument(Document, shows=Difference):
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
