"""A short notice that an admin sets for everybody, and whether strangers could reach the server."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from urllib.parse import urlsplit

from app.config import Settings, is_local
from app.db.json_columns import parse_json_column
from app.db.session import format_utc_time, now
from app.db.store import Store
from app.errors import InputError
from app.features.audit.service import add_audit_event
from app.features.people.queries import read_team_setting, write_team_setting
from app.json_text import Moment, json_text
from app.wording import is_one_line, is_visible

_BANNER = "maintenance"
"""Name of the setting."""
LONGEST = 300
"""Characters of a notice."""


@dataclass(frozen=True)
class Banner:
    """A notice.

    Attributes:
        starts: When it begins to be shown, in UTC; None: at once.
        until: When it is no longer shown; None: when somebody takes it away.
    """

    text: str
    starts: Moment | None = None
    until: Moment | None = None


def read_banner(store: Store) -> Banner | None:
    """The notice that is or will be shown; None: there is none, or its time is over."""
    with store.read() as session:
        found = read_team_setting(session, _BANNER)
    banner = None if found is None else Banner(**parse_json_column(found))
    return None if banner is None or (banner.until or "~") <= now() else banner


def set_banner(
    store: Store,
    text: str,
    *,
    starts: datetime | None = None,
    until: datetime | None = None,
    actor: str,
) -> Banner:
    """Show everybody a notice, in place of the one before; times have a zone.

    Raises:
        InputError: The text is empty, too long or more than a line, or its time is over before it
            begins.
    """
    text = text.strip()
    if not is_visible(text) or len(text) > LONGEST:
        raise InputError(f"a notice must have 1 to {LONGEST} characters", pointer="/text")
    if not is_one_line(text):
        raise InputError("a notice must be one line without control characters", pointer="/text")
    at = datetime.now(UTC)
    if until is not None and until <= max(starts or at, at):
        raise InputError(
            "the notice would never be shown: `until` must be later than now and than the start",
            pointer="/until",
        )
    begin, end = (None if time is None else format_utc_time(time) for time in (starts, until))
    banner = Banner(text, begin, end)
    with store.write() as session:
        write_team_setting(session, _BANNER, json_text(asdict(banner)))
        add_audit_event(session, actor, "maintenance notice set", None, text=text)
    return banner


def clear_banner(store: Store, *, actor: str) -> bool:
    """Take the notice away; whether there was one."""
    with store.write() as session:
        if read_team_setting(session, _BANNER) is None:
            return False
        write_team_setting(session, _BANNER, None)
        add_audit_event(session, actor, "maintenance notice cleared", None)
        return True


def find_exposure_warning(settings: Settings) -> str | None:
    """What makes it unsafe to serve with some settings, as a sentence; None: nothing."""
    secure = (settings.url or "").startswith("https://")
    if not is_local(settings.host) and not settings.team:
        return (
            f"{settings.host} can be reached from other machines, and without accounts anyone who "
            f"reaches it could change everything. Use 127.0.0.1, or serve a team with --team."
        )
    if not is_local(settings.host) and not secure:
        return (
            f"{settings.host} can be reached by other machines: passwords must not travel in the "
            "clear. Put a proxy with TLS in front, and say with --url https://NAME what people open."
        )
    if settings.url and not secure and not is_local(urlsplit(settings.url).hostname or ""):
        return (
            f"{settings.url} is not encrypted: passwords must not travel in the clear. "
            "Say --url https://NAME, and let a proxy with TLS answer there."
        )
    return None
