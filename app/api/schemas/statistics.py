"""Statistics of a dataset; every bar says which query opens the queue at it."""

from __future__ import annotations

from pydantic import BaseModel, Field

from app.review.queue.statistics import Histogram, Share, Statistics


class SplitSeries(BaseModel):
    """The bars of one split."""

    split: str
    counts: list[int]
    unknown: int = Field(description="Groups that have no such number.")


class StatisticsHistogram(BaseModel):
    """How one number is spread over the groups that match."""

    name: str
    label: str
    unit: str
    field: str = Field(description="Its field in queries.")
    edges: list[float] = Field(description="One more than there are bars.")
    open_low: bool = Field(description="The first bar also holds what lies below.")
    open_high: bool = Field(description="The last bar also holds what lies beyond.")
    log: bool = Field(
        description="The bars are equally wide on a logarithmic scale, but the first: it holds 0 "
        "and all that is smaller than the second edge."
    )
    queries: list[str] = Field(description="For each bar, the query that finds its groups.")
    series: list[SplitSeries]

    @staticmethod
    def of(histogram: Histogram) -> StatisticsHistogram:
        """The document of a histogram."""
        measure = histogram.measure
        names = ("name", "label", "unit", "field", "open_low", "open_high", "log")
        return StatisticsHistogram(
            **{name: getattr(measure, name) for name in names},
            edges=list(measure.edges),
            queries=list(histogram.queries),
            series=[
                SplitSeries(split=item.split, counts=list(item.counts), unknown=item.unknown)
                for item in histogram.series
            ],
        )


class PositionsDocument(BaseModel):
    """Balls on the pitch; a cell is found by `x>=a x<b y>=c y<d`."""

    x_edges: list[float] = Field(description="Metres along the length, from the centre mark.")
    y_edges: list[float] = Field(description="Metres across, towards the main cameras.")
    counts: list[list[int]] = Field(description="A row for each cell of y, in it one for each x.")
    outside: int = Field(description="Balls beyond the outermost cells.")


class MatchShare(BaseModel):
    """Groups of a match in one split."""

    match: str
    split: str
    groups: int
    passing: int
    accepted: int

    @staticmethod
    def of(share: Share) -> MatchShare:
        """The document of a match's share."""
        return MatchShare(**vars(share))


class SplitShare(BaseModel):
    """Groups of a split."""

    split: str
    groups: int
    passing: int
    accepted: int


class StatisticsDocument(BaseModel):
    """Statistics over the groups that a query matches."""

    groups: int
    histograms: list[StatisticsHistogram]
    positions: PositionsDocument
    matches: list[MatchShare]
    splits: list[SplitShare]

    @staticmethod
    def of(found: Statistics) -> StatisticsDocument:
        """The document of statistics."""
        places = found.positions
        return StatisticsDocument(
            groups=found.groups,
            histograms=[StatisticsHistogram.of(item) for item in found.histograms],
            positions=PositionsDocument(
                x_edges=list(places.x_edges),
                y_edges=list(places.y_edges),
                counts=[list(row) for row in places.counts],
                outside=places.outside,
            ),
            matches=[MatchShare.of(item) for item in found.matches],
            splits=[
                SplitShare(**{name: getattr(item, name) for name in SplitShare.model_fields})
                for item in found.splits
            ],
        )
