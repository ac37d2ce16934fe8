"""What may be a password."""

from __future__ import annotations

import pytest
from argon2.low_level import Type
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.errors import InputError
from app.features.people import links as passwords
from app.features.people.links import hash_password


@pytest.fixture(autouse=True)
def cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    hasher = Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1, type=Type.ID)
    monkeypatch.setattr(passwords, "HASHER", PasswordHash((hasher,)))


class TestHashPassword:
    @pytest.mark.parametrize(
        "password",
        [
            "1234567890",
            "password123",
            "qwertyuiop",
            "iloveyou123",
            "manchester1",
            "aaaaaaaaaaaa",
            "abcabcabcabc",
            "annabelle1",
            "Touchline1",
            "passwordpassword" * 10,
        ],
    )
    def test_one_that_is_common_or_of_few_parts_is_refused(self, password: str) -> None:
        with pytest.raises(InputError, match="easy to guess") as caught:
            hash_password(password, "annabelle", pointer="/new")
        assert caught.value.pointer == "/new"

    @pytest.mark.parametrize(
        "password", ["three plain words", "correct horse battery staple", "x" * 10 + "7Kq!v" * 30]
    )
    def test_words_that_nobody_puts_together_are_taken(self, password: str) -> None:
        assert hash_password(password, "anna")

    @pytest.mark.parametrize("password", ["short", "x" * 201])
    def test_its_length_is_asked_first(self, password: str) -> None:
        with pytest.raises(InputError, match="10 to 200 characters"):
            hash_password(password, "anna")
