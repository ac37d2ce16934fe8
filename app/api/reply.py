"""Reply: the answer to a change, made once, kept in the transaction of its work, and sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Generic, TypeVar

from fastapi import Depends, Request
from pydantic import BaseModel
from starlette.responses import Response

from app.review.answers.answers import Answer, keep_with_work
from app.review.answers.keep import Kept, keep_nothing
from app.review.answers.saved_progress import SavedProgress

T = TypeVar("T")

ASKED = "touchline.asked"
"""Where a request's scope says under which key it was sent."""
KEPT_HEADERS = ("content-type", "etag", "location", "cache-control")


@dataclass
class KeyedRequest:
    """A request under an Idempotency-Key; ``kept`` once its answer is in the database."""

    key: str
    actor: str
    digest: str
    kept: bool = False

    def note_kept(self) -> None:
        """Its answer is in the database."""
        self.kept = True

    @property
    def progress(self) -> SavedProgress:
        """Where work of several transactions says how far it is."""
        return SavedProgress(self.key, self.actor, self.digest)


class Reply(Generic[T]):
    """The answer to one request.

    Work is given ``keep`` and calls it in its own transaction, so that the answer is in the
    database exactly when the work is.

    Args:
        asked: The key of the request, where it has one.
        make: Makes the answer from what the work came to.

    Attributes:
        made: The answer that was kept, or None.
    """

    def __init__(self, asked: KeyedRequest | None, make: Callable[[T], Response]):
        self._asked, self._make = asked, make
        self.made: Response | None = None
        self._of: T | None = None

    @property
    def progress(self) -> SavedProgress | None:
        """Where the work says how far it is; None for a request without a key."""
        return None if self._asked is None else self._asked.progress

    def keep(self, outcome: T) -> Kept:
        """Make the answer; what is returned writes it into a transaction."""
        response = self._make(outcome)
        self.made, self._of = response, outcome
        asked = self._asked
        if asked is None:
            return keep_nothing(outcome)
        answer = answer_of(asked.digest, response)
        return keep_with_work(asked.key, asked.actor, answer, asked.note_kept)

    def of(self, outcome: T) -> Response:
        """The answer to send: the one that was kept, or a new one where nothing was saved."""
        return self.made if self.made and self._of is outcome else self._make(outcome)


def answer_of(digest: str, response: Response) -> Answer:
    """What is kept of an answer."""
    headers = {name: response.headers[name] for name in KEPT_HEADERS if name in response.headers}
    return Answer(digest, response.status_code, headers, bytes(response.body))


def document(
    content: BaseModel, status: int = 200, headers: dict[str, str] | None = None
) -> Response:
    """A document as it is sent."""
    return Response(content.model_dump_json(), status, headers, "application/json")


def nothing(_outcome: object) -> Response:
    """The answer of what leaves nothing to say: 204."""
    return Response(status_code=204)


async def get_asked(request: Request) -> KeyedRequest | None:
    """The key under which a request was sent, or None."""
    asked: KeyedRequest | None = request.scope.get(ASKED)
    return asked


AskedUnder = Annotated[KeyedRequest | None, Depends(get_asked)]
