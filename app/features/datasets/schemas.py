"""Datasets, and what a query finds in them."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import AliasPath, BaseModel, ConfigDict, Field

from app.features.datasets.service import Dataset
from app.features.policies.schemas import PolicyDocument
from app.http.documents import Document, ListDocument


class DatasetDocument(Document, shows=Dataset):
    """A dataset, its progress and its policy."""

    policy: PolicyDocument
    created: datetime
    hides_groups: bool = Field(
        description=(
            "Whether groups are hidden from the logged-in person until the batch that they "
            "annotate independently is closed; counts leave them out."
        )
    )


class DatasetList(ListDocument[DatasetDocument]):
    """Every dataset, by name."""


class Progress(Document):
    """How many groups match, and how far they are."""

    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    stale: int = Field(description="Changed after their verdict.")


class Histogram(Document):
    """Counts of one number over the groups that match.

    A bin holds what is at least its left edge and below its right one; the first one also what
    is smaller, the last one its right edge.
    """

    low: float = Field(
        validation_alias=AliasPath("column", "edges", 0), description="Left end of the first bin."
    )
    high: float = Field(
        validation_alias=AliasPath("column", "edges", -1), description="Right end of the last bin."
    )
    edges: list[float] = Field(
        validation_alias=AliasPath("column", "edges"), description="One more than there are bins."
    )
    open_high: bool = Field(
        validation_alias=AliasPath("column", "open_high"),
        description="The last bin also holds what lies beyond.",
    )
    log: bool = Field(
        validation_alias=AliasPath("column", "log"),
        description="The bins are equally wide on a logarithmic scale, but the first: it holds 0 "
        "and all that is smaller than the second edge.",
    )
    counts: list[int]
    unknown: int = Field(description="Groups that have no such number.")


class SummaryDocument(Document):
    """Counts and histograms over the groups that a query matches."""

    progress: Progress
    histograms: dict[str, Histogram] = Field(
        description="By column: jac, error_percent, sigma, parallax, size_ratio."
    )


class DatasetDeletion(BaseModel):
    """The name of the dataset, once more: nobody deletes one by a slip."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"confirm": "demo"}]})

    confirm: Annotated[str, Field(max_length=200)] = ""


class DeletedDocument(BaseModel):
    """What was deleted, or, with `dry_run`, what would be."""

    dry_run: bool
    id: int
    name: str
    counts: dict[str, int] = Field(
        description="groups, views, verdicts, saved_views, versions, predictions, evaluations."
    )
