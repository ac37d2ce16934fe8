"""Proposals beside lines that determine no camera: open as long as those are what they were."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0020"
down_revision: str | None = "0019"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column(
        "proposal", sa.Column("beside", sa.String(), nullable=False, server_default=sa.text("''"))
    )
