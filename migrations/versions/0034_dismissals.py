"""Findings that a person has checked and dismissed."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0034"
down_revision: str | None = "0033"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "dismissal",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("group_id", sa.Integer(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("at", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("view", sa.String(), nullable=True),
        sa.Column("marking", sa.String(), nullable=True),
        sa.Column("suggested", sa.String(), nullable=True),
        sa.Column("number", sa.Double(), nullable=True),
        sa.Column("sentence", sa.String(), nullable=False),
        sa.Column("dismissed", sa.Boolean(), nullable=False),
        sa.Column("note", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(["group_id"], ["groups.id"]),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("dismissal_group", "dismissal", ["group_id", "id"])
    refuse("UPDATE")
    # Dismissals may go with their dataset, once the log says that it was deleted.
    refuse(
        "DELETE",
        "WHEN NOT EXISTS (SELECT 1 FROM groups JOIN log ON log.dataset_id = groups.dataset_id "
        "WHERE groups.id = OLD.group_id AND log.kind = 'dataset_deleted')",
    )
    # INSERT OR REPLACE deletes without asking a DELETE trigger.
    refuse("INSERT", "WHEN NEW.id <= (SELECT max(id) FROM dismissal)")
    dismissed = sa.Column("dismissed", sa.String(), server_default="", nullable=False)
    op.add_column("queue", dismissed)


def refuse(verb: str, when: str = "") -> None:
    """Make the database itself refuse a statement that would rewrite what was dismissed."""
    op.execute(
        f"CREATE TRIGGER dismissal_refuses_{verb.lower()} BEFORE {verb} ON dismissal {when} "
        "BEGIN SELECT RAISE(ABORT, 'rows of dismissal are never changed'); END"
    )
