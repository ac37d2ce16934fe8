"""Settings: where things live and how much is allowed, from the environment (TOUCHLINE_...)."""

from __future__ import annotations

import os
from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


def _user_data_folder() -> Path:
    root = os.environ.get("XDG_DATA_HOME")
    return (Path(root) if root else Path.home() / ".local" / "share") / "touchline"


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
    workers: int = Field(default_factory=lambda: os.cpu_count() or 1)
    """Processes that solve in batches."""
    max_upload_bytes: int = 64 * 1024 * 1024
    """Largest request body."""
    max_file_bytes: int = 256 * 1024 * 1024
    """Largest single data file (JSON, XML, CSV) that an importer reads."""
    max_members: int = 200_000
    """Most members of an archive."""
    max_pixels: int = 50_000_000
    """Most pixels of an image, checked before it is decoded."""
    max_side: int = 16_384
    """Longest side of an image, pixels, checked before it is decoded."""

    @property
    def database(self) -> str:
        """URL of the database."""
        return self.database_url or f"sqlite+pysqlite:///{self.home / 'touchline.db'}"

    @property
    def cache(self) -> Path:
        """Derived images; can be deleted at any time."""
        return self.home / "cache"

    @property
    def exports(self) -> Path:
        """Exports made over REST."""
        return self.home / "exports"
