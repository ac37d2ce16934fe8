"""Request bodies: JSON alone, capped while they arrive, and plain enough for every reader."""

from __future__ import annotations

import asyncio
import json
import re
from collections import Counter
from collections.abc import Iterable
from typing import Any, NoReturn

import numpy as np
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import Message, Receive

from app.finite import quoted
from app.http.problem import make_problem, problem_response

MAX_JSON_BYTES = 512 * 1024
"""A group with every line of six views is below 50 kB; what is longer is refused before it is read."""
BYTES = "application/octet-stream"
"""What upload routes take, and nothing else does."""
MAX_DEPTH = 16
MAX_CONTAINERS = 5_000
"""Lists and objects of one body: a request may bring 2,000 points, and each is an object. Ten times as
many were read for a second, in which nobody else was answered."""
MAX_VALUES = 10_000
"""Values of one body, by its commas: 2,000 points are 4,000. Each one that is wrong costs as much as ten
that are right, and whoever asks for that is answered before anybody is known by name."""
MAX_NAMES = 200
"""Names of one object: the 26 markings, or 64 views, and room for what comes."""
MAX_NAME = 1_000
"""Characters of a name; that of a view is a file's."""
MAX_STRANGERS_BYTES = 64 * 1024
"""Of what is asked before anybody is known: a passkey's answer has three texts of 16 kB at most."""
BODY_SECONDS = 20.0
"""For each ``BODY_BYTES`` of a body, and for what is left of it: so long a client may let the server wait."""
BODY_BYTES = 16 * 1024
# Possessive, and the closing quote may be missing: linear on whatever comes.
_STRINGS = re.compile(rb'"(?:[^"\\]|\\.)*+"?', re.DOTALL)
_NO_BRACKETS = bytes(sorted(set(range(256)) - set(b"[]{}")))
_STEPS = np.zeros(256, np.int32)
_STEPS[list(b"[{")], _STEPS[list(b"]}")] = 1, -1
_DOUBTFUL = re.compile(rb"\\u[dD][89abAB]|\d[eE]\+?\d|\d{300}")
"""What may be half of a surrogate pair, or a number that is too large."""


class BodyError(Exception):
    """A body that is refused, and the status that says so."""

    def __init__(self, status: int, detail: str, hint: str | None = None):
        super().__init__(detail)
        self.status, self.detail, self.hint = status, detail, hint

    def response(self) -> Response:
        """What its sender is told."""
        problem = make_problem(self.status, self.detail, hint=self.hint)
        # The rest of the body is unread: the connection cannot carry another request.
        headers = {"Connection": "close"} if self.status in (408, 413) else None
        return problem_response(problem, headers)


class TimedBody:
    """Receives a body from a client that has to send it steadily; the time that the server takes does not count.

    Args:
        receive: Gives the next message.
    """

    def __init__(self, receive: Receive):
        self._receive = receive
        self._seconds, self._bytes, self._ended = BODY_SECONDS, 0, False

    async def receive(self) -> Message:
        """The next message.

        Raises:
            BodyError: It did not come in time.
        """
        if self._ended:
            return await self._receive()
        clock = asyncio.get_running_loop().time
        began = clock()
        try:
            async with asyncio.timeout(self._seconds):
                message = await self._receive()
        except TimeoutError:
            raise BodyError(408, "the rest of the request did not come") from None
        self._seconds -= clock() - began
        self._bytes += len(message.get("body", b""))
        if self._bytes >= BODY_BYTES:
            self._seconds, self._bytes = BODY_SECONDS, 0
        self._ended = not message.get("more_body", False)
        return message


def read_json(body: bytes) -> Any:
    """The value of a body; raises ``BodyError`` unless the bytes are JSON as RFC 8259 has it, finite and flat enough.

    Python's reader also takes NaN, Infinity, 1e999, other encodings and lone surrogates; none of
    these survives a way through a database or another program.
    """
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError:
        raise BodyError(400, "the body is not UTF-8 text") from None
    _require_few_parts(body)
    try:
        value = json.loads(
            text, parse_constant=_refuse_constant, object_pairs_hook=_object_without_repeated_names
        )
    except ValueError as error:
        place = f" at character {error.pos}" if isinstance(error, json.JSONDecodeError) else ""
        raise BodyError(400, f"the body is not JSON{place}") from None
    if _DOUBTFUL.search(body):
        _refuse_what_cannot_be_written(value)
    if rb"\u0000" in body and (where := _find_null_character(value)) is not None:
        raise BodyError(
            400,
            f"the text at {quoted(where, 80)} in the body holds U+0000, which is not stored",
            hint="Leave it out.",
        )
    return value


def _find_null_character(value: object, place: str = "") -> str | None:
    """JSON pointer to a text, or to a name, that holds U+0000; None where there is none."""
    parts: Iterable[tuple[object, object]] = ()
    if isinstance(value, str):
        return place or "/" if "\0" in value else None
    if isinstance(value, dict):
        if any("\0" in name for name in value):
            return place or "/"
        parts = value.items()
    elif isinstance(value, list):
        parts = enumerate(value)
    found = (_find_null_character(part, f"{place}/{name}") for name, part in parts)
    return next((one for one in found if one is not None), None)


def _require_few_parts(body: bytes) -> None:
    """Count brackets and commas before anything is made of them, on text that may not be JSON."""
    outside = _without_strings(body)
    if outside.count(b",") > MAX_VALUES:
        raise BodyError(400, f"the body holds more than {MAX_VALUES} values")
    brackets = outside.translate(None, _NO_BRACKETS)
    steps = _STEPS[np.frombuffer(brackets, np.uint8)]
    if np.cumsum(steps).max(initial=0) > MAX_DEPTH:
        raise BodyError(400, f"the body is nested more than {MAX_DEPTH} levels deep")
    if np.count_nonzero(steps > 0) > MAX_CONTAINERS:
        raise BodyError(400, f"the body holds more than {MAX_CONTAINERS} lists and objects")


def _without_strings(body: bytes) -> bytes:
    """What stands outside of quotes."""
    if b"\\" in body:
        return _STRINGS.sub(b"", body)
    # Every other part lies between quotes: five times as quick, and while it lasts nobody is answered.
    return b"".join(body.split(b'"')[::2])


def _refuse_constant(name: str) -> NoReturn:
    raise BodyError(400, f"{name} is not a number in JSON")


def _object_without_repeated_names(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose names differ: of two equal ones, readers disagree which counts."""
    if len(pairs) > MAX_NAMES:
        raise BodyError(400, f"a JSON object of the body has more than {MAX_NAMES} keys")
    if any(len(name) > MAX_NAME for name, _ in pairs):
        raise BodyError(400, f"a name in the body has more than {MAX_NAME} characters")
    found = dict(pairs)
    if len(found) < len(pairs):
        names = Counter(name for name, _ in pairs)
        raise BodyError(
            400, f"the body names {quoted(names.most_common(1)[0][0], 80)} more than once"
        )
    return found


def _refuse_what_cannot_be_written(value: object) -> None:
    try:
        json.dumps(value, ensure_ascii=False, allow_nan=False).encode("utf-8")
    except UnicodeEncodeError:
        raise BodyError(400, "a text in the body is not valid Unicode") from None
    except ValueError:
        raise BodyError(400, "a number in the body is too large") from None


async def read_body(headers: Headers, receive: Receive, most: int) -> bytes:
    """The body of a request, of so many bytes at most.

    An honest Content-Length is refused before a byte is read; a dishonest or chunked one is cut off as
    soon as the cap is passed.

    Raises:
        BodyError: It is longer, does not come in time, or whoever sent it has left.
    """
    declared = headers.get("content-length", "0")
    if not declared.isascii() or not declared.isdigit():
        raise BodyError(400, "Content-Length is not a number")
    if len(declared) > 18 or int(declared) > most:
        raise _too_large_error(most)
    body, timed = bytearray(), TimedBody(receive)
    more = True
    while more:
        message = await timed.receive()
        if message["type"] == "http.disconnect":
            raise BodyError(400, "the body was cut off")
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > most:
            raise _too_large_error(most)
    return bytes(body)


def _too_large_error(most: int) -> BodyError:
    return BodyError(413, f"a request body may have at most {most} bytes")


def require_bytes(types: list[str]) -> None:
    """Raise ``BodyError`` (415) unless the Content-Type is plain bytes."""
    if [kind.strip().lower() for kind in types] != [BYTES]:
        raise BodyError(415, "an upload must be plain bytes", hint=f"Send Content-Type: {BYTES}.")


def require_json_type(types: list[str]) -> None:
    """Raise ``BodyError`` (415) unless the Content-Type is JSON in UTF-8."""
    kind, *parameters = [part.strip().lower() for part in "".join(types).split(";")]
    charsets = [item.partition("=")[2].strip('"') for item in parameters if "charset" in item]
    if len(types) != 1 or kind != "application/json" or any(c != "utf-8" for c in charsets):
        raise BodyError(
            415, "a request body must be JSON", hint="Send Content-Type: application/json."
        )
