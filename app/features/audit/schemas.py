"""The audit: who said and did what."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.features.audit.service import AuditEntry
from app.http.documents import ListDocument


class AuditDocument(ListDocument[AuditEntry]):
    """Entries, the newest first."""

    next: Annotated[str, Field(coerce_numbers_to_str=True)] | None = Field(
        description="`cursor` of the next page; null on the last one."
    )
