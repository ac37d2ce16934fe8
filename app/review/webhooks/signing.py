"""Signing: the secret and the signature by which a receiver knows that a message is ours.

They are made of a key in the home and a salt in the database, so that who reads the database, or a
backup of it, can sign nothing.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from base64 import b64encode
from datetime import datetime

from standardwebhooks import Webhook

from app.config import Settings
from app.store.keys import WEBHOOKS, installation_key


def new_salt() -> str:
    """What makes a secret another one."""
    return secrets.token_hex(16)


def secret_of(settings: Settings, salt: str) -> str:
    """The secret of a webhook, as the specification writes it (``whsec_``).

    Raises:
        StorageError: The disk refuses the key.
    """
    made = hmac.digest(installation_key(settings, WEBHOOKS), salt.encode(), hashlib.sha256)
    return f"whsec_{b64encode(made).decode()}"


def sign(secret: str, message: str, at: datetime, body: str) -> dict[str, str]:
    """Headers of a message (standardwebhooks.com)."""
    return {
        "webhook-id": message,
        "webhook-timestamp": str(int(at.timestamp())),
        "webhook-signature": Webhook(secret).sign(message, at, body),
    }
