"""Statistics of a dataset; every bar says which query opens the queue at it."""

from __future__ import annotations

from typing import Any

from pydantic import Field, model_validator

from app.api.schemas.document import Document
from app.review.queue.statistics import Measure, MeasureHistogram, MeasureSeries, Share


class SplitSeries(Document, shows=MeasureSeries):
    """The bars of one split."""

    unknown: int = Field(description="Groups that have no such number.")


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
    series: list[SplitSeries]

    @model_validator(mode="before")
    @classmethod
    def _with_measure(cls, value: Any) -> Any:
        return (
            {**vars(value), **vars(value.measure)} if isinstance(value, MeasureHistogram) else value
        )


class PositionsDocument(Document):
    """Balls on the pitch; a cell is found by `x>=a x<b y>=c y<d`."""

    x_edges: list[float] = Field(description="Metres along the length, from the centre mark.")
    y_edges: list[float] = Field(description="Metres across, towards the main cameras.")
    counts: list[list[int]] = Field(description="A row for each cell of y, in it one for each x.")
    outside: int = Field(description="Balls that lie outside all cells.")


class MatchShare(Document, shows=Share):
    """Groups of a match in one split."""


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
    positions: PositionsDocument
    matches: list[MatchShare]
    splits: list[SplitShare]
