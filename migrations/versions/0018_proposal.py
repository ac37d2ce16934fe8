"""Cameras that were proposed for views without lines, and which lines were accepted from one."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0018"
down_revision: str | None = "0017"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("station", sa.Column("proposed", sa.String(), nullable=True))
    op.create_table(
        "proposal",
        sa.Column("view_id", sa.Integer(), nullable=False),
        sa.Column("outcome", sa.String(), nullable=False),
        sa.Column("sentence", sa.String(), nullable=False),
        sa.Column("supported", sa.Double(), nullable=True),
        sa.Column("explained", sa.Double(), nullable=True),
        sa.Column("points", sa.Integer(), nullable=False),
        sa.Column("error_px", sa.Double(), nullable=True),
        sa.Column("runner_up", sa.Double(), nullable=True),
        sa.Column("lines", sa.String(), nullable=False),
        sa.Column("frame", sa.String(), nullable=False),
        sa.Column("sought_with", sa.String(), nullable=False),
        sa.Column("version", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["view_id"], ["view.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("view_id"),
    )
    op.create_index("proposal_outcome", "proposal", ["outcome"])
