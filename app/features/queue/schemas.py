"""Documents of the queue and of what a query can ask."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from app.db.log import LogEntry
from app.features.findings.service import GroupFindings
from app.features.groups.history import STATION_EDITS
from app.features.groups.schemas import image_address
from app.features.groups.solution_schemas import (
    DismissedDocument,
    FailingGate,
    FindingDocument,
    FixDocument,
    GuideDocument,
    OfferDocument,
)
from app.features.queue.fields import FieldKind
from app.features.queue.service import GroupRow as QueueRow
from app.features.queue.service import Neighbours as QueueNeighbours
from app.http.documents import Document, ListDocument
from app.soccer.choices import VerdictState
from app.soccer.finding import Dismissal, Finding

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


def thumbnail_address(view_id: int | None) -> str | None:
    """Where the small picture of a group's main view is served."""
    if view_id is None:
        return None
    return f"{image_address(view_id)}?width={THUMBNAIL_WIDTH}"


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
            thumbnail=thumbnail_address(row.main_view),
        )


_SAME = tuple(
    name
    for name in GroupRow.model_fields
    if name not in ("label", "changed", "first_failing", "findings", "dismissed", "thumbnail")
)


class GroupPage(ListDocument[GroupRow]):
    """Groups that match, in order; `next` is the cursor of the page after this one."""

    total: int = Field(description="How many match in all.")


class Neighbours(Document, shows=QueueNeighbours):
    """Where a group stands among those that match, and what comes before and after it."""

    index: int | None = Field(description="From 0; null when the group does not match.")


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
    fix: FixDocument | None
    offers: list[OfferDocument] = Field(description="Edits that correct it.")
    guide: GuideDocument | None = Field(
        description="Where a person has to look or draw; null if edits are offered, or nothing."
    )
    dismissed: DismissedDocument | None = Field(
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


class History(ListDocument[LogEntryDocument]):
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
