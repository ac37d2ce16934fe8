"""The tests on PostgreSQL: every home that they make has its database on one private server.

``python -m tests.on_postgresql [ARGUMENTS OF PYTEST]`` starts the server and runs them. A home's
database is named after its folder. A copy of the folder gets a copy of the database, and a command
that is started with the folder in its environment gets the database's address there. Tests with the
mark ``file_of_sqlite`` are about that file, and are left out.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import psycopg
from psycopg.errors import DuplicateDatabase

from app.config import Settings
from tests.cluster import ADVICE, Cluster, find_programs, running_cluster

NAMED = "TESTS_CLUSTER"
"""Where the server is that all processes of the tests share; no setting of the product's."""
EMPTY = "empty"
"""The database that those of new homes are copies of: migrated, and empty."""
MARK = "file_of_sqlite"
_HOME, _URL = "TOUCHLINE_HOME", "TOUCHLINE_DATABASE_URL"
_OWN = (
    "SET session_replication_role = replica;"
    " UPDATE installation SET key = replace(gen_random_uuid()::text, '-', '')"
)
"""Makes a copy of the empty database an installation of its own."""


def run(arguments: list[str]) -> int:
    """Run pytest; its exit code."""
    from app.db.store import Store

    with running_cluster() as cluster:
        url = cluster.make(EMPTY, "template0")
        Store.open(Settings(home=cluster.folder / "home", database_url=url)).close()
        command = [sys.executable, "-m", "pytest", *arguments]
        # A home that was named for the caller, as make does, would give its database to all.
        environment = {name: text for name, text in os.environ.items() if name not in (_HOME, _URL)}
        environment[NAMED] = str(cluster.folder)
        return subprocess.run(command, env=environment, check=False).returncode


def shared_cluster() -> Cluster | None:
    """The server of these tests; None: each home has its file."""
    named = os.environ.get(NAMED)
    return None if named is None else Cluster(Path(named))


class Homes:
    """The databases of homes: made when one is opened, copied with its folder."""

    def __init__(self, cluster: Cluster):
        self._cluster = cluster
        self._folder = cluster.folder / "homes"
        self._folder.mkdir(exist_ok=True)

    def url(self, home: Path) -> str:
        """Where the database of a home is, or will be."""
        return self._cluster.url(_name(home))

    def ensure(self, home: Path) -> None:
        """Make the database of a home, if there is none."""
        note = self._folder / _name(home)
        if note.exists():
            return
        try:
            url = self._cluster.make(_name(home), EMPTY)
        except DuplicateDatabase:
            return
        with psycopg.connect(url, autocommit=True) as database:
            database.execute(_OWN)
        note.write_text(str(home.resolve()))

    def copy(self, source: Path, target: Path) -> None:
        """Copy the databases of all homes in a folder that was copied."""
        source, target = source.resolve(), target.resolve()
        for note in list(self._folder.iterdir()):
            home = Path(note.read_text())
            if home.is_relative_to(source):
                copied = target / home.relative_to(source)
                self._cluster.make(_name(copied), note.name)
                (self._folder / _name(copied)).write_text(str(copied))


def _name(home: Path) -> str:
    return "home_" + hashlib.sha256(str(home.resolve()).encode()).hexdigest()[:24]


def install(cluster: Cluster) -> None:
    """Let every home of this process, and of those that it starts, have its database there."""
    homes = Homes(cluster)
    _say_url(homes)
    _pass_on(homes)
    shutil.copytree = _copying(homes, shutil.copytree)
    from app.db.dialects.postgresql import PostgreSQLDialect

    make = PostgreSQLDialect.make_engine

    @wraps(make)
    def make_engine(self: PostgreSQLDialect, settings: Settings, **options: Any) -> Any:
        if settings.database_url == homes.url(settings.home):
            homes.ensure(settings.home)
        return make(self, settings, **options)

    PostgreSQLDialect.make_engine = make_engine  # type: ignore[method-assign]


def _say_url(homes: Homes) -> None:
    """Settings that name no database mean that of their home."""
    init, copy = Settings.__init__, Settings.model_copy

    @wraps(init)
    def made(self: Settings, **values: Any) -> None:
        init(self, **values)
        if self.database_url is None:
            self.database_url = homes.url(self.home)

    @wraps(copy)
    def copied(self: Settings, **options: Any) -> Settings:
        other = copy(self, **options)
        if other.database_url == homes.url(self.home):
            other.database_url = homes.url(other.home)
        return other

    Settings.__init__ = made  # type: ignore[method-assign]
    Settings.model_copy = copied  # type: ignore[method-assign, assignment]


def _pass_on(homes: Homes) -> None:
    """Commands that are started in a home are told where its database is."""
    init = subprocess.Popen.__init__

    @wraps(init)
    def started(self: Any, *arguments: Any, **options: Any) -> None:
        environment = options.get("env")
        environment = dict(os.environ if environment is None else environment)
        if _HOME in environment and _URL not in environment:
            home = Path(environment[_HOME])
            homes.ensure(home)
            options["env"] = {**environment, _URL: homes.url(home)}
        init(self, *arguments, **options)

    subprocess.Popen.__init__ = started  # type: ignore[method-assign]


def _copying(homes: Homes, copytree: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(copytree)
    def copied(source: Any, target: Any, *arguments: Any, **options: Any) -> Any:
        done = copytree(source, target, *arguments, **options)
        homes.copy(Path(source), Path(target))
        return done

    return copied


if __name__ == "__main__":
    if find_programs() is None:
        sys.exit(ADVICE)
    sys.exit(run(sys.argv[1:]))
