"""HTTP status and document of each error; a stale change gets the current state."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from app.errors import (
    ClusterError,
    ConflictError,
    DamagedError,
    ForbiddenError,
    GeometryError,
    HeldGroupError,
    ImageError,
    InputError,
    NotFoundError,
    NotLoggedInError,
    OverloadedError,
    ReviewError,
    SharedStationError,
    StaleRevisionError,
    StorageError,
    TooLargeError,
    TooManyPointsError,
    TooManyTriesError,
)
from app.http.access import get_current_visibility
from app.http.headers import SCHEME as BEARER
from app.http.headers import read_bearer_token
from app.http.problem import (
    SCHEME,
    TITLES,
    FieldProblem,
    GroupViewerDocument,
    make_problem,
    problem_response,
)
from app.http.requests import UNKNOWN, describe_unknown_name

log = structlog.get_logger("touchline.api")

STATUSES: tuple[tuple[type[ReviewError], int], ...] = (
    (TooLargeError, 413),
    (TooManyPointsError, 422),
    (ImageError, 422),
    (InputError, 400),
    (NotLoggedInError, 401),
    (ForbiddenError, 403),
    (NotFoundError, 404),
    (StaleRevisionError, 412),
    (ConflictError, 409),
    (GeometryError, 422),
    (StorageError, 507),
    (OverloadedError, 503),
    (ClusterError, 503),
    (TooManyTriesError, 429),
)
"""The first branch that fits decides."""
RETRY_SECONDS = "5"


_OBJECT, _LIST = "must be an object", "must be a list"
_WHOLE, _NUMBER = "must be a whole number", "must be a number"
_PLAIN = {
    "dict_type": _OBJECT,
    "model_type": _OBJECT,
    "model_attributes_type": _OBJECT,
    "dataclass_type": _OBJECT,
    "list_type": _LIST,
    "tuple_type": _LIST,
    "none_required": "must be null",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "string_type": "must be a text",
    "string_too_short": "must have {min_length} characters or more",
    "string_too_long": "must have {max_length} characters or less",
    "too_short": "must have {min_length} items or more, and has {actual_length}",
    "too_long": "must have {max_length} items or less, and has {actual_length}",
    "int_type": _WHOLE,
    "int_parsing": _WHOLE,
    "int_from_float": _WHOLE,
    "float_type": _NUMBER,
    "float_parsing": _NUMBER,
    "finite_number": "must be a finite number",
    "greater_than": "must be more than {gt}",
    "greater_than_equal": "must be {ge} or more",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be {le} or less",
    "missing": "is missing",
    "string_pattern_mismatch": "has characters that are not allowed here, or lacks some",
}
"""What is said instead of the framework's words, which are Python's."""


class PreconditionRequiredError(ReviewError):
    """A change without If-Match: it could overwrite what its sender never saw."""


class StaleStateError(ReviewError):
    """A ``StaleRevisionError`` together with the state as it is now.

    Args:
        current: The document that a reader would get now, as JSON text.
    """

    def __init__(self, error: StaleRevisionError, current: str):
        super().__init__(error.message, hint=error.hint)
        self.current = current
        self.etag = error.current_etag


def find_http_status(error: ReviewError) -> int:
    """The HTTP status of an error of the tree."""
    special = {PreconditionRequiredError: 428, StaleStateError: 412}
    if type(error) in special:
        return special[type(error)]
    if isinstance(error, StorageError) and not _is_disk_full(error):
        return 503
    return next((status for kind, status in STATUSES if isinstance(error, kind)), 500)


def _is_disk_full(error: StorageError) -> bool:
    """Whether the disk is full, rather than the database busy or damaged."""
    cause = error.__cause__
    original = getattr(cause, "orig", None)
    name = str(getattr(original, "sqlite_errorname", "") or getattr(original, "sqlstate", ""))
    full = getattr(cause, "errno", None) in (errno.ENOSPC, errno.EDQUOT)
    return name.startswith(("SQLITE_FULL", "53100")) or full


def install_error_handlers(app: FastAPI) -> None:
    """Make the application answer every known error with a problem."""
    app.add_exception_handler(ReviewError, _handle_review_error)
    app.add_exception_handler(RequestValidationError, _handle_validation_error)
    app.add_exception_handler(HTTPException, _handle_http_exception)


async def _handle_review_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, ReviewError)
    status = find_http_status(error)
    hint = error.hint
    if isinstance(error, NotFoundError) and error.known:
        hint = hint or error.suggest_nearest_name(get_current_visibility(request.scope).sees)
    problem = make_problem(
        status,
        error.message,
        hint=hint,
        pointer=error.pointer,
        station=error.station if isinstance(error, SharedStationError) else None,
        here=[GroupViewerDocument.model_validate(one) for one in error.here]
        if isinstance(error, HeldGroupError)
        else None,
    )
    headers = {"Retry-After": RETRY_SECONDS} if status in (503, 507) else {}
    if isinstance(error, TooManyTriesError):
        headers["Retry-After"] = str(error.seconds)
    if status == 401:
        headers["WWW-Authenticate"] = SCHEME if read_bearer_token(request.scope) is None else BEARER
    current = None
    if isinstance(error, StaleStateError):
        headers["ETag"], current = error.etag, error.current
    if isinstance(error, DamagedError):
        request.app.state.services.store.record_damage(error)
    # Of what is only too much at once the line of its request is enough: there may be thousands.
    is_only_much = isinstance(error, OverloadedError) and error.__cause__ is None
    if status >= 500 and not is_only_much:
        cause = str(error.__cause__ or "").partition("\n")[0]
        log.error("request refused", instance=problem.instance, error=str(error), cause=cause)
    return problem_response(problem, headers, current)


async def _handle_validation_error(request: Request, error: Exception) -> Response:
    """422 with a pointer for each field; 404 where the id in the path cannot be one."""
    assert isinstance(error, RequestValidationError)
    details = error.errors()
    for detail in details:
        if detail["loc"][0] == "path":
            missing = f"there is no {detail['loc'][1]} with such an id"
            return problem_response(make_problem(404, missing))
    errors = [
        FieldProblem(
            pointer=_pointer_of_location(detail["loc"]), detail=_problem_sentence(request, detail)
        )
        for detail in details[:20]
    ]
    first = _most_telling_problem(errors)
    place = f"{first.pointer}: " if first.pointer else ""
    problem = make_problem(422, f"{place}{first.detail}", pointer=first.pointer, errors=errors)
    return problem_response(problem)


def _most_telling_problem(errors: Sequence[FieldProblem]) -> FieldProblem:
    """The problem to speak of: a misspelt name rather than that the right one is missing."""
    missing = str(errors[0].pointer)
    place, _, name = missing.rpartition("/")
    for other in errors[1:]:
        near = other.detail.endswith(f"; did you mean {name}?")
        if near and str(other.pointer).rpartition("/")[0] == place:
            return other
    return errors[0]


def _problem_sentence(request: Request, detail: dict[str, Any]) -> str:
    """Pydantic's message without the prefix that it gives to our own validators."""
    if detail["type"] == UNKNOWN:
        return describe_unknown_name(request, detail["loc"])
    if detail["type"] in ("literal_error", "enum"):
        return f"must be {detail['ctx']['expected'].replace(chr(39), '')}"
    plain = _PLAIN.get(detail["type"])
    if plain is not None:
        return plain.format_map(detail.get("ctx", {}))
    text = str(detail["msg"]).removeprefix("Value error, ")
    return text[:1].lower() + text[1:]


def _pointer_of_location(location: Sequence[int | str]) -> str:
    """JSON pointer (RFC 6901) of the place; the first part says body, query or header."""
    # Pydantic names the branch of a union, such as ``literal['a','b']``, as if it were a place.
    parts = [
        part for part in location[1:] if part != "[key]" and not str(part).startswith("literal[")
    ]
    escaped = (str(part).replace("~", "~0").replace("/", "~1") for part in parts)
    return "".join(f"/{part}" for part in escaped)


async def _handle_http_exception(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    detail = {
        404: "there is nothing at this address",
        405: f"{request.method} is not possible here",
    }.get(error.status_code, TITLES.get(error.status_code, ("", "the request failed"))[1])
    problem = make_problem(error.status_code, detail)
    return problem_response(problem, error.headers)


@contextmanager
def add_current_state_to_conflicts(load: Callable[[], BaseModel]) -> Iterator[None]:
    """Turn a ``StaleRevisionError`` into one that carries the present document.

    Args:
        load: Reads the present document; called only when it is needed.
    """
    try:
        yield
    except StaleRevisionError as error:
        raise StaleStateError(error, load().model_dump_json()) from error
