"""Frames against which predictions are judged."""

from __future__ import annotations

from sqlalchemy import update

from app.db.idempotency import without_pending_response
from app.db.store import Store
from app.features.datasets.tables import GroupModel
from app.features.predictions.frames import read_version_truth
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.soccer.split import Split


def test_views_that_are_gone_have_ids_of_their_own_in_every_split(
    store: Store, fill, make_static
) -> None:
    fill(make_static(10), make_static(11))
    split = Split("camera", test_cameras=("cam2",))
    request = FreezeRequest("v1", groups="passing", split=split)
    version = freeze_dataset(store, "demo", request, actor="ann")
    with store.write() as session, without_pending_response():
        session.execute(update(GroupModel).values(key=GroupModel.key + "0"))
    with store.read() as session:
        for name in ("train", "test", None):
            truth = read_version_truth(session, version, name)
            ids = [frame.id for frame in truth.frames]
            assert ids and max(ids) < 0 and len({*ids}) == len(ids) == truth.gone
