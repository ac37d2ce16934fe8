"""The queue's rows: one a group, brought in step whenever something it shows has changed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from typing import Any, cast

from sqlalchemy import (
    Table,
    and_,
    bindparam,
    func,
    or_,
    select,
    update,
)

from app.db.dialects.dialect import insert_or_replace
from app.db.session import Session
from app.features.datasets.tables import (
    DatasetModel,
    GroupModel,
    StationModel,
    ViewModel,
)
from app.features.findings.queries import (
    GroupDismissals,
    findings_from_rows,
    read_import_findings_and_dismissals,
    split_open_and_dismissed_kinds,
)
from app.features.groups.queries import StoredGroup
from app.features.people.visibility_queries import shown_actor_column
from app.features.queue.tables import QueueModel
from app.features.solutions.codec import SolutionSummary
from app.features.solutions.queries import (
    SolutionKey,
    SolutionModel,
    read_solutions,
    read_summary,
    select_current_solution_id,
)
from app.features.verdicts.queries import StoredVerdict, is_group_mended
from app.features.verdicts.tables import VerdictModel
from app.soccer.finding import Finding

_BATCH = 1000
_QUEUE = cast(Table, QueueModel.__table__)
_REPLACE = insert_or_replace(_QUEUE)
_ROW = update(_QUEUE).where(_QUEUE.c.group_id == bindparam("row"))
_NUMBERS = [
    item.name for item in fields(SolutionSummary) if item.name not in ("passes", "findings")
]


def refresh_queue(session: Session, group_ids: Sequence[int]) -> None:
    """Project groups, views, verdicts and solutions onto the queue's rows, anew for each group."""
    for start in range(0, len(group_ids), _BATCH):
        _replace_rows(session, group_ids[start : start + _BATCH])


def refresh_verdict_columns(session: Session, group_ids: Sequence[int]) -> None:
    """Bring only what verdicts say in step: a fraction of the work of ``refresh_queue``."""
    for start in range(0, len(group_ids), _BATCH):
        ids = group_ids[start : start + _BATCH]
        verdicts = _read_newest_verdicts_by_group(session, ids)
        edited = filter_edited_groups(session, ids)
        heads = session.execute(
            select(GroupModel.id, GroupModel.inputs_hash, QueueModel.passes)
            .join(QueueModel, QueueModel.group_id == GroupModel.id)
            .where(GroupModel.id.in_(ids))
        )
        values = [
            {
                "of": head.id,
                **_make_verdict_columns(head, verdicts.get(head.id), edited, head.passes),
            }
            for head in heads.all()
        ]
        if values:
            session.execute(
                update(QueueModel).where(QueueModel.group_id == bindparam("of")), values
            )


def update_row(
    session: Session,
    stored: StoredGroup,
    verdict: StoredVerdict | None,
    noticed: Sequence[str],
    summary: SolutionSummary,
) -> None:
    """Bring a group's row in step whose edit and solution are at hand: nothing is read.

    Not of a group in which findings were dismissed: ``refresh_queue`` knows these.

    Args:
        session: A write session.
        stored: The group as it is now.
        verdict: The newest one.
        noticed: Kinds of what imports noticed.
        summary: Of the group's solution.
    """
    edited = {stored.id} if stored.edited else set[int]()
    values = {
        "changed": stored.changed,
        **_make_verdict_columns(stored, verdict, edited, summary.passes),
        **_make_solution_columns(summary, noticed),
    }
    session.execute(_ROW, {"row": stored.id, **values})


def update_row_verdict(
    session: Session, stored: StoredGroup, verdict: StoredVerdict, passes: bool | None
) -> None:
    """Show a new verdict in a group's row; the rest of it is in step."""
    edited = {stored.id} if stored.edited else set[int]()
    session.execute(
        _ROW, {"row": stored.id, **_make_verdict_columns(stored, verdict, edited, passes)}
    )


def find_outdated_rows(session: Session) -> tuple[int, list[int]]:
    """How many groups there are, and ids of those whose row ``refresh_queue`` would write otherwise.

    Raises:
        DamagedError: A solution's summary is not what was written.
    """
    ids = session.scalars(select(GroupModel.id).order_by(GroupModel.id)).all()
    apart: list[int] = []
    for start in range(0, len(ids), _BATCH):
        some = ids[start : start + _BATCH]
        present = session.execute(select(_QUEUE).where(_QUEUE.c.group_id.in_(some)))
        found = {row.group_id: dict(row._mapping) for row in present}
        apart += [
            row["group_id"]
            for row in _build_queue_rows(session, some)
            if row != found.get(row["group_id"])
        ]
    return len(ids), apart


def _replace_rows(session: Session, ids: Sequence[int]) -> None:
    rows = _build_queue_rows(session, ids)
    if rows:
        session.execute(_REPLACE, rows)


def _build_queue_rows(session: Session, ids: Sequence[int]) -> list[dict[str, Any]]:
    """Rows of groups as they follow from everything else."""
    views, verdicts = (
        _read_views_by_group(session, ids),
        _read_newest_verdicts_by_group(session, ids),
    )
    (findings, dismissals), edited = (
        read_import_findings_and_dismissals(session, ids),
        filter_edited_groups(session, ids),
    )
    heads = _read_groups_with_summaries(session, ids)
    own = {head.id: findings_from_rows(findings[head.id], head.inputs_hash) for head, _ in heads}
    checked = _split_findings_by_dismissal(session, dismissals, own)
    rows = []
    for head, summary in heads:
        passes = None if summary is None else summary.passes
        judged = _make_verdict_columns(head, verdicts.get(head.id), edited, passes)
        row = {**_make_group_columns(head, views[head.id]), **judged}
        row.update(_make_solution_columns(summary, [item.kind for item in own[head.id]]))
        rows.append(row | checked.get(head.id, {}))
    return rows


def _split_findings_by_dismissal(
    session: Session,
    dismissals: Mapping[int, GroupDismissals],
    noticed: Mapping[int, Sequence[Finding]],
) -> dict[int, dict[str, Any]]:
    """Which kinds of findings are open and which dismissed, of the few groups in which people have
    dismissed any: their solutions are decoded."""
    if not dismissals:
        return {}
    keys = session.execute(
        select(
            GroupModel.id,
            GroupModel.inputs_hash,
            DatasetModel.policy_hash,
            SolutionModel.solver_version,
        )
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .join(SolutionModel, SolutionModel.id == select_current_solution_id())
        .where(GroupModel.id.in_(list(dismissals)))
    )
    solutions = read_solutions(session, [SolutionKey(*key) for key in keys], markings=False)
    checked = {}
    for group, dismissed in dismissals.items():
        solved = solutions.get(group)
        found = [*(() if solved is None else solved.findings), *noticed[group]]
        opened, closed = split_open_and_dismissed_kinds(found, dismissed)
        checked[group] = {
            "findings": _join_with_commas(opened),
            "dismissed": _join_with_commas(closed),
        }
    return checked


def _read_groups_with_summaries(
    session: Session, ids: Sequence[int]
) -> list[tuple[Any, SolutionSummary | None]]:
    """Groups with the summary of the newest solution of their present state, if there is one.

    That of an earlier solver counts until the group is solved again: its numbers stay in the queue.
    """
    statement = (
        select(*GroupModel.__table__.columns, SolutionModel.summary)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .outerjoin(SolutionModel, SolutionModel.id == select_current_solution_id())
        .where(GroupModel.id.in_(ids))
    )
    return [
        (row, None if row.summary is None else read_summary(row.summary))
        for row in session.execute(statement)
    ]


def _read_views_by_group(session: Session, ids: Sequence[int]) -> dict[int, list[Any]]:
    statement = (
        select(ViewModel.group_id, ViewModel.id, ViewModel.key, ViewModel.media_path)
        .where(ViewModel.group_id.in_(ids))
        .order_by(ViewModel.position)
    )
    views: dict[int, list[Any]] = defaultdict(list)
    for row in session.execute(statement):
        views[row.group_id].append(row)
    return views


def _read_newest_verdicts_by_group(session: Session, ids: Sequence[int]) -> dict[int, Any]:
    newest = (
        select(func.max(VerdictModel.id))
        .where(VerdictModel.group_id.in_(ids))
        .group_by(VerdictModel.group_id)
    )
    plain = [column for column in VerdictModel.__table__.columns if column.name != "actor"]
    actor = shown_actor_column(VerdictModel.actor, VerdictModel.at).label("actor")
    rows = session.execute(select(*plain, actor).where(VerdictModel.id.in_(newest)))
    return {row.group_id: row for row in rows}


def _make_group_columns(head: Any, views: Sequence[Any]) -> dict[str, Any]:
    main = views[0].id if views and views[0].media_path is not None else None
    names = ("dataset_id", "number", "key", "label", "match", "split", "changed")
    return {
        **{name: getattr(head, name) for name in names},
        "group_id": head.id,
        "views": len(views),
        "pictures": sum(view.media_path is not None for view in views),
        "view_keys": _join_with_commas([view.key for view in views]),
        "main_view": main,
    }


def filter_edited_groups(session: Session, ids: Sequence[int]) -> set[int]:
    """The groups that differ from what was imported.

    A shared station is not the group's: what is drawn there counts for no group.
    """
    own = and_(StationModel.shared.is_(False), StationModel.digest != StationModel.source_digest)
    statement = (
        select(ViewModel.group_id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(ViewModel.group_id.in_(ids), or_(ViewModel.digest != ViewModel.source_digest, own))
        .distinct()
    )
    return set(session.scalars(statement))


def _make_verdict_columns(
    head: Any, verdict: Any, edited: Collection[int], passes: bool | None
) -> dict[str, Any]:
    if verdict is None or verdict.state == "unreviewed":
        nobody = dict.fromkeys(("reason", "reviewer", "override"))
        return {**nobody, "status": "unreviewed", "stale": False, "fixed": False}
    return {
        "status": verdict.state,
        "stale": verdict.inputs_hash != head.inputs_hash,
        "reason": verdict.reason,
        "reviewer": verdict.actor,
        "override": verdict.override,
        "fixed": is_group_mended(verdict, head.id in edited, passes),
    }


def _make_solution_columns(
    summary: SolutionSummary | None, noticed: Sequence[str]
) -> dict[str, Any]:
    if summary is None:
        nothing: dict[str, Any] = {**dict.fromkeys(_NUMBERS), "dismissed": ""}
        return {**nothing, "solved": False, "passes": None, "findings": _join_with_commas(noticed)}
    values = {name: getattr(summary, name) for name in _NUMBERS}
    return {
        **values,
        "passes": summary.passes,
        "solved": True,
        "findings": _join_with_commas([*summary.findings, *noticed]),
        "dismissed": "",
    }


def _join_with_commas(items: Sequence[str]) -> str:
    return f",{','.join(dict.fromkeys(items))}," if items else ""
