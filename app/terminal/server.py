"""What a command works on: a server, or the database of a home on this machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import urlsplit

from app.durable import is_open_to_others
from app.errors import InputError, ReviewError
from app.formats.safe_path import open_regular_file
from app.progress import ReportProgress
from app.terminal.options import read_settings
from app.terminal.terminal import show_progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from app.config import Settings
    from app.db.store import Store
    from touchline.client import Client

Answer = TypeVar("Answer", bound=Collection[Any])
ABLE = (
    "datasets",
    "findings",
    "import",
    "solve",
    "policy",
    "verdict",
    "export",
    "freeze",
    "versions",
    "evaluate",
    "batch",
)
"""Commands that work against a server; of ``datasets`` its ``list``."""
MAX_TOKEN = 1000
"""Bytes of a file that is read for a token."""


@dataclass(frozen=True)
class ServerPlace:
    """Where it is, and the file that holds a token for it; None: it asks nobody."""

    url: str
    token_file: Path | None


_SERVER: ContextVar[ServerPlace | None] = ContextVar("server", default=None)


def set_current_server(url: str | None, token_file: Path | None, command: str | None) -> None:
    """Let this command work against a server; None: in a home on this machine.

    Raises:
        InputError: The command cannot, or the address would show the token to others.
    """
    _SERVER.set(None)
    if url is None:
        return
    if command not in ABLE:
        raise InputError(
            f"touchline {command} works in a home on this machine, not against a server",
            hint=f"Leave out --server (TOUCHLINE_SERVER). Those that can: {', '.join(ABLE)}.",
        )
    from app.config import is_local

    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.username:
        raise InputError(
            f"{url} is not the address of a server",
            hint="Write the address as https://NAME, or http://localhost:PORT on this machine.",
        )
    if parts.scheme == "http" and not is_local(parts.hostname):
        raise InputError(
            f"{url} is not encrypted, so the token could be read on its way",
            hint="Use https://. http:// is allowed for this machine alone.",
        )
    _SERVER.set(ServerPlace(url.rstrip("/"), token_file))


def get_current_server() -> ServerPlace | None:
    """The server that this command works against; None: it works in a home."""
    return _SERVER.get()


def require_no_server() -> None:
    """Raise InputError in what cannot be asked of the server that was named."""
    if get_current_server() is not None:
        raise InputError(
            "this works in a home on this machine, not against a server",
            hint="Leave out --server (TOUCHLINE_SERVER).",
        )


def read_token(path: Path) -> str:
    """The token in a file that its owner alone can read.

    Raises:
        InputError: It is not a regular file, others can read it, or it holds none.
    """
    from app.features.people.access_tokens import has_valid_checksum

    try:
        with open_regular_file(path) as file:
            found = os.fstat(file.fileno())
            text = file.read(MAX_TOKEN).decode("ascii", "replace").strip()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    if is_open_to_others(found):
        raise InputError(f"other users can read {path}", hint=f"chmod 600 {path}")
    if not has_valid_checksum(text):
        raise InputError(
            f"{path} does not contain a complete token",
            hint="Copy it again, all of it: tl_ and 54 letters and digits.",
        )
    return text


@contextmanager
def connect_to_server(server: ServerPlace) -> Iterator[Client]:
    """A connection to a server that was looked at: it is there, of this version, and knows us.

    Raises:
        ReviewError: It is not; or, inside the block, it refuses something.
    """
    from touchline.client import Client
    from touchline.errors import TouchlineError

    headers = {}
    if server.token_file is not None:
        headers["Authorization"] = f"Bearer {read_token(server.token_file)}"
    try:
        with Client(server.url, patience=0, timeout=20) as first:
            _require_same_version(server, first)
        with Client(server.url, headers=headers) as client:
            _require_login(server, client)
            yield client
    except TouchlineError as error:
        raise _translate_client_error(server, error) from error


def ask_server(call: Callable[[Client], Answer]) -> Answer | None:
    """What the server answers that this command works against; None: it works in a home.

    Args:
        call: Asks it; what it returns is never None.

    Raises:
        ReviewError: It is not there, is of another version, does not know us, or refuses something.
    """
    server = get_current_server()
    if server is None:
        return None
    with connect_to_server(server) as client:
        return call(client)


def _require_same_version(server: ServerPlace, client: Client) -> None:
    from app.formats.manifest import read_software_version

    mine, found = read_software_version(), None
    # What is no JSON at all.
    with suppress(ValueError):
        found = client.get("/healthz")
    theirs = found.get("version") if isinstance(found, dict) else None
    if not isinstance(theirs, str):
        raise InputError(
            f"the server at {server.url} is not a Touchline server", hint="Check the address."
        )
    if theirs.split(".")[:2] != mine.split(".")[:2]:
        raise InputError(
            f"{server.url} runs Touchline {theirs}, and this is {mine}",
            hint=f"Install the wheel of Touchline {theirs} here, or name another server.",
        )


def _require_login(server: ServerPlace, client: Client) -> None:
    session = client.get("session")
    if session["team"] and session["name"] is None:
        raise InputError(
            f"{server.url} requires a login",
            hint="Name a file with a token: --token-file (TOUCHLINE_TOKEN_FILE).",
        )
    if not session["team"] and server.token_file is not None:
        raise InputError(
            "this server is run by one person alone: it has no tokens",
            hint="Leave out --token-file (TOUCHLINE_TOKEN_FILE).",
        )


def _translate_client_error(server: ServerPlace, error: Exception) -> ReviewError:
    """The same as an error of a command: what the server said, or why it said nothing."""
    message, hint = getattr(error, "message", str(error)), getattr(error, "hint", None)
    said_nothing = getattr(error, "status", None) == 0
    if said_nothing and "WRONG_VERSION_NUMBER" in message:
        from app.config import is_local

        here = is_local(urlsplit(server.url).hostname or "")
        return InputError(
            f"{server.url} answers without TLS",
            hint="Write the address as http://..."
            if here
            else "Name the port of the proxy with TLS, or run the command on the server's machine.",
        )
    if said_nothing and ("certificate" in message.lower() or "ssl" in message.lower()):
        return InputError(
            f"{server.url} has a TLS certificate that cannot be verified: {message}",
            hint="Check the address. If the server uses your own certificate authority, name its"
            " certificate in SSL_CERT_FILE.",
        )
    if said_nothing:
        hint = "Is it running, and the address right?"
    return ReviewError(message, hint=hint)


@contextmanager
def open_store(settings: Settings | None = None, *, may_create: bool = False) -> Iterator[Store]:
    """The database of a home; by default the one that the environment names.

    Raises:
        InputError: The home has no database, and the command may not create one.
    """
    require_no_server()
    from app.db.dialects.dialect import get_dialect
    from app.db.recovery.preopen_check import require_database
    from app.db.store import Store

    settings = settings or read_settings()
    if get_dialect(settings).is_file and not may_create:
        require_database(
            settings,
            "Set TOUCHLINE_HOME to the home folder of an installation; touchline import and"
            " touchline serve begin a new one.",
        )
    with closing(Store.open(settings)) as store:
        yield store


@contextmanager
def open_store_to_solve(
    what: str, workers: int | None, cluster: str | None = None
) -> Iterator[tuple[Store, Executor | None, ReportProgress]]:
    """The database, where its datasets are solved, and a bar that says what is done."""
    from app.workers.executors import open_executor

    settings = read_settings(cluster=cluster)
    with (
        open_store(settings) as store,
        open_executor(settings, workers) as executor,
        show_progress(what) as progress,
    ):
        yield store, executor, progress
