"""An evaluation of predicted tracks: against those of a version, or those that people accepted."""

from __future__ import annotations

from app.db.json_columns import Json
from app.db.session import Session
from app.errors import InputError
from app.evaluation.result import Evaluation
from app.evaluation.track_scores import TrueTrack, evaluate_tracks
from app.features.datasets.service import DatasetHead
from app.features.groups.digest import digest
from app.features.predictions.frames import truth_pins
from app.features.predictions.queries import PredictionSet, read_predicted_tracks
from app.features.tracks.codec import track_from_json
from app.features.tracks.service import accepted_tracks
from app.features.versions.frozen_queries import json_of, read_frozen
from app.features.versions.service import Version
from app.formats.tracks_writer import folder_name
from app.soccer.solution import SOLVER_VERSION


def track_evaluation(
    session: Session, dataset: DatasetHead, version: Version | None, predictions: PredictionSet
) -> tuple[Evaluation, dict[str, Json]]:
    """What came of it, and what pins the truth.

    Args:
        session: Any session.
        dataset: Whose tracks are the truth.
        version: Whose tracks are; None: those that people accepted and that are not stale.
        predictions: A set of tracks.

    Raises:
        InputError: There is no true track, or nothing that is predicted is of an instant of one.
    """
    if version is None:
        values = accepted_tracks(session, dataset)
        pins = truth_pins(dataset.policy, SOLVER_VERSION, digest(values), "accepted")
    else:
        bodies = read_frozen(session, version.dataset_id, version.tracks.values())
        values = {key: json_of(bodies[name]) for key, name in version.tracks.items()}
        pins = truth_pins(
            version.policy, version.solver_version, version.hash, version.groups, version
        )
    if not values:
        where = f'the version "{version.name}"' if version else f'"{dataset.name}"'
        raise InputError(
            f"{where} has no track of the ball that a person accepted",
            hint="Make and accept its tracks, then freeze a version.",
            pointer="/version",
        )
    truth = [_true(key, value) for key, value in sorted(values.items())]
    return evaluate_tracks(truth, read_predicted_tracks(session, predictions.id)), pins


def _true(key: str, value: Json) -> TrueTrack:
    track = track_from_json(value["track"])
    return TrueTrack(
        key,
        folder_name(key),
        track.frames,
        track.times,
        track.position,
        track.state,
        track.mode,
        tuple((event.kind, event.time_s) for event in track.events),
    )
