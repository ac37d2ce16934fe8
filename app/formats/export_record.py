"""What a writer gets per group: the group, its solution and what people decided."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from app.formats.frame_names import frame_path_by_match, guess_frame_suffix, with_export_key
from app.geometry.camera import Camera
from app.soccer.ball_boxes import collect_ball_boxes, find_ball_fit, is_ball_3d_valid_in_view
from app.soccer.frames import Box, box_to_corner_origin, clip_box
from app.soccer.group import Group, View
from app.soccer.solution import BallFit, Solution, ViewSolution

_NOT_CALIBRATED = ("calibratable", "jac", "agreement")


@dataclass(frozen=True)
class ExportRecord:
    """One group on its way out.

    Attributes:
        solution: None for a group that was never solved (only in an export of everything).
        verdict: ``accepted``, ``rejected``, ``deferred`` or ``unreviewed``; ``accepted (stale)``
            where the group changed afterwards.
        reason: Why it was rejected, or why it was accepted against a gate.
        override: The gate against which it was accepted, or None.
        splits: Split by view, where views of one group are split.
        frames: Where the frame of each view was placed in the export, by view key; relative.
        names: Keys by which the files of views are called, where not by their own (``ExportKeyAssigner``).
    """

    group: Group
    solution: Solution | None
    verdict: str = "unreviewed"
    reason: str | None = None
    override: str | None = None
    splits: Mapping[str, str] = field(default_factory=dict)
    frames: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)

    def split_of_view(self, view: View) -> str:
        """``train``, ``test``, ``valid`` or empty: that of the view, or else of its group."""
        return self.splits.get(view.key, self.group.split)

    def with_export_file_key(self, view: View) -> View:
        """A view with the key by which its files are called."""
        return with_export_key(view, self.names.get(view.key))

    def view_solution(self, view: View) -> ViewSolution | None:
        """What was computed for one view."""
        return self.solution.view(view.key) if self.solution else None

    def camera(self, view: View) -> Camera | None:
        """Camera of one view, whatever the gates say."""
        solved = self.view_solution(view)
        return solved.calibration.camera if solved else None

    def camera_covariance(self, view: View) -> tuple[float, ...] | None:
        """Covariance of the parameters of a view's camera, row by row, where it is known, (64,)."""
        solved = self.view_solution(view)
        return None if solved is None else solved.calibration.known_covariance_with_pitch

    def passes_camera_gates(self, view: View) -> bool:
        """Whether the view has a camera that passed the gates on cameras."""
        solved = self.view_solution(view)
        return (
            solved is not None
            and solved.calibration.camera is not None
            and solved.failed not in _NOT_CALIBRATED
        )

    def ball_fit(self, view: View, everything: bool) -> BallFit | None:
        """The 3D ball in one view; in views of no valid pair only when everything is asked."""
        return find_ball_fit(self.solution, view, everything)

    def has_ball_3d(self, view: View) -> bool:
        """Whether the 3D ball holds in one view; every format's count of balls counts these."""
        return is_ball_3d_valid_in_view(self.solution, view)

    def is_training_view(self, view: View) -> bool:
        """Whether a detector may learn from a view: its ball holds in 3D, or it shows none.

        In any other view a ball was annotated that the other views do not confirm. A view that a
        person left out teaches nothing, not even that it shows no ball.
        """
        return view.included and (not _shows_ball(view) or self.has_ball_3d(view))

    def teaches_truth(self, view: View, boxes: str, every_view: bool) -> bool:
        """Whether what a detector would learn from a view is what the view shows.

        A view that shows a ball and has no box would teach that there is none, also where every view
        is asked for: its ball is only a point, there are several to pick from, or its box lies
        beside the picture.

        Args:
            view: One of the group's.
            boxes: One of ``BOX_KINDS``.
            every_view: Whether views count from which no detector should learn (``is_training_view``).
        """
        box = choose_ball_box(self, view, boxes)
        inside = box is not None and clip_box(box_to_corner_origin(box), view.size) is not None
        if _shows_ball(view) and not inside:
            return False
        return every_view or self.is_training_view(view)

    def keep_training_views(
        self, boxes: str = "optimized", every_view: bool = False
    ) -> ExportRecord:
        """The same group with the views alone that ``teaches_truth`` keeps."""
        views = tuple(
            view for view in self.group.views if self.teaches_truth(view, boxes, every_view)
        )
        return replace(self, group=replace(self.group, views=views))

    @property
    def ball_point(self) -> tuple[float, float, float] | None:
        """The 3D ball, pitch frame, metres, z down; None where it is not a finite place."""
        ball = self.solution.ball if self.solution else None
        return ball.point if ball is not None and all(map(math.isfinite, ball.point)) else None

    @property
    def verdict_text(self) -> str:
        """Verdict and reason in one cell."""
        return f"{self.verdict}: {self.reason}" if self.reason else self.verdict


def _shows_ball(view: View) -> bool:
    """Whether a ball is annotated in a view, and not as out of view."""
    return any(not ball.out_of_view for ball in view.balls)


def choose_ball_box(record: ExportRecord, view: View, kind: str) -> Box | None:
    """The ball's box of one of ``BOX_KINDS``; the annotated one where the view has none of it.

    None where several balls are annotated: nobody has picked one.
    """
    if view.ball is None:
        return None
    boxes = collect_ball_boxes(record.solution, view)
    return boxes.get(kind) or boxes.get("annotated")


def find_export_frame_name(record: ExportRecord, view: View) -> str:
    """Where the frame of a view is in the export, or would be."""
    placed, called = record.frames.get(view.key), record.with_export_file_key(view)
    return placed or frame_path_by_match(
        record.group, called, record.split_of_view(view), guess_frame_suffix(view)
    )
