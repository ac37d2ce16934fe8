"""Why a view was left out, what verifying a version said, and bulk verdicts given again."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0007"
down_revision: str | None = "0006"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("view", sa.Column("left_out", sa.String(), nullable=True))
    op.add_column("verdict_batch", sa.Column("undo_spans", sa.String(), nullable=True))
    op.add_column("verdict_batch", sa.Column("redone", sa.Integer(), nullable=True))
    op.create_table(
        "version_check",
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("at", sa.String(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("solver_version", sa.String(), nullable=False),
        sa.Column("report", sa.String(), nullable=True),
        sa.Column("problem", sa.String(), nullable=True),
        sa.ForeignKeyConstraint(["version_id"], ["version.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("version_id"),
    )
    _forget_what_was_not_mended()


def _forget_what_was_not_mended() -> None:
    """``fixed`` was said of every edited group with a verdict; it is said of mended ones alone."""
    op.execute(
        "UPDATE queue SET fixed = 0 WHERE fixed AND (status != 'accepted' "
        "OR override IS NOT NULL OR passes = 0 OR NOT EXISTS (SELECT 1 FROM view "
        "JOIN station ON station.id = view.station_id WHERE view.group_id = queue.group_id "
        "AND (view.digest != view.source_digest "
        "OR (NOT station.shared AND station.digest != station.source_digest))))"
    )
