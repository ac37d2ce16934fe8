"""Concealment: a request asks for something else where its reader may not know what it asked for.

What somebody does not see is asked for under an id that nothing has. The answer is that of an unknown
one by construction, whatever the route looks at first; and what nobody has found, no route finds.
"""

from __future__ import annotations

import secrets
from typing import Any
from urllib.parse import quote, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import Message, Receive, Scope, Send

from app.features.people.ownership import OwnedKind
from app.finite import MAX_ID, json_text
from app.http.bodies import VALUE
from app.http.datasets_of_request import TEXTS, AskedAbout, Mention, OwnedMention
from app.http.problem import MEDIA_TYPE

SENT = "touchline.sent"
"""Where a request's scope under other names has the one that was sent."""
HIDDEN = "touchline.hidden"
"""Where it has a function that says whether what is asked for is there, and not for its reader."""
_NO_ID = str(MAX_ID)
_NO_UPLOAD = "0" * 32
_NO_NAME = f"nothing-{secrets.token_hex(12)}"


class Concealment:
    """A request that names other things than it was sent with, and its answer, which does not.

    Args:
        asked: The request.
        owned: Where the things are that it mentions.
    """

    def __init__(self, asked: AskedAbout, owned: list[OwnedMention]):
        self._asked = asked
        self._other: list[tuple[Mention, str | int]] = []
        self._said: dict[bytes, bytes] = {}
        for one in owned:
            mention, ownership = one.mention, one.ownership
            if mention.named.kind is OwnedKind.NEW_DATASET:
                continue
            if ownership is None:
                other = _without(mention.named.kind)
                self._other.append((mention, other))
                shown = json_text(str(mention.named.by))[1:-1]
                self._said[str(other).encode()] = shown.encode("utf-8", "replace")
            elif ownership.called is not None:
                self._other.append((mention, ownership.called))

    def __bool__(self) -> bool:
        return bool(self._other)

    def scope(self, scope: Scope) -> Scope:
        """The request under the other names."""
        path = dict(self._asked.path)
        query, body = [*self._asked.query], self._asked.body
        for mention, other in self._other:
            if mention.place == "path":
                path[mention.field] = str(other)
            elif mention.place == "query":
                query[mention.index] = (mention.field, str(other))
            elif mention.place == "body":
                kept = mention.named.kind in TEXTS
                body = _with(body, mention.field.split("/"), str(other) if kept else int(other))
        template = self._asked.route.partition(" ")[2]
        address = template.format(**path)
        changed = {**scope, SENT: scope, "path": address, "raw_path": quote(address).encode()}
        changed["query_string"] = urlencode(query).encode() if query else b""
        if body is not self._asked.body:
            changed[VALUE] = body
            headers = MutableHeaders(raw=list(scope["headers"]))
            headers["content-length"] = str(len(_json(body)))
            changed["headers"] = headers.raw
        return changed

    def receive(self, receive: Receive, scope: Scope) -> Receive:
        """The body under the other names."""
        if scope.get(VALUE) is self._asked.body:
            return receive
        begun = False

        async def changed() -> Message:
            nonlocal begun
            if begun:
                return await receive()
            begun = True
            # What was sent is read, and left.
            while (await receive()).get("more_body", False):
                pass
            return {"type": "http.request", "body": _json(scope[VALUE]), "more_body": False}

        return changed

    def send(self, send: Send) -> Send:
        """The answer, which speaks of what was asked for."""
        held: Message | None = None
        parts = bytearray()

        async def told(message: Message) -> None:
            nonlocal held
            if message["type"] == "http.response.start":
                kind = Headers(raw=message["headers"]).get("content-type", "")
                if self._said and kind.startswith(MEDIA_TYPE):
                    held = message
                    return
            elif held is not None and message["type"] == "http.response.body":
                parts.extend(message.get("body", b""))
                if message.get("more_body", False):
                    return
                body = bytes(parts)
                for other, said in self._said.items():
                    body = body.replace(other, said)
                headers = MutableHeaders(raw=list(held["headers"]))
                headers["content-length"] = str(len(body))
                await send({**held, "headers": headers.raw})
                await send({"type": "http.response.body", "body": body})
                return
            await send(message)

        return told


def _with(body: Any, field: list[str], other: str | int) -> Any:
    """A body with another value in one field."""
    inner = other if len(field) == 1 else _with(body[field[0]], field[1:], other)
    return {**body, field[0]: inner}


def _json(body: Any) -> bytes:
    return json_text(body).encode()


def _without(kind: OwnedKind) -> str | int:
    """The name of that kind that nothing has."""
    if kind is OwnedKind.UPLOAD:
        return _NO_UPLOAD
    return _NO_NAME if kind in (OwnedKind.DATASET, OwnedKind.VERSION) else _NO_ID
