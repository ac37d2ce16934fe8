"""What the queue is sorted and filtered by is found by index."""

from collections.abc import Sequence

from alembic import op

revision: str = "0029"
down_revision: str | None = "0028"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

COLUMNS = (
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
)


def upgrade() -> None:
    for name in COLUMNS:
        op.create_index(f"queue_{name}", "queue", ["dataset_id", name, "number"])
