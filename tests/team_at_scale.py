"""A team's installation at scale, as processes of this machine: what docker/scale.yaml describes.

Needs no Docker: the same commands with the same settings and secrets, an S3 server for tests (moto) in the
place of the store, a private PostgreSQL, and Caddy (Debian: ``apt-get install caddy``, or TOUCHLINE_CADDY names
its program) with the site of docker/Caddyfile. Through its TLS somebody becomes the first admin, imports from the
store, has the workers solve, looks at a frame, judges, and exports to the store; a web process is killed meanwhile.
``python -m tests.team_at_scale [GROUPS]``; what was not as it should be ends it with 1.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import ssl
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
import psutil
import yaml

from app.command_line import app as touchline
from app.config import Settings
from app.features.solve.jobs import WORTH_A_POOL
from app.object_store.store import ObjectStore, open_store
from tests.cluster import running_cluster
from tests.e2e.service import ROOT, SERVE, free_port
from tests.moto_server import moto_server
from tests.waiting import SECONDS

FOLDER = ROOT / "docker"
GROUPS = 410
"""So many that the server gives them to the cluster."""
PICTURED = 2
INSIDE = "/run/secrets"
PATIENCE_S = 8 * SECONDS
"""A dozen processes that start at once, on a machine that does much else."""
PASSWORD = "four plain words here"

Json = dict[str, Any]


def together() -> Json:
    """compose.yaml with scale.yaml laid over it, as ``docker compose`` does: mappings and lists are joined."""
    base, over = (
        yaml.safe_load((FOLDER / f"{name}.yaml").read_text("utf-8"))
        for name in ("compose", "scale")
    )
    return _laid_over(base, over)  # type: ignore[no-any-return]


def _laid_over(base: Any, over: Any) -> Any:
    if isinstance(base, dict) and isinstance(over, dict):
        return {**base, **{key: _laid_over(base.get(key), value) for key, value in over.items()}}
    if isinstance(base, list) and isinstance(over, list):
        return [*base, *(item for item in over if item not in base)]
    return over


def settings_of(service: Json, secrets: Path) -> Settings:
    """Settings of a service, as its container would read them, with the secrets of a folder."""
    given = environment_of(service, secrets, {"${TOUCHLINE_NAME}": "localhost"})
    rest = {name: text for name, text in os.environ.items() if not name.startswith("TOUCHLINE_")}
    with patch.dict(os.environ, {**rest, **given}, clear=True):
        return Settings()


def environment_of(service: Json, secrets: Path, here: dict[str, str]) -> dict[str, str]:
    """Its environment with the secrets of a folder; ``here``: what is called otherwise on this machine."""
    found = {}
    for name, text in service["environment"].items():
        found[name] = str(text)
        for old, new in {INSIDE: str(secrets), **here}.items():
            found[name] = found[name].replace(old, new)
    return found


def make_secrets(folder: Path) -> Path:
    """Passwords, keys and certificates in a new folder, for whoever runs the tests."""
    own = {**os.environ, "OWNER": f"{os.getuid()}:{os.getgid()}"}
    script = [str(FOLDER / "make-secrets.sh"), str(folder)]
    subprocess.run(script, env=own, check=True, capture_output=True)
    return folder


def is_healthy(service: Json, secrets: Path, port: int) -> bool:
    """What the check of a service says here, for another port of the scheduler."""
    program, *words = service["healthcheck"]["test"][1:]
    assert program == "python"
    code = words[-1].replace(INSIDE, str(secrets)).replace("8786", str(port))
    command = [sys.executable, *words[:-1], code.replace(":2252", f":{port:04X}")]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@dataclass
class Installation:
    """What runs, and what went wrong."""

    folder: Path
    secrets: Path
    services: Json
    ports: dict[str, int]
    ended: ExitStack
    running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    @property
    def address(self) -> str:
        """What people open."""
        return f"https://localhost:{self.ports['https']}"

    def expect(self, what: str, holds: object) -> None:
        """Say something that must hold, and whether it does."""
        print(f"{'  ' if holds else 'NO'} {what}", flush=True)
        if not holds:
            self.faults.append(what)

    def start(self, name: str, service: str, *command: str, **environment: str) -> None:
        """Start a program of Touchline with the settings of a service."""
        given = {key: text for key, text in os.environ.items() if not key.startswith("TOUCHLINE_")}
        own = environment_of(
            self.services[service],
            self.secrets,
            {
                "${TOUCHLINE_NAME}": f"localhost:{self.ports['https']}",
                "scheduler:8786": f"127.0.0.1:{self.ports['scheduler']}",
                "store:8333": f"127.0.0.1:{self.ports['store']}",
            },
        )
        own.pop("TMPDIR", None)
        self.run(name, [sys.executable, "-c", SERVE, *command], {**given, **own, **environment})

    def run(self, name: str, command: list[str], environment: dict[str, str]) -> None:
        """Start a program, which ends with the installation."""
        log = self.ended.enter_context((self.folder / f"{name}.log").open("wb"))
        process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=log, stderr=log)
        self.running[name] = process
        self.ended.callback(self.end, name)

    def end(self, name: str) -> int:
        """Exit code of a program that was asked to end."""
        process = self.running[name]
        if process.poll() is None:
            process.terminate()
        try:
            return process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    def said(self, name: str) -> str:
        """What a program has said."""
        return (self.folder / f"{name}.log").read_text("utf-8", "replace")

    def until(self, what: str, ready: Callable[[], Any], seconds: float = PATIENCE_S) -> Any:
        """What a function says, once that is something; a fault where it stays nothing."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := ready():
                return found
            time.sleep(0.5)
        logs = "\n".join(f"--- {name}\n{self.said(name)[-2000:]}" for name in self.running)
        raise SystemExit(f"{what}: did not happen\n{logs}")

    def healthy(self, service: str) -> bool:
        """Whether the check that its container has says so."""
        return is_healthy(self.services[service], self.secrets, self.ports["scheduler"])


@contextmanager
def installed(folder: Path, caddy: str) -> Iterator[tuple[Installation, ObjectStore]]:
    """Everything but a dataset, until the block is left."""
    secrets = make_secrets(folder / "secrets")
    ports = {name: free_port() for name in ("https", "http", "server", "scheduler")}
    with running_cluster() as database, moto_server("touchline") as proxy, ExitStack() as ended:
        # Its password is not asked here, where it is reached by its socket alone.
        (secrets / "database_url").write_text(database.create())
        ports["store"] = proxy.port
        services = together()["services"]
        it = Installation(folder, secrets, services, ports, ended)
        for name in ("scheduler", "worker"):
            it.expect(f"no {name}: its check fails", not it.healthy(name))
        # All at once: each waits for those that it needs.
        it.start("scheduler", "scheduler", "scheduler", f"tls://127.0.0.1:{ports['scheduler']}")
        for number in range(services["worker"]["scale"]):
            it.start(f"worker{number}", "worker", "worker", "--workers", "1")
        server = {
            "TOUCHLINE_PORT": str(ports["server"]),
            "TOUCHLINE_HOME": str(folder / "home"),
            "TOUCHLINE_IMAGE_WORKERS": "1",
            "TOUCHLINE_IMPORT_FOLDERS": "",
        }
        it.start("server", "touchline", "serve", **server)
        _start_proxy(it, caddy)
        it.until("the scheduler is healthy", lambda: it.healthy("scheduler"))
        it.until("the workers are healthy", lambda: it.healthy("worker"))
        it.until("the server is healthy", lambda: _server_is_healthy(ports["server"]))
        stores = json.loads(services["touchline"]["environment"]["TOUCHLINE_STORES"])
        stores["store"] |= {"endpoint": proxy.endpoint, "key_file": str(secrets / "store_keys")}
        yield it, open_store(Settings(home=folder / "filling", stores=stores), "store")
        codes = {name: it.end(name) for name in ("server", *_workers(it), "scheduler")}
        it.expect(f"all end when they are told to: {codes}", not any(codes.values()))
        for name in it.running:
            it.expect(f"no traceback of {name}", "Traceback" not in it.said(name))


def _workers(it: Installation) -> list[str]:
    return [name for name in it.running if name.startswith("worker")]


def _server_is_healthy(port: int) -> bool:
    """What the image's own check says."""
    text = (FOLDER / "Dockerfile").read_text("utf-8").replace("\\\n", " ")
    found = re.search(r'HEALTHCHECK .*?CMD (\["python".*\])', text)
    assert found is not None
    words = json.loads(found[1])
    command = [sys.executable, *words[1:]]
    environment = {"TOUCHLINE_PORT": str(port), "PATH": os.environ["PATH"]}
    return (
        subprocess.run(command, env=environment, capture_output=True, check=False).returncode == 0
    )


def _start_proxy(it: Installation, caddy: str) -> None:
    """Caddy with the site of docker/Caddyfile, on other ports and with an authority of its own."""
    text = (FOLDER / "Caddyfile").read_text("utf-8")
    here = f"admin off\n\thttp_port {it.ports['http']}\n\thttps_port {it.ports['https']}\n\tskip_install_trust"
    for old, new in (
        ("admin off", here),
        ("{$TOUCHLINE_NAME} {", "{$TOUCHLINE_NAME} {\n\ttls internal"),
        ("127.0.0.1:8000", f"127.0.0.1:{it.ports['server']}"),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (it.folder / "Caddyfile").write_text(text)
    own = {
        "PATH": os.environ["PATH"],
        "HOME": str(it.folder),
        "XDG_DATA_HOME": str(it.folder),
        "TOUCHLINE_NAME": f"localhost:{it.ports['https']}",
    }
    it.run(
        "proxy",
        [caddy, "run", "--config", str(it.folder / "Caddyfile"), "--adapter", "caddyfile"],
        own,
    )
    root = it.folder / "caddy/pki/authorities/local/root.crt"
    it.until("the proxy has a certificate", root.is_file)


def walk(it: Installation, store: ObjectStore, groups: int) -> None:
    """What a team does, through the proxy."""
    root = ssl.create_default_context(cafile=it.folder / "caddy/pki/authorities/local/root.crt")
    headers = {"Origin": it.address}
    with httpx.Client(
        base_url=f"{it.address}/api/v1", verify=root, headers=headers, timeout=300
    ) as ask:
        it.until("the proxy answers", lambda: _status(ask, f"{it.address}/readyz") == 200)
        it.expect("nobody is let in without a session", ask.get("/datasets").status_code == 401)
        link = it.until("a first link", lambda: re.search(r"/join#(\S+)", it.said("server")))
        chosen = {"token": link[1], "password": PASSWORD, "name": "ann"}
        it.expect("the first admin logs in", ask.post("/links/use", json=chosen).is_success)
        _fill(it, store, groups)
        for name, count in (("pictured", PICTURED), ("league", groups)):
            body = {"dataset": name, "format": "soccernet-v3", "policy": "paper"}
            body |= {"source": {"folder": f"s3://store/{name}"}}  # type: ignore[dict-item]
            job = _finished(it, ask, ask.post("/imports", json=body))
            it.expect(f"{name} is imported from the store", job["result"].get("new") == count)
        before = _processor(it)
        it.until("all is solved", lambda: _solved(ask, "league", groups))
        spent = _processor(it) - before
        if groups >= WORTH_A_POOL:
            it.expect(f"workers solved, {spent:.1f} s of their processor", spent > 0.01 * groups)
        _look(it, ask)
        _kill_one(it)
        _judge(it, ask)
        body = {"dataset": "league", "format": "soccernet-v3d", "to": "s3://store/out/league.zip"}
        job = _finished(it, ask, ask.post("/exports", json=body))
        it.expect("accepted groups are exported to the store", job["state"] == "done")
        content = store.read_whole("out/league.zip", 2**30)[0]
        names = zipfile.ZipFile(BytesIO(content)).namelist()
        it.expect(f"the store has them: {len(content):,} bytes", "manifest.json" in str(names))
        sent = ask.get(f"/exports/{job['id']}/content")
        it.expect("people get the same through the proxy", sent.content == content)


def _fill(it: Installation, store: ObjectStore, groups: int) -> None:
    for name, options in (
        ("pictured", f"--groups {PICTURED}"),
        ("league", f"--groups {groups} --labels-only"),
    ):
        tree = it.folder / name
        touchline(["sample", *options.split(), "--workers", "1", str(tree)], standalone_mode=False)
        for path in sorted(tree.rglob("*")):
            if path.is_file():
                store.put(f"{name}/{path.relative_to(tree).as_posix()}", path.read_bytes())


def _look(it: Installation, ask: httpx.Client) -> None:
    row = ask.get("/groups", params={"dataset": "pictured"}).json()["items"][0]
    view = ask.get(f"/groups/{row['id']}").json()["views"][0]
    shown = ask.get(f"{it.address}{view['image']}")
    it.expect("a frame of the store is shown", shown.headers["content-type"].startswith("image/"))


def _kill_one(it: Installation) -> None:
    """Kill one of the web processes, which is then started anew."""
    found = psutil.Process(it.running["server"].pid).children()
    largest = sorted(found, key=lambda one: one.memory_info().rss)[-2:]
    it.expect("two web processes", len(largest) == 2)
    largest[-1].kill()


def _judge(it: Installation, ask: httpx.Client) -> None:
    """Accept what passes; a page hears of it."""
    # Groups without pictures are accepted by who says why.
    asked = {"q": "passes:yes", "state": "accepted", "note": "labels alone"}
    with ask.stream("GET", "/events", params={"dataset": "league"}) as stream:
        lines = stream.iter_lines()
        it.until("the stream listens", lambda: "listening" in next(lines, ""))
        headers = {"Idempotency-Key": "accept"}
        judged = it.until(
            "a verdict",
            lambda: _done(
                lambda: ask.post("/datasets/league/verdicts", json=asked, headers=headers)
            ),
        )
        heard = next((line for line in lines if line.startswith("data:")), "")
    it.expect(f"verdicts: {judged.text[:120]}", judged.is_success and judged.json()["changed"])
    it.expect("the stream tells of them", heard)


def _done(work: Callable[[], httpx.Response]) -> httpx.Response | None:
    """An answer of the product's; None where the process that was asked has just gone."""
    try:
        answer = work()
    except httpx.TransportError:
        return None
    return None if answer.status_code in (502, 503) else answer


def _status(ask: httpx.Client, address: str) -> int:
    answer = _done(lambda: ask.get(address))
    return 0 if answer is None else answer.status_code


def _solved(ask: httpx.Client, name: str, groups: int) -> bool:
    answer = _done(lambda: ask.get(f"/datasets/{name}"))
    return answer is not None and answer.json()["solved"] == groups


def _finished(it: Installation, ask: httpx.Client, answer: httpx.Response) -> Json:
    """The job of an answer, once it is over."""
    if answer.status_code != 202:
        raise SystemExit(f"{answer.url}: {answer.text}")
    job: Json = answer.json()

    def over() -> Json | None:
        nonlocal job
        job = ask.get(f"/jobs/{job['id']}").json()
        return job if job["state"] not in ("waiting", "running") else None

    it.until(f"the end of {answer.url}", over)
    it.expect(f"job {job['id']} ended: {str(job)[:300]}", job["state"] == "done")
    return job


def _processor(it: Installation) -> float:
    """Seconds of the processor that the workers have used so far."""
    total = 0.0
    for name in _workers(it):
        for process in psutil.Process(it.running[name].pid).children(recursive=True):
            used = process.cpu_times()
            total += used.user + used.system
    return total


def main() -> int:
    """Set all up, walk, and say what did not hold."""
    groups = int(sys.argv[1]) if len(sys.argv) > 1 else GROUPS
    caddy = os.environ.get("TOUCHLINE_CADDY") or shutil.which("caddy")
    if caddy is None:
        print("Caddy is missing (Debian: apt-get install caddy, or TOUCHLINE_CADDY=its program).")
        return 1
    with (
        tempfile.TemporaryDirectory(prefix="touchline-team-") as name,
        installed(Path(name), caddy) as (it, store),
    ):
        walk(it, store, groups)
    for fault in it.faults:
        print(f"FAULT {fault}")
    return 1 if it.faults else 0


if __name__ == "__main__":
    sys.exit(main())
