"""Settings: where things live and how much is allowed, from the environment (TOUCHLINE_...)."""

from __future__ import annotations

import ipaddress
import json
import os
import re
import socket
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import unquote, urlsplit

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SecretStr,
    StringConstraints,
    field_validator,
    model_validator,
)
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from app.durable import read_private_file
from app.errors import InputError
from app.log import LogFormat


def _user_data_folder() -> Path:
    root = os.environ.get("XDG_DATA_HOME")
    return (Path(root) if root else Path.home() / ".local" / "share") / "touchline"


def find_memory_limit(
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


class ObjectStoreSettings(BaseModel):
    """One object store (S3 or what speaks like it), as the operator describes it.

    Attributes:
        url: ``s3://bucket`` or ``s3://bucket/prefix``; nothing beside it is ever asked for.
        endpoint: Where it is, such as https://minio.example.org:9000; None: at Amazon.
        region: Its region.
        key: Access key, with ``secret`` and, for keys that expire, ``token``.
        key_file: A file in place of these, in the form of ~/.aws/credentials, for its owner alone
            (0600); read again when it changes.
        profile: Section of that file.
        anonymous: It is public, and asked without keys.
        exports: Exports may be written to it.
        delivery: How browsers get an export that lies there: ``proxied`` through this server, or
            ``signed``: sent to an address of the store that is good for a minute.
        seconds: Longest time that one request to it may take.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    url: Annotated[
        str, StringConstraints(pattern=r"^s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[^?#]*)?$")
    ]
    endpoint: str | None = None
    region: str = "us-east-1"
    key: SecretStr | None = None
    secret: SecretStr | None = None
    token: SecretStr | None = None
    key_file: Path | None = None
    profile: str = "default"
    anonymous: bool = False
    exports: bool = False
    delivery: Literal["proxied", "signed"] = "proxied"
    seconds: float = Field(default=10.0, gt=0, le=600)

    @model_validator(mode="after")
    def _require_one_login_method(self) -> ObjectStoreSettings:
        given = (self.key is not None and self.secret is not None, self.key_file is not None)
        if sum((*given, self.anonymous)) != 1:
            raise ValueError("needs exactly one of these: key and secret, key_file, or anonymous")
        if self.endpoint is not None and not _URL.fullmatch(self.endpoint.lower()):
            raise ValueError("endpoint must be an address such as https://minio.example.org:9000")
        return self

    @property
    def bucket(self) -> str:
        """Name of the bucket."""
        return self.url.removeprefix("s3://").partition("/")[0]

    @property
    def prefix(self) -> str:
        """What the key of every object begins with; empty, or without slashes at its ends."""
        return self.url.removeprefix("s3://").partition("/")[2].strip("/")


StoreName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,62}$")]

_FILE = "touchline.db"
_HOST = re.compile(r"[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\]")
_URL = re.compile(r"https?://(?:[a-z0-9.-]+|\[[0-9a-f:]+\])(?::\d{1,5})?/?")


class Settings(BaseSettings):
    """Everything an operator can set; the defaults are safe on one machine for one person."""

    model_config = SettingsConfigDict(env_prefix="TOUCHLINE_", extra="ignore")

    home: Path = Field(default_factory=_user_data_folder)
    """The folder that holds the database, the media cache and the exports."""
    database_url: str | None = Field(default=None, repr=False)
    """Database to use instead of the SQLite file in ``home``:
    ``postgresql://USER:PASSWORD@HOST/NAME``."""
    database_url_file: Path | None = None
    """Or a file with that address, which only its owner may read (``chmod 600``)."""
    host: str = "127.0.0.1"
    """Address the server listens on."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port the server listens on."""
    allowed_hosts: list[str] = ["127.0.0.1", "localhost", "[::1]"]
    """Host headers the server answers to, without the port."""
    log_format: LogFormat = "text"
    """Lines of the log: ``text`` (name=value) or ``json`` (an object a line, for a log collector)."""
    team: bool = False
    """People log in; without it everybody who reaches the server is the same user ``local``."""
    url: str | None = None
    """The address that people open, such as https://touchline.example.org, if a proxy with TLS
    stands in front."""
    proxies: list[str] = ["127.0.0.1", "::1"]
    """Addresses or networks (10.0.0.0/8) of proxies whose X-Forwarded-For header is trusted, once
    ``url`` is set."""
    webhooks: list[str] = []
    """Allowed addresses of webhooks, such as https://hooks.example.org/touchline, including
    addresses below them."""
    stalled_hours: float = Field(default=24.0, gt=0, le=8760)
    """Hours without activity after which an unfinished batch is stalled. A batch after its due
    day is always stalled."""
    sso_issuer: str | None = None
    """Address of the OpenID Connect provider with which people log in (single sign-on), as the
    provider gives it: https://accounts.example.org."""
    sso_client_id: str | None = None
    """Client id of this server at the provider."""
    sso_client_secret: SecretStr | None = None
    """Client secret of this server at the provider."""
    sso_client_secret_file: Path | None = None
    """Or a file with that secret, which only its owner may read (``chmod 600``)."""
    sso_label: str = Field("single sign-on", min_length=1, max_length=40)
    """Name of the provider for people: the button says *Log in with* this."""
    sso_hosts: list[str] = []
    """Beginnings of further addresses of the provider, such as https://oauth2.googleapis.com; the
    server sends requests to no others."""
    sso_scope: str = "openid email profile"
    """Scopes that are requested from the provider."""
    sso_name_claim: str = "preferred_username"
    """Claim with the name of a new person."""
    sso_domains: list[str] = []
    """Allowed domains of verified e-mail addresses; empty: any address, or none."""
    sso_group_claim: str | None = None
    """Claim that lists the person's groups."""
    sso_groups: list[str] = []
    """Allowed groups: people in one of them may log in; empty: everybody."""
    sso_new_role: str | None = None
    """Role of new people at their first login, such as ``viewer``; empty: they are refused."""
    sso_only: bool = False
    """Only single sign-on: login by password or passkey is off."""
    sso_second_factor: list[str] = []
    """Values of the claims ``amr`` and ``acr`` that mean that the provider has required a
    second factor: then Touchline requires none; empty: it always requires its own."""
    smtp_host: str | None = None
    """Mail server by which invitations are sent, such as smtp.example.org; empty: no mail is sent, and links
    are shown."""
    smtp_port: int | None = Field(default=None, ge=1, le=65535)
    """Its port; empty: 587 with ``starttls``, 465 with ``tls``, 25 with ``none``."""
    smtp_security: Literal["starttls", "tls", "none"] = "starttls"
    """``starttls`` or ``tls``: the connection is encrypted, and the server's certificate checked; ``none``
    only for a mail server on this machine."""
    smtp_user: str | None = None
    """The account at the mail server, if it requires one."""
    smtp_password: SecretStr | None = Field(default=None, repr=False)
    """Its password."""
    smtp_password_file: Path | None = Field(default=None, repr=False)
    """Or a file with that password, which only its owner may read (``chmod 600``)."""
    smtp_from: str | None = None
    """Sender address of mails, such as touchline@example.org."""
    workers: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1)
    """Processes that solve in batches."""
    web_workers: int = Field(default=1, ge=1, le=64)
    """Processes that answer requests; more than one only on PostgreSQL."""
    cluster: str | None = None
    """Address of a scheduler, such as tls://solve.example.org:8786, whose workers solve batches
    instead of processes of this machine."""
    cluster_keys: Path | None = None
    """Folder with ca.pem, cert.pem and key.pem, with which scheduler, workers and servers
    authenticate each other."""
    image_workers: int = Field(default_factory=lambda: min(os.cpu_count() or 1, 4), ge=1)
    """Processes that make pictures of frames."""
    max_upload_bytes: int = Field(default=8 * 1024**3, ge=1)
    """Largest uploaded file, such as the recording of a match; a JSON body is smaller still."""
    upload_days: int = Field(default=7, ge=0)
    """Days after which an uploaded file is deleted, unless a dataset reads frames from it."""
    upload_quota_bytes: int = Field(default=20 * 1024**3, ge=0)
    """Bytes that the uploads of one person may use together on a team's server; 0: no limit."""
    export_days: int = Field(default=0, ge=0)
    """Days after which the file of a finished export is deleted; 0: never. The export of a
    version can be made again; other exports would have the present state of the dataset."""
    answer_bytes: int = Field(default=64 * 2**20, ge=0)
    """Space for responses stored under Idempotency-Keys; beyond it the oldest lose their
    content, not their key."""
    job_days: int = Field(default=90, ge=0)
    """Days after which a job that has ended is deleted, unless it made an export."""
    cache_days: int = Field(default=30, ge=0)
    """Days after which a derived image is made again."""
    import_folders: Annotated[list[Path], NoDecode] = []
    """Folders below which imports over REST may read, separated by ``:`` (or a JSON list)."""
    stores: dict[StoreName, ObjectStoreSettings] = {}
    """Object stores by the name that people use for them (``s3://NAME/...``), as JSON: ``url`` with
    ``key`` and ``secret``, ``key_file`` or ``anonymous``; ``endpoint``, ``exports`` and more: [operations.md](operations.md)."""
    store_cache_bytes: int = Field(default=4 * 1024**3, ge=2**26)
    """Space for frames of object stores that are cached on this disk; the least recently used
    are deleted first."""
    max_file_bytes: int = Field(default=256 * 1024 * 1024, ge=1)
    """Largest single data file (JSON, XML, CSV) that an importer reads."""
    import_memory: int = Field(
        default_factory=lambda: min(4 * 1024**3, find_memory_limit() // 2), ge=1
    )
    """Bytes of memory that an import over REST may use."""
    import_seconds: int = Field(default=3600, ge=1)
    """Seconds of processor time that an import over REST may take."""
    max_members: int = Field(default=200_000, ge=1)
    """Most members of an archive."""
    max_pixels: int = Field(default=50_000_000, ge=1)
    """Most pixels of an image, checked before it is decoded."""
    max_side: int = Field(default=16_384, ge=1)
    """Longest side of an image, pixels, checked before it is decoded."""

    @field_validator("import_folders", mode="before")
    @classmethod
    def _split_folders(cls, value: object) -> object:
        if not isinstance(value, str):
            return value
        if value.lstrip().startswith("["):
            try:
                return json.loads(value)
            except json.JSONDecodeError:
                raise ValueError('is not JSON; write it as ["ONE", "ANOTHER"]') from None
        return [part for part in value.split(os.pathsep) if part]

    @field_validator("proxies")
    @classmethod
    def _check_proxies(cls, value: list[str]) -> list[str]:
        for text in value:
            try:
                ipaddress.ip_network(text, strict=False)
            except ValueError:
                raise ValueError(
                    f"{text!r} is not an address such as 10.0.0.7, nor a network such as 10.0.0.0/8"
                ) from None
        return value

    @field_validator("allowed_hosts")
    @classmethod
    def _check_allowed_hosts(cls, value: list[str]) -> list[str]:
        for text in value:
            if not _HOST.fullmatch(text):
                raise ValueError(
                    f"{text!r} is not a host name; write it without scheme, port and path"
                )
        return value

    @field_validator("url")
    @classmethod
    def _normalise_url(cls, value: str | None) -> str | None:
        if value is None or _URL.fullmatch(value.lower()):
            return None if value is None else value.lower().rstrip("/")
        raise ValueError(
            "must be the base URL of the server, such as https://touchline.example.org"
        )

    @model_validator(mode="after")
    def _read_database_url_file(self) -> Settings:
        if self.database_url_file is None:
            return self
        if self.database_url is not None:
            raise InputError(
                "the database is given twice: by TOUCHLINE_DATABASE_URL and by TOUCHLINE_DATABASE_URL_FILE"
            )
        self.database_url = read_private_file(self.database_url_file, "TOUCHLINE_DATABASE_URL_FILE")
        if not self.database_url:
            raise InputError(
                f"{self.database_url_file}, which TOUCHLINE_DATABASE_URL_FILE names, is empty;"
                " write the database URL into it"
            )
        return self

    @property
    def recordings(self) -> Path:
        """Indices of recordings, and their frames that groups use."""
        return self.home / "recordings"

    @property
    def uploads(self) -> Path:
        """Files uploaded over REST."""
        return self.home / "uploads"

    @property
    def database(self) -> str:
        """URL of the database."""
        return self.database_url or f"sqlite+pysqlite:///{self.home / _FILE}"

    @property
    def database_file(self) -> Path:
        """The file of the database; of one on a server, where in the home its file would lie."""
        if not self.database.startswith("sqlite"):
            return self.home / _FILE
        return Path(self.database.partition("///")[2].partition("?")[0])

    @property
    def uses_solver_processes(self) -> bool:
        """Whether processes of its own solve what people ask: a team's, in one process that answers."""
        return self.team and self.web_workers == 1

    @property
    def database_name(self) -> str:
        """What the database is called in a sentence: its file, or its name on its server."""
        if self.database.startswith("sqlite"):
            return self.database_file.name
        name = urlsplit(self.database).path.strip("/")
        return f"the database {unquote(name)}" if name else "the database"

    @property
    def yields(self) -> Path:
        """The folder of the tables that yields are counted from, a part of the cache."""
        return self.cache / "yields"

    @property
    def cache(self) -> Path:
        """Derived images; can be deleted at any time."""
        return self.home / "cache"

    @property
    def exports(self) -> Path:
        """Exports made over REST."""
        return self.home / "exports"


_PACKAGE = Path(__file__).resolve().parent


def find_packaged_folder(name: str) -> Path:
    """Where ``static`` or ``migrations`` lies: inside the package when it was installed from a
    wheel, beside it in a checkout."""
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


_SHORT = re.compile(r"[0-9a-fA-FxX.]+")
"""IPv4 addresses as the system takes them, ``127.1`` for one."""


def is_local(host: str) -> bool:
    """Whether nobody but this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        if _SHORT.fullmatch(host):
            host = socket.inet_ntoa(socket.inet_aton(host))
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except (OSError, ValueError):
        return False
