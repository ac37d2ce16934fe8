"""Requests that change a dataset, or what belongs to one, each made ready to be sent."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.imports.upload_queries import find_complete_upload_path
from app.features.jobs.queries import NewJob, insert_job
from app.features.paint.proposal_queries import Proposal, save_proposals
from app.features.people.logins import Login
from app.features.people.roles import DatasetRoles, Role
from app.features.people.service import invite
from app.features.people.session_routes import get_login
from app.features.predictions.reader import PredictionFiles, read_files
from app.features.predictions.service import add_predictions
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.service import get_recording
from app.formats.frame_names import frame_path_in_split
from app.http.team import get_team_login
from app.json_text import json_text
from app.sample.scene import TRUTH, truth_to_json
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from tests.drawn_balls import place, write_film
from tests.flights import add_flight
from tests.integration.conftest import picture
from tests.rigs import groups as rig_groups
from tests.scenes import make_scenes
from tests.tracked_frames import frame
from tests.unit.http.group_requests import (
    API,
    Request,
    ended,
    etag_of,
    idle,
    send,
    services_of,
    store_of,
)
from tests.videos import write_video

BROADCAST = "/datasets/broadcast"


def uploaded(api: Any, name: str, content: bytes) -> str:
    """Id of a file that is there."""
    headers = {"Content-Type": "application/octet-stream"}
    answer = api.post(f"{API}/uploads", params={"name": name}, content=content, headers=headers)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def bulk(_api: Any) -> Request:
    body = {"q": "", "state": "deferred", "note": "All of them.", "expected": 3}
    return "POST", "/datasets/broadcast/verdicts", body, {}


def bulk_undone(api: Any) -> Request:
    body = {"state": "deferred"}
    batch = send(api, ("POST", f"{BROADCAST}/verdicts", body, {})).json()["batch"]
    return "POST", f"/verdict-batches/{batch}/undo", None, {}


def bulk_redone(api: Any) -> Request:
    _, path, _, _ = asked = bulk_undone(api)
    send(api, asked)
    return "POST", path.replace("undo", "redo"), None, {}


def policy(api: Any) -> Request:
    path = "/datasets/broadcast/policy"
    return "PUT", path, {"name": "strict"}, etag_of(api, path)


def using(api: Any, **values: Any) -> None:
    """Let the policy of the dataset be another one, and wait until all is solved under it."""
    path = f"{BROADCAST}/policy"
    ended(api, ("PUT", path, values, etag_of(api, path)))


def recording(api: Any) -> str:
    """The address of a recording that is indexed."""
    folder = store_of(api).settings.home
    film = write_video(folder / "film.mp4", "mp4v", 20)
    upload = uploaded(api, film.name, film.read_bytes())
    body = {"dataset": "broadcast", "source": {"upload": upload}}
    return f"/recordings/{ended(api, ('POST', '/recordings', body, {})).result['recording']}"


def no_recording(api: Any) -> Request:
    return "DELETE", recording(api), None, {}


def match_clock(api: Any) -> Request:
    return "PATCH", recording(api), {"clocks": [{"frame": 3, "half": 1, "seconds": 60}]}, {}


def found_shots(api: Any) -> Request:
    return "POST", f"{recording(api)}/shots", None, {}


def shots(api: Any) -> Request:
    path = f"{recording(api)}/shots"
    body = {"shots": [{"first": 0, "last": 9, "kind": "replay"}]}
    return "PUT", path, body, etag_of(api, path)


def instants(api: Any) -> Request:
    return "POST", f"{recording(api)}/groups", {"frames": [3], "propose": False}, {}


def track_verdict(api: Any) -> Request:
    path = f"/tracks/{add_flight(store_of(api))}"
    return "PATCH", path, {"verdict": "rejected"}, etag_of(api, path)


def tracks(api: Any) -> Request:
    add_flight(store_of(api))
    return "POST", "/datasets/flight/tracks", {}, {}


def tracked_cameras(api: Any) -> Request:
    return "POST", f"{recording(api)}/cameras", {"first": 0, "last": 9}, {}


def ball_click(api: Any) -> Request:
    folder = store_of(api).settings.home
    film = write_film(folder / "ball.avi")
    upload = uploaded(api, film.name, film.read_bytes())
    body = {"dataset": "broadcast", "source": {"upload": upload}}
    path = f"/recordings/{ended(api, ('POST', '/recordings', body, {})).result['recording']}"
    frames = {"shots": [{"first": 0, "last": 11, "kind": "main"}]}
    send(api, ("PUT", f"{path}/shots", frames, etag_of(api, f"{path}/shots")))
    x, y = place(5)
    return "POST", f"{path}/ball-runs", {"frame": 5, "x": x, "y": y}, {}


def ball_run(api: Any) -> str:
    made = send(api, asked := ball_click(api)).json()
    return f"{asked[1]}/{made['id']}"


def another_ball_click(api: Any) -> Request:
    path = ball_run(api)
    x, y = place(8)
    return "POST", f"{path}/clicks", {"frame": 8, "x": x, "y": y}, etag_of(api, path)


def no_ball_run(api: Any) -> Request:
    return "DELETE", ball_run(api), None, {}


def turned_cameras(api: Any) -> Request:
    path = recording(api)
    found = get_recording(store_of(api), int(path.rpartition("/")[2]))
    frames = [frame(number, "tracked") for number in range(10)]
    save_cameras(store_of(api), found, (0, 9), TrackedStretch(frames, ()), [], "ann")
    return "PATCH", f"{path}/cameras/3", {"turned": True}, {}


def link(api: Any) -> Request:
    path = recording(api)
    replay = {"recording": int(path.rpartition("/")[2]), "first": 10, "last": 19}
    return "POST", f"{path}/links", {"live": {"first": 0, "last": 9}, "replay": replay}, {}


def linked(api: Any) -> str:
    made = send(api, asked := link(api)).json()
    return f"{asked[1]}/{made['id']}"


def linked_instants(api: Any) -> Request:
    path = linked(api)
    body = {"instants": [{"live": 2, "replay": 12}]}
    return "PUT", f"{path}/instants", body, etag_of(api, path)


def ball_link(api: Any) -> Request:
    return "POST", f"{linked(api)}/ball", {}, {}


def no_link(api: Any) -> Request:
    return "DELETE", linked(api), None, {}


def saved_view(_api: Any) -> Request:
    return "POST", "/datasets/broadcast/saved-views", {"name": "Mine", "q": "jac<0.8"}, {}


def no_saved_view(api: Any) -> Request:
    made = send(api, saved_view(api)).json()
    return "DELETE", f"/saved-views/{made['id']}", None, {}


def export(_api: Any) -> Request:
    body = {"dataset": "broadcast", "format": "cameras", "all": True}
    return "POST", "/exports", body, {}


def no_export(api: Any) -> Request:
    return "DELETE", f"/exports/{ended(api, export(api)).id}", None, {}


def freeze(_api: Any) -> Request:
    return "POST", "/datasets/broadcast/versions", {"name": "v1", "groups": "passing"}, {}


def verification(api: Any) -> Request:
    version = ended(api, freeze(api)).result["version"]
    return "POST", f"/versions/{version}/verify", None, {}


def no_dataset(api: Any) -> Request:
    scenes = make_scenes(groups=1, seed=3, faults=False)
    import_groups(store_of(api), "demo", [scenes[0].group], source="files", actor="local")
    return "DELETE", "/datasets/demo", {"confirm": "demo"}, {}


def limits(api: Any) -> Request:
    present = api.get(f"{API}{BROADCAST}/agreement").json()["limits"]
    return "PUT", f"{BROADCAST}/agreement/limits", {**present, "line_px": 8.0}, {}


def batch(_api: Any) -> Request:
    return "POST", f"{BROADCAST}/batches", {"name": "First half"}, {}


def batch_edited(api: Any) -> Request:
    made = send(api, batch(api)).json()
    return "PATCH", f"/batches/{made['id']}", {"name": "Second half"}, {}


def no_batch(api: Any) -> Request:
    made = send(api, batch(api)).json()
    return "DELETE", f"/batches/{made['id']}", None, {}


def gold_choice(api: Any) -> Request:
    store = store_of(api)
    (scene, *_) = make_scenes(groups=1, seed=3, faults=False)
    truth = {"seed": 3, "groups": {scene.truth.key: truth_to_json(scene.truth)}}
    (store.settings.home / TRUTH).write_text(json_text(truth))
    frames = str((store.settings.home / scene.truth.key).parent / "Frames-v3.zip")
    views = tuple(replace(view, media=Media(frames, view.key)) for view in scene.group.views)
    import_groups(store, "demo", [replace(scene.group, views=views)], source="files", actor="local")
    return "POST", "/datasets/demo/gold", {"source": "sample"}, {}


def guidelines(_api: Any) -> Request:
    return "PUT", f"{BROADCAST}/guidelines", {"text": "Look twice.", "based_on": 0}, {}


def guideline_picture(api: Any) -> Request:
    body = {"upload": uploaded(api, "case.png", picture(0, 40, 30))}
    return "POST", f"{BROADCAST}/guidelines/pictures", body, {}


def data_import(api: Any) -> Request:
    source = {"upload": uploaded(api, "labels.json", b"{}")}
    body = {"dataset": "fresh", "format": "soccernet-v3", "source": source}
    return "POST", "/imports", body, {}


def table(api: Any) -> str:
    """Id of an upload with a ball that is predicted for the first view of the first group."""
    group = api.get(f"{API}/groups/1").json()
    key = group["views"][0]["key"]
    view = View(key, Station(key, ImageSize(1280, 720)))
    name = frame_path_in_split(Group(group["key"], ()), view, "", ".jpg")
    return uploaded(api, "p.csv", f"image,x,y,w,h,score\n{name},600,300,14,14,0.9".encode())


def predictions(api: Any) -> Request:
    # That another process reads them is a test of its own, and takes its time.
    services_of(api).predictions.read = read_files  # type: ignore[method-assign]
    body = {"name": "yolo", "format": "csv", "upload": table(api)}
    return "POST", f"{BROADCAST}/predictions", body, {}


def predicted(api: Any) -> int:
    """Id of a set of predictions, read in this process."""
    store = store_of(api)
    files = PredictionFiles(find_complete_upload_path(store.settings, table(api)), format="csv")
    return add_predictions(store, "broadcast", "yolo", files, actor="local").id


def no_predictions(api: Any) -> Request:
    return "DELETE", f"/predictions/{predicted(api)}", None, {}


def evaluation(api: Any) -> Request:
    return "POST", f"{BROADCAST}/evaluations", {"predictions": predicted(api)}, {}


def no_evaluation(api: Any) -> Request:
    made = ended(api, evaluation(api)).result["evaluation"]
    return "DELETE", f"/evaluations/{made}", None, {}


def accepted(api: Any) -> Request:
    body = {"dataset": "broadcast", "predictions": predicted(api), "q": "", "replace": True}
    return "POST", "/predictions/accept", body, {}


def accepted_at_once(api: Any) -> Request:
    _, path, body, _ = accepted(api)
    del body["q"]
    view = api.get(f"{API}/groups/1").json()["views"][0]["id"]
    return "POST", path, {**body, "views": [view]}, {}


def accepted_one(api: Any) -> Request:
    predicted(api)
    view = api.get(f"{API}/groups/1").json()["views"][0]["id"]
    (box,) = api.get(f"{API}/views/{view}/predictions").json()["items"]
    path = f"/views/{view}/predictions/{box['id']}/accept?replace=true"
    return "POST", path, None, etag_of(api, "/groups/1")


def practice(_api: Any) -> Request:
    return "POST", "/practice", {"again": True}, {}


def recording_practice(_api: Any) -> Request:
    return "POST", "/practice/recording", {}, {}


def cancelled(api: Any) -> Request:
    with store_of(api).write() as session:
        job = insert_job(session, NewJob("solve", "Solve", "local", 1))
    return "DELETE", f"/jobs/{job}", None, {}


def noise(_api: Any) -> Request:
    return "POST", f"{BROADCAST}/noise", None, {}


def no_noise(_api: Any) -> Request:
    return "DELETE", f"{BROADCAST}/noise", None, {}


def paint(api: Any) -> Request:
    using(api, name="touchline")
    return "POST", f"{BROADCAST}/paint", {}, {}


def no_paint(api: Any) -> Request:
    store = store_of(api)
    group = load_group_state(store, 1).group
    views = tuple(replace(view, media=Media(f"/gone/{view.key}")) for view in group.views)
    import_groups(store, "broadcast", [replace(group, views=views)], source="test", actor="local")
    ended(api, paint(api))
    idle(api)
    return "DELETE", f"{BROADCAST}/paint", None, {}


def estimate(_api: Any) -> Request:
    return "POST", f"{BROADCAST}/pictures", {}, {}


def match_of(api: Any, what: str) -> str:
    """Name of the dataset's match."""
    (item,) = api.get(f"{API}{BROADCAST}/{what}").json()["items"]
    return str(item["match"])


def match_picture(api: Any) -> Request:
    stretched = {"aspect": 1.04, "shift": [0.0, 0.0], "sigma": [0.01, 0.01, 0.01]}
    body = {"match": match_of(api, "pictures"), "picture": stretched}
    return "PATCH", f"{BROADCAST}/pictures", body, {}


def pitch(api: Any) -> Request:
    path = f"{BROADCAST}/pitches"
    body = {"match": match_of(api, "pitches"), "length": 103.0, "width": 66.0}
    return "PATCH", path, body, etag_of(api, path)


def solving(_api: Any) -> Request:
    return "POST", f"{BROADCAST}/solve", None, {}


def pitch_estimates(_api: Any) -> Request:
    return "POST", f"{BROADCAST}/pitches", None, {}


def positions(api: Any) -> Request:
    using(api, values={"calibration.share_position": True})
    return "POST", f"{BROADCAST}/positions", {"match": match_of(api, "positions")}, {}


def no_positions(api: Any) -> Request:
    ended(api, positions(api))
    idle(api)
    return "DELETE", f"{BROADCAST}/positions?match={match_of(api, 'positions')}", None, {}


def proposals(_api: Any) -> Request:
    return "POST", f"{BROADCAST}/proposals", {}, {}


def no_proposals(api: Any) -> Request:
    view = api.get(f"{API}/groups/1").json()["views"][0]["id"]
    found = Proposal(view, "nothing", "", {}, None, None, 0, None, None, "", "", "1")
    with store_of(api).write() as session:
        save_proposals(session, [found])
    return "DELETE", f"{BROADCAST}/proposals", None, {}


def rig(api: Any) -> Request:
    import_groups(store_of(api), "rig", rig_groups(45), source="test", actor="local")
    return "POST", "/datasets/rig/rig", {}, {}


def no_rig(api: Any) -> Request:
    method, path, _, _ = asked = rig(api)
    seen = ended(api, asked).result["inputs"]
    ended(api, (method, path, {"accept": "sigma", "inputs": seen}, {}))
    idle(api)
    return "DELETE", path, None, {}


def bell(api: Any) -> Request:
    """Of somebody who is logged in, and was told something."""
    store = store_of(api)
    person, _ = invite(store, "ann", Role.LEAD, actor="local")
    send(api, ("POST", "/groups/1/threads", {"text": "@ann look"}, {}))
    login = Login(1, person.id, "ann", DatasetRoles(Role.LEAD), datetime.now(UTC))
    api.app.dependency_overrides |= {get_login: lambda: login, get_team_login: lambda: None}
    return "POST", "/notifications/read", {"ids": None}, {}
