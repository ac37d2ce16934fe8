"""What can go wrong, and what to do about it.

::

    TouchlineError(message, hint)
      DataError            an export, a cache or a frame cannot be used
        HashError            its content is not what its hash says
      MissingPackageError  a package that this needs is not installed
      CameraError          numbers of no camera
      ServerError          the server refused, or was not there
        UnreachableError     no answer
        RequestError         400, 413, 415, 422, 428: the request
        ForbiddenError       403
        NotFoundError        404
        ConflictError        409: does not fit the state
          StaleError           412: somebody else was faster; ``current`` is the present state
        BusyError            408, 503: try again
        FullError            507: the server's disk
      JobError             a job failed or was cancelled
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class TouchlineError(Exception):
    """Everything that this package raises.

    Attributes:
        message: What is wrong, one sentence.
        hint: What to do, or None.
    """

    def __init__(self, message: str, hint: str | None = None):
        super().__init__(message if hint is None else f"{message}. {hint}")
        self.message, self.hint = message, hint


class DataError(TouchlineError):
    """An export, a cache or a frame cannot be used."""


class HashError(DataError):
    """Content is not what its hash says."""


class MissingPackageError(TouchlineError):
    """A package that this needs is not installed."""


class CameraError(TouchlineError):
    """Numbers that are those of no camera."""


class ServerError(TouchlineError):
    """The server refused, or was not there.

    Attributes:
        status: HTTP status, 0 without an answer.
        problem: The problem document (RFC 9457); empty where the answer held none.
        report: Of ``Client.edit_views``: what earlier requests did; else None.
    """

    report: dict[str, Any] | None = None

    def __init__(
        self,
        message: str,
        hint: str | None = None,
        status: int = 0,
        problem: Mapping[str, Any] | None = None,
    ):
        super().__init__(message, hint)
        self.status, self.problem = status, dict(problem or {})

    @property
    def pointer(self) -> str | None:
        """JSON pointer to what is wrong in the body, or ``/name`` of a parameter."""
        return self.problem.get("pointer")

    @property
    def current(self) -> Any:
        """The present state, where somebody else was faster."""
        return self.problem.get("current")


class UnreachableError(ServerError):
    """There was no answer."""


class RequestError(ServerError):
    """The request cannot be used."""


class ForbiddenError(ServerError):
    """The server lets nobody do this, or not you."""


class NotFoundError(ServerError):
    """It is not there."""


class ConflictError(ServerError):
    """It does not fit the state."""


class StaleError(ConflictError):
    """Somebody else was faster; ``current`` is the present state."""


class BusyError(ServerError):
    """The server has too much to do."""


class FullError(ServerError):
    """The server's disk is full."""


class JobError(TouchlineError):
    """A job failed or was cancelled.

    Attributes:
        job: Its document.
    """

    def __init__(self, job: Mapping[str, Any]):
        problem = job.get("problem") or {}
        reason = problem.get("detail") or job.get("sentence") or "no reason was given"
        super().__init__(f"job {job['id']} {job['state']}: {reason}", problem.get("hint"))
        self.job = dict(job)


_BY_STATUS: dict[int, type[ServerError]] = {
    403: ForbiddenError,
    404: NotFoundError,
    408: BusyError,
    409: ConflictError,
    412: StaleError,
    503: BusyError,
    507: FullError,
}


def error_of(status: int, problem: Mapping[str, Any]) -> ServerError:
    """The error for an answer that is no success.

    Args:
        status: HTTP status.
        problem: The problem document; may be empty.
    """
    kind = _BY_STATUS.get(status, RequestError if 400 <= status < 500 else ServerError)
    message = problem.get("detail") or problem.get("title") or f"the server answered {status}"
    return kind(message, problem.get("hint"), status, problem)
