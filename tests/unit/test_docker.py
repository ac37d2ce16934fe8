"""What is written for operators keeps what SECURITY.md promises."""

from __future__ import annotations

import json
import os
import re
import shlex
import stat
import subprocess
from configparser import RawConfigParser
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.config import ObjectStoreSettings, Settings
from app.object_store.store import read_access_keys
from app.workers.cluster import parse_scheduler_address
from tests.team_at_scale import FOLDER, make_secrets, settings_of, together


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    """The services of compose.yaml."""
    text = (FOLDER / "compose.yaml").read_text("utf-8")
    found: dict[str, Any] = yaml.safe_load(text)["services"]
    return found


def assert_bounded_log(service: dict[str, Any]) -> None:
    """What a service says stays below 200 MB on this machine's disk."""
    log = service["logging"]
    assert log["driver"] == "local"
    size = re.fullmatch(r"(\d+)m", log["options"]["max-size"])
    assert size
    assert 0 < int(size[1]) * int(log["options"]["max-file"]) <= 200


class TestCompose:
    def test_nobody_reaches_touchline_but_through_the_proxy(self, services: dict[str, Any]) -> None:
        assert [name for name, one in services.items() if "ports" in one] == ["door"]
        for name in ("touchline", "proxy"):
            assert services[name]["network_mode"] == "service:door"
        assert "TOUCHLINE_HOST" not in services["touchline"]["environment"]

    def test_the_service_that_owns_the_network_never_ends_by_itself(
        self, services: dict[str, Any]
    ) -> None:
        """Whose network ends while others live in it leaves them where nobody comes."""
        door = services["door"]
        assert door["command"] == ["tail", "-f", "/dev/null"]
        assert door["restart"] == "unless-stopped"
        for name in ("touchline", "proxy"):
            assert services[name]["depends_on"]["door"]["restart"] is True

    def test_frames_that_are_not_there_are_not_made(self, services: dict[str, Any]) -> None:
        (frames,) = [one for one in services["touchline"]["volumes"] if isinstance(one, dict)]
        assert (frames["target"], frames["read_only"]) == ("/frames", True)
        assert frames["bind"] == {"create_host_path": False}

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

    def test_each_may_write_to_its_volumes_alone(self, services: dict[str, Any]) -> None:
        for service in services.values():
            assert service["read_only"] is True
            assert service["cap_drop"] == ["ALL"]
            assert service["security_opt"] == ["no-new-privileges:true"]

    def test_none_takes_the_whole_machine(self, services: dict[str, Any]) -> None:
        assert all({"mem_limit", "pids_limit"} <= service.keys() for service in services.values())

    def test_none_fills_the_disk_with_what_it_says(self, services: dict[str, Any]) -> None:
        for service in services.values():
            assert_bounded_log(service)

    def test_backups_lie_beside_the_home(self, services: dict[str, Any]) -> None:
        assert "${TOUCHLINE_BACKUPS:-backups}:/backups" in services["touchline"]["volumes"]
        text = (FOLDER / "Dockerfile").read_text("utf-8")
        assert re.search(r"install -d .* -o 10001 .* /backups$", text, re.M)

    def test_settings_are_those_that_the_product_knows(self, services: dict[str, Any]) -> None:
        given = services["touchline"]["environment"]
        assert {name for name in given if name.startswith("TOUCHLINE_")} <= KNOWN

    def test_the_proxy_is_asked_whether_it_listens(self, services: dict[str, Any]) -> None:
        # Touchline's own is in its image.
        assert "healthcheck" in services["proxy"]


KNOWN = {f"TOUCHLINE_{name.upper()}" for name in Settings.model_fields}
AS_ROOT = {"proxy"}
"""Caddy's image has no other user; it has no capability but for ports below 1024."""
OWN_IMAGE = {"touchline", "scheduler", "worker"}
"""Whose image says who they are."""


@pytest.fixture(scope="module")
def scaled() -> dict[str, Any]:
    """compose.yaml with scale.yaml laid over it."""
    return together()


@pytest.fixture(scope="module")
def secrets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What make-secrets.sh makes, for whoever runs the tests."""
    return make_secrets(tmp_path_factory.mktemp("made") / "secrets")


class TestScale:
    def test_nobody_reaches_anything_but_the_proxy(self, scaled: dict[str, Any]) -> None:
        services = scaled["services"]
        assert [name for name, one in services.items() if "ports" in one] == ["door"]
        assert services["touchline"]["network_mode"] == "service:door"
        inner = {name: (text or {}).get("internal") for name, text in scaled["networks"].items()}
        assert all(inner.values())
        assert set(services["door"]["networks"]) == {"default", *inner}

    def test_workers_reach_neither_database_nor_store(self, scaled: dict[str, Any]) -> None:
        joined = {name: set(one.get("networks", ())) for name, one in scaled["services"].items()}
        for name in ("worker", "scheduler"):
            assert not joined[name] & (joined["database"] | joined["store"])
            read = {one["source"] for one in scaled["services"][name]["secrets"]}
            assert read == {"cluster_ca", "cluster_certificate", "cluster_key"}

    def test_every_service_is_confined(self, scaled: dict[str, Any]) -> None:
        for name, service in scaled["services"].items():
            assert service["read_only"] is True, name
            assert service["cap_drop"] == ["ALL"], name
            assert service["security_opt"] == ["no-new-privileges:true"], name
            assert {"mem_limit", "pids_limit", "restart"} <= service.keys(), name
            assert_bounded_log(service)
            assert "healthcheck" in service or name == "touchline", name
            added = service.get("cap_add", [])
            assert added == (["NET_BIND_SERVICE"] if name in AS_ROOT else []), name
            user = str(service.get("user", "root")).partition(":")[0]
            assert name in AS_ROOT | OWN_IMAGE or user not in ("root", "0"), name
            if name in OWN_IMAGE:
                assert service["image"] == "touchline" and "user" not in service

    def test_images_are_named_by_version(self, scaled: dict[str, Any]) -> None:
        for name, service in scaled["services"].items():
            if name not in OWN_IMAGE:
                repository, _, version = service["image"].partition(":")
                assert re.fullmatch(r"\d+(\.\d+)*", version), name
                # No address of a registry.
                assert "." not in repository

    def test_the_image_has_the_libraries_that_it_needs(self, scaled: dict[str, Any]) -> None:
        for name in OWN_IMAGE:
            assert scaled["services"][name]["build"]["args"]["LIBRARIES"] == "requirements-all.txt"

    def test_settings_are_those_that_the_product_knows(self, scaled: dict[str, Any]) -> None:
        for name in OWN_IMAGE:
            given = scaled["services"][name]["environment"]
            assert {key for key in given if key.startswith("TOUCHLINE_")} <= KNOWN

    def test_no_secret_stands_in_an_environment(self, scaled: dict[str, Any]) -> None:
        for service in scaled["services"].values():
            for name, text in service.get("environment", {}).items():
                assert not re.search(r"(PASSWORD|SECRET|KEY|TOKEN)$", name)
                # Nor in an address.
                assert not re.search(r"://[^/]*@", str(text))
        stores = json.loads(scaled["services"]["touchline"]["environment"]["TOUCHLINE_STORES"])
        for store in stores.values():
            assert not {"key", "secret", "token"} & store.keys()

    def test_each_begins_when_what_it_needs_is_healthy(self, scaled: dict[str, Any]) -> None:
        services = scaled["services"]
        for service in services.values():
            for other, how in service.get("depends_on", {}).items():
                ready = services[other].get("healthcheck", {"disable": True})
                wanted = {"service_healthy"}
                if ready.get("disable"):
                    wanted = {"service_completed_successfully"}
                if other == "door":
                    # It does nothing that could be waited for.
                    wanted = {"service_started"}
                assert how["condition"] in wanted
        assert {"database", "bucket", "scheduler"} <= services["touchline"]["depends_on"].keys()
        assert "store" in services["bucket"]["depends_on"]
        assert "scheduler" in services["worker"]["depends_on"]

    def test_what_is_named_is_there(self, scaled: dict[str, Any], secrets: Path) -> None:
        for secret in scaled["secrets"].values():
            name = Path(secret["file"]).relative_to("secrets")
            assert (secrets / name).is_file()
        for service in scaled["services"].values():
            for volume in service.get("volumes", ()):
                if isinstance(volume, dict):
                    continue
                source = volume.partition(":")[0]
                assert source in scaled["volumes"] or source[0] in ".$"
            for secret in service.get("secrets", ()):
                assert (secret if isinstance(secret, str) else secret["source"]) in scaled[
                    "secrets"
                ]

    def test_two_web_processes_and_two_workers(self, scaled: dict[str, Any]) -> None:
        services = scaled["services"]
        assert services["touchline"]["environment"]["TOUCHLINE_WEB_WORKERS"] == "2"
        assert services["worker"]["scale"] == 2


class TestSecrets:
    def test_touchline_takes_them(self, scaled: dict[str, Any], secrets: Path) -> None:
        settings = settings_of(scaled["services"]["touchline"], secrets)
        assert re.fullmatch(r"postgresql://touchline:\w{48}@database/touchline", settings.database)
        store: ObjectStoreSettings = settings.stores["store"]
        key, secret, _ = read_access_keys(store) or ("", "", "")
        (identity,) = json.loads((secrets / "store.json").read_text())["identities"]
        assert identity["credentials"] == [{"accessKey": key, "secretKey": secret}]
        assert {right.partition(":")[2] for right in identity["actions"]} == {store.bucket}
        assert settings.cluster is not None
        assert parse_scheduler_address(settings.cluster, settings.cluster_keys).make_dask_security()
        password = (secrets / "database_password").read_text()
        assert f":{password}@" in settings.database

    def test_nobody_else_comes_past_the_folder(self, secrets: Path) -> None:
        assert stat.S_IMODE(secrets.stat().st_mode) == 0o700
        open_ = {
            path.name
            for path in secrets.rglob("*")
            if path.is_file() and stat.S_IMODE(path.stat().st_mode) & 0o077
        }
        # Of users whose numbers other images choose.
        assert open_ == {"database_password", "store.json"}

    def test_two_installations_share_nothing(self, secrets: Path, tmp_path: Path) -> None:
        make_secrets(tmp_path / "other")
        for path in secrets.rglob("*"):
            if path.is_file():
                assert (tmp_path / "other" / path.relative_to(secrets)).read_bytes() != (
                    path.read_bytes()
                )

    def test_what_is_there_is_not_replaced(self, secrets: Path) -> None:
        before = (secrets / "database_url").read_text()
        with pytest.raises(subprocess.CalledProcessError) as caught:
            make_secrets(secrets)
        assert b"already exists" in caught.value.stderr
        assert (secrets / "database_url").read_text() == before
        assert [path.name for path in secrets.parent.iterdir()] == [secrets.name]


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


def read_unit(name: str) -> RawConfigParser:
    """A file for systemd; of what is said twice the last one counts."""
    unit = RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    assert unit.read(FOLDER / name)
    return unit


def environment_of_unit(name: str) -> dict[str, str]:
    """What a unit gives its program, with systemd's names for folders."""
    said = read_unit(name)["Service"]["Environment"]
    return {name: text for name, _, text in (item.partition("=") for item in said.split())}


class TestUnit:
    def test_the_service_writes_to_its_own_folders_alone(self) -> None:
        unit = read_unit("touchline.service")
        service = unit["Service"]
        assert service["User"] not in ("", "root")
        assert service["ProtectSystem"] == "strict"
        assert service["NoNewPrivileges"] == "yes"
        assert "ReadWritePaths" not in service
        assert {"TasksMax", "MemoryMax"} <= service.keys()
        # A child that dies for want of memory is no reason to stop the server.
        assert service["OOMPolicy"] == "continue"
        assert {"StartLimitIntervalSec", "StartLimitBurst"} <= unit["Unit"].keys()
        assert service["RestartPreventExitStatus"] == "2"
        given, made = environment_of_unit("touchline.service"), service["StateDirectory"].split()
        assert {given["TOUCHLINE_HOME"], given["TMPDIR"]} == {f"%S/{name}" for name in made}
        assert given["NUMBA_CACHE_DIR"] == f"%C/{service['CacheDirectory']}"

    def test_what_may_be_large_is_made_on_the_disk_of_the_home(self) -> None:
        given = environment_of_unit("touchline.service")
        assert given["TMPDIR"].startswith(f"{given['TOUCHLINE_HOME']}/")

    def test_settings_of_the_operator_are_read_where_they_are_given(self) -> None:
        for name in ("touchline.service", "touchline-backup.service"):
            assert read_unit(name)["Service"]["EnvironmentFile"] == "-/etc/touchline/environment"


class TestBackupUnit:
    @pytest.fixture
    def service(self) -> Any:
        return read_unit("touchline-backup.service")["Service"]

    def test_is_of_the_home_and_the_user_of_the_server(self, service: Any) -> None:
        assert service["User"] == read_unit("touchline.service")["Service"]["User"]
        mine, its = (
            environment_of_unit(name) for name in ("touchline-backup.service", "touchline.service")
        )
        assert mine == its
        # Whoever makes the first backup may come before the server.
        assert (
            service["CacheDirectory"] == read_unit("touchline.service")["Service"]["CacheDirectory"]
        )

    def test_makes_a_backup_each_time_and_deletes_those_that_are_old(
        self, service: Any, tmp_path: Path
    ) -> None:
        def run(command: str) -> None:
            said = command.replace("/srv/backups", str(tmp_path))
            words = shlex.split(said.replace("%%", "%").replace("$$", "$"))
            subprocess.run(words, check=True)

        old, other = tmp_path / "touchline-2020-01-01T030000.zip", tmp_path / "other.zip"
        for path in (old, other):
            path.touch()
            os.utime(path, (0, 0))
        assert "/opt/touchline/bin/touchline backup " in service["ExecStart"]
        run(service["ExecStart"].replace("/opt/touchline/bin/touchline backup", "/usr/bin/touch"))
        run(service["ExecStartPost"])
        (made,) = tmp_path.glob("touchline-*.zip")
        assert re.fullmatch(r"touchline-\d{4}-\d\d-\d\dT\d{6}\.zip", made.name)
        assert other.exists()

    def test_every_night_has_one(self) -> None:
        timer = read_unit("touchline-backup.timer")
        assert re.fullmatch(r"\*-\*-\* \d\d:\d\d", timer["Timer"]["OnCalendar"])
        assert timer["Timer"]["Persistent"] == "true"
        assert timer["Install"]["WantedBy"] == "timers.target"
