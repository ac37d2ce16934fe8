"""Settings that depend on what the machine gives, and on files that they name."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer

from app.config import Settings, find_memory_limit, is_local
from app.errors import InputError
from app.terminal.options import read_settings

MB = 2**20


@pytest.mark.parametrize(
    ("said", "limits", "expected"),
    [
        (
            "0::/system.slice/touchline.service",
            {"system.slice/touchline.service/memory.max": 64},
            64,
        ),
        ("0::/a/b", {"a/memory.max": 32, "a/b/memory.max": 64}, 32),
        # A container on version 1 names the path outside, and shows its own group as the outermost.
        ("5:cpu:/x\n4:memory:/docker/1", {"memory/memory.limit_in_bytes": 48}, 48),
    ],
    ids=["unit", "around", "container"],
)
def test_memory_is_what_the_control_group_leaves(
    tmp_path: Path, said: str, limits: dict[str, int], expected: int
) -> None:
    (own := tmp_path / "cgroup").write_text(said + "\n")
    for name, limit in limits.items():
        file = tmp_path / "groups" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{limit * MB}\n")
    assert find_memory_limit(own, tmp_path / "groups") == expected * MB


def test_without_a_limit_it_is_the_machines(tmp_path: Path) -> None:
    (own := tmp_path / "cgroup").write_text("0::/\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert find_memory_limit(own, tmp_path) == find_memory_limit(tmp_path / "none") > 256 * MB


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, 0) for name in ("workers", "image_workers", "max_upload_bytes", "max_file_bytes")),
        *((name, 0) for name in ("import_memory", "import_seconds", "max_members", "max_side")),
        *((name, -1) for name in ("upload_days", "export_days", "job_days", "cache_days")),
        *((name, -1) for name in ("answer_bytes", "max_pixels", "port")),
        ("port", 65536),
    ],
)
def test_a_number_out_of_bounds_is_wrong_usage(
    name: str, value: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"TOUCHLINE_{name.upper()}", str(value))
    with pytest.raises(typer.BadParameter, match=f"TOUCHLINE_{name.upper()}"):
        read_settings()


def test_every_number_has_bounds() -> None:
    numbers = {
        name
        for name, field in Settings.model_fields.items()
        if field.annotation in (int, float, int | None)
    }
    assert "workers" in numbers
    assert not {name for name in numbers if not Settings.model_fields[name].metadata}


class TestDatabaseUrlFile:
    URL = "postgresql://ann:pass@database/touchline"

    @pytest.fixture(autouse=True)
    def _no_url(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("TOUCHLINE_DATABASE_URL", raising=False)

    @pytest.fixture
    def file(self, tmp_path: Path) -> Path:
        """A file with the address, of its owner alone."""
        (file := tmp_path / "url").write_text(f"{self.URL}\n")
        file.chmod(0o600)
        return file

    def test_the_address_is_what_the_file_says(
        self, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_DATABASE_URL_FILE", str(file))
        settings = Settings(home=tmp_path)
        assert settings.database == self.URL
        assert "pass" not in repr(settings)

    def test_it_is_given_once(self, file: Path) -> None:
        with pytest.raises(InputError, match="given twice"):
            Settings(database_url="postgresql://other/x", database_url_file=file)

    @pytest.mark.parametrize("mode", [0o640, 0o604, 0o620])
    def test_a_file_that_others_may_use_is_refused(self, file: Path, mode: int) -> None:
        file.chmod(mode)
        with pytest.raises(InputError, match="other users can read") as caught:
            Settings(database_url_file=file)
        assert "pass" not in f"{caught.value.message} {caught.value.hint}"

    @pytest.mark.parametrize("content", [b" \n", b"\xff\xfe", None], ids=["empty", "bytes", "none"])
    def test_a_file_without_an_address_is_refused(self, file: Path, content: bytes | None) -> None:
        file.unlink() if content is None else file.write_bytes(content)
        with pytest.raises(InputError, match=r"is empty|cannot be read"):
            Settings(database_url_file=file)


class TestIsLocal:
    @pytest.mark.parametrize(
        "host", ["127.0.0.1", "127.8.8.8", "127.1", "0x7f.1", "localhost", "::1", "[::1]"]
    )
    def test_this_machine_alone(self, host: str) -> None:
        assert is_local(host)

    @pytest.mark.parametrize(
        "host",
        [
            "0.0.0.0",
            "0",
            "10.1",
            "::",
            "10.0.0.1",
            "example.org",
            "",
            "localhost.",
            "127.0.0.1 x",
            "127.0.0.300",
        ],
    )
    def test_everything_else_is_reached_by_others(self, host: str) -> None:
        assert not is_local(host)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("PROXIES", '["proxy.example.org"]', "is not an address such as 10.0.0.7"),
        ("ALLOWED_HOSTS", '["https://x.example"]', "is not a host name"),
        ("ALLOWED_HOSTS", '["localhost:8820"]', "is not a host name"),
        ("IMPORT_FOLDERS", "[bad", "is not JSON; write it as"),
    ],
)
def test_a_value_that_can_never_match_is_refused_with_its_setting(
    name: str, value: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"TOUCHLINE_{name}", value)
    with pytest.raises(typer.BadParameter, match=said) as refused:
        read_settings()
    assert f"(TOUCHLINE_{name})" in refused.value.message
