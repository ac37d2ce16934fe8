"""Make sure that the browser tests have a Chromium: install it, find one, or say what to do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

LIGHT = "chromium-headless-shell"
"""The same browser without windows: a page opens in less than half the time."""
NAMES = (
    LIGHT,
    "chromium",
    "chromium-browser",
    "google-chrome-stable",
    "google-chrome",
    "chrome",
)
ADVICE = (
    "The browser tests need Chromium, and none was found. Install it (Debian, Ubuntu: "
    "'apt-get install chromium-headless-shell' as root) or point TOUCHLINE_CHROMIUM at one."
)


def find_chromium() -> str | None:
    """Path of a Chromium: the one in TOUCHLINE_CHROMIUM, else one on the PATH."""
    named = os.environ.get("TOUCHLINE_CHROMIUM")
    return named or next((path for name in NAMES if (path := shutil.which(name))), None)


def install_chromium() -> None:
    """Install Chromium from the system's packages, where this user may."""
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        return
    print("Installing Chromium from the system's packages", flush=True)
    # Package lists may be missing or old; older systems have no package of the light one.
    if _install(LIGHT):
        return
    _run("update")
    if not _install(LIGHT) and find_chromium() is None:
        _install("chromium")


def _install(package: str) -> bool:
    return _run("install", "-y", "--no-install-recommends", package, "fonts-dejavu-core")


def _run(*arguments: str) -> bool:
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    done = subprocess.run(
        ["apt-get", *arguments], env=environment, check=False, capture_output=True
    )
    return done.returncode == 0


if __name__ == "__main__":
    if "TOUCHLINE_CHROMIUM" not in os.environ and not shutil.which(LIGHT):
        install_chromium()
    if find_chromium() is None:
        sys.exit(ADVICE)
