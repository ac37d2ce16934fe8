"""The proxy that stands before the server of a team: Caddy with the limits of docker/Caddyfile, without TLS.

``python -m tests.torture.proxy`` installs it where it is missing.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from tests.e2e.service import ROOT, free_port
from tests.system_packages import install
from tests.waiting import SECONDS

ADVICE = "The flood runs behind Caddy, which is not here. Debian: apt-get install caddy"


@dataclass(frozen=True)
class Proxy:
    """Where clients reach a server."""

    port: int

    @property
    def address(self) -> str:
        """As a browser has it."""
        return f"http://127.0.0.1:{self.port}"


@contextmanager
def behind_proxy(port: int, folder: Path) -> Iterator[Proxy]:
    """A proxy before the server of a port, with its files in a folder.

    Raises:
        FileNotFoundError: There is no Caddy.
    """
    program = shutil.which("caddy")
    if program is None:
        raise FileNotFoundError(ADVICE)
    proxy = Proxy(free_port())
    text = (ROOT / "docker/Caddyfile").read_text("utf-8")
    for old, new in (
        ("{$TOUCHLINE_NAME} {", f"{proxy.address} {{"),
        ("127.0.0.1:8000", f"127.0.0.1:{port}"),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (site := folder / "Caddyfile").write_text(text)
    own = {"HOME": str(folder), "XDG_DATA_HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    with (folder / "proxy.log").open("wb") as log:
        process = subprocess.Popen(
            [program, "run", "--config", str(site), "--adapter", "caddyfile"],
            env=own,
            stdout=log,
            stderr=log,
        )
    try:
        _wait_until_it_answers(proxy, process)
        yield proxy
    finally:
        process.kill()
        process.wait(SECONDS)


def _wait_until_it_answers(proxy: Proxy, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        assert process.poll() is None, "the proxy ended: see proxy.log"
        try:
            if httpx.get(f"{proxy.address}/readyz", timeout=SECONDS).is_success:
                return
        except httpx.TransportError:
            time.sleep(0.1)
    raise AssertionError("the proxy does not answer")


if __name__ == "__main__":
    if shutil.which("caddy") is None:
        install("caddy")
    if shutil.which("caddy") is None:
        sys.exit(ADVICE)
