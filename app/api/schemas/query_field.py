"""What a query can ask: fields with their operators, and the orders of a list."""

from __future__ import annotations

from pydantic import Field

from app.api.schemas.document import Document, ListDocument
from app.review.queue.fields import FieldKind


class QueryFieldDocument(Document):
    """One field of a query."""

    name: str
    kind: FieldKind = Field(
        description="`number` compares, `flag` is yes or no, `choice` is one of `values`, `text` is "
        "any text, `ids` are numbers of groups, `order` says how groups are listed."
    )
    meaning: str
    unit: str = Field(description="Of a number; empty: it has none.")
    operators: list[str] = Field(description="All that it has; `:` and `=` mean the same.")
    values: list[str] = Field(
        description="What it can be; of a number or a text, words with a meaning of their own."
    )
    several: bool = Field(description="Whether `a,b` means either.")
    also: list[str] = Field(description="Other names that are understood.")


class QueryOrderDocument(Document):
    """One order of a list; its name with `-desc` is the reverse, and what has no value comes last."""

    name: str
    meaning: str


class QueryFieldList(ListDocument[QueryFieldDocument]):
    """All that a query can ask."""

    sorts: list[QueryOrderDocument]
