"""Events: what changed, without what it is now."""

from __future__ import annotations

from pydantic import BaseModel, Field

from app.api.schemas.job import JobDocument


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


EVENTS: dict[str, type[BaseModel]] = {
    "group": GroupEvent,
    "dataset": DatasetEvent,
    "job": JobDocument,
}
"""What the data of each kind of event is."""
