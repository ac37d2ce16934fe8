from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.errors import ImageError, JobCancelled, TooLargeError
from app.video import indexing
from app.video.frames import read_frames
from app.video.indexing import index_recording
from app.video.measures import hash_distance
from tests.videos import (
    HEIGHT,
    WIDTH,
    mark_interlaced,
    number_of,
    numbered,
    stretch_pixels,
    turn,
    write_pictures,
    write_video,
)


class TestIndexRecording:
    def test_it_knows_the_file_its_frames_and_its_key_frames(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "MPG2", 40)
        index = index_recording(path, settings)
        facts = index.facts
        assert facts.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
        assert facts.bytes == path.stat().st_size
        assert (facts.width, facts.height, facts.rotation) == (WIDTH, HEIGHT, 0)
        assert facts.time_base == (1, 25) and index.pts.tolist() == list(range(40))
        assert index.keys.tolist() == [0, 12, 24, 36]
        assert facts.has_seek_table

    @pytest.mark.parametrize("suffix", ["ts", "mpg"])
    def test_a_stream_has_no_seek_table_and_its_last_frame_a_time(
        self, suffix: str, tmp_path: Path, settings: Settings
    ) -> None:
        index = index_recording(write_video(tmp_path / f"cam1.{suffix}", "MPG2", 40), settings)
        assert not index.facts.has_seek_table
        assert index.pts.tolist() == list(range(40))
        assert index.keys.tolist() == [0, 12, 24, 36]

    def test_a_stream_cut_between_key_frames_begins_with_its_first_frame(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.ts", "MPG2", 60)
        packets = path.read_bytes()
        # The two tables stay; of the pictures the first key frame goes.
        path.write_bytes(packets[: 2 * 188] + packets[10 * 188 :])
        index = index_recording(path, settings)
        assert (len(index), index.times[0]) == (48, 400.0)
        assert (index.fps, index.is_variable) == (25.0, False)
        assert index.seconds[:3] == pytest.approx([0.0, 0.04, 0.08])
        assert index.end == pytest.approx(48 / 25)
        shown = [number_of(image) for _, image in read_frames(path, index, [0, 20, 47])]
        assert shown == [12, 32, 59]

    def test_a_turned_recording_is_upright(self, tmp_path: Path, settings: Settings) -> None:
        path = turn(write_video(tmp_path / "cam1.mp4", "mp4v", 5), 90)
        facts = index_recording(path, settings).facts
        assert facts.rotation == 90
        assert (facts.width, facts.height) == (HEIGHT, WIDTH)

    @pytest.mark.parametrize(
        ("over", "under", "size"), [(4, 3, (213, 96)), (8, 9, (160, 108)), (0, 0, (160, 96))]
    )
    def test_wide_and_high_pixels_are_made_square(
        self, over: int, under: int, size: tuple[int, int], tmp_path: Path, settings: Settings
    ) -> None:
        path = stretch_pixels(write_video(tmp_path / "cam1.mp4", "mp4v", 5), over, under)
        facts = index_recording(path, settings).facts
        assert (facts.width, facts.height) == size
        assert (facts.coded_width, facts.coded_height) == (WIDTH, HEIGHT)

    def test_pixels_of_a_turned_recording_are_turned_too(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = turn(stretch_pixels(write_video(tmp_path / "cam1.mp4", "mp4v", 5), 4, 3), 270)
        facts = index_recording(path, settings).facts
        assert (facts.width, facts.height) == (HEIGHT, 213)

    @pytest.mark.parametrize("since", [0, 150])
    def test_one_whose_interlaced_pictures_cannot_be_read_is_refused(
        self, since: int, tmp_path: Path, settings: Settings
    ) -> None:
        path = mark_interlaced(write_video(tmp_path / "cam 1.avi", "MPG2", 240), since)
        with pytest.raises(ImageError, match=r"^cam 1\.avi is interlaced \(two fields") as caught:
            index_recording(path, settings)
        assert caught.value.hint is not None
        assert "ffmpeg -i 'cam 1.avi' -vf bwdif -c:v" in caught.value.hint

    def test_one_that_cannot_be_decoded_names_its_codec(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.avi", "XVID", 5)
        path.write_bytes(path.read_bytes().replace(b"XVID", b"AV01"))
        with pytest.raises(ImageError, match=r"^cam1\.avi has no frame .* \(codec AV1\)$"):
            index_recording(path, settings)

    @pytest.mark.parametrize("fields", [True, False])
    def test_two_fields_in_a_frame_are_seen(
        self, fields: bool, tmp_path: Path, settings: Settings
    ) -> None:
        def picture(time: float) -> np.ndarray:
            drawn = np.full((240, 320, 3), 60, np.uint8)
            for place in range(0, 320, 40):
                left = int(place + 9 * time) % 320
                drawn[30:210, left : left + 14] = 220
            return drawn

        frames = []
        for number in range(260):
            frame = picture(number)
            if fields:
                frame[1::2] = picture(number + 0.5)[1::2]
            frames.append(frame)
        path = write_pictures(tmp_path / "cam1.avi", "MJPG", frames)
        assert index_recording(path, settings).facts.interlaced is fields

    def test_of_a_recording_that_stands_still_that_is_not_known(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_pictures(tmp_path / "cam1.mp4", "mp4v", [numbered(3)] * 60)
        assert index_recording(path, settings).facts.interlaced is None

    def test_frames_that_look_alike_have_like_hashes(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        noise = np.random.default_rng(3)
        one, other = (
            cv2.resize(noise.integers(0, 255, (12, 20, 3), np.uint8), (320, 180)) for _ in range(2)
        )
        darker = (one * 0.8).astype(np.uint8)
        path = write_pictures(tmp_path / "cam1.avi", "MJPG", [one, darker, other])
        hashes = index_recording(path, settings).measured["hash"]
        near, far = hash_distance(hashes[:1], hashes[1:])
        assert near <= 4 and far >= 20

    def test_who_wants_it_to_end_is_heard(self, tmp_path: Path, settings: Settings) -> None:
        heard = []

        def tell(done: int, total: int | None) -> None:
            heard.append((done, total))
            raise JobCancelled

        with pytest.raises(JobCancelled):
            index_recording(write_video(tmp_path / "cam1.mp4", "mp4v", 150), settings, tell)
        assert heard == [(100, 150)]


def damaged(path: Path, how: str) -> Path:
    """A file that is no whole recording."""
    suffix = {"half of an avi": "avi", "half of a mkv": "mkv"}.get(how, "mp4")
    path = path.with_suffix(f".{suffix}")
    whole = write_video(path, "mp4v" if suffix == "mp4" else "MJPG", 60).read_bytes()
    path.write_bytes(
        {
            "empty": b"",
            "text": b"this is no video, but a text that is long enough to be read",
            "head alone": whole[:40],
            "noise": np.random.default_rng(4).bytes(5000),
        }.get(how, whole[: len(whole) // 2])
    )
    return path


class TestDamagedFiles:
    @pytest.mark.parametrize(
        ("how", "said"),
        [
            ("empty", "is empty"),
            ("text", "is not a video that can be read"),
            ("noise", "is not a video that can be read"),
            ("head alone", "is cut off: 40 of its 44 bytes are there"),
            ("half of an mp4", "is cut off: .* bytes are there"),
            ("half of an avi", "is cut off: .* bytes are there"),
            ("half of a mkv", "is cut off: .* bytes are there"),
        ],
    )
    def test_one_sentence_says_what_is_wrong(
        self, how: str, said: str, tmp_path: Path, settings: Settings
    ) -> None:
        path = damaged(tmp_path / "cam1", how)
        with pytest.raises(ImageError, match=f"^{path.name} ({said})"):
            index_recording(path, settings)

    def test_a_recording_without_end_is_refused(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(indexing, "MAX_FRAMES", 19)
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 20)
        with pytest.raises(TooLargeError, match="more than 19 frames"):
            index_recording(path, settings)

    def test_larger_frames_than_the_limits_are_refused(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write_video(tmp_path / "cam1.mp4", "mp4v", 5)
        with pytest.raises(TooLargeError):
            index_recording(path, settings.model_copy(update={"max_pixels": 1000}))

    def test_a_playlist_opens_no_other_file(self, tmp_path: Path, settings: Settings) -> None:
        other = write_video(tmp_path / "other.mp4", "mp4v", 5)
        path = tmp_path / "list.mp4"
        path.write_text(f"ffconcat version 1.0\nfile '{other}'\n")
        with pytest.raises(ImageError, match="not a video that can be read"):
            index_recording(path, settings)
