"""Indices by which a request finds what is left for a person in a batch of thousands."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0035"
down_revision: str | None = "0034"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    left = sa.text("settled IS NULL AND handed_in IS NULL")
    op.create_index(
        "batch_group_free", "batch_group", ["batch_id"], sqlite_where=left, postgresql_where=left
    )
    op.create_index("take_of_person", "take", ["batch_id", "person", "handed_in", "settled"])
