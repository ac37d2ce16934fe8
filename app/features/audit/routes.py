"""The audit: who said and did what, for admins and for the leads of a dataset."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from datetime import UTC, datetime
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import StreamingResponse
from pydantic import Field
from starlette.responses import Response

from app.features.audit import service as audit
from app.features.audit.queries import AuditQuery
from app.features.audit.service import KINDS, AuditEntry, AuditPage, AuditTopic
from app.features.datasets.service import dataset_id
from app.features.people.visibility_queries import EVERYTHING, Visibility
from app.formats.csv_text import format_csv_line
from app.http.access import get_current_login
from app.http.cursor import Before, Cursor, parse_descending_cursor
from app.http.deps import AppStore
from app.http.documents import ListDocument, encode_document
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.route import Route
from app.json_text import MAX_ID

router = APIRouter(prefix="/audit", tags=["users"], route_class=Route)
COLUMNS = tuple(field.name for field in fields(AuditEntry))
Search = Annotated[
    str,
    Query(
        alias="q",
        max_length=200,
        description="Words that all stand in an entry: its sentence, person, dataset or group.",
    ),
]


class AuditDocument(ListDocument[AuditEntry]):
    """Entries, the newest first."""

    next: Annotated[str, Field(coerce_numbers_to_str=True)] | None = Field(
        description="`cursor` of the next page; null on the last one."
    )


async def find_led_datasets_of_request(request: Request) -> Visibility:
    """The datasets whose audit whoever asks may read."""
    login = get_current_login(request.scope)
    return EVERYTHING if login is None else login.roles.visibility_of_led_datasets()


Led = Annotated[Visibility, Depends(find_led_datasets_of_request)]


def parse_audit_query(
    store: AppStore,
    dataset: Annotated[
        str | None, Query(max_length=200, description="Name or id of the dataset.")
    ] = None,
    group: Annotated[int | None, Query(ge=1, le=MAX_ID, description="Id of a group.")] = None,
    person: Annotated[
        str | None, Query(max_length=120, description="A person, with all of their tokens.")
    ] = None,
    family: Annotated[AuditTopic | None, Query(description="What it is about.")] = None,
    since: Annotated[datetime | None, Query(description="From this time on.")] = None,
    until: Annotated[datetime | None, Query(description="Before this time.")] = None,
) -> AuditQuery:
    """Of whom, of what and when."""
    if group is not None:
        audit.require_group(store, group)
    return AuditQuery(
        None if dataset is None else dataset_id(store, dataset),
        group,
        person or None,
        None if family is None else KINDS[family],
        _format_time(since),
        _format_time(until),
    )


def _format_time(at: datetime | None) -> str | None:
    if at is None:
        return None
    try:
        whole = at if at.tzinfo is not None else at.replace(tzinfo=UTC)
        return whole.astimezone(UTC).isoformat(timespec="microseconds")
    except OverflowError:
        return at.replace(tzinfo=UTC).isoformat(timespec="microseconds")


Asked = Annotated[AuditQuery, Depends(parse_audit_query)]


@router.get("", response_model=AuditDocument)
@may(Action.LEAD, dataset=OwnedKind.DATASET, group=OwnedKind.GROUP, where=RoleScope.SOMEWHERE)
def get_audit(
    store: AppStore,
    led: Led,
    query: Asked,
    search: Search = "",
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
    cursor: Cursor = None,
    before: Before = None,
) -> AuditPage:
    """The audit log, newest first: of all datasets that the person leads, or of one.

    A search looks through 20,000 entries at a time: a page may hold fewer than asked for, or none,
    and have a `next` all the same.
    """
    return audit.read_audit(
        store,
        query,
        led,
        search=search,
        before=parse_descending_cursor(cursor, before),
        limit=limit,
    )


@router.get(
    "/export.{ending}",
    response_class=Response,
    responses={
        200: {"content": {"text/csv": {}, "application/x-ndjson": {}}, "description": "The file."},
    },
)
@may(Action.LEAD, dataset=OwnedKind.DATASET, group=OwnedKind.GROUP, where=RoleScope.SOMEWHERE)
def export_audit(
    ending: Literal["csv", "jsonl"], store: AppStore, led: Led, query: Asked, search: Search = ""
) -> StreamingResponse:
    """The same, all of it, as a table (no cell of which is a formula) or as JSON Lines."""
    found = audit.iterate_audit_entries(store, query, led, search)
    lines = _csv_lines(found) if ending == "csv" else _json_lines(found)
    kind = "text/csv; charset=utf-8" if ending == "csv" else "application/x-ndjson"
    saved = {"Content-Disposition": f'attachment; filename="touchline-audit.{ending}"'}
    return StreamingResponse(lines, media_type=kind, headers=saved)


def _csv_lines(found: Iterator[AuditEntry]) -> Iterator[str]:
    yield format_csv_line(COLUMNS)
    for entry in found:
        yield format_csv_line(getattr(entry, name) for name in COLUMNS)


def _json_lines(found: Iterator[AuditEntry]) -> Iterator[str]:
    for entry in found:
        yield encode_document(entry).decode() + "\n"
