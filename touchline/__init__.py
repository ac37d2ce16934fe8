"""Touchline for scripts: frozen versions as records and tables, cameras, frames, and a client.

    import touchline

    version = touchline.open("league-v1.zip")            # or an address, with dataset= and version=
    for view in version.views:
        print(view.key, view.camera.project([[0, 0, 0]]))

docs/library.md has the rest. Nothing here needs the server's code.
"""

from touchline.ball import Ball, Box, ImageBall
from touchline.camera import Camera
from touchline.client import Client
from touchline.dataset import Dataset
from touchline.errors import TouchlineError
from touchline.opening import open_version as open  # noqa: A004  `touchline.open` is its name
from touchline.pitch import markings
from touchline.recordings import Link, Recording, Shot
from touchline.samples import Samples
from touchline.track import Track, TrackEvent
from touchline.view import Group, View

__all__ = [
    "Ball",
    "Box",
    "Camera",
    "Client",
    "Dataset",
    "Group",
    "ImageBall",
    "Link",
    "Recording",
    "Samples",
    "Shot",
    "TouchlineError",
    "Track",
    "TrackEvent",
    "View",
    "markings",
    "open",
]
