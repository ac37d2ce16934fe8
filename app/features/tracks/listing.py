"""The tracks of a dataset as people work through them: chosen, in an order, and for whom they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from app.db.store import Store
from app.features.batches.queries import list_batch_people, list_batches_of_tracks
from app.features.datasets.service import dataset_id
from app.features.tracks.service import Track, list_tracks

TrackOrder = Literal["match", "worst", "gaps"]


@dataclass(frozen=True)
class TrackChoice:
    """Which tracks of a dataset, and in which order; None: all.

    Attributes:
        verdict: ``none``: nobody judged them.
        stale: Whether their groups have changed since.
        assigned: Name of a person in whose open batches they are.
        batch: Id of an open batch that they are in.
        sort: ``match`` and frame, ``worst``: the largest left-out error first, ``gaps``: those of which
            least is known first; tracks of a batch come in its order.
    """

    verdict: Literal["accepted", "rejected", "none"] | None = None
    stale: bool | None = None
    assigned: str | None = None
    batch: int | None = None
    sort: TrackOrder = "match"


@dataclass(frozen=True)
class ListedTrack:
    """A track of a list.

    Attributes:
        batches: Open batches that it is in.
        assigned: Names of the people whom these are given to; a batch that is given to nobody is for
            every reviewer.
        everybody: Whether one of them is.
    """

    track: Track
    batches: tuple[int, ...] = ()
    assigned: tuple[str, ...] = ()
    everybody: bool = False
    place: int = 0

    @property
    def gap_share(self) -> float:
        """Share of the frames in which nothing is known."""
        summary = self.track.summary
        return summary.states.get("gap", 0) / max(summary.frames, 1)


def choose_tracks(store: Store, dataset: str | int, choice: TrackChoice) -> list[ListedTrack]:
    """The tracks of a dataset that somebody asks for, in their order."""
    tracks = list_tracks(store, dataset)
    with store.read() as session:
        given = list_batches_of_tracks(session, dataset_id(store, dataset))
        ids = {batch for places in given.values() for batch, _ in places}
        people: dict[int, list[str]] = {batch: [] for batch in ids}
        for row in list_batch_people(session, sorted(ids)):
            people[row.batch_id].append(row.name)
    listed = [
        _make_listed_track(track, dict(given.get(track.id, ())), people, choice) for track in tracks
    ]
    found = [one for one in listed if _is_chosen(one, choice)]
    if choice.sort == "worst":
        found.sort(key=lambda one: -(one.track.summary.p95_px or 0.0))
    elif choice.sort == "gaps":
        found.sort(key=lambda one: -one.gap_share)
    elif choice.batch is not None:
        found.sort(key=lambda one: one.place)
    return found


def _make_listed_track(
    track: Track, places: Mapping[int, int], people: Mapping[int, list[str]], choice: TrackChoice
) -> ListedTrack:
    names = sorted({name for batch in places for name in people[batch]})
    everybody = any(not people[batch] for batch in places)
    place = 0 if choice.batch is None else places.get(choice.batch, 0)
    return ListedTrack(track, tuple(places), tuple(names), everybody, place)


def _is_chosen(one: ListedTrack, choice: TrackChoice) -> bool:
    track = one.track
    if choice.verdict is not None and (track.verdict or "none") != choice.verdict:
        return False
    if choice.stale is not None and track.stale != choice.stale:
        return False
    if choice.assigned is not None and not (one.everybody or choice.assigned in one.assigned):
        return False
    return choice.batch is None or choice.batch in one.batches
