"""Insight: what would make a group pass, and what each marking of a view is worth."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import AppStore, Id
from app.api.paging import paged
from app.api.problem import responses
from app.api.schemas.insight import Influences, Remedies
from app.review.editing import submit
from app.review.editing.found_view import find_view
from app.review.editing.influence import influences
from app.review.editing.remedies import find_remedies

router = APIRouter(tags=["insight"])


@router.get("/groups/{group}/remedies", operation_id="getRemedies", responses=responses(404))
@paged()
def get_remedies(group: Id, store: AppStore) -> Remedies:
    """Small edits with which a group that fails would pass, each tried out; saves nothing."""
    state = submit.load_solved(store, group)
    if state.solution is None:
        return Remedies(items=[])
    found = find_remedies(state.group, state.policy, state.solution)
    return Remedies(items=found)


@router.get("/views/{view}/influence", operation_id="getInfluence", responses=responses(404))
@paged()
def get_influence(view: Id, store: AppStore) -> Influences:
    """What the camera of a view would be without each of its markings; saves nothing."""
    found = find_view(store, view)
    state = submit.load(store, found.group_id)
    seen = next(item for item in state.group.views if state.view_ids[item.key] == view)
    items = influences(seen.station, state.group.pitch, state.policy.calibration)
    return Influences(items=items)
