"""Findings: what a person should look at, over a whole dataset."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query

from app.features.datasets.service import dataset_id
from app.features.findings.service import count_groups, read_findings
from app.features.queue.routes import FindingList, FindingRow
from app.http.cursor import parse_cursor
from app.http.deps import AppStore, DatasetQuery
from app.http.permissions import Action, OwnedKind, may
from app.http.route import Route
from app.soccer.finding import FINDING_KINDS

router = APIRouter(prefix="/findings", tags=["findings"], route_class=Route)

FindingKind = Literal[FINDING_KINDS]  # type: ignore[valid-type]
MAX_GROUPS = 500


@router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET)
def list_findings(
    store: AppStore,
    dataset: DatasetQuery,
    kind: Annotated[FindingKind | None, Query(description="Only these.")] = None,
    dismissed: Annotated[
        bool | None, Query(description="Only dismissed findings (true), or only open ones (false).")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=MAX_GROUPS, description="Groups a page.")] = 50,
    cursor: Annotated[
        str | None, Query(max_length=20, description="`next` of the page before.")
    ] = None,
) -> FindingList:
    """Findings by number of the group, dismissed ones too; `total` counts the groups that have some."""
    found = dataset_id(store, dataset)
    after = parse_cursor(cursor) or 0
    groups = read_findings(store, found, after=after, limit=limit, kind=kind, dismissed=dismissed)
    rows = [
        FindingRow.of(group, finding, dismissal)
        for group in groups
        for finding, dismissal in zip(group.findings, group.dismissed, strict=True)
    ]
    following = str(groups[-1].number) if len(groups) == limit else None
    return FindingList(
        items=rows, next=following, total=count_groups(store, found, kind, dismissed=dismissed)
    )
