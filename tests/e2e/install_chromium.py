"""Make sure that the browser tests have a Chromium: install it, find one, or say what to do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

NAMES = ("chromium", "chromium-browser", "google-chrome-stable", "google-chrome", "chrome")
ADVICE = (
    "The browser tests need Chromium, and none was found. Install it (Debian, Ubuntu: "
    "'apt-get install chromium' as root) or point TOUCHLINE_CHROMIUM at one."
)


def find_chromium() -> str | None:
    """Path of a Chromium: the one in TOUCHLINE_CHROMIUM, else one on the PATH."""
    named = os.environ.get("TOUCHLINE_CHROMIUM")
    return named or next((path for name in NAMES if (path := shutil.which(name))), None)


def install_chromium() -> None:
    """Install Chromium from the system's packages, where this user may."""
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        return
    quiet = {"check": False, "stdout": subprocess.DEVNULL}
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    print("Installing Chromium from the system's packages", flush=True)
    subprocess.run(["apt-get", "update"], env=environment, **quiet)
    subprocess.run(
        ["apt-get", "install", "-y", "--no-install-recommends", "chromium", "fonts-dejavu-core"],
        env=environment,
        **quiet,
    )


if __name__ == "__main__":
    if find_chromium() is None:
        install_chromium()
    if find_chromium() is None:
        sys.exit(ADVICE)
