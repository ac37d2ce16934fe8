"""How often a job was begun without an end, so that what ends servers is not begun for ever."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0011"
down_revision: str | None = "0010"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("job", sa.Column("tries", sa.Integer(), nullable=False, server_default="0"))
