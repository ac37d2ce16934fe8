"""Videos: opened as files of known containers, never as lists that name other files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2

_CONTAINERS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,asf,flv,ogg"
"""By FFmpeg's names. Those that are left out include playlists (concat, hls): their files could
be anywhere."""
_OPTIONS = f"format_whitelist;{_CONTAINERS}|protocol_whitelist;file"


@contextmanager
def open_video(path: Path) -> Iterator[cv2.VideoCapture]:
    """A video, opened or not (``isOpened``), and closed again."""
    # Read by OpenCV at each opening. No other backend: one of them takes "%d" in a name for a
    # row of files.
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = _OPTIONS
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        yield video
    finally:
        video.release()
