"""What is written for operators keeps what SECURITY.md promises."""

from __future__ import annotations

import re
from configparser import RawConfigParser
from typing import Any

import pytest
import yaml

from tests.release.libraries import ROOT

FOLDER = ROOT / "docker"


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    """The services of compose.yaml."""
    text = (FOLDER / "compose.yaml").read_text("utf-8")
    found: dict[str, Any] = yaml.safe_load(text)["services"]
    return found


class TestCompose:
    def test_nobody_reaches_touchline_but_through_the_proxy(self, services: dict[str, Any]) -> None:
        assert "ports" not in services["touchline"]
        assert services["touchline"]["network_mode"] == "service:proxy"
        assert "TOUCHLINE_HOST" not in services["touchline"]["environment"]

    def test_people_log_in_under_the_name_that_the_proxy_has_a_certificate_for(
        self, services: dict[str, Any]
    ) -> None:
        given = services["touchline"]["environment"]
        assert given["TOUCHLINE_TEAM"] == "true"
        assert given["TOUCHLINE_URL"] == "https://${TOUCHLINE_NAME}"

    def test_the_proxy_never_starts_without_its_name(self, services: dict[str, Any]) -> None:
        given = services["proxy"]["environment"]
        used = set(re.findall(r"\{\$(\w+)\}", (FOLDER / "Caddyfile").read_text("utf-8")))
        assert used == given.keys() == {"TOUCHLINE_NAME"}
        assert all(text.startswith(f"${{{name}:?") for name, text in given.items())

    def test_both_may_write_to_their_volumes_alone(self, services: dict[str, Any]) -> None:
        for service in services.values():
            assert service["read_only"] is True
            assert service["cap_drop"] == ["ALL"]
            assert service["security_opt"] == ["no-new-privileges:true"]

    def test_neither_takes_the_whole_machine(self, services: dict[str, Any]) -> None:
        assert all({"mem_limit", "pids_limit"} <= service.keys() for service in services.values())

    def test_backups_lie_beside_the_home(self, services: dict[str, Any]) -> None:
        assert "${TOUCHLINE_BACKUPS:-backups}:/backups" in services["touchline"]["volumes"]
        text = (FOLDER / "Dockerfile").read_text("utf-8")
        assert re.search(r"install -d .* -o 10001 .* /backups$", text, re.M)


class TestDockerfile:
    def test_what_may_be_large_is_not_made_in_memory(self, services: dict[str, Any]) -> None:
        text = (FOLDER / "Dockerfile").read_text("utf-8")
        for name in ("TMPDIR", "NUMBA_CACHE_DIR"):
            folder = re.search(rf"^ENV .*\b{name}=(\S+)", text, re.M)
            assert folder and folder[1].startswith("/data/")
        assert re.search(r"install -d .* /data/tmp\b", text)

    def test_what_runs_is_not_root_and_has_no_tools(self) -> None:
        text = (FOLDER / "Dockerfile").read_text("utf-8")
        last = text.rpartition("\nFROM ")[2]
        assert re.search(r"^USER [1-9]\d*:[1-9]\d*$", last, re.M)
        assert re.search(r"^HEALTHCHECK ", last, re.M)
        assert re.findall(r"^VOLUME (.*)$", last, re.M) == ["/data"]
        assert "TOUCHLINE_HOST" not in text
        assert not re.search(r"\bapt|\bpip\b|\bmake\b", last)


class TestUnit:
    def test_the_service_writes_to_its_own_folders_alone(self) -> None:
        unit = RawConfigParser(strict=False)
        unit.optionxform = str  # type: ignore[assignment,method-assign]
        unit.read(FOLDER / "touchline.service")
        service = unit["Service"]
        assert service["User"] not in ("", "root")
        assert service["ProtectSystem"] == "strict"
        assert service["NoNewPrivileges"] == "yes"
        assert "ReadWritePaths" not in service
        assert f"%S/{service['StateDirectory']}" in service["Environment"]
        assert {"TasksMax", "MemoryMax"} <= service.keys()
        assert {"StartLimitIntervalSec", "StartLimitBurst"} <= unit["Unit"].keys()
        assert service["RestartPreventExitStatus"] == "2"
        assert f"%C/{service['CacheDirectory']}" in service["Environment"]
