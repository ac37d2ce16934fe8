"""A private PostgreSQL of the tests: a cluster in a temporary folder, reached by a socket alone."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from tests.waiting import SECONDS

ADVICE = (
    "The tests on PostgreSQL need its server, and none was found. Install it (Debian, Ubuntu:"
    " 'apt-get install postgresql' as root) or set TOUCHLINE_POSTGRES to the folder of its programs."
)
_UNSAFE = {"fsync": "off", "synchronous_commit": "off", "full_page_writes": "off"}
"""A cluster that is gone after the tests need not survive a power cut."""
DATA = "data"
"""The folder of its files, beside the socket."""
_ROOM = {"max_connections": "500"}
"""Every store of every process of the tests has some."""


def find_programs() -> Path | None:
    """The folder with ``initdb`` and ``postgres``: TOUCHLINE_POSTGRES, PATH, or where Debian has it."""
    named = os.environ.get("TOUCHLINE_POSTGRES")
    found = shutil.which("initdb")
    places = [
        *([Path(named)] if named else []),
        *([Path(found).resolve().parent] if found else []),
        *sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=_version, reverse=True),
    ]
    return next((place for place in places if (place / "postgres").exists()), None)


def _version(folder: Path) -> int:
    return int(re.sub(r"\D", "", folder.parent.name) or 0)


class Cluster:
    """A running cluster.

    Attributes:
        folder: Where its socket is.
    """

    _numbers = count(1)

    def __init__(self, folder: Path):
        self.folder = folder

    @property
    def pid(self) -> int:
        """Of its first process, the parent of all others."""
        return int((self.folder / DATA / "postmaster.pid").read_text().split()[0])

    def url(self, database: str) -> str:
        """The address of a database."""
        return f"postgresql://postgres@/{database}?host={self.folder}"

    def create(self, like: str | None = None) -> str:
        """A new database, empty or like the one of a URL; returns its URL."""
        # Several processes of tests may share a cluster, and several of these one process.
        name = f"touchline{os.getpid()}_{next(Cluster._numbers)}"
        return self.make(name, "template0" if like is None else _name(like))

    def make(self, name: str, like: str) -> str:
        """A new database of a name, like that of another; returns its URL."""
        import psycopg

        with psycopg.connect(f"host={self.folder} user=postgres", autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name} TEMPLATE {like}".encode())
        return self.url(name)


def _name(url: str) -> str:
    return url.partition("@/")[2].partition("?")[0]


@contextmanager
def running_cluster(*, lasting: bool = False) -> Iterator[Cluster]:
    """A cluster for as long as it is asked for; it ends with this process at the latest.

    Args:
        lasting: Whether it syncs what it has promised, as one of people does.
    """
    programs = find_programs()
    if programs is None:
        raise FileNotFoundError(ADVICE)
    folder = Path(tempfile.mkdtemp(prefix="pg-"))
    # PostgreSQL refuses to run as root.
    user = "postgres" if os.geteuid() == 0 else None
    if user is not None:
        shutil.chown(folder, user, user)
    data = folder / DATA
    try:
        # Text is sorted as a language does it, so that our own order shows.
        language = ("--encoding=UTF8", "--locale-provider=icu", "--icu-locale=en")
        who = ("-U", "postgres", "-A", "trust")
        _run(programs / "initdb", "-D", data, *who, *language, "--no-sync", user=user)
        with _server(programs / "postgres", folder, {} if lasting else _UNSAFE, user):
            yield Cluster(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _server(
    program: Path, folder: Path, promises: Mapping[str, str], user: str | None
) -> Iterator[None]:
    options = {**promises, **_ROOM, "listen_addresses": "", "unix_socket_directories": str(folder)}
    words = [word for name, value in options.items() for word in ("-c", f"{name}={value}")]
    log = (folder / "log").open("w")
    keeper = ["setpriv", "--pdeathsig", "TERM"] if shutil.which("setpriv") else []
    command = [*keeper, str(program), "-D", str(folder / DATA), *words]
    with log, subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, **_as(user)) as server:
        try:
            _wait(folder, server)
            yield
        finally:
            # Fast: sessions that are still open are ended.
            server.send_signal(2)


def _wait(folder: Path, server: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + SECONDS
    while time.monotonic() < until and server.poll() is None:
        if "ready to accept connections" in (folder / "log").read_text():
            return
        time.sleep(0.02)
    raise RuntimeError((folder / "log").read_text())


def _run(*command: object, user: str | None) -> None:
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False, **_as(user)
    )
    if done.returncode:
        raise RuntimeError(done.stderr)


def _as(user: str | None) -> dict:
    return {} if user is None else {"user": user, "group": user, "extra_groups": []}
