"""The queue knows how many views of a group have a picture."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0006"
down_revision: str | None = "0005"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.add_column(
        "queue", sa.Column("pictures", sa.Integer(), nullable=False, server_default=sa.text("0"))
    )
    op.execute(
        "UPDATE queue SET pictures = (SELECT count(*) FROM view "
        "WHERE view.group_id = queue.group_id AND view.media_path IS NOT NULL)"
    )
