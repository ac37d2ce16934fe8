"""Datasets, and what a query finds in them."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.policy import PolicyDocument
from app.review.datasets.dataset import Dataset
from app.review.queue.progress import Summary


class DatasetDocument(BaseModel):
    """A dataset, its progress and its policy."""

    id: int
    name: str
    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    policy: PolicyDocument
    created: datetime

    @staticmethod
    def of(dataset: Dataset) -> DatasetDocument:
        """The document of a dataset."""
        values = {**vars(dataset), "policy": PolicyDocument.model_validate(dataset.policy)}
        return DatasetDocument.model_validate(values)


class DatasetList(BaseModel):
    """Every dataset, by name."""

    items: list[DatasetDocument]


class Progress(BaseModel):
    """How many groups match, and how far they are."""

    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    stale: int = Field(description="Changed after their verdict.")


class Histogram(BaseModel):
    """Counts of one number over the groups that match.

    A bin holds what is at least its left edge and below its right one; the first one also what
    is smaller, the last one its right edge.
    """

    low: float = Field(description="Left end of the first bin.")
    high: float = Field(description="Right end of the last bin.")
    edges: list[float] = Field(description="One more than there are bins.")
    open_high: bool = Field(description="The last bin also holds what lies beyond.")
    log: bool = Field(
        description="The bins are equally wide on a logarithmic scale, but the first: it holds 0 "
        "and all that is smaller than the second edge."
    )
    counts: list[int]
    unknown: int = Field(description="Groups that have no such number.")


class SummaryDocument(BaseModel):
    """Counts and histograms over the groups that a query matches."""

    progress: Progress
    histograms: dict[str, Histogram] = Field(
        description="By column: jac, error_percent, sigma, parallax, size_ratio."
    )

    @staticmethod
    def of(summary: Summary) -> SummaryDocument:
        """The document of a summary."""
        return SummaryDocument(
            progress=Progress(**{name: getattr(summary, name) for name in Progress.model_fields}),
            histograms={
                name: Histogram(
                    low=item.column.edges[0],
                    high=item.column.edges[-1],
                    edges=list(item.column.edges),
                    open_high=item.column.open_high,
                    log=item.column.log,
                    counts=list(item.counts),
                    unknown=item.unknown,
                )
                for name, item in summary.histograms.items()
            },
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
