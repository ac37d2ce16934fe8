"""Saved views of the queue, and who has reviewed how much."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.datasets.service import MAX_TITLE
from app.features.queue.query import MAX_LENGTH
from app.features.saved_views.service import SavedView
from app.features.verdicts.service import Reviewer
from app.http.documents import ListDocument


class NewSavedView(BaseModel):
    """A query and the name that it shall have."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"name": "Nearly there", "q": "jac<0.8 jac>0.75"}]},
    )

    name: Annotated[str, Field(min_length=1, max_length=MAX_TITLE)]
    q: Annotated[str, Field(max_length=MAX_LENGTH)]


class SavedViewList(ListDocument[SavedView]):
    """Saved views, by name."""


class ReviewerList(ListDocument[Reviewer]):
    """Everybody who has judged a group, the most active first."""
