"""A database says which installation it is."""

import secrets
from collections.abc import Sequence
from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

revision: str = "0010"
down_revision: str | None = "0009"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    table = op.create_table(
        "installation",
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("created", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("key"),
    )
    created = datetime.now(UTC).isoformat(timespec="microseconds")
    key = secrets.token_hex(16)
    op.bulk_insert(table, [{"key": key, "created": created}])
    # In the first page, too: there it can be read before SQLite opens the file (store.wal).
    op.execute(f"PRAGMA application_id = {int(key[:7], 16)}")
