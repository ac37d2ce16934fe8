from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import UnsafePathError
from app.formats.safe_path import require_safe_path, resolve_inside

HOSTILE = [
    "", "..", "../a", "a/../../b", "a/..", "/etc/passwd", "//host/share", "C:/a", "c:a",
    "a\\b", "..\\a", "a\x00b", "a\nb", "a\x7f", "%2e%2e/a", "%2e%2e%2fa", "%252e%252e%252fa",
    "..%2fa", "%2fetc/passwd", "..%5ca", "a%00b", "\uff0e\uff0e/a", "\u2025/a", "a/\ud800",
    "%EF%BC%8E%EF%BC%8E/a", "%E2%80%A5/a",
    "a/" + "b" * 256, "é" * 128 + "/a",
]  # fmt: skip


class TestCheckName:
    @pytest.mark.parametrize("name", HOSTILE)
    def test_a_hostile_path_is_refused(self, name: str) -> None:
        with pytest.raises(UnsafePathError):
            require_safe_path(name)

    @pytest.mark.parametrize(
        "name",
        ["7.png", "a/b/c", "spain_laliga/2014-2015/2015-02-14 - 20-00 Málaga 1 - 0 Elche/x.json",
         "100% FC 2 - 1 A.C. Ö/..7.png", "a..b", "...", ".hidden", "b" * 255 + "/" + "c" * 255],
    )  # fmt: skip
    def test_the_names_of_matches_are_fine(self, name: str) -> None:
        assert require_safe_path(name) == name


class TestResolveInside:
    @pytest.mark.parametrize("name", HOSTILE)
    def test_a_hostile_path_is_refused(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(UnsafePathError):
            resolve_inside(tmp_path, name)

    def test_a_file_that_is_still_to_be_made_is_fine(self, tmp_path: Path) -> None:
        assert resolve_inside(tmp_path, "a/b.json") == tmp_path.resolve() / "a/b.json"

    def test_a_link_that_leads_out_is_refused(self, tmp_path: Path) -> None:
        root = tmp_path / "root"
        root.mkdir()
        (tmp_path / "secret").write_text("x")
        (root / "file").symlink_to(tmp_path / "secret")
        (root / "folder").symlink_to(tmp_path)
        for name in ("file", "folder/secret", "folder/new"):
            with pytest.raises(UnsafePathError, match="leads out"):
                resolve_inside(root, name)

    def test_a_link_that_stays_inside_is_followed(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("x")
        (tmp_path / "b").symlink_to(tmp_path / "a")
        assert resolve_inside(tmp_path, "b") == (tmp_path / "a").resolve()

    def test_the_root_may_be_a_link_itself(self, tmp_path: Path) -> None:
        (tmp_path / "real").mkdir()
        (tmp_path / "root").symlink_to(tmp_path / "real")
        assert resolve_inside(tmp_path / "root", "a") == (tmp_path / "real").resolve() / "a"

    @given(st.text(max_size=30))
    def test_whatever_is_accepted_lies_inside(self, name: str) -> None:
        root = Path("/srv/data")
        try:
            real = resolve_inside(root, name)
        except (UnsafePathError, OSError):
            return
        assert real == root or root in real.parents
