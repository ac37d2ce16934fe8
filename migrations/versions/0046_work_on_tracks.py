"""Balls that contradict a track, as findings of their groups; and batches that give out tracks."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0046"
down_revision: str | None = "0045"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("import_finding", sa.Column("number", sa.Double(), nullable=True))
    op.add_column("import_finding", sa.Column("place", sa.String(), nullable=True))
    op.add_column("import_finding", sa.Column("of_inputs", sa.String(), nullable=True))
    op.add_column("batch", sa.Column("kind", sa.String(), nullable=False, server_default="groups"))
    op.create_table(
        "batch_track",
        sa.Column("batch_id", sa.Integer(), nullable=False),
        sa.Column("track_id", sa.Integer(), nullable=False),
        sa.Column("place", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["batch_id"], ["batch.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["track_id"], ["track.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("batch_id", "track_id"),
    )
    op.create_index("batch_track_track", "batch_track", ["track_id"], unique=False)
