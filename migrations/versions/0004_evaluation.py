"""Predictions and evaluations."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "0004"
down_revision: str | None = "0003"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    op.create_table(
        "prediction_set",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("format", sa.String(), nullable=False),
        sa.Column("source", sa.String(), nullable=False),
        sa.Column("created", sa.String(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("digest", sa.String(), nullable=False),
        sa.Column("frames", sa.Integer(), nullable=False),
        sa.Column("boxes", sa.Integer(), nullable=False),
        sa.Column("cameras", sa.Integer(), nullable=False),
        sa.Column("unknown", sa.Integer(), nullable=False),
        sa.Column("report", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("dataset_id", "name", name="prediction_set_name"),
    )
    op.create_table(
        "prediction",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("set_id", sa.Integer(), nullable=False),
        sa.Column("view_id", sa.Integer(), nullable=False),
        sa.Column("x", sa.Double(), nullable=False),
        sa.Column("y", sa.Double(), nullable=False),
        sa.Column("width", sa.Double(), nullable=False),
        sa.Column("height", sa.Double(), nullable=False),
        sa.Column("score", sa.Double(), nullable=False),
        sa.ForeignKeyConstraint(["set_id"], ["prediction_set.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["view_id"], ["view.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("prediction_set_view", "prediction", ["set_id", "view_id"], unique=False)
    op.create_index("prediction_view", "prediction", ["view_id"], unique=False)
    op.create_table(
        "predicted_camera",
        sa.Column("set_id", sa.Integer(), nullable=False),
        sa.Column("view_id", sa.Integer(), nullable=False),
        sa.Column("camera", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["set_id"], ["prediction_set.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["view_id"], ["view.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("set_id", "view_id"),
    )
    op.create_index("predicted_camera_view", "predicted_camera", ["view_id"], unique=False)
    op.create_table(
        "evaluation",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("dataset_id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("created", sa.String(), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("prediction_set_id", sa.Integer(), nullable=True),
        sa.Column("careful_set_id", sa.Integer(), nullable=True),
        sa.Column("version_id", sa.Integer(), nullable=True),
        sa.Column("pins", sa.String(), nullable=False),
        sa.Column("counts", sa.String(), nullable=False),
        sa.Column("tables", sa.String(), nullable=False),
        sa.Column("figures", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["dataset_id"], ["dataset.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("evaluation_dataset", "evaluation", ["dataset_id", "id"], unique=False)
    op.create_table(
        "evaluation_frame",
        sa.Column("evaluation_id", sa.Integer(), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("frame_id", sa.Integer(), nullable=False),
        sa.Column("group_id", sa.Integer(), nullable=False),
        sa.Column("group", sa.String(), nullable=False),
        sa.Column("view", sa.String(), nullable=False),
        sa.Column("match", sa.String(), nullable=False),
        sa.Column("ball", sa.Boolean(), nullable=False),
        sa.Column("detections", sa.Integer(), nullable=False),
        sa.Column("score", sa.Double(), nullable=True),
        sa.Column("iou", sa.Double(), nullable=True),
        sa.Column("hit_score", sa.Double(), nullable=True),
        sa.Column("hit_iou", sa.Double(), nullable=True),
        sa.Column("distance_m", sa.Double(), nullable=True),
        sa.Column("diameter_px", sa.Double(), nullable=True),
        sa.Column("parallax_degrees", sa.Double(), nullable=True),
        sa.Column("size_error_percent", sa.Double(), nullable=True),
        sa.Column("error_m", sa.Double(), nullable=True),
        sa.Column("error_percent", sa.Double(), nullable=True),
        sa.Column("any_error_m", sa.Double(), nullable=True),
        sa.Column("predicted_error_m", sa.Double(), nullable=True),
        sa.Column("predicted_error_percent", sa.Double(), nullable=True),
        sa.Column("predicted_any_error_m", sa.Double(), nullable=True),
        sa.Column("predicted_jac", sa.Double(), nullable=True),
        sa.Column("box_iou", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(["evaluation_id"], ["evaluation.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("evaluation_id", "position"),
    )
