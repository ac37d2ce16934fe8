"""Jobs: work that outlasts a request."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from app.http.documents import Document, ListDocument
from app.soccer.choices import JobState

JobKind = Literal[
    "solve",
    "import",
    "export",
    "freeze",
    "verify",
    "evaluate",
    "detect",
    "bulk",
    "practice",
    "rig",
    "positions",
    "paint",
    "proposals",
    "pictures",
    "recording",
    "instants",
    "ball",
    "track",
    "link",
]


class JobProblem(Document):
    """Why a job failed."""

    detail: str
    hint: str | None
    pointer: str | None


class JobDocument(Document):
    """A job as it stands."""

    id: int
    kind: JobKind
    title: str = Field(description="What the job does, in a sentence.")
    dataset: str | None = Field(description="Name of the dataset that it works on.")
    state: JobState
    done: int
    total: int | None = Field(description="How much there is to do; null while that is unknown.")
    sentence: str = Field(description="What the job is doing now, in a sentence.")
    result: Any = Field(description="The result; its fields depend on the kind.")
    problem: JobProblem | None
    created: datetime
    started: datetime | None
    ended: datetime | None
    actor: str


class JobPage(ListDocument[JobDocument]):
    """Jobs, the newest first; ``next`` is the cursor of the next page."""
