"""Groups that change are marked, and what is asked of every group of a queue lies in one index."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0030"
down_revision: str | None = "0029"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

READ = "inputs_hash, split, match, pitch_length, pitch_width"
"""What is read of a group beside its solution."""

SCANNED = (
    "number",
    "status",
    "stale",
    "fixed",
    "solved",
    "views",
    "pictures",
    "passes",
    "value",
    "margin",
    "min_jac",
    "agreement",
    "error_px",
    "error_percent",
    "sigma_m",
    "parallax_degrees",
    "size_ratio",
    "height_m",
    "distance_m",
    "box_px",
    "x_m",
    "y_m",
    "gate",
    "split",
    "findings",
)


def upgrade() -> None:
    op.create_table(
        "group_change",
        sa.Column("id", sa.Integer(), primary_key=True),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column(
            "group_id",
            sa.Integer(),
            sa.ForeignKey("groups.id", ondelete="CASCADE"),
            nullable=False,
            unique=True,
        ),
        # No number is ever given again, though the marks of a deleted dataset go.
        sqlite_autoincrement=True,
    )
    for name, moment, group in (
        ("group_new_is_marked", "INSERT ON groups", "NEW.id"),
        ("group_change_is_marked", f"UPDATE OF {READ} ON groups", "NEW.id"),
        ("group_solved_is_marked", "INSERT ON solution", "NEW.group_id"),
    ):
        op.execute(
            f"CREATE TRIGGER {name} AFTER {moment} BEGIN "
            f"DELETE FROM group_change WHERE group_id = {group}; "
            "INSERT INTO group_change (dataset_id, group_id) "
            f"SELECT dataset_id, id FROM groups WHERE id = {group}; END"
        )
    op.create_index("queue_scanned", "queue", ["dataset_id", *SCANNED])
