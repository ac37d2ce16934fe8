"""Client: the REST interface (docs/api.md), with retries, preconditions and jobs handled."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from json import dumps
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, quote, urlsplit
from uuid import uuid4

from touchline.bulk_edits import merged, placed, refusal, requests_of
from touchline.errors import (
    DataError,
    JobError,
    NotFoundError,
    RequestError,
    ServerError,
    UnreachableError,
    error_of,
)
from touchline.packages import package
from touchline.recordings import (
    Link,
    Recording,
    SendProgress,
    Shot,
    read,
    require_same,
    send_in_parts,
)

API = "/api/v1/"
ADDRESS = "http://127.0.0.1:8000"
PATIENCE = 60.0
"""Seconds for which a request is tried again."""
_RETRIED = (408, 503)
_FIRST_PAUSE, _LONGEST_PAUSE, _FIRST_LOOK, _LONGEST_LOOK = 0.25, 8.0, 0.05, 2.0
_CHUNK = 1 << 20


class Client:
    """Speaks to a server. Usable by one thread at a time; a context manager closes it.

    A request that finds the server busy (503) or not there is sent again until ``patience`` is at
    its end. Whatever changes something carries an ``Idempotency-Key``, so that it counts once.

    Args:
        address: Of the server, without ``/api/v1``.
        headers: Sent with every request, for example what a proxy asks for.
        timeout: Seconds that one request may take.
        patience: Seconds for which a request is tried again; 0: once.

    Raises:
        DataError: The address begins with neither http:// nor https://.
    """

    def __init__(
        self,
        address: str = ADDRESS,
        *,
        headers: Mapping[str, str] | None = None,
        timeout: float = 60.0,
        patience: float = PATIENCE,
    ):
        if not address.startswith(("http://", "https://")):
            raise DataError(
                f'"{address}" is not the address of a server',
                f"Write it with its scheme: {ADDRESS}",
            )
        self.address, self._patience = address.rstrip("/").removesuffix("/api/v1"), patience
        self._again = partial(Client, headers=headers, timeout=timeout, patience=patience)
        self._httpx = package("httpx")
        self._http = self._httpx.Client(
            headers={"Accept": "application/json", **(headers or {})},
            timeout=timeout,
            follow_redirects=False,
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        # A client that a version keeps for its frames is closed with it.
        if hasattr(self, "_http"):
            self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """Workers that load data make connections of their own."""
        return self._again, (self.address,)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def get(self, path: str, **params: Any) -> Any:
        """A document.

        Args:
            path: Below ``/api/v1/``, such as ``groups/12``.
            params: Of the query; None leaves one out.

        Raises:
            ServerError: The server refused, or was not there (``touchline.errors``).
        """
        return _value(self.send("GET", path, params=params))

    def post(self, path: str, body: Any = None, **options: Any) -> Any:
        """Send a document and get the answer; ``options`` as those of ``send``."""
        return _value(self.send("POST", path, json=body, **options))

    def put(self, path: str, body: Any, **options: Any) -> Any:
        """Put a document in a place; ``if_match`` says what it replaces."""
        return _value(self.send("PUT", path, json=body, **options))

    def patch(self, path: str, body: Any, **options: Any) -> Any:
        """Change a part; ``if_match`` says of what state."""
        return _value(self.send("PATCH", path, json=body, always=True, **options))

    def delete(self, path: str, body: Any = None, **options: Any) -> Any:
        """Delete."""
        return _value(self.send("DELETE", path, json=body, **options))

    def read(self, path: str, **params: Any) -> bytes:
        """The bytes of a picture or a zip."""
        content: bytes = self.send("GET", path, params=params).content
        return content

    def pages(self, path: str, *, limit: int = 200, **params: Any) -> Iterator[Any]:
        """The items of a list, page after page; no row is missed or seen twice."""
        cursor: str | None = None
        while True:
            page = self.get(path, limit=limit, cursor=cursor, **params)
            yield from page["items"]
            cursor = page.get("next")
            if cursor is None:
                return

    def wait(
        self,
        job: int | str | Mapping[str, Any],
        *,
        timeout: float | None = None,
        progress: Callable[[dict[str, Any]], object] | None = None,
    ) -> dict[str, Any]:
        """Wait for a job to end.

        Args:
            job: Its id or its document.
            timeout: Seconds; None: as long as it takes.
            progress: Called with the job's document each time that it was looked at.

        Returns:
            The document of the job, done.

        Raises:
            JobError: It failed or was cancelled.
            TimeoutError: It is not done by then; it goes on.
        """
        identity = job["id"] if isinstance(job, Mapping) else job
        end, pause = None if timeout is None else time.monotonic() + timeout, _FIRST_LOOK
        while True:
            found: dict[str, Any] = self.get(f"jobs/{identity}")
            if progress is not None:
                progress(found)
            if found["state"] == "done":
                return found
            if found["state"] in ("failed", "cancelled"):
                raise JobError(found)
            if end is not None and time.monotonic() + pause > end:
                raise TimeoutError(f"job {identity} is not done: {found['sentence']}")
            time.sleep(pause)
            pause = min(pause * 1.5, _LONGEST_LOOK)

    def edit_views(
        self,
        dataset: str | int,
        items: Iterable[Mapping[str, Any]],
        *,
        dry_run: bool = False,
        if_match: str | None = None,
    ) -> dict[str, Any]:
        """Set balls and lines of any number of views, in as many requests as they need.

        Items with the same ``group`` or ``etag`` are sent together, for a group is edited whole or not
        at all. What is refused is in the report and stops nothing; where a request as a whole is
        refused, each of its items has the reason.

        Args:
            dataset: Name or id.
            items: Each with ``view``, ``etag`` and ``ball``, ``lines`` or both, as ``POST
                /datasets/{dataset}/edits`` takes them.
            dry_run: Only report what would happen.
            if_match: ``"*"``: items without ``etag`` change whatever their group is then.

        Returns:
            One report: counts ``changed``, ``unchanged``, ``refused``, and ``items`` in the order given.

        Raises:
            ServerError: The first request was refused as a whole (nothing was done), or a later one
                for a reason that concerns all that are left; ``report`` of the error says what was
                done before.
        """
        report: dict[str, Any] = {"dry_run": dry_run, "items": []}
        path = f"datasets/{quote(str(dataset), safe='')}/edits"
        params = {"dry_run": "true" if dry_run else None}
        for chunk in requests_of([*items]):
            body: dict[str, Any] = {"items": [item for _, item in chunk]}
            if if_match is not None:
                body["if_match"] = if_match
            places = [place for place, _ in chunk]
            try:
                found = _value(self.send("POST", path, params=params, json=body))["items"]
            except ServerError as error:
                if not report["items"] or not isinstance(error, RequestError):
                    error.report = merged(report)
                    raise
                found = [refusal(error, index) for index in range(len(chunk))]
            report["items"] += [placed(one, places) for one in found]
        return merged(report)

    def recordings(self, dataset: str | None = None) -> list[Recording]:
        """The recordings of a dataset, or of all that one sees, the newest first."""
        return [read(Recording, one) for one in self.pages("recordings", dataset=dataset)]

    def shots(self, recording: Recording | int) -> list[Shot]:
        """The shots of a recording, or of that of an id, in their order."""
        number = recording if isinstance(recording, int) else recording.id
        return [read(Shot, one) for one in self.pages(f"recordings/{number}/shots")]

    def links(self, recording: Recording | int) -> list[Link]:
        """The links of a recording's replays to live shots, by the frames of their live shots."""
        number = recording if isinstance(recording, int) else recording.id
        return [Link.of(one) for one in self.pages(f"recordings/{number}/links")]

    def upload_recording(
        self,
        dataset: str,
        path: Path | str,
        *,
        sent: SendProgress | None = None,
        progress: Callable[[dict[str, Any]], object] | None = None,
    ) -> Recording:
        """Send a video of a match, and have it indexed and cut into shots.

        Called again after an interruption, wherever it came, it goes on where it was.

        Args:
            dataset: Name; a dataset is made where there is none of that name.
            path: The file.
            sent: Called with bytes that the server has, and how many there are.
            progress: Called with the document of the job that indexes it.

        Raises:
            DataError: The file cannot be read or changes meanwhile; HashError: the server has another.
            JobError: It is not a video that can be read.
        """
        file = Path(path)
        upload = self.upload(file, in_parts=True, sent=sent)
        job = self.post("recordings", {"dataset": dataset, "source": {"upload": upload}})
        number = self.wait(job, progress=progress)["result"]["recording"]
        recording = read(Recording, self.get(f"recordings/{number}"))
        require_same(file, recording)
        return recording

    def upload(
        self,
        path: Path | str,
        name: str | None = None,
        *,
        in_parts: bool = False,
        sent: SendProgress | None = None,
    ) -> str:
        """Send a file for an import or an evaluation; its id is the answer.

        ``in_parts``: so that it goes on where it was when it is interrupted; ``sent`` is then called
        with bytes that the server has, and how many there are.
        """
        file = Path(path)
        if in_parts:
            return send_in_parts(self.send, file, name, sent)
        headers = {"Content-Type": "application/octet-stream"}
        params = {"name": name or file.name}
        answer = self.send("POST", "uploads", params=params, content=file, headers=headers)
        return str(_value(answer)["id"])

    def download(self, path: str, out: Path | str) -> Path:
        """Fetch a file of any size; it appears whole or not at all."""
        target = Path(out)
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = target.with_name(f".{target.name}.{uuid4().hex}.partial")
        try:
            self.send("GET", path, into=partial)
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
        return target

    def export(self, out: Path | str, *, keep: bool = True, **request: Any) -> Path:
        """Make an export and fetch its zip.

        Args:
            out: The file to write; it appears whole or not at all.
            keep: Whether the server keeps its own copy.
            request: What to export: ``dataset``, ``format``, ``version``, ``boxes``, ``images``,
                ``all``.
        """
        job = self.post("exports", request)
        self.wait(job)
        target = self.download(f"exports/{job['id']}/content", out)
        if not keep:
            self.delete(f"exports/{job['id']}")
        return target

    def send(
        self,
        method: str,
        path: str,
        *,
        params: Mapping[str, Any] | None = None,
        json: Any = None,
        always: bool = False,
        content: Path | bytes | None = None,
        into: Path | None = None,
        if_match: str | Mapping[str, Any] | None = None,
        key: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> Any:
        """Send a request, again where the server is busy or not there; ``httpx.Response``.

        Args:
            method: ``GET``, ``POST`` ...
            path: Below ``/api/v1/``, or an address that a document named; it may have a query.
            params: More of the query, in place of what the path says; None leaves one out.
            json: The body; None sends none.
            always: Send ``null`` for a body that is None.
            content: A file, or bytes, to send instead.
            into: A file to write what comes into.
            if_match: The ETag that a change builds on, or the document that has it as ``etag``.
            key: Idempotency key; one is made for whatever changes something.
            headers: More of them.

        Raises:
            ServerError: The server refused, or was not there (``touchline.errors``).
        """
        sent = dict(headers or {})
        if if_match is not None:
            sent["If-Match"] = if_match if isinstance(if_match, str) else if_match["etag"]
        if method != "GET":
            sent["Idempotency-Key"] = key or uuid4().hex
        body: dict[str, Any] = {"content": content} if isinstance(content, bytes) else {}
        if json is not None or always:
            # Not httpx's own: it takes None for no body at all.
            sent.setdefault("Content-Type", "application/json")
            body = {"content": dumps(json, allow_nan=False).encode()}
        query = {name: value for name, value in (params or {}).items() if value is not None}
        # httpx drops the query of an address for which it is given parameters, even none.
        path, _, asked = path.partition("?")
        for name, value in parse_qsl(asked, keep_blank_values=True):
            if name not in (params or {}):
                query[name] = [*query.get(name, ()), value]

        def ask() -> Any:
            url, more = self._url(path), {"params": query, "headers": sent}
            if into is not None:
                return self._fetch(into, method, url, more)
            if not isinstance(content, Path):
                return self._http.request(method, url, **more, **body)
            with content.open("rb") as file:
                return self._http.request(method, url, **more, content=_chunks(file))

        return self._patiently(ask)

    def _fetch(self, into: Path, method: str, url: str, more: Mapping[str, Any]) -> Any:
        with self._http.stream(method, url, **more) as answer:
            if not answer.is_success:
                answer.read()
                return answer
            with into.open("wb") as file:
                for chunk in answer.iter_bytes(_CHUNK):
                    file.write(chunk)
        return answer

    def _url(self, path: str) -> str:
        if path.startswith(("http://", "https://")):
            if urlsplit(path)[:2] != urlsplit(self.address)[:2]:
                raise NotFoundError(f"{path} is on another server than {self.address}")
            return path
        return self.address + (path if path.startswith("/") else API + path)

    def _patiently(self, ask: Callable[[], Any]) -> Any:
        end, pause = time.monotonic() + self._patience, _FIRST_PAUSE
        while True:
            try:
                answer = ask()
            except self._httpx.TransportError as error:
                failure: Exception = UnreachableError(
                    f"{self.address} does not answer ({error or type(error).__name__})",
                    "Start it with: touchline serve",
                )
            else:
                if answer.is_success:
                    return answer
                failure = error_of(answer.status_code, _problem(answer))
                if answer.status_code not in _RETRIED:
                    raise failure
                pause = max(pause, _retry_after(answer.headers))
            if time.monotonic() + pause > end:
                raise failure
            time.sleep(pause)
            pause = min(pause * 2, _LONGEST_PAUSE)


def _chunks(file: Any) -> Iterator[bytes]:
    while chunk := file.read(_CHUNK):
        yield chunk


def _value(answer: Any) -> Any:
    return answer.json() if answer.content else None


def _problem(answer: Any) -> dict[str, Any]:
    """The problem document of an answer, or nothing where it holds none."""
    try:
        found = answer.json()
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _retry_after(headers: Mapping[str, str]) -> float:
    text = headers.get("Retry-After", "")
    return float(text) if text.isdigit() else 0.0
