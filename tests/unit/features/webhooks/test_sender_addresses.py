"""Addresses of webhooks: the operator decides, and no spelling leads elsewhere."""

from __future__ import annotations

import pytest

from app.config import Settings
from app.errors import ConflictError, InputError
from app.features.webhooks.sender import require_allowed_address, require_valid_setting

ALLOWED = ["https://hooks.example.org/touchline", "http://127.0.0.1:9000"]


@pytest.mark.parametrize(
    "url",
    [
        "https://hooks.example.org/touchline",
        "https://hooks.example.org/touchline/a?b=c",
        "https://HOOKS.example.org:443/touchline",
        "https://hooks.example.org./touchline",
        "http://127.0.0.1:9000/anything",
    ],
)
def test_what_lies_below_an_allowed_address_is_allowed(url: str) -> None:
    require_allowed_address(url, ALLOWED)


@pytest.mark.parametrize(
    "url",
    [
        "http://hooks.example.org/touchline",
        "https://hooks.example.org/",
        "https://hooks.example.org/touchlines",
        "https://hooks.example.org:8443/touchline",
        "https://hooks.example.org.evil.test/touchline",
        "https://hooks.example.org@evil.test/touchline",
        "https://anna:secret@hooks.example.org/touchline",
        "https://hooks.example.org:443@evil.test/touchline",
        "https://evil.test#hooks.example.org/touchline",
        "https://evil.test\\hooks.example.org/touchline",
        "https://hooks.example.org/touchline/../admin",
        "https://hooks.example.org/touchline/%2e%2E/admin",
        "https://hooks.example.org/touchline/..%2fadmin",
        "https://hooks.example.org/touchline/..;/admin",
        "https://hooks.example.org/touchline/..;x=1/admin",
        "https://hooks.example.org/touchline/%2e%2e%3Bx/admin",
        "https://hooks.example.org/touchline/.;/admin",
        "https://hooks.example.org/touchline\n",
        "https://hoöks.example.org/touchline",
        "https://hooks.example.org../touchline",
        "http://127.0.0.1:90000/",
        "http://[::1/",
        "http://169.254.169.254/latest",
        "file:///etc/passwd",
        "//hooks.example.org/touchline",
        "",
    ],
)
def test_every_other_one_is_refused_with_its_field(url: str) -> None:
    with pytest.raises(InputError) as refused:
        require_allowed_address(url, ALLOWED, "/url")
    assert refused.value.pointer == "/url"


def test_where_the_operator_allows_none_the_setting_is_named() -> None:
    with pytest.raises(ConflictError, match="not allowed to send webhooks") as refused:
        require_allowed_address(ALLOWED[0], [])
    assert "TOUCHLINE_WEBHOOKS" in (refused.value.hint or "")


@pytest.mark.parametrize("wrong", ["hooks.example.org", "ftp://hooks.example.org"])
def test_a_wrong_address_in_the_setting_is_refused_before_anything_is_sent(
    wrong: str, settings: Settings
) -> None:
    with pytest.raises(InputError, match=r"^TOUCHLINE_WEBHOOKS: "):
        require_valid_setting(settings.model_copy(update={"webhooks": [ALLOWED[0], wrong]}))
    require_valid_setting(settings.model_copy(update={"webhooks": [ALLOWED[0]]}))
