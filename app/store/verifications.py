"""Verification: what came of verifying a version the last time, kept with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import select

from app.canonical import canonical
from app.soccer.solution import SOLVER_VERSION
from app.store.clock import now
from app.store.dialect.statements import insert_or_replace
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json, parse
from app.store.tables.versions import VersionCheckModel


@dataclass(frozen=True)
class Verification:
    """The last time that a version was computed once more.

    Attributes:
        at: When it ended.
        actor: Who asked for it.
        solver_version: Of the solver that computed.
        report: As ``VerifyReport.values`` has it; None where nothing came of it.
        problem: Why nothing came of it, else None.
    """

    at: str
    actor: str
    solver_version: str
    report: Json
    problem: str | None


def keep_verification(
    store: Store, version_id: int, *, actor: str, report: Json = None, problem: str | None = None
) -> None:
    """Keep what came of verifying a version, in the place of what came of it before."""
    values = {
        "version_id": version_id,
        "at": now(),
        "actor": actor,
        "solver_version": SOLVER_VERSION,
        "report": None if report is None else canonical(report),
        "problem": problem,
    }
    statement = insert_or_replace(VersionCheckModel)
    with store.write() as session:
        session.execute(statement, [values], execution_options={"render_nulls": True})


def read_verifications(session: Session, versions: list[int]) -> dict[int, Verification]:
    """The last verification of versions, by id; those that nobody verified are left out."""
    model = VersionCheckModel
    statement = select(*model.__table__.columns).where(model.version_id.in_(versions))
    return {row.version_id: _verification(row) for row in session.execute(statement)}


def _verification(row: Any) -> Verification:
    report = None if row.report is None else parse(row.report)
    return Verification(row.at, row.actor, row.solver_version, report, row.problem)
