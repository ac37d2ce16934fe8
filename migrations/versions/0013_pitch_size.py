"""Sizes of pitches that the lines of each match show, kept under a digest of those lines."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0013"
down_revision: str | None = "0011"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "pitch_estimate",
        sa.Column("dataset_id", sa.Integer(), sa.ForeignKey("dataset.id"), primary_key=True),
        sa.Column("match", sa.String(), primary_key=True),
        sa.Column("inputs", sa.String(), nullable=False),
        sa.Column("length", sa.Double()),
        sa.Column("width", sa.Double()),
        sa.Column("length_sigma", sa.Double()),
        sa.Column("width_sigma", sa.Double()),
        sa.Column("frames", sa.Integer(), nullable=False),
        sa.Column("problem", sa.String()),
    )
