"""What was read of the paint in pictures, kept under its digest, and named by groups."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0016"
down_revision: str | None = "0015"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "paint_evidence",
        sa.Column("digest", sa.String(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("reason", sa.String(), nullable=True),
        sa.Column("body", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"]),
        sa.PrimaryKeyConstraint("digest", "dataset_id"),
    )
    op.execute(
        "CREATE TRIGGER paint_evidence_refuses_update BEFORE UPDATE ON paint_evidence "
        "BEGIN SELECT RAISE(ABORT, 'what was read of a picture is never changed'); END"
    )
    op.add_column("groups", sa.Column("paint", sa.String(), nullable=True))
