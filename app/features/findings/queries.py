"""Findings of imports, and findings that a person has checked."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Container, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import (
    BindParameter,
    Double,
    ForeignKey,
    Index,
    Table,
    bindparam,
    delete,
    insert,
    literal,
    null,
    select,
    union_all,
)
from sqlalchemy import cast as cast_to
from sqlalchemy.orm import Mapped, mapped_column

from app.db.dialects.dialect import select_from_number_list
from app.db.json_columns import parse_json_column, translate_shape_errors_to_damage
from app.db.log import NewLogEntry, append_entries
from app.db.session import Base, Session
from app.features.datasets.tables import GroupModel, ImportFindingModel, ViewModel
from app.features.groups.insert_queries import find_next_row_id
from app.features.people.visibility_queries import shown_actor_column
from app.json_text import canonical_json_text
from app.soccer.finding import (
    PICTURE_GEOMETRY,
    PITCH_SIZE,
    TRACK_DISAGREES,
    Dismissal,
    Finding,
    FindingWithBallPlace,
    SuggestedFix,
)

SEEN = (PITCH_SIZE, PICTURE_GEOMETRY, TRACK_DISAGREES)
"""Kinds that stand beside what imports noticed and are in no log: computed, or seen of pictures."""
Noticed = tuple[str | None, str]
"""Key of a view, or None where the whole group is meant; and the sentence."""
DISMISSAL = "dismissal"
"""Kind of the log's entries."""


class DismissalModel(Base):
    """A finding of a group that somebody dismissed, or (``dismissed`` false) opened again.

    ``kind``, ``view``, ``marking`` and ``suggested`` name the finding; ``number`` and ``sentence``
    are what it said: where it says something else now, the dismissal no longer counts.
    """

    __tablename__ = "dismissal"
    __table_args__ = (Index("dismissal_group", "group_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    actor: Mapped[str]
    at: Mapped[str]
    kind: Mapped[str]
    view: Mapped[str | None]
    marking: Mapped[str | None]
    suggested: Mapped[str | None]
    number: Mapped[float | None] = mapped_column(Double)
    sentence: Mapped[str]
    dismissed: Mapped[bool]
    note: Mapped[str | None]


def findings_from_rows(rows: Iterable[Any], inputs_hash: str) -> list[Finding]:
    """The stored findings of a group in its present state.

    Args:
        rows: Of the group, as ``read_import_findings_and_dismissals`` has them.
        inputs_hash: Of the group now; what was said of another state of it is left out.
    """
    return [_finding_from_row(row) for row in rows if row.of_inputs in (None, inputs_hash)]


def _finding_from_row(row: Any) -> Finding:
    if row.kind != TRACK_DISAGREES:
        return Finding(row.kind, row.sentence, view=row.view)
    with translate_shape_errors_to_damage():
        place = None if row.place is None else tuple(parse_json_column(row.place))
    fix = SuggestedFix("move_ball" if place else "exclude_view", row.view)
    return FindingWithBallPlace(
        row.kind, row.sentence, view=row.view, number=row.number, fix=fix, place=place
    )


def list_group_import_findings(session: Session, group_id: int) -> list[Noticed]:
    """What is noticed about a group, in the order in which it was."""
    model = ImportFindingModel
    statement = select(model.view, model.sentence).where(
        model.group_id == group_id, model.kind.not_in(SEEN)
    )
    return [(row.view, row.sentence) for row in session.execute(statement.order_by(model.id))]


def filter_groups_with_finding(session: Session, ids: Collection[int], sentence: str) -> set[int]:
    """The groups among them that have a finding about the whole group."""
    model = ImportFindingModel
    statement = select(model.group_id).where(
        model.group_id.in_(select_from_number_list(ids)),
        model.view.is_(None),
        model.sentence == sentence,
    )
    return {number for number in session.scalars(statement) if number is not None}


def add_group_findings(
    session: Session, kind: str, noticed: Iterable[tuple[int, str | None, str]]
) -> None:
    """Insert findings: group, view and sentence of each."""
    rows = [
        {"group_id": group, "view": view, "kind": kind, "sentence": sentence}
        for group, view, sentence in noticed
    ]
    if rows:
        session.execute(insert(ImportFindingModel), rows)


def replace_group_import_findings(
    session: Session, group_id: int, kind: str, noticed: Iterable[Noticed]
) -> None:
    """Put findings in the place of all that imports noticed about a group."""
    model = ImportFindingModel
    session.execute(delete(model).where(model.group_id == group_id, model.kind.not_in(SEEN)))
    add_group_findings(session, kind, ((group_id, view, text) for view, text in noticed))


def find_station_finding(session: Session, station_id: int) -> str | None:
    """The sentence of the import finding of a static camera; None where there is none."""
    model = ImportFindingModel
    return session.scalar(select(model.sentence).where(model.station_id == station_id))


def replace_station_finding(
    session: Session, station_id: int, kind: str, sentence: str | None
) -> None:
    """Put a finding (or none) in the place of the one that a static camera has."""
    model = ImportFindingModel
    session.execute(delete(model).where(model.station_id == station_id))
    if sentence is not None:
        values = {"station_id": station_id, "kind": kind, "sentence": sentence}
        session.execute(insert(model), [values])


def replace_picture_shape_findings(
    session: Session, dataset_id: int, keys: Collection[str], found: Iterable[tuple[str, str, str]]
) -> list[int]:
    """Put findings about the shapes of pictures in the place of those that groups have.

    Args:
        session: Of a write.
        dataset_id: The dataset.
        keys: Of the groups whose pictures were looked at; other groups keep theirs.
        found: Key of the group, key of the view and sentence of each.

    Returns:
        Ids of the groups concerned.
    """
    model, wanted = ImportFindingModel, set(found)
    mine = select(GroupModel.id, GroupModel.key).where(GroupModel.dataset_id == dataset_id)
    has = select(model.id, model.group_id, model.view, model.sentence, GroupModel.key)
    has = has.join(GroupModel, GroupModel.id == model.group_id).where(
        GroupModel.dataset_id == dataset_id, model.kind == PICTURE_GEOMETRY
    )
    looked = set(keys)
    present = {
        (row.key, row.view, row.sentence): row for row in session.execute(has) if row.key in looked
    }
    gone = [row for key, row in present.items() if key not in wanted]
    fresh = sorted(wanted - present.keys())
    ids = {row.key: row.id for row in session.execute(mine)} if fresh else {}
    if gone:
        session.execute(
            delete(model).where(model.id.in_(select_from_number_list(row.id for row in gone)))
        )
    rows = [(ids[group], view, text) for group, view, text in fresh if group in ids]
    add_group_findings(session, PICTURE_GEOMETRY, rows)
    return sorted({row.group_id for row in gone} | {row[0] for row in rows})


@dataclass(frozen=True)
class UnexplainedBall:
    """A ball that a track does not explain, as it is stored.

    Attributes:
        group_id: Of the group.
        view: Key of the view.
        sentence: What is wrong.
        number: How far from the track, pixels.
        place: Where the track is seen, pixels; None where it is not.
        of_inputs: Hash of the group that shows it there.
    """

    group_id: int
    view: str
    sentence: str
    number: float
    place: tuple[float, float] | None
    of_inputs: str


def replace_unexplained_ball_findings(
    session: Session,
    dataset_id: int,
    matches: Collection[str],
    groups: Container[int] | None,
    found: Iterable[UnexplainedBall],
) -> list[int]:
    """Put balls that tracks do not explain in the place of those that groups have.

    Args:
        session: Of a write.
        dataset_id: The dataset.
        matches: Of the groups.
        groups: Ids of those that are asked about; None: all of the matches.
        found: All of them; what is there already is not written again, nor of groups that are no more.

    Returns:
        Ids of the groups concerned.
    """
    model = ImportFindingModel
    columns = (model.group_id, model.view, model.sentence, model.number, model.place)
    statement = (
        select(model.id, *columns, model.of_inputs)
        .join(GroupModel, GroupModel.id == model.group_id)
        .where(GroupModel.dataset_id == dataset_id, GroupModel.match.in_(list(matches)))
        .where(model.kind == TRACK_DISAGREES)
    )
    present: dict[tuple[Any, ...], int] = {
        tuple(row[1:]): row.id
        for row in session.execute(statement)
        if groups is None or row.group_id in groups
    }
    # One that was read before this write may be gone.
    there = set(
        session.scalars(
            select(GroupModel.id).where(
                GroupModel.dataset_id == dataset_id, GroupModel.match.in_(list(matches))
            )
        )
    )
    wanted: set[tuple[Any, ...]] = {
        (
            *(item.group_id, item.view, item.sentence, item.number),
            *(None if item.place is None else canonical_json_text(item.place), item.of_inputs),
        )
        for item in found
        if item.group_id in there
    }
    gone = [number for key, number in present.items() if key not in wanted]
    if gone:
        session.execute(delete(model).where(model.id.in_(select_from_number_list(gone))))
    names = ("group_id", "view", "sentence", "number", "place", "of_inputs")
    fresh = sorted(wanted - present.keys(), key=lambda key: (key[0], str(key[1])))
    if fresh:
        rows = [dict(zip(names, key, strict=True)) | {"kind": TRACK_DISAGREES} for key in fresh]
        session.execute(insert(model), rows)
    return sorted({key[0] for key in present.keys() ^ wanted})


_TABLE = cast(Table, DismissalModel.__table__)
SHOWN = (
    *(_TABLE.c[name] for name in ("marking", "suggested", "number", "at", "dismissed", "note")),
    shown_actor_column(_TABLE.c.actor, _TABLE.c.at).label("actor"),
)
"""What ``current_dismissals_by_group`` asks of a row besides ``group``, ``id``, ``kind``, ``view`` and ``sentence``."""


@dataclass(frozen=True)
class GroupDismissals:
    """What people dismissed in a group.

    Attributes:
        last: Id of the newest row; 0: nobody dismissed anything, ever.
        standing: The dismissals that were not taken back.
    """

    last: int = 0
    standing: tuple[Dismissal, ...] = ()

    def find_dismissals(self, findings: Sequence[Finding]) -> tuple[Dismissal | None, ...]:
        """The dismissal of each finding; None: it is open."""
        return tuple(
            next((item for item in self.standing if item.covers(finding)), None)
            for finding in findings
        )


NOTHING_DISMISSED = GroupDismissals()
"""Of a group in which nobody ever dismissed anything."""


def current_dismissals_by_group(rows: Iterable[Any]) -> dict[int, GroupDismissals]:
    """What people dismissed, by group id; groups in which nobody ever did are left out.

    ``rows`` are those of the table, the oldest first (``read_import_findings_and_dismissals`` reads them).
    """
    found: dict[int, GroupDismissals] = {}
    for row in rows:
        names = (row.kind, row.view, row.marking, row.suggested)
        dismissal = Dismissal(*names, row.number, row.sentence, row.actor, row.at, row.note)
        before = found.get(row.group, NOTHING_DISMISSED).standing
        others = tuple(item for item in before if not item.covers(dismissal))
        found[row.group] = GroupDismissals(
            row.id, (*others, dismissal) if row.dismissed else others
        )
    return found


MERGED_COLUMNS = tuple(
    column.name for column in _TABLE.columns if column.name not in ("id", "group_id")
)
"""What is carried of a row to another installation."""


def read_dismissals_to_export(
    session: Session, ids: Iterable[int]
) -> dict[int, list[dict[str, Any]]]:
    """The dismissals of groups to export, by group, oldest first."""
    columns = [_TABLE.c[name] for name in MERGED_COLUMNS]
    statement = select(_TABLE.c.group_id, *columns).where(_TABLE.c.group_id.in_(list(ids)))
    found: dict[int, list[dict[str, Any]]] = {}
    for group_id, *values in session.execute(statement.order_by(_TABLE.c.id)):
        found.setdefault(group_id, []).append(dict(zip(MERGED_COLUMNS, values, strict=True)))
    return found


def insert_dismissal(
    session: Session,
    dataset_id: int,
    group_id: int,
    dismissal: Dismissal,
    *,
    dismissed: bool,
    brought: tuple[str, str] | None = None,
) -> int:
    """Insert that a finding was dismissed, or opened again, and log it; returns the row's id.

    ``brought`` is who brought it from another installation, and when; the log has it under them.
    """
    identity = find_next_row_id(session, DismissalModel)
    body = {name: value for name, value in vars(dismissal).items() if name not in ("actor", "at")}
    body |= {"dismissed": dismissed}
    row = {
        "id": identity,
        "group_id": group_id,
        "actor": dismissal.actor,
        "at": dismissal.at,
        **body,
    }
    session.execute(insert(_TABLE), [row])
    actor, at = brought or (dismissal.actor, dismissal.at)
    if brought is not None:
        body |= {"actor": dismissal.actor, "at": dismissal.at}
    append_entries(session, [NewLogEntry(DISMISSAL, actor, at, body, dataset_id, group_id)])
    return identity


def split_open_and_dismissed_kinds(
    findings: Sequence[Finding], dismissals: GroupDismissals
) -> tuple[list[str], list[str]]:
    """Kinds of findings that are open, and of those that are dismissed; a kind may be both."""
    found = dismissals.find_dismissals(findings)
    pairs = list(zip(findings, found, strict=True))
    opened = dict.fromkeys(finding.kind for finding, dismissal in pairs if dismissal is None)
    closed = dict.fromkeys(finding.kind for finding, dismissal in pairs if dismissal is not None)
    return list(opened), list(closed)


_DISMISSED = 2
"""Where rows of ``_NOTICED`` are dismissals."""
_NOTICE = ImportFindingModel.__table__
_VIEW = ViewModel.__table__
_IDS: BindParameter[Any] = bindparam("ids", expanding=True)
_CHECKED = DismissalModel.__table__
_UNKNOWN = [
    _NOTICE.c.number if column.name == "number" else cast_to(null(), column.type).label(column.name)
    for column in SHOWN
]
_SAID_OF = [_NOTICE.c.place, _NOTICE.c.of_inputs]
_NOTICED = union_all(
    select(
        _NOTICE.c.group_id.label("group"),
        _NOTICE.c.kind,
        _NOTICE.c.sentence,
        _NOTICE.c.view,
        literal(0).label("source"),
        _NOTICE.c.id,
        *_UNKNOWN,
        *_SAID_OF,
    ).where(_NOTICE.c.group_id.in_(_IDS)),
    select(
        *(_VIEW.c.group_id, _NOTICE.c.kind, _NOTICE.c.sentence, _VIEW.c.key, literal(1)),
        *(_NOTICE.c.id, *_UNKNOWN, *_SAID_OF),
    )
    .join_from(_VIEW, _NOTICE, _NOTICE.c.station_id == _VIEW.c.station_id)
    .where(_VIEW.c.group_id.in_(_IDS)),
    select(
        *(_CHECKED.c.group_id, _CHECKED.c.kind, _CHECKED.c.sentence, _CHECKED.c.view, literal(2)),
        *(_CHECKED.c.id, *SHOWN, *(cast_to(null(), column.type) for column in _SAID_OF)),
    ).where(_CHECKED.c.group_id.in_(_IDS)),
).order_by("source", "id")
"""A group's own come before those of its static cameras; then what people have dismissed."""


def read_import_findings_and_dismissals(
    session: Session, ids: Sequence[int]
) -> tuple[dict[int, list[Any]], dict[int, GroupDismissals]]:
    """What imports noticed about groups and about the shared stations of their views, and which
    findings people have dismissed, in one statement.

    Returns:
        Rows for ``findings_from_rows``, and what was dismissed, by group id.
    """
    rows = session.execute(_NOTICED, {"ids": list(ids)}).all()
    found: dict[int, list[Any]] = defaultdict(list)
    for row in rows:
        if row.source != _DISMISSED:
            found[row.group].append(row)
    return found, current_dismissals_by_group(row for row in rows if row.source == _DISMISSED)


def read_import_notices(session: Session, ids: Sequence[int]) -> dict[int, list[Any]]:
    """The first part of ``read_import_findings_and_dismissals``."""
    return read_import_findings_and_dismissals(session, ids)[0]
