"""Settings that depend on what the machine gives."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.config import memory_bytes

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
    assert memory_bytes(own, tmp_path / "groups") == expected * MB


def test_without_a_limit_it_is_the_machines(tmp_path: Path) -> None:
    (own := tmp_path / "cgroup").write_text("0::/\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert memory_bytes(own, tmp_path) == memory_bytes(tmp_path / "none") > 256 * MB
