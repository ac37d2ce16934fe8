"""Agreement: what independent annotations of a group came to, and the limits they keep."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0026"
down_revision: str | None = "0025"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "agreement",
        sa.Column("group_id", sa.Integer(), nullable=False),
        sa.Column("batch_id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("takes", sa.String(), nullable=False),
        sa.Column("pairs", sa.LargeBinary(), nullable=False),
        sa.Column("worst", sa.Double(), nullable=False),
        sa.Column("disagreements", sa.Integer(), nullable=False),
        sa.Column("found", sa.String(), nullable=False),
        sa.Column("outcome", sa.String(), nullable=True),
        sa.Column("take_id", sa.Integer(), nullable=True),
        sa.Column("decided", sa.String(), nullable=True),
        sa.Column("decided_by", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(["group_id"], ["groups.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("group_id", "batch_id"),
    )
    op.create_index("agreement_dataset", "agreement", ["dataset_id", "state"])
    op.create_table(
        "agreement_limits",
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("line_px", sa.Double(), nullable=False),
        sa.Column("markings", sa.Integer(), nullable=False),
        sa.Column("ball_px", sa.Double(), nullable=False),
        sa.Column("diameter_px", sa.Double(), nullable=False),
        sa.Column("ball_m", sa.Double(), nullable=False),
        sa.Column("jac", sa.Double(), nullable=False),
        sa.Column("changed", sa.String(), nullable=False),
        sa.Column("changed_by", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("dataset_id"),
    )
