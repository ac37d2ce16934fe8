"""Hosts: who can reach an address."""

from __future__ import annotations

import ipaddress
import re
import socket

_SHORT = re.compile(r"[0-9a-fA-FxX.]+")
"""IPv4 addresses as the system takes them, ``127.1`` for one."""


def is_local(host: str) -> bool:
    """Whether nobody but this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        if _SHORT.fullmatch(host):
            host = socket.inet_ntoa(socket.inet_aton(host))
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except (OSError, ValueError):
        return False
