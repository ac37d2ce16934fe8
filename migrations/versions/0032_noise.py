"""How noisy the balls of cameras and people are beside their dataset's."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0032"
down_revision: str | None = "0031"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("dataset", sa.Column("noise", sa.String(), nullable=True))
    op.add_column("view", sa.Column("noise", sa.Double(), nullable=True))
