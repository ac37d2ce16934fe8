"""Links between a replay and the live shot that it shows again."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0037"
down_revision: str | None = "0036"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "shot_link",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("live_id", sa.Integer(), nullable=False),
        sa.Column("live_first", sa.Integer(), nullable=False),
        sa.Column("live_last", sa.Integer(), nullable=False),
        sa.Column("replay_id", sa.Integer(), nullable=False),
        sa.Column("replay_first", sa.Integer(), nullable=False),
        sa.Column("replay_last", sa.Integer(), nullable=False),
        sa.Column("instants", sa.String(), nullable=False),
        sa.Column("assumed_speed", sa.Double(), nullable=True),
        sa.Column("map", sa.String(), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("created", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"]),
        sa.ForeignKeyConstraint(["live_id"], ["recording.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["replay_id"], ["recording.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("shot_link_live", "shot_link", ["live_id"])
    op.create_index("shot_link_replay", "shot_link", ["replay_id"])
