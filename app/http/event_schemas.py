"""Events: what changed, without what it is now."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, Field

from app.features.jobs.schemas import JobDocument
from app.features.maintenance.service import Banner
from app.http.documents import Document


class GroupEvent(BaseModel):
    """A group has changed; whoever shows it under another ETag reads it again."""

    group: int
    dataset: str | None
    etag: str | None
    kind: str = Field(
        description="What happened: a kind as in the history of the group, or `solved`."
    )
    actor: str | None


class DatasetEvent(BaseModel):
    """A dataset as a whole has changed: its policy, its groups, or whether it exists."""

    dataset: str | None = Field(description="Name of the dataset; null when it is deleted.")
    kind: str
    actor: str | None


class PresenceDocument(Document):
    """Somebody who has a group of a batch open."""

    person: str
    since: datetime


class WorkEvent(BaseModel):
    """A group of a batch was opened, left, taken over or handed in."""

    batch: int
    group: int
    dataset: str | None
    here: list[PresenceDocument] = Field(description="People who have the group open now.")


class MaintenanceEvent(BaseModel):
    """The notice of maintenance is another one."""

    banner: Banner | None = Field(description="Null: it was taken away.")


EVENTS: dict[str, type[BaseModel]] = {
    "group": GroupEvent,
    "dataset": DatasetEvent,
    "job": JobDocument,
    "work": WorkEvent,
    "maintenance": MaintenanceEvent,
}
"""What the data of each kind of event is."""
