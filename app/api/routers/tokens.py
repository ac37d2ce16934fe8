"""Tokens: made, listed and ended by whoever they speak for."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import AppStore, Id
from app.api.paging import paged
from app.api.problem import responses
from app.api.routers.sessions import Me
from app.api.schemas.access_token import (
    AccessTokenDocument,
    AccessTokenList,
    MadeAccessToken,
    NewAccessToken,
)
from app.api.team import AppTeam
from app.review.datasets.dataset import dataset_id

router = APIRouter(prefix="/tokens", tags=["tokens"])


@router.get("", operation_id="listTokens", responses=responses(401, 409))
@paged()
def list_tokens(team: AppTeam, me: Me) -> AccessTokenList:
    """One's own tokens, those that have expired too."""
    return AccessTokenList(items=team.tokens.of_person(me.person_id))


@router.post(
    "",
    operation_id="makeToken",
    status_code=201,
    responses=responses(401, 404, 409, 413, 415),
)
def make_token(new: NewAccessToken, store: AppStore, team: AppTeam, me: Me) -> MadeAccessToken:
    """Make a token for a script of one's own; its text is shown this once, and kept nowhere."""
    limit = None if new.dataset is None else dataset_id(store, new.dataset)
    made, text = team.tokens.make(me, new.name, new.scopes, days=new.days, dataset_id=limit)
    return MadeAccessToken(token=AccessTokenDocument.model_validate(made), text=text)


@router.delete(
    "/{token}", operation_id="endToken", status_code=204, responses=responses(401, 404, 409)
)
def end_token(token: Id, team: AppTeam, me: Me) -> None:
    """End a token of one's own: whatever uses it is refused from now on."""
    team.tokens.end(token, me.person_id, actor=me.actor)
