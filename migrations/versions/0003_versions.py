"""Frozen dataset versions."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0003"
down_revision: str | None = "0002"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

DATASET_IS_THERE = "WHEN EXISTS (SELECT 1 FROM dataset WHERE id = OLD.dataset_id)"
VERSION_IS_THERE = "WHEN EXISTS (SELECT 1 FROM version WHERE id = {row}.version_id)"
BODY_IS_THERE = (
    "WHEN OLD.body IS NOT NULL OR OLD.key IS NOT NEW.key OR OLD.dataset_id IS NOT NEW.dataset_id"
)
VERSION_IS_KNOWN = (
    "WHEN EXISTS (SELECT 1 FROM version "
    "WHERE id = NEW.id OR (dataset_id = NEW.dataset_id AND name = NEW.name))"
)


def upgrade() -> None:
    op.create_table(
        "version",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("note", sa.String(), nullable=False),
        sa.Column("licence", sa.String(), nullable=False),
        sa.Column("created", sa.String(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("hash", sa.String(), nullable=False),
        sa.Column("groups", sa.String(), nullable=False),
        sa.Column("policy", sa.String(), nullable=False),
        sa.Column("policy_hash", sa.String(), nullable=False),
        sa.Column("solver_version", sa.String(), nullable=False),
        sa.Column("software_version", sa.String(), nullable=False),
        sa.Column("split", sa.String(), nullable=False),
        sa.Column("counts", sa.String(), nullable=False),
        sa.Column("previous", sa.Integer(), nullable=True),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("dataset_id", "name", name="version_name"),
    )
    op.create_table(
        "version_group",
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("match", sa.String(), nullable=False),
        sa.Column("member", sa.Boolean(), nullable=False),
        sa.Column("why", sa.String(), nullable=True),
        sa.Column("split", sa.String(), nullable=False),
        sa.Column("splits", sa.String(), nullable=True),
        sa.Column("verdict", sa.String(), nullable=True),
        sa.Column("said", sa.String(), nullable=True),
        sa.Column("solution", sa.String(), nullable=True),
        sa.Column("ball", sa.String(), nullable=True),
        sa.Column("frames", sa.LargeBinary(), nullable=True),
        # The version's own row comes last and seals it.
        sa.ForeignKeyConstraint(
            ["version_id"],
            ["version.id"],
            ondelete="CASCADE",
            deferrable=True,
            initially="DEFERRED",
        ),
        sa.PrimaryKeyConstraint("version_id", "position"),
        sa.UniqueConstraint("version_id", "key", name="version_group_key"),
    )
    op.create_table(
        "frozen",
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("body", sa.LargeBinary(), nullable=True),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("dataset_id", "key"),
    )
    for table in ("version", "version_group"):
        refuse(table, "UPDATE")
    refuse("frozen", "UPDATE", BODY_IS_THERE)
    refuse("version", "DELETE", DATASET_IS_THERE)
    refuse("frozen", "DELETE", DATASET_IS_THERE)
    refuse("version_group", "DELETE", VERSION_IS_THERE.format(row="OLD"))
    # INSERT OR REPLACE deletes without asking a DELETE trigger.
    refuse("version", "INSERT", VERSION_IS_KNOWN)
    refuse("version_group", "INSERT", VERSION_IS_THERE.format(row="NEW"))
    op.execute(
        "CREATE TRIGGER frozen_keeps_what_it_has BEFORE INSERT ON frozen WHEN EXISTS "
        "(SELECT 1 FROM frozen WHERE dataset_id = NEW.dataset_id AND key = NEW.key) "
        "BEGIN SELECT RAISE(IGNORE); END"
    )
    # Calibrations can be deleted and computed again, but by this solver alone.
    op.execute(
        "CREATE TRIGGER calibration_stays_in_versions BEFORE DELETE ON calibration BEGIN "
        "UPDATE frozen SET body = OLD.body WHERE key = 'calibration:' || OLD.key "
        "AND dataset_id IN (SELECT id FROM dataset) AND body IS NULL; END"
    )


def refuse(table: str, verb: str, when: str = "") -> None:
    """Make the database itself refuse a statement that would change a frozen version."""
    op.execute(
        f"CREATE TRIGGER {table}_refuses_{verb.lower()} BEFORE {verb} ON {table} {when} "
        f"BEGIN SELECT RAISE(ABORT, 'a frozen version is never changed'); END"
    )
