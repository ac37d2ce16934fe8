"""Files that are called videos, and would have the decoder open others, or take all memory."""

from __future__ import annotations

import ctypes
import os
import re
import resource
import socket
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.config import Settings
from app.db.store import Store
from app.errors import ImageError, StorageError, TooLargeError
from app.features.recordings.index import index_recording_file, index_recording_in_worker
from app.features.recordings.service import add_recording, get_recording
from app.video.frames import read_frames
from app.video.indexing import index_recording
from tests.videos import HEIGHT, WIDTH, write_video

_OPENED = 0x20
"""IN_OPEN of inotify."""
PLAYLISTS = {
    "concat.mp4": "ffconcat version 1.0\nfile beside/secret.mp4\n",
    "absolute.mp4": "ffconcat version 1.0\nfile '{file}'\n",
    "concat.mkv": "ffconcat version 1.0\nfile 'http://{host}/a.mp4'\n",
    "list.m3u8.mp4": "#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\n{file}\n#EXT-X-ENDLIST\n",
    "network.ts": "#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\nhttp://{host}/a.ts\n#EXT-X-ENDLIST\n",
    "session.mp4": "v=0\no=- 0 0 IN IP4 {address}\ns=x\nc=IN IP4 {address}\nt=0 0\n"
    "m=video {port} RTP/AVP 96\na=rtpmap:96 H264/90000\n",
    "manifest.mp4": '<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011" type="static">'
    "<Period><BaseURL>http://{host}/</BaseURL></Period></MPD>",
    "redirect.wmv": "[Reference]\nRef1=http://{host}/a.asf\n",
    "pattern.mp4": "{file}",
}
"""What a text of that name would have opened: a file beside it, or an address of this machine."""


@contextmanager
def nobody_opens(path: Path) -> Iterator[None]:
    """Fails where a file is opened meanwhile, by whatever way."""
    libc = ctypes.CDLL(None, use_errno=True)
    watch = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        assert libc.inotify_add_watch(watch, os.fsencode(path), _OPENED) > 0
        yield
        with pytest.raises(BlockingIOError):
            os.read(watch, 4096)
    finally:
        os.close(watch)


@contextmanager
def nobody_calls() -> Iterator[tuple[str, int]]:
    """Where to call on this machine; fails where somebody does."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        listener.setblocking(False)
        yield listener.getsockname()
        with pytest.raises(BlockingIOError):
            listener.accept()


class TestPlaylists:
    @pytest.mark.parametrize("name", PLAYLISTS)
    def test_it_is_refused_and_nothing_is_opened(
        self, name: str, tmp_path: Path, settings: Settings
    ) -> None:
        (tmp_path / "beside").mkdir()
        file = write_video(tmp_path / "beside" / "secret.mp4", "mp4v", 5)
        path = tmp_path / name
        with nobody_calls() as (address, port):
            host = f"{address}:{port}"
            text = PLAYLISTS[name].format(file=file, host=host, address=address, port=port)
            path.write_text(text)
            with nobody_opens(file), pytest.raises(ImageError) as caught:
                index_recording(path, settings)
        assert caught.value.message == f"{name} is not a video that can be read"

    @pytest.mark.parametrize("name", ["film_%d.mp4", "concat:a.mp4|b.mp4", "pipe:0.mp4"])
    def test_a_name_that_says_something_to_the_decoder_is_a_name(
        self, name: str, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        plain = write_video(tmp_path / "plain.mp4", "mp4v", 5)
        monkeypatch.chdir(tmp_path)
        plain.rename(tmp_path / name)
        assert len(index_recording(tmp_path / name, settings)) == 5


def jpeg_of(data: bytes, sides: int) -> bytes:
    """The file, whose JPEGs say that they are so wide and high."""
    return re.sub(
        rb"(\xff\xc0\x00\x11\x08)....", lambda m: m[1] + struct.pack(">HH", sides, sides), data
    )


def png_of(data: bytes, sides: int) -> bytes:
    """The file, whose PNGs say that they are so wide and high."""
    found = bytearray(data)
    for place in [match.start() for match in re.finditer(b"IHDR", data)]:
        found[place + 4 : place + 12] = struct.pack(">II", sides, sides)
        checksum = zlib.crc32(bytes(found[place : place + 17]))
        found[place + 17 : place + 21] = struct.pack(">I", checksum)
    return bytes(found)


class TestHugePictures:
    """A few bytes that say that they are gigabytes."""

    @pytest.mark.parametrize("sides", [16_000, 60_000])
    @pytest.mark.parametrize("codec", ["MJPG", "MPNG"])
    def test_they_are_refused_in_a_process_of_little_memory(
        self, codec: str, sides: int, store: Store, tmp_path: Path
    ) -> None:
        path = write_video(tmp_path / "huge.avi", codec, 20)
        small = path.read_bytes()
        path.write_bytes((jpeg_of if codec == "MJPG" else png_of)(small, sides))
        assert path.read_bytes() != small
        recording = add_recording(store, "cup", path, actor="ann")
        with pytest.raises((ImageError, TooLargeError), match=r"^huge\.avi "):
            index_recording_in_worker(
                store, recording.id, actor="ann", progress=lambda *_: None, stop=lambda: None
            )
        assert not get_recording(store, recording.id).indexed

    def test_those_that_grow_amid_the_file_have_the_size_of_the_first(
        self, settings: Settings, tmp_path: Path
    ) -> None:
        path = write_video(tmp_path / "grows.avi", "MJPG", 20)
        data = path.read_bytes()
        half = len(data) // 2
        path.write_bytes(data[:half] + jpeg_of(data[half:], 1600))
        index = index_recording(path, settings)
        shapes = {frame.shape for _, frame in read_frames(path, index, range(len(index)))}
        assert shapes == {(HEIGHT, WIDTH, 3)}


class TestFullDisk:
    def test_it_is_a_sentence_and_leaves_nothing(self, settings: Settings, tmp_path: Path) -> None:
        path = write_video(tmp_path / "final.mp4", "mp4v", 60)
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        try:
            # A disk on which no file gets any larger.
            resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
            with pytest.raises(StorageError, match=r"index of final\.mp4 cannot be stored"):
                index_recording_file(path, settings, lambda _: None)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert list(settings.recordings.iterdir()) == []
        index_recording_file(path, settings, lambda _: None)
        assert len(list(settings.recordings.iterdir())) == 1
