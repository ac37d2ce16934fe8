"""Saved views, batches of verdicts, places in the queue, and datasets that can be deleted."""

import json
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import sqlalchemy as sa
from alembic import op

revision: str = "0005"
down_revision: str | None = "0004"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

PLACES = ("distance_m", "box_px", "x_m", "y_m")
CHUNK = 500
FROZEN = "BEGIN SELECT RAISE(ABORT, 'rows of {table} are never changed'); END"


def upgrade() -> None:
    op.create_table(
        "saved_view",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("query", sa.String(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("created", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"]),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("dataset_id", "name", name="saved_view_name"),
    )
    op.create_table(
        "verdict_batch",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("at", sa.String(), nullable=False),
        sa.Column("query", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=True),
        sa.Column("note", sa.String(), nullable=True),
        sa.Column("changed", sa.Integer(), nullable=False),
        sa.Column("spans", sa.String(), nullable=False),
        sa.Column("log_id", sa.Integer(), nullable=True),
        sa.Column("undone", sa.String(), nullable=True),
        sa.Column("undone_by", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"]),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("verdict_batch_dataset", "verdict_batch", ["dataset_id", "id"])
    op.create_table(
        "used_id",
        sa.Column("table", sa.String(), nullable=False),
        sa.Column("id", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("table"),
    )
    _let_deleted_datasets_go()
    for name in PLACES:
        op.add_column("queue", sa.Column(name, sa.Double(), nullable=True))
    _fill_places()


def _let_deleted_datasets_go() -> None:
    """Verdicts may go with their dataset, once the log says that it was deleted."""
    op.create_index(
        "log_deleted", "log", ["dataset_id"], sqlite_where=sa.text("kind = 'dataset_deleted'")
    )
    op.execute("DROP TRIGGER verdict_refuses_delete")
    op.execute(
        "CREATE TRIGGER verdict_refuses_delete BEFORE DELETE ON verdict WHEN NOT EXISTS "
        "(SELECT 1 FROM groups JOIN log ON log.dataset_id = groups.dataset_id "
        "WHERE groups.id = OLD.group_id AND log.kind = 'dataset_deleted') "
        + FROZEN.format(table="verdict")
    )


def _fill_places() -> None:
    """Where each ball is, into the summaries of solutions and from there into the queue.

    Solutions are never changed but here: their summary gains what it would have had.
    """
    connection = op.get_bind()
    op.execute("DROP TRIGGER solution_refuses_update")
    statement = sa.text("UPDATE solution SET summary = :summary WHERE id = :id")
    for rows in _chunks(connection):
        balls = _balls(connection, {row.group_id for row in rows})
        cameras = _cameras(connection, rows)
        values = [
            {"id": row.id, "summary": _summary(row, balls.get(row.group_id, {}), cameras)}
            for row in rows
        ]
        connection.execute(statement, values)
    op.execute(
        "CREATE TRIGGER solution_refuses_update BEFORE UPDATE ON solution "
        + FROZEN.format(table="solution")
    )
    found = ", ".join(f"json_extract(s.summary, '$.{name}') AS {name}" for name in PLACES)
    set_ = ", ".join(f"{name} = found.{name}" for name in PLACES)
    op.execute(
        f"UPDATE queue SET {set_} FROM (SELECT s.group_id, {found} FROM solution s "
        "JOIN groups g ON g.id = s.group_id AND g.inputs_hash = s.inputs_hash "
        "JOIN dataset d ON d.id = g.dataset_id AND d.policy_hash = s.policy_hash) AS found "
        "WHERE found.group_id = queue.group_id AND queue.solved"
    )


def _chunks(connection: sa.Connection) -> Iterator[Sequence[Any]]:
    statement = sa.text(
        "SELECT id, group_id, calibrations, summary, body FROM solution "
        "WHERE id > :after ORDER BY id LIMIT :count"
    )
    after = 0
    while rows := connection.execute(statement, {"after": after, "count": CHUNK}).all():
        yield rows
        after = rows[-1].id


def _balls(connection: sa.Connection, groups: set[int]) -> dict[int, dict[str, float | None]]:
    """Annotated diameter of each view with one ball, by group and key of the view."""
    statement = sa.text(
        "SELECT group_id, key, balls FROM view WHERE included AND group_id IN :ids "
        "ORDER BY group_id, position"
    ).bindparams(sa.bindparam("ids", expanding=True))
    found: dict[int, dict[str, float | None]] = {}
    for row in connection.execute(statement, {"ids": sorted(groups)}):
        seen = [ball for ball in json.loads(row.balls) if not ball["out_of_view"]]
        if len(seen) == 1:
            box = seen[0]["box"]
            diameter = None if box is None else (box[2] + box[3]) / 2
            found.setdefault(row.group_id, {})[row.key] = diameter
    return found


def _cameras(connection: sa.Connection, rows: Sequence[Any]) -> dict[str, list[float]]:
    """Position of each camera by the key of its calibration."""
    keys = {key for row in rows for key in json.loads(row.calibrations)}
    statement = sa.text("SELECT key, body FROM calibration WHERE key IN :keys").bindparams(
        sa.bindparam("keys", expanding=True)
    )
    found = {}
    for row in connection.execute(statement, {"keys": sorted(keys)}):
        camera = json.loads(zlib.decompress(row.body))["camera"]
        if camera is not None:
            found[row.key] = camera["position"]
    return found


def _summary(
    row: Any, balls: Mapping[str, float | None], cameras: Mapping[str, list[float]]
) -> str:
    summary = json.loads(row.summary)
    body = json.loads(zlib.decompress(row.body))
    annotated = [diameter for diameter in balls.values() if diameter is not None]
    places = dict.fromkeys(PLACES, None)
    places["box_px"] = annotated[0] if annotated else None
    if body["ball"] is not None:
        x, y, z = map(float, body["ball"]["point"])
        first = next(view for view in body["views"] if view["view"] == body["ball"]["views"][0])
        places |= {"x_m": x, "y_m": y, "box_px": balls.get(first["view"])}
        places["distance_m"] = math.dist((x, y, z), cameras[first["calibration_key"]])
        if places["box_px"] is None and first["ball"] is not None:
            places["box_px"] = first["ball"]["optimized_diameter_px"]
    return json.dumps({**summary, **places}, separators=(",", ":"), allow_nan=False)
