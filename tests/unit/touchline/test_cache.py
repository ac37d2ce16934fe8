"""Where versions of servers are kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from touchline.cache import cached_version

VERSION = {"dataset": "league", "name": "v1", "created": "2026-11-30T10:00:00Z", "hash": "ab" * 32}


def test_a_version_is_found_again(tmp_path: Path) -> None:
    path = cached_version(tmp_path, VERSION, "exact", images=True)
    assert path == cached_version(tmp_path, {**VERSION, "note": "else"}, "exact", images=True)
    assert path != cached_version(tmp_path, VERSION, "exact", images=False)


@pytest.mark.parametrize("name", ["dataset", "name", "created"])
def test_another_version_of_the_same_hash_is_kept_apart(tmp_path: Path, name: str) -> None:
    """Its licence and pictures may be others."""
    other = {**VERSION, name: "another"}
    paths = {cached_version(tmp_path, one, "exact", images=True) for one in (VERSION, other)}
    assert len(paths) == 2
