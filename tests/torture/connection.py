"""A kept connection to a server of this machine, light enough that the server is what is measured."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass

API = "/api/v1"
ANSWER_SECONDS = 60.0


@dataclass(frozen=True)
class Answer:
    """Status, headers by their names in small letters, and body."""

    status: int
    headers: dict[str, str]
    body: bytes


class Connection:
    """One that is opened when something is asked, and again where the server has closed it.

    Args:
        port: Of the server.
        headers: Sent with each request.
    """

    def __init__(self, port: int, headers: Mapping[str, str] | None = None):
        self._port = port
        self._headers = {"Host": f"127.0.0.1:{port}", **(headers or {})}
        self._reader: asyncio.StreamReader | None = None
        self._writer: asyncio.StreamWriter | None = None

    async def ask(
        self, method: str, path: str, body: bytes | None = None, etag: str | None = None
    ) -> Answer:
        """The answer to a request.

        Raises:
            OSError: Nobody listens, or the line was cut.
            EOFError: It ended within an answer.
            TimeoutError: No answer came in time.
        """
        async with asyncio.timeout(ANSWER_SECONDS):
            if self._reader is None or self._reader.at_eof():
                self.close()
                self._reader, self._writer = await asyncio.open_connection("127.0.0.1", self._port)
            assert self._writer is not None
            headers = self._headers if etag is None else {**self._headers, "If-Match": etag}
            self._writer.write(write_head(method, path, body, headers) + (body or b""))
            answer = await read_answer(self._reader)
        if answer.headers.get("connection") == "close":
            self.close()
        return answer

    def close(self) -> None:
        """Hang up."""
        if self._writer is not None:
            self._writer.close()
        self._reader = self._writer = None


def write_head(method: str, path: str, body: bytes | None, headers: Mapping[str, str]) -> bytes:
    """How a request begins, up to the empty line; a body is JSON where nothing else is said."""
    if body is not None:
        length = {"Content-Length": str(len(body))}
        headers = {"Content-Type": "application/json", **headers, **length}
    lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {told}" for name, told in headers.items())]
    return "\r\n".join([*lines, "", ""]).encode()


async def read_answer(reader: asyncio.StreamReader, whole: bool = True) -> Answer:
    """The next answer of a line; without its body where only the head is wanted.

    Raises:
        EOFError: The line ended before.
    """
    first, *rest = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
    headers = {
        name.lower(): value.strip() for name, _, value in (one.partition(":") for one in rest)
    }
    length = headers.get("content-length", "")
    body = await reader.readexactly(int(length)) if whole and length.isdigit() else b""
    return Answer(int(first.split(" ")[1]), headers, body)
