"""Query fields: what the queue's search box, and every `q`, understands."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.paging import paged
from app.api.problem import responses
from app.api.schemas.query_field import QueryFieldList
from app.review.queue.fields import FIELDS, ORDERS

router = APIRouter(tags=["queue"])


@router.get("/query-fields", operation_id="listQueryFields", responses=responses())
@paged()
def list_query_fields() -> QueryFieldList:
    """Every field of a query with its operators, unit and values, and every order."""
    return QueryFieldList(items=FIELDS, sorts=ORDERS)
