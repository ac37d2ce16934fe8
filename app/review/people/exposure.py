"""Exposure: whether strangers could come in, or passwords would be read on their way."""

from __future__ import annotations

from urllib.parse import urlsplit

from app.config import Settings
from app.hosts import is_local


def exposure_of(settings: Settings) -> str | None:
    """What makes it unsafe to serve with some settings, as a sentence; None: nothing."""
    secure = (settings.url or "").startswith("https://")
    if not is_local(settings.host) and not settings.team:
        return (
            f"{settings.host} can be reached by other machines, and without accounts everybody who "
            "reaches it could change everything. Use 127.0.0.1, or serve a team with --team."
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
