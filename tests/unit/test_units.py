"""The units of systemd: what guards the server guards the backup, which reads the same home."""

from __future__ import annotations

from pathlib import Path

DOCKER = Path(__file__).parents[2] / "docker"
GUARDS = (
    "Protect",
    "Private",
    "Restrict",
    "Capability",
    "Ambient",
    "SystemCall",
    "Lock",
    "IPAddress",
)
MORE = ("NoNewPrivileges", "RemoveIPC", "UMask")


def guards(name: str) -> dict[str, str]:
    lines = (DOCKER / name).read_text().splitlines()
    settings = dict(
        line.split("=", 1) for line in lines if "=" in line and not line.startswith("#")
    )
    return {key: text for key, text in settings.items() if key.startswith(GUARDS) or key in MORE}


def test_the_backup_is_guarded_as_the_server_is() -> None:
    server = guards("touchline.service")
    assert len(server) > 20
    assert guards("touchline-backup.service") == server
