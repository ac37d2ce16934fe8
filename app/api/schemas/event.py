"""Events: what changed, without what it is now."""

from __future__ import annotations

from pydantic import BaseModel, Field


class GroupEvent(BaseModel):
    """A group is not what it was; whoever shows another ETag reads it again."""

    group: int
    dataset: str | None
    etag: str | None
    kind: str = Field(description="As in the history of the group, or `solved`.")
    actor: str | None


class DatasetEvent(BaseModel):
    """A dataset as a whole is not what it was: its policy, its groups, or that it is there."""

    dataset: str | None = Field(description="Its name; null when it is gone.")
    kind: str
    actor: str | None
