"""Problem JSON (RFC 9457): the document of an error."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from pydantic import BaseModel, Field
from starlette.responses import Response

from app.http.documents import Document

MEDIA_TYPE = "application/problem+json"


class FieldProblem(BaseModel):
    """One field of a request that cannot be used."""

    pointer: str = Field(description="JSON pointer into the body, or `/name` of a parameter.")
    detail: str


class GroupViewerDocument(Document):
    """The person who has a group of a batch open."""

    person: str
    since: datetime


class Problem(BaseModel):
    """What went wrong, for people (`detail`, `hint`) and for programs (`type`, `pointer`)."""

    type: str = Field(
        description="Names the kind of problem.", examples=["urn:touchline:problem:not-found"]
    )
    title: str = Field(description="The kind of problem in a few words.")
    status: int = Field(description="The HTTP status.", examples=[404])
    detail: str = Field(description="One sentence about this occurrence.")
    hint: str | None = Field(default=None, description="What to do about it.")
    pointer: str | None = Field(
        default=None, description="JSON pointer to the field of the body that is at fault."
    )
    instance: str = Field(description="Id of this occurrence, also in the server's log.")
    errors: list[FieldProblem] | None = Field(
        default=None, description="Every field at fault (422)."
    )
    station: int | None = Field(
        default=None, description="The station that owns the lines (409 on a static view)."
    )
    here: list[GroupViewerDocument] | None = Field(
        default=None, description="Who has the group of a batch open (409 on its lease)."
    )
    current: dict[str, Any] | None = Field(
        default=None, description="The state as it is now, complete (412)."
    )


TITLES: Mapping[int, tuple[str, str]] = {
    400: ("bad-request", "The request cannot be used"),
    401: ("login", "Nobody is logged in"),
    403: ("forbidden", "That is not allowed"),
    404: ("not-found", "There is no such thing"),
    405: ("method-not-allowed", "This resource does not do that"),
    408: ("timeout", "The request did not come in time"),
    409: ("conflict", "The request does not fit the present state"),
    412: ("stale", "Somebody else changed it first"),
    413: ("too-large", "The request is too large"),
    415: ("unsupported-media-type", "The body has the wrong type"),
    416: ("range", "That part of the file does not exist"),
    422: ("invalid", "The request is not valid"),
    428: ("precondition-required", "If-Match is required"),
    429: ("too-many-tries", "Too many tries"),
    500: ("internal", "The server made a mistake"),
    503: ("unavailable", "The service is not ready"),
    507: ("storage", "The server cannot store it"),
}


SCHEME = 'Session realm="Touchline"'
"""How one logs in, for a 401: with POST /api/v1/session, which browsers are no help with."""
Responses = dict[int | str, dict[str, Any]]
"""Answers of a route, by status, as the framework takes them."""


def make_problem(
    status: int,
    detail: str,
    *,
    hint: str | None = None,
    pointer: str | None = None,
    errors: list[FieldProblem] | None = None,
    station: int | None = None,
    here: list[GroupViewerDocument] | None = None,
) -> Problem:
    """A problem of that status, its kind, title and instance filled in."""
    kind, title = TITLES.get(status, ("http", "The request failed"))
    return Problem(
        type=f"urn:touchline:problem:{kind}",
        title=title,
        status=status,
        detail=detail,
        hint=hint,
        pointer=pointer,
        instance=uuid.uuid4().urn,
        errors=errors,
        station=station,
        here=here,
    )


def problem_response(
    problem: Problem, headers: Mapping[str, str] | None = None, current: str | None = None
) -> Response:
    """The answer that carries a problem; members that do not apply are left out.

    ``current`` is its member of that name as JSON text: the event loop does not write a whole
    group once more.
    """
    optional = {"errors", "station", "here", "current"}
    absent = {name for name in optional if getattr(problem, name) is None}
    body = problem.model_dump_json(exclude=absent)
    if current is not None:
        body = f'{body[:-1]},"current":{current}}}'
    return Response(
        body,
        status_code=problem.status,
        media_type=MEDIA_TYPE,
        headers={"Cache-Control": "no-store", **(headers or {})},
    )


def responses(*statuses: int) -> Responses:
    """The ``responses`` of a route that refuses with these statuses.

    Those that follow from its address, its body and its headers are added to the OpenAPI document by
    ``http/openapi.py``.
    """
    return {
        status: {
            "description": TITLES[status][1],
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
        for status in sorted(statuses)
    }
