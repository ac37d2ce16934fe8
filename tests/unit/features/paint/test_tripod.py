"""Main cameras of a match in a dataset: what they know together is given, solved with and taken back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.db.store import Store
from app.errors import ConflictError
from app.features.datasets.service import require_dataset_with_matches
from app.features.groups.edit import SetLines
from app.features.groups.queries import read_groups
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import import_groups
from app.features.paint import service
from app.features.paint.service import undo_paint_reading
from app.features.paint.tripod import solve_match_tripods
from app.features.policies.service import change_policy
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.soccer.policy import TOUCHLINE
from tests.unit.solving.test_match_tripod import match


@pytest.fixture
def dataset(store) -> Store:
    """Four groups of a match, and one without; each with its paint, as if it had just been read."""
    groups = [*match()[1].values()]
    groups.append(replace(groups[0], key="alone", match=""))
    import_groups(
        store, "demo", [replace(each, paint={}) for each in groups], source="f", actor="ann"
    )
    change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
    with store.write() as session:
        wanted = {number: each.paint for number, each in enumerate(groups, start=1)}
        service._save_reading_edits(session, 1, wanted, "ann", {"run": "read"})
    solve_dataset(store, "demo")
    return store


def share(store, matches=None, require_wanted=None):
    with store.read() as session:
        head = require_dataset_with_matches(session, "demo")
    solve_match_tripods(store, head, matches, "ann", "read", require_wanted)


def readings(store):
    with store.read() as session:
        found = read_groups(session, [1, 2, 3, 4, 5])
    return [stored.group.paint["a"] for stored in found.values()]


def sigmas(store):
    """Of the camera's position as documents and files have it, metres."""
    found = []
    for number in range(1, 6):
        (view,) = load_group_state(store, number).solution.views
        covariance = np.reshape(view.calibration.known_covariance_with_pitch, (8, 8))[3:6, 3:6]
        found.append(float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])))
    return found


def test_main_cameras_of_a_match_know_it_together_and_solving_follows(dataset):
    before = sigmas(dataset)
    share(dataset)
    assert [item.tripod is not None for item in readings(dataset)] == [True] * 4 + [False]
    assert sorted(list_stale_groups(dataset, "demo")) == [1, 2, 3, 4]
    solve_dataset(dataset, "demo")
    after = sigmas(dataset)
    assert after[4] == before[4]
    assert all(now != then for now, then in zip(after[:4], before[:4], strict=True))


def test_once_more_changes_nothing(dataset):
    share(dataset)
    given = readings(dataset)
    solve_dataset(dataset, "demo")
    share(dataset)
    assert readings(dataset) == given and list_stale_groups(dataset, "demo") == []


def test_another_match_is_left_alone(dataset):
    share(dataset, ["other"])
    assert all(item.tripod is None for item in readings(dataset))


def test_it_goes_with_the_reading_when_that_is_taken_back(dataset):
    share(dataset)
    with dataset.write() as session:
        undo_paint_reading(session, "demo", actor="ann")
    with dataset.read() as session:
        assert all(not stored.group.paint for stored in read_groups(session, [1, 2, 3]).values())


def test_what_is_not_wanted_any_more_is_not_given(dataset):
    def cancelled():
        raise ConflictError("cancelled")

    with pytest.raises(ConflictError):
        share(dataset, require_wanted=cancelled)
    assert all(item.tripod is None for item in readings(dataset))


def test_an_edit_of_lines_leaves_its_view_to_itself_and_the_others_as_they_are(dataset):
    share(dataset)
    given = readings(dataset)
    at = load_group_state(dataset, 2)
    edit = SetLines("a", {next(iter(at.group.views[0].station.lines)): None})
    submit_edit(dataset, 2, edit, if_match=at.etag, actor="ann")
    (view,) = load_group_state(dataset, 2).solution.views
    assert view.calibration.source == "lines"
    share(dataset)
    kept = readings(dataset)
    assert kept[1] == given[1] and all(kept[at].tripod is not None for at in (0, 2, 3))
    assert all(kept[at].tripod != given[at].tripod for at in (0, 2, 3))
