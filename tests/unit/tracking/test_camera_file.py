"""Cameras of frames as a file, both ways."""

from __future__ import annotations

import pytest

from app.errors import InputError
from app.tracking.camera_file import frame_cameras_from_bytes, frame_cameras_to_bytes
from tests.tracked_frames import frame


def test_frames_come_back_exactly_and_the_same_frames_are_the_same_bytes():
    frames = [frame(7, "tracked"), frame(8, "bridged"), frame(9, "lost")]
    content = frame_cameras_to_bytes(frames)
    back = frame_cameras_from_bytes(content)
    assert back == frames and back[2].camera is None
    assert back[0].camera is not None and frames[0].camera is not None
    assert (back[0].camera.rotation == frames[0].camera.rotation).all()
    assert frame_cameras_to_bytes(back) == content


@pytest.mark.parametrize("content", [b"", b"no file", b"PK\x03\x04"])
def test_what_is_no_such_file_is_refused(content: bytes):
    with pytest.raises(InputError, match="empty or damaged"):
        frame_cameras_from_bytes(content)
    whole = frame_cameras_to_bytes([frame(0, "tracked")])
    with pytest.raises(InputError):
        frame_cameras_from_bytes(whole[: len(whole) // 2])
