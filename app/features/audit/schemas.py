"""The audit: who said and did what."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import Field

from app.features.audit.service import AuditEntry
from app.http.documents import Document, ListDocument


class AuditEntryDocument(Document, shows=AuditEntry):
    """One thing that somebody said or did."""

    at: datetime
    actor: str = Field(
        description="Name of the person, with the name of the token for a script's request."
    )
    kind: str = Field(description="Of the entry in the log.")
    dataset: str | None = Field(description="null: of none, or it is gone.")
    network: str | None = Field(description="From which address, where that is known.")
    address: str | None = Field(description="Of the page that it is about.")
    hash: str = Field(description="Of the entry, in the chain of the log.")


class AuditDocument(ListDocument[AuditEntryDocument]):
    """Entries, the newest first."""

    next: Annotated[str, Field(coerce_numbers_to_str=True)] | None = Field(
        description="`cursor` of the next page; null on the last one."
    )
