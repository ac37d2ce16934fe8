"""Tracks of the ball that were predicted."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0045"
down_revision: str | None = "0044"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column(
        "prediction_set", sa.Column("tracks", sa.Integer(), nullable=False, server_default="0")
    )
    op.create_table(
        "predicted_track",
        sa.Column(
            "set_id",
            sa.Integer(),
            sa.ForeignKey("prediction_set.id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("stretch", sa.String(), primary_key=True),
        sa.Column("body", sa.LargeBinary(), nullable=False),
    )
