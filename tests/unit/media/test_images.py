from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.config import Settings
from app.errors import ImageError, TooLargeError
from app.media.images import MAX_SCANS, ImageHeader, check_jpeg_scans, check_size, read_header

PICTURE = np.random.default_rng(3).integers(0, 255, (37, 53, 3), dtype=np.uint8)
WEBP_LOSSLESS = [cv2.IMWRITE_WEBP_QUALITY, 101]


def encoded(suffix: str, *options: int) -> bytes:
    return cv2.imencode(suffix, PICTURE, list(options))[1].tobytes()


def png(width: int, height: int) -> bytes:
    """The beginning of a PNG that declares a size."""
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", b"")


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def webp_extended() -> bytes:
    """A WebP with transparency: its size stands in a header before that of the picture."""
    transparent = np.dstack([PICTURE, np.full(PICTURE.shape[:2], 9, np.uint8)])
    data = cv2.imencode(".webp", transparent, [cv2.IMWRITE_WEBP_QUALITY, 50])[1].tobytes()
    assert data[12:16] == b"VP8X"
    return data


def many_scans(count: int) -> bytes:
    """A progressive JPEG that a decoder takes, with so many scans: the last one of ten again and again."""
    whole = encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    last = whole.rfind(b"\xff\xda")
    assert whole.count(b"\xff\xda") == 10
    return whole[:last] + whole[last:-2] * (count - 9) + whole[-2:]


class TestReadHeader:
    @pytest.mark.parametrize(
        ("data", "kind"),
        [
            (encoded(".jpg"), "image/jpeg"),
            (encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1), "image/jpeg"),
            (encoded(".png"), "image/png"),
            (encoded(".webp"), "image/webp"),
            (encoded(".webp", *WEBP_LOSSLESS), "image/webp"),
        ],
    )
    def test_agrees_with_the_encoder(self, data: bytes, kind: str) -> None:
        assert read_header(data) == ImageHeader(kind, 53, 37)

    def test_an_extended_webp_declares_its_canvas(self) -> None:
        assert read_header(webp_extended()) == ImageHeader("image/webp", 53, 37)

    def test_a_comment_before_the_frame_of_a_jpeg_is_skipped(self) -> None:
        data = encoded(".jpg")
        comment = b"\xff\xfe\x00\x06\xff\xc0\x00\x00"
        assert read_header(data[:2] + comment + data[2:]) == ImageHeader("image/jpeg", 53, 37)

    @pytest.mark.parametrize(
        "data",
        [
            b"",
            b"GIF89a" + bytes(50),
            b"<svg xmlns='http://www.w3.org/2000/svg'/>",
            b"BM" + bytes(60),
            b"\xff\xd8\xff\xd9",
            b"\xff\xd8\xff\xe0\x00\x00" + bytes(20),
            b"\xff\xd8\xff",
            encoded(".png")[:20],
            encoded(".jpg")[:15],
            encoded(".webp")[:16],
            b"\x89PNG\r\n\x1a\n" + bytes(40),
            b"RIFF\0\0\0\0WEBPJUNK" + bytes(20),
            png(0, 5),
        ],
    )
    def test_a_file_that_is_no_image_is_refused_in_a_sentence(self, data: bytes) -> None:
        with pytest.raises(ImageError):
            read_header(data)

    @given(st.binary(max_size=60))
    def test_any_bytes_are_a_header_or_an_image_error(self, data: bytes) -> None:
        for start in (b"", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"RIFF\0\0\0\0WEBP"):
            try:
                read_header(start + data)
            except ImageError as error:
                assert error.message


class TestCheckSize:
    @pytest.mark.parametrize(
        ("width", "height"), [(16_385, 1), (1, 16_385), (10_000, 5_001), (100_000, 100_000)]
    )
    def test_refuses_what_is_too_large(self, width, height) -> None:
        with pytest.raises(TooLargeError, match=f"{width} x {height}"):
            check_size(read_header(png(width, height)), Settings())

    @pytest.mark.parametrize(
        ("largest", "larger"), [((10_000, 5_000), (10_000, 5_001)), ((16_384, 3_051), (16_385, 1))]
    )
    def test_refuses_no_image_but_what_is_larger_than_the_largest(self, largest, larger) -> None:
        refused = []
        for size in (largest, larger):
            try:
                check_size(read_header(png(*size)), Settings())
            except TooLargeError:
                refused.append(size)
        assert refused == [larger]


class TestCheckScans:
    def test_refuses_what_is_drawn_once_more_than_the_most(self) -> None:
        most, more = many_scans(MAX_SCANS), many_scans(MAX_SCANS + 1)
        check_jpeg_scans(most)
        with pytest.raises(TooLargeError, match=r"^frame 7\.jpg is drawn in more than 100 scans"):
            check_jpeg_scans(more, "frame 7.jpg")
        for data in (most, more):
            picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
            assert picture.shape == PICTURE.shape

    @pytest.mark.parametrize(
        "option", [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 1)]
    )
    def test_takes_what_encoders_write(self, option: tuple[int, ...]) -> None:
        check_jpeg_scans(encoded(".jpg", cv2.IMWRITE_JPEG_QUALITY, 100, *option))

    @pytest.mark.parametrize(
        "between",
        [
            pytest.param(b"\xff\xfe\x00\x04\xff\xd9", id="an end within a comment"),
            pytest.param(b"\xff\x02\xff\xff", id="a reserved marker and a length"),
            pytest.param(b"\xff\x00\xff\xff", id="a stuffed byte and a length"),
            pytest.param(b"\xff\xd3\xff\xff", id="a restart and a length"),
            pytest.param(b"\xff\xff\xff", id="bytes that fill"),
            pytest.param(b"\xff\xfe\x00\x00", id="a comment without its length"),
        ],
    )
    def test_counts_the_scans_behind_whatever_a_decoder_passes_over(self, between: bytes) -> None:
        scan = b"\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00" + between
        check_jpeg_scans(b"\xff\xd8" + scan * MAX_SCANS)
        with pytest.raises(TooLargeError):
            check_jpeg_scans(b"\xff\xd8" + scan * (MAX_SCANS + 1))

    @pytest.mark.parametrize("place", ["a comment", "behind the end"])
    def test_what_is_no_scan_counts_as_none(self, place: str) -> None:
        data, scans = encoded(".jpg"), b"\xff\xda\x00\x02" * (MAX_SCANS + 1)
        comment = b"\xff\xfe" + struct.pack(">H", len(scans) + 2) + scans
        check_jpeg_scans(
            data[:2] + comment + data[2:] if place == "a comment" else data + bytes(2) + scans
        )

    @given(st.lists(st.sampled_from([b"\xff", b"\xda", b"\xd9", b"\xfe", b"\0", b"\x02"])))
    def test_any_bytes_come_to_an_end(self, parts: list[bytes]) -> None:
        check_jpeg_scans(b"\xff\xd8" + b"".join(parts))
