"""Settings: where things live and how much is allowed, from the environment (TOUCHLINE_...)."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict


def _user_data_folder() -> Path:
    root = os.environ.get("XDG_DATA_HOME")
    return (Path(root) if root else Path.home() / ".local" / "share") / "touchline"


def memory_bytes(
    own: Path = Path("/proc/self/cgroup"), groups: Path = Path("/sys/fs/cgroup")
) -> int:
    """Memory that this process may have: the machine's, or what a container or unit is given.

    Args:
        own: Says which control groups the process is in, one ``number:controllers:path`` a line.
        groups: Where the kernel shows them; version 1 has a folder for each controller.
    """
    found = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    for line in own.read_text().splitlines() if own.exists() else []:
        _, controllers, path = line.split(":", 2)
        if controllers not in ("", "memory"):
            continue
        name = "memory.limit_in_bytes" if controllers else "memory.max"
        inner = Path(path.lstrip("/"))
        # A limit of what is around it holds, too; a container may show its own as the outermost.
        for folder in (inner, *inner.parents):
            file = groups / controllers / folder / name
            limit = file.read_text().strip() if file.is_file() else ""
            found += [int(limit)] if limit.isdigit() else []
    return min(found)


_URL = re.compile(r"https?://(?:[a-z0-9.-]+|\[[0-9a-f:]+\])(?::\d{1,5})?/?")


class Settings(BaseSettings):
    """Everything an operator can set; the defaults are safe on one machine for one person."""

    model_config = SettingsConfigDict(env_prefix="TOUCHLINE_", extra="ignore")

    home: Path = Field(default_factory=_user_data_folder)
    """The folder that holds the database, the media cache and the exports."""
    database_url: str | None = None
    """Another database than the SQLite file in ``home``."""
    host: str = "127.0.0.1"
    """Address the server listens on."""
    port: int = 8000
    """Port the server listens on."""
    allowed_hosts: list[str] = ["127.0.0.1", "localhost", "[::1]"]
    """Host headers the server answers to, without the port."""
    team: bool = False
    """People log in; without it everybody who reaches the server is the one user ``local``."""
    url: str | None = None
    """The address that people open, such as https://touchline.example.org, where a proxy with TLS
    stands in front."""
    proxies: list[str] = ["127.0.0.1", "::1"]
    """Addresses of proxies that are believed whom they forward (X-Forwarded-For), once ``url`` is set."""
    workers: int = Field(default_factory=lambda: os.cpu_count() or 1)
    """Processes that solve in batches."""
    image_workers: int = Field(default_factory=lambda: min(os.cpu_count() or 1, 4), ge=1)
    """Processes that make pictures of frames."""
    max_upload_bytes: int = 2 * 1024**3
    """Largest uploaded file; a JSON body is smaller still."""
    upload_days: int = 7
    """After so many days an uploaded file that no dataset reads its frames from is deleted."""
    answer_bytes: int = 64 * 2**20
    """Room for answers under Idempotency-Keys; beyond it the oldest lose their text, not their
    key."""
    job_days: int = 90
    """After so many days a job that is over is forgotten, unless it made an export."""
    cache_days: int = 30
    """After so many days a derived image is made anew."""
    import_folders: Annotated[list[Path], NoDecode] = []
    """Folders below which imports over REST may read, separated by ``:`` (or a JSON list)."""
    max_file_bytes: int = 256 * 1024 * 1024
    """Largest single data file (JSON, XML, CSV) that an importer reads."""
    import_memory: int = Field(default_factory=lambda: min(4 * 1024**3, memory_bytes() // 2))
    """Bytes of memory that an import over REST may use."""
    import_seconds: int = 3600
    """Seconds of processor time that an import over REST may take."""
    max_members: int = 200_000
    """Most members of an archive."""
    max_pixels: int = 50_000_000
    """Most pixels of an image, checked before it is decoded."""
    max_side: int = 16_384
    """Longest side of an image, pixels, checked before it is decoded."""

    @field_validator("import_folders", mode="before")
    @classmethod
    def _folders(cls, value: object) -> object:
        if not isinstance(value, str):
            return value
        if value.lstrip().startswith("["):
            return json.loads(value)
        return [part for part in value.split(os.pathsep) if part]

    @field_validator("url")
    @classmethod
    def _address(cls, value: str | None) -> str | None:
        if value is None or _URL.fullmatch(value.lower()):
            return None if value is None else value.lower().rstrip("/")
        raise ValueError(
            "must be the beginning of an address, such as https://touchline.example.org"
        )

    @property
    def uploads(self) -> Path:
        """Files uploaded over REST."""
        return self.home / "uploads"

    @property
    def database(self) -> str:
        """URL of the database."""
        return self.database_url or f"sqlite+pysqlite:///{self.home / 'touchline.db'}"

    @property
    def database_file(self) -> Path:
        """The file of the database."""
        return Path(self.database.partition("///")[2].partition("?")[0])

    @property
    def cache(self) -> Path:
        """Derived images; can be deleted at any time."""
        return self.home / "cache"

    @property
    def exports(self) -> Path:
        """Exports made over REST."""
        return self.home / "exports"
