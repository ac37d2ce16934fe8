"""Saved views of the queue, and who has reviewed how much."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.datasets.service import MAX_TITLE
from app.features.queue.query import MAX_LENGTH
from app.features.verdicts.service import Reviewer
from app.http.documents import Document, ListDocument


class NewSavedView(BaseModel):
    """A query and the name that it shall have."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"name": "Nearly there", "q": "jac<0.8 jac>0.75"}]},
    )

    name: Annotated[str, Field(min_length=1, max_length=MAX_TITLE)]
    q: Annotated[str, Field(max_length=MAX_LENGTH)]


class SavedViewDocument(Document):
    """A query under a name that everybody on the dataset sees."""

    id: int
    name: str
    q: str = Field(validation_alias="query")
    by: str = Field(validation_alias="actor")
    created: datetime
    groups: int = Field(description="How many match now.")


class SavedViewList(ListDocument[SavedViewDocument]):
    """Saved views, by name."""


class ReviewerList(ListDocument[Reviewer]):
    """Everybody who has judged a group, the most active first."""
