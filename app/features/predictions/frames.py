"""The truth of an evaluation: frames of a frozen version, or of a dataset as it is now."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import get_args

from app.db.json_columns import Json
from app.db.session import Session
from app.errors import ConflictError, InputError
from app.evaluation.frame import GroundTruthFrame
from app.features.datasets.service import DatasetHead
from app.features.groups.state import read_states
from app.features.groups.view_queries import find_group_and_view_ids
from app.features.versions.membership import read_candidates, require_solved
from app.features.versions.queries import BATCH, read_rows
from app.features.versions.service import FrozenGroup, Version, read_frozen_groups
from app.formats.manifest import read_software_version
from app.json_text import quote_text
from app.soccer.ball_boxes import collect_ball_boxes, is_ball_3d_valid_in_view
from app.soccer.choices import LiveRule
from app.soccer.codec import digest_json, policy_to_json
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION, Solution

LIVE_RULES: tuple[str, ...] = get_args(LiveRule)
"""Which groups of a dataset that is not frozen take part."""


@dataclass(frozen=True)
class EvaluationTruth:
    """Frames, and what pins them.

    Attributes:
        gone: Frames of the version whose view the dataset no longer has; nothing can be
            predicted for them.
        pins: JSON: version or digest, policy, solver and software version.
    """

    frames: tuple[GroundTruthFrame, ...]
    policy: Policy
    gone: int
    pins: Json


def read_version_truth(session: Session, version: Version, split: str | None) -> EvaluationTruth:
    """The frames of a frozen version, with the ids that its views have today."""
    rows = list(read_rows(session, version.id, members=True))
    frames: list[GroundTruthFrame] = []
    gone = seen = 0
    for start in range(0, len(rows), BATCH):
        frozen = read_frozen_groups(session, version, rows[start : start + BATCH])
        ids = find_group_and_view_ids(
            session, version.dataset_id, [item.group.key for item in frozen]
        )
        for item in frozen:
            for frame in _iterate_frozen_frames(item, ids.get(item.group.key, (0, {})), seen):
                if split is None or frame.split == split:
                    frames.append(frame)
                    gone += frame.id < 0
            seen += len(item.group.views)
    pins = describe_ground_truth(
        version.policy, version.solver_version, version.hash, version.groups, version
    )
    return EvaluationTruth(tuple(frames), version.policy, gone, pins)


def read_live_truth(
    session: Session, dataset: DatasetHead, rule: str, split: str | None
) -> EvaluationTruth:
    """The frames of a dataset as it is now; the pin is a digest of all that they follow from.

    Raises:
        InputError: ``rule`` is none of ``LIVE_RULES``.
        ConflictError: Groups that might take part have no solution.
    """
    if rule not in LIVE_RULES:
        raise unknown_group_rule_error(rule)
    wanted = "passing" if rule == "all" else rule
    candidates = read_candidates(session, dataset.id, wanted, any_ball=True)
    require_solved(candidates, dataset.name)
    ids = [item.id for item in candidates if item.why is None or rule == "all"]
    frames: list[GroundTruthFrame] = []
    hashes: list[list[str]] = []
    for start in range(0, len(ids), BATCH):
        for state in read_states(session, ids[start : start + BATCH]):
            hashes.append([state.key, state.stored.inputs_hash])
            if state.solution is None:
                raise ConflictError(
                    f"group {state.key} has no solution", hint="Solve the dataset first."
                )
            frames += [
                frame
                for frame in iterate_group_frames(
                    state.group, state.solution, state.id, state.view_ids
                )
                if split is None or frame.split == split
            ]
    pins = describe_ground_truth(dataset.policy, SOLVER_VERSION, digest_json(sorted(hashes)), rule)
    return EvaluationTruth(tuple(frames), dataset.policy, 0, pins)


def iterate_group_frames(
    group: Group,
    solution: Solution,
    group_id: int,
    view_ids: Mapping[str, int],
    splits: Mapping[str, str] | None = None,
) -> Iterator[GroundTruthFrame]:
    """The frames of a solved group.

    The 3D ball, and the boxes that follow from it, belong to the views in a valid pair alone.
    """
    for view in group.views:
        solved = solution.view(view.key)
        inside = is_ball_3d_valid_in_view(solution, view)
        yield GroundTruthFrame(
            id=view_ids[view.key],
            group_id=group_id,
            group=group.key,
            view=view.key,
            match=group.match,
            size=view.size,
            split=(splits or {}).get(view.key, group.split),
            boxes=collect_ball_boxes(solution, view),
            absent=view.ball is None and any(ball.out_of_view for ball in view.balls),
            camera=solved.calibration.camera if solved else None,
            point=solution.ball.point if solution.ball and inside else None,
            parallax_degrees=solution.ball.parallax_degrees if solution.ball else None,
            lines=view.station.lines,
            pitch=group.pitch,
            station=view.station.key,
            predicted_by=view.ball.predicted_by if view.ball else "",
        )


def _iterate_frozen_frames(
    item: FrozenGroup, present: tuple[int, Mapping[str, int]], count: int
) -> Iterator[GroundTruthFrame]:
    """Views that the dataset no longer has get ids below zero, each its own."""
    group_id, known = present
    ids = {
        view.key: known.get(view.key, -(count + place + 1))
        for place, view in enumerate(item.group.views)
    }
    splits = {view.key: item.row.split for view in item.group.views} | dict(item.row.splits or {})
    yield from iterate_group_frames(item.group, item.solution, group_id, ids, splits)


def describe_ground_truth(
    policy: Policy, solver_version: str, state: str, groups: str, version: Version | None = None
) -> dict[str, Json]:
    """The pins of an evaluation that identify its ground truth, as JSON.

    Args:
        policy: The policy that judged it.
        solver_version: The solver that computed it.
        state: Digest of its content; for a version, its hash.
        groups: Which groups take part.
        version: Whose truth it is; None: the dataset as it was.
    """
    return {
        "version": version and version.id,
        "version_name": version and version.name,
        "version_hash": version and version.hash,
        "groups": groups,
        "state": state,
        "policy": policy_to_json(policy),
        "policy_hash": policy.hash,
        "solver_version": solver_version,
        "software_version": read_software_version(),
    }


def unknown_group_rule_error(rule: str) -> InputError:
    """The error where somebody wants groups by a rule that is none of ``LIVE_RULES``."""
    known = ", ".join(LIVE_RULES)
    return InputError(f"groups must be one of {known}, not {quote_text(rule)}", pointer="/groups")
