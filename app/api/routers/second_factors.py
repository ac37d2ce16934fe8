"""Second factors: one's own, those that admins take away, and whether everybody needs one."""

from __future__ import annotations

from fastapi import APIRouter, Request

from app.api.deps import Id
from app.api.problem import responses
from app.api.routers.sessions import Me
from app.api.schemas.people import (
    CodeOnly,
    EnrolmentDocument,
    PasswordOnly,
    RecoveryCodes,
    SecondFactorDocument,
    TeamSettings,
)
from app.api.team import AppTeam

router = APIRouter(tags=["sessions"])
OWN = "/session/second-factor"


@router.get(OWN, operation_id="getSecondFactor", responses=responses(401, 409))
def get_second_factor(team: AppTeam, me: Me) -> SecondFactorDocument:
    """Whether a code is asked for after one's password, and how many recovery codes are left."""
    return SecondFactorDocument.model_validate(team.factors.state(me.person_id))


@router.post(OWN, operation_id="beginSecondFactor", responses=responses(401, 409, 413, 415, 429))
def begin(said: PasswordOnly, request: Request, team: AppTeam, me: Me) -> EnrolmentDocument:
    """What an authenticator has to know, shown this once; nothing is asked for before it is confirmed."""
    team.count_try(request, me.name)
    return EnrolmentDocument.model_validate(team.factors.begin(me, said.password))


@router.post(
    f"{OWN}/confirm",
    operation_id="confirmSecondFactor",
    responses=responses(401, 404, 409, 413, 415, 429),
)
def confirm(said: CodeOnly, team: AppTeam, me: Me) -> RecoveryCodes:
    """Ask for a code from now on; every other session ends. The recovery codes are shown this once."""
    team.tries.count_code(me.name)
    return RecoveryCodes(codes=team.factors.confirm(me, said.code))


@router.delete(
    OWN,
    operation_id="deleteSecondFactor",
    status_code=204,
    responses=responses(401, 409, 413, 415, 429),
)
def remove(said: PasswordOnly, request: Request, team: AppTeam, me: Me) -> None:
    """Stop asking for a code; 409 where everybody needs a second factor."""
    team.count_try(request, me.name)
    team.factors.remove(me, said.password)


@router.delete(
    "/users/{user}/second-factor",
    operation_id="deleteSecondFactorOfUser",
    status_code=204,
    responses=responses(401, 404, 409),
)
def clear(user: Id, team: AppTeam, me: Me) -> None:
    """Take away the second factor of somebody who has lost it."""
    team.factors.clear(user, actor=me.actor)


@router.get("/team", operation_id="getTeam", responses=responses(401, 409))
def get_settings(team: AppTeam, _me: Me) -> TeamSettings:
    """What counts for everybody."""
    return TeamSettings(require_second_factor=team.factors.required())


@router.put("/team", operation_id="changeTeam", responses=responses(401, 409, 413, 415))
def put_settings(wanted: TeamSettings, team: AppTeam, me: Me) -> TeamSettings:
    """Let everybody need a second factor, or not; whoever has none makes one before anything else."""
    team.factors.require(wanted.require_second_factor, actor=me.actor)
    return wanted
