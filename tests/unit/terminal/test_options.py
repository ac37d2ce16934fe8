"""What was typed, or set in the environment, in a wrong way is told in a sentence."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from typer import BadParameter

from app.terminal.options import parse_frame_offset

Run = Callable[..., tuple[int, str, str]]


class TestParsePlace:
    def test_the_name_of_what_is_not_there_does_not_steer_the_terminal(
        self, touchline: Run
    ) -> None:
        code, _, err = touchline("import", "coco", "/\x1b[31mx", "--dataset", "x")
        assert code == 2
        assert "Path '/\\u001b[31mx' does not exist." in err
        assert "\x1b" not in err


class TestParseFrameOffset:
    @pytest.mark.parametrize("text", ["1=8,2=-9", "1:8, 2:-9"])
    def test_cameras_are_told_apart_with_an_equals_sign_or_a_colon(self, text: str) -> None:
        assert parse_frame_offset(text) == {1: 8, 2: -9}

    def test_one_number_is_that_of_all(self) -> None:
        assert parse_frame_offset("-8") == -8

    @pytest.mark.parametrize("text", ["", "1=", "1-8", "1=8;2=9"])
    def test_anything_else_is_refused(self, text: str) -> None:
        with pytest.raises(BadParameter, match="is not an offset"):
            parse_frame_offset(text)


class TestReadSettings:
    @pytest.mark.parametrize(
        ("name", "content", "shape"),
        [
            ("TOUCHLINE_ALLOWED_HOSTS", "example.org", '["ONE", "ANOTHER"]'),
            ("TOUCHLINE_STORES", '{"a": {"secret": "example.org', '{"NAME": {...}}'),
        ],
    )
    def test_a_variable_that_is_no_json_is_named_with_its_shape_and_not_its_content(
        self, touchline: Run, monkeypatch: pytest.MonkeyPatch, name: str, content: str, shape: str
    ) -> None:
        monkeypatch.setenv(name, content)
        code, _, err = touchline("doctor")
        assert code == 2
        assert f"{name} is not JSON; write it as {shape}" in " ".join(err.replace("│", "").split())
        assert "example.org" not in err
        assert "Traceback" not in err
