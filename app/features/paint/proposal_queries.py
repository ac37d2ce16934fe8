"""Proposals in the database: what was proposed for views without a camera, and which are open.

A proposal is open while its view has no given camera, and no lines, or those beside which it was
made because they determined no camera. What was accepted stays, so that undo opens it again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, cast

from sqlalchemy import ColumnElement, Select, Table, and_, case, delete, func, or_, select
from sqlalchemy.orm import aliased

from app.db.dialects.dialect import insert, select_from_number_list, select_json_array_items
from app.db.json_columns import parse_json_column, translate_shape_errors_to_damage
from app.db.session import Session
from app.features.datasets.tables import DatasetModel, GroupModel, StationModel, ViewModel
from app.features.paint.queries import ProposalModel
from app.features.queue.tables import QueueModel
from app.features.solutions.queries import (
    SolutionModel,
    is_current_solution,
    list_undetermined_calibrations,
)
from app.json_text import canonical_json_text
from app.soccer.annotation import Lines
from app.soccer.codec import lines_from_json, lines_to_json
from app.soccer.paint_evidence import PROPOSAL_OUTCOMES

_PROPOSAL = cast(Table, ProposalModel.__table__)
_BATCH = 500


@dataclass(frozen=True)
class Proposal:
    """What was proposed for one view when its picture was looked at last.

    Attributes:
        outcome: ``proposed``, ``unsure`` or ``nothing``.
        sentence: Why no lines are proposed, or which drawn lines contradict the proposal; else empty.
        lines: Points on the paint of markings that nobody drew, pixels of the annotated size; none
            unless proposed.
        supported, explained, points, error_px, runner_up: As of ``ViewProposal``.
        frame: Digest of the picture's bytes; empty where there were none.
        sought_with: Digest of what else was known then.
        version: Of what read the picture.
        beside: Digest of the station that had lines then, which determined no camera; else empty.
    """

    view_id: int
    outcome: str
    sentence: str
    lines: Lines
    supported: float | None
    explained: float | None
    points: int
    error_px: float | None
    runner_up: float | None
    frame: str
    sought_with: str
    version: str
    beside: str = ""


@dataclass(frozen=True)
class MatchProposalCounts:
    """How far the views of one match are.

    Attributes:
        match: Name of the match.
        views: Without a camera, given or of their lines, and with a picture; static cameras count
            once.
        looked: How many of them were looked at as they are now; ``proposed``, ``unsure`` and
            ``nothing`` add up to it.
        proposed: For how many of those lines are proposed.
        unsure: For how many a camera was found that may be another's.
        nothing: For how many there was none, or no picture.
        accepted: Views whose lines are as they were proposed, at least in part.
    """

    match: str
    views: int
    looked: int
    proposed: int
    unsure: int
    nothing: int
    accepted: int


def _has_no_lines_or_camera() -> ColumnElement[bool]:
    return and_(StationModel.lines == "{}", StationModel.given.is_(None))


def _is_open_proposal() -> ColumnElement[bool]:
    """Whether a view is as it was when it was looked at, as far as lines and camera go."""
    beside = ProposalModel.beside
    return or_(
        and_(_has_no_lines_or_camera(), beside == ""),
        and_(beside != "", beside == StationModel.digest),
    )


def _needs_proposal(lost: Collection[int]) -> ColumnElement[bool]:
    """Whether a view is one to look at: of a static camera that is the first with a picture.

    Args:
        lost: Ids of the views to look at whose lines determine no camera (``list_views_with_undetermined_lines``).
    """
    view, station = aliased(ViewModel), aliased(StationModel)
    # One look at all of them: asked view by view, a camera of many views would cost their square.
    first = (
        select(func.min(view.id))
        .join(station, station.id == view.station_id)
        .where(station.shared, station.lines == "{}", view.media_path.is_not(None))
        .group_by(view.station_id)
    )
    alone = or_(StationModel.shared.is_(False), ViewModel.id.in_(first))
    bare = and_(_has_no_lines_or_camera(), ViewModel.media_path.is_not(None), alone)
    return or_(bare, ViewModel.id.in_(select_from_number_list(sorted(lost))))


def list_views_with_undetermined_lines(
    session: Session, dataset_id: int, matches: Collection[str] | None = None
) -> set[int]:
    """Ids of views with a picture and lines that determine no camera, as they are solved now.

    Of a static camera the first one. Groups that wait to be solved have none.
    """
    named = select_json_array_items(SolutionModel.calibrations)
    statement = (
        select(ViewModel.id, ViewModel.station_id, named.c.value.label("calibration"))
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .join(QueueModel, QueueModel.group_id == GroupModel.id)
        .join(SolutionModel, is_current_solution())
        .join(named, named.c.key == ViewModel.position)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(
            GroupModel.dataset_id == dataset_id,
            # The finding of such views, told of their groups: the others need not be looked at.
            QueueModel.findings.contains(",under_constrained,"),
            StationModel.lines != "{}",
            StationModel.given.is_(None),
            ViewModel.media_path.is_not(None),
        )
        .order_by(ViewModel.id.desc())
    )
    if matches is not None:
        statement = statement.where(GroupModel.match.in_(matches))
    rows = session.execute(statement).all()
    left_open = list_undetermined_calibrations(session, {row.calibration for row in rows})
    return set({row.station_id: row.id for row in rows if row.calibration in left_open}.values())


def select_groups_with_open_proposal(outcome: str | None = None) -> Select[Any]:
    """Ids of the groups with an open proposal, of that outcome where one is named."""
    statement = (
        select(ViewModel.group_id)
        .join(ProposalModel, ProposalModel.view_id == ViewModel.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(_is_open_proposal())
    )
    return statement if outcome is None else statement.where(ProposalModel.outcome == outcome)


def list_views_to_propose_for(
    session: Session, dataset_id: int, matches: Collection[str] | None = None
) -> list[tuple[int, list[int]]]:
    """Groups with the ids of those of their views that have no camera but a picture.

    Args:
        session: Any session.
        dataset_id: The dataset.
        matches: By name; None: all.
    """
    lost = list_views_with_undetermined_lines(session, dataset_id, matches)
    statement = (
        select(ViewModel.group_id, ViewModel.id)
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(GroupModel.dataset_id == dataset_id, _needs_proposal(lost))
        .order_by(GroupModel.match, GroupModel.number, ViewModel.position)
    )
    if matches is not None:
        statement = statement.where(GroupModel.match.in_(matches))
    found: dict[int, list[int]] = {}
    for group, view in session.execute(statement):
        found.setdefault(group, []).append(view)
    return list(found.items())


def count_proposals_by_match(
    session: Session, dataset_id: int, matches: Collection[str] | None = None
) -> list[MatchProposalCounts]:
    """How far each match of a dataset is, or each of these, by name."""
    lost = list_views_with_undetermined_lines(session, dataset_id, matches)
    is_candidate, outcome = _needs_proposal(lost), ProposalModel.outcome
    # What was said of a view as it was before says nothing of it now.
    looked = and_(is_candidate, _is_open_proposal())

    def count_where(*conditions: ColumnElement[bool]) -> ColumnElement[int]:
        return func.coalesce(func.sum(case((and_(*conditions), 1), else_=0)), 0)

    statement = (
        select(
            GroupModel.match,
            count_where(is_candidate),
            count_where(looked),
            *(count_where(looked, outcome == name) for name in PROPOSAL_OUTCOMES),
            count_where(outcome == "proposed", StationModel.proposed.is_not(None)),
        )
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .outerjoin(ProposalModel, ProposalModel.view_id == ViewModel.id)
        .where(GroupModel.dataset_id == dataset_id)
        .group_by(GroupModel.match)
        .order_by(GroupModel.match)
    )
    if matches is not None:
        statement = statement.where(GroupModel.match.in_(matches))
    rows: Iterable[Any] = session.execute(statement)
    return [MatchProposalCounts(*row) for row in rows]


def read_proposals(session: Session, views: Iterable[int]) -> dict[int, Proposal]:
    """What was proposed for views, by id; those that nobody looked at are left out."""
    wanted, found = sorted(set(views)), {}
    for start in range(0, len(wanted), _BATCH):
        some = wanted[start : start + _BATCH]
        for row in session.execute(select(_PROPOSAL).where(_PROPOSAL.c.view_id.in_(some))):
            found[row.view_id] = _proposal_from_row(row)
    return found


def read_group_proposals(session: Session, group_id: int) -> list[tuple[str, bool, Proposal]]:
    """Key of the view, whether it is open, and the proposal, in the order of a group's views."""
    statement = (
        select(ViewModel.key, _is_open_proposal().label("open"), *_PROPOSAL.columns)
        .join(_PROPOSAL, _PROPOSAL.c.view_id == ViewModel.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(ViewModel.group_id == group_id)
        .order_by(ViewModel.position)
    )
    return [
        (row.key, bool(row.open), _proposal_from_row(row)) for row in session.execute(statement)
    ]


def save_proposals(session: Session, proposals: Sequence[Proposal]) -> None:
    """Put proposals in the place of what their views had; views that are gone are passed over."""
    ids = select(ViewModel.id).where(
        ViewModel.id.in_(select_from_number_list(item.view_id for item in proposals))
    )
    present = set(session.scalars(ids))
    rows = [
        {**asdict(item), "lines": canonical_json_text(lines_to_json(item.lines))}
        for item in proposals
        if item.view_id in present
    ]
    if rows:
        statement = insert(_PROPOSAL)
        changed = {name: statement.excluded[name] for name in rows[0] if name != "view_id"}
        session.execute(
            statement.on_conflict_do_update(index_elements=["view_id"], set_=changed), rows
        )


def delete_proposals(session: Session, dataset_id: int) -> int:
    """Forget what was proposed for a dataset's views; how many that were."""
    mine = (
        select(ViewModel.id)
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .where(GroupModel.dataset_id == dataset_id)
    )
    gone = session.execute(delete(_PROPOSAL).where(_PROPOSAL.c.view_id.in_(mine)))
    return int(cast(Any, gone).rowcount)


def _proposal_from_row(row: Any) -> Proposal:
    values = {item.name: getattr(row, item.name) for item in fields(Proposal)}
    with translate_shape_errors_to_damage():
        return Proposal(**{**values, "lines": lines_from_json(parse_json_column(row.lines))})
