"""The agreement of cameras with the paint of their pictures, in the queue.

Nothing is filled in: what was solved before has none.
"""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0017"
down_revision: str | None = "0016"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column("queue", sa.Column("agreement", sa.Double(), nullable=True))
