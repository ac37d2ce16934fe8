"""Datasets, and what a query finds in them."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.policy import PolicyDocument
from app.review.datasets import Dataset
from app.review.progress import Summary


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
        values = {**vars(dataset), "policy": PolicyDocument.of(dataset.policy)}
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
    """Counts of one number over the groups that match, in bins of equal width."""

    low: float = Field(description="Left end of the first bin.")
    high: float = Field(description="Right end of the last bin.")
    counts: list[int]


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
                name: Histogram(low=item.low, high=item.high, counts=list(item.counts))
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
