"""Members of a dataset: who works there, and which role they have there."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import AppStore, DatasetPath, Id
from app.api.paging import paged
from app.api.problem import responses
from app.api.routers.sessions import Me
from app.api.schemas.people import MemberDocument, MemberEdit, MemberList
from app.api.team import AppTeam
from app.review.people import members

router = APIRouter(prefix="/datasets/{dataset}/members", tags=["users"])


@router.get("", operation_id="listMembers", responses=responses(401, 404, 409))
@paged()
def list_members(dataset: DatasetPath, store: AppStore, _team: AppTeam, _me: Me) -> MemberList:
    """Everybody who can log in, and what they are in the dataset."""
    return MemberList(items=members.list_members(store, dataset))


@router.put(
    "/{user}",
    operation_id="setMemberRole",
    response_model=MemberDocument,
    responses=responses(401, 404, 409, 413, 415),
)
def set_role(
    dataset: DatasetPath, user: Id, change: MemberEdit, store: AppStore, _team: AppTeam, me: Me
) -> members.Member:
    """Give somebody a role in this dataset alone, up to lead; null takes it back.

    Nobody changes their own rights, and nobody those of an admin.
    """
    return members.give_role(store, dataset, user, change.role, actor=me.actor)
