"""Practice on a recording: made with faults, mended step by step, and weighed against what is true."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from app.db.store import Store
from app.errors import ConflictError, JobCancelled
from app.features.imports.ingest import ensure_dataset
from app.features.practice import recording as module
from app.features.practice.recording import (
    DATASET,
    FILM,
    make_recording_practice,
    read_recording_practice,
)
from app.features.practice.recording_lessons import FilmTruth
from app.features.recordings.camera_tracking import (
    rotate_cameras_half_turn,
    track_stretch_in_worker,
)
from app.features.recordings.links import add_link, set_instants
from app.features.recordings.service import add_recording
from app.features.recordings.shots import replace_shots
from tests.videos import write_video

SHORT = (
    ("main", 1.2, "start"),
    ("closeup", 0.6, "cut"),
    ("main", 3.0, "cut"),
    ("replay", 3.2, "wipe", 0.5, 0),
    ("main", 1.2, "wipe"),
)


@pytest.fixture
def made(store: Store, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.setattr(module, "PARTS", SHORT)
    return make_recording_practice(store, lambda *_: None, actor="ann")


def lessons(store: Store) -> dict[str, Any]:
    found = read_recording_practice(store, store.settings)
    assert [one.name for one in found.lessons] == ["shots", "cameras", "side", "link"]
    return {one.name: one for one in found.lessons}


def test_each_lesson_is_open_until_it_is_mended_and_says_what_is_right_in_numbers(
    store: Store, made: dict[str, Any]
) -> None:
    number = made["recording"]
    assert (made["dataset"], made["made"]) == (DATASET, True)
    first = lessons(store)
    assert {one.state for one in first.values()} == {"open"}
    assert (first["shots"].right, first["shots"].total) == (2, 5)
    assert "2 of 5 shots are right." in first["shots"].feedback
    assert 0.75 < first["cameras"].right / first["cameras"].total < 0.85
    assert "have none" in first["cameras"].feedback and first["cameras"].off < 1.0
    assert first["side"].off > 60 and "on the other side it would be" in first["side"].feedback
    assert first["link"].feedback == "The replay is not linked yet."

    told = json.loads((store.settings.home / FILM).with_suffix(".json").read_text())
    truth = FilmTruth.of(told)
    live, replay = truth.shots[truth.live], truth.shots[truth.replay]
    replace_shots(store, number, truth.shots, None, actor="ann")
    quiet = {"actor": "ann", "progress": lambda *_: None, "stop": lambda: None}
    track_stretch_in_worker(store, number, live.first, live.last, **quiet)
    rotate_cameras_half_turn(store, number, replay.first, True, actor="ann")
    wrong = add_link(
        store,
        (number, truth.shots[0].first, truth.shots[0].last),
        (number, replay.first, replay.last),
        actor="ann",
    )
    assert "which the replay does not show" in lessons(store)["link"].feedback
    link = add_link(
        store, (number, live.first, live.last), (number, replay.first, replay.last), actor="ann"
    )
    assert wrong.id != link.id
    assert "but no instant is linked yet" in lessons(store)["link"].feedback
    pairs = []
    for frame in (replay.first + 2, replay.last - 2):
        seconds = truth.offset_s + truth.speed * frame / truth.fps
        pairs.append((min(max(round(seconds * truth.fps), live.first), live.last), frame))
    set_instants(store, number, link.id, pairs[:1], None, None, actor="ann")
    assert "Its speed is assumed" in lessons(store)["link"].feedback
    for frames, state in ((22, "open"), (3, "almost")):
        off = [(one + frames, two) for one, two in pairs]
        set_instants(store, number, link.id, off, None, None, actor="ann")
        assert lessons(store)["link"].state == state
    set_instants(store, number, link.id, pairs, None, None, actor="ann")
    last = lessons(store)
    assert {name: one.state for name, one in last.items()} == dict.fromkeys(last, "right")
    assert last["shots"].feedback == "5 of 5 shots are right."
    assert last["cameras"].right == last["cameras"].total and last["cameras"].off < 1.0
    assert last["side"].off < 1.0
    assert last["link"].off < 1.0 and "the true speed is 0.5" in last["link"].feedback

    again = make_recording_practice(store, lambda *_: None, actor="ann")
    assert again == {**made, "made": False}
    afresh = make_recording_practice(store, lambda *_: None, actor="ann", again=True)
    assert afresh["made"] and lessons(store)["shots"].state == "open"


@pytest.mark.parametrize("step", ["Finding its shots.", "Following the camera of the replay."])
def test_one_whose_making_was_stopped_is_made_anew(
    store: Store, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    monkeypatch.setattr(module, "PARTS", SHORT)

    def stop_there(_done: int, _total: int | None = None, sentence: str = "", /) -> None:
        if sentence.startswith(step):
            raise JobCancelled

    with pytest.raises(JobCancelled):
        make_recording_practice(store, stop_there, actor="ann")
    half = read_recording_practice(store, store.settings)
    assert half.recording is not None and half.lessons == ()
    made = make_recording_practice(store, lambda *_: None, actor="ann")
    assert made["made"] and {one.state for one in lessons(store).values()} == {"open"}


def test_a_dataset_of_that_name_is_left_alone(store: Store, tmp_path: Path) -> None:
    assert read_recording_practice(store, store.settings).lessons == ()
    ensure_dataset(store, DATASET, "ann")
    film = write_video(tmp_path / "own.mp4", "mp4v", 20)
    add_recording(store, DATASET, film, actor="ann")
    with pytest.raises(ConflictError, match="you already have a dataset"):
        make_recording_practice(store, lambda *_: None, actor="ann")
    assert read_recording_practice(store, store.settings).lessons == ()
