"""Names under which tools and people keep the ball: ``ball``, ``sports_ball``, ``Soccer-Balls``."""

from __future__ import annotations

import re
import unicodedata

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_A-Za-z]+")
_BALLS = frozenset(
    {"ball", "fussball", "voetbal", "ballon", "balon", "pelota", "bola", "pallone", "pilka"}
    | {"мяч", "足球", "ボール", "サッカーボール", "공", "축구공"}
)
_OF_SOCCER = frozenset(
    {"sport", "soccer", "foot", "game", "match", "play", "the", "object", "futbol", "futebol"}
)
"""Words that may stand beside it; any other makes it another ball (basket, hand) or no ball (boy)."""


def is_ball(name: str) -> bool:
    """Whether a name means the ball of a football match, whatever its case, separators and digits.

    Example:
        >>> [is_ball(name) for name in ("Sports_Ball", "soccer-balls", "ball_1", "basketball")]
        [True, True, True, False]
    """
    words = [
        word
        for part in _WORD.findall(strip_accents(name))
        for word in _split_compound_word(part.lower())
    ]
    return any(word in _BALLS for word in words) and all(
        word in _BALLS or word in _OF_SOCCER for word in words
    )


def is_same_name(one: str, other: str) -> bool:
    """Whether two names differ in case, separators and accents alone."""
    return _letters_and_digits(one) == _letters_and_digits(other)


def strip_accents(name: str) -> str:
    """A name without accents and in the usual form of each letter."""
    letters = unicodedata.normalize("NFKD", name[:200].replace("ß", "ss"))
    kept = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return unicodedata.normalize("NFKC", kept)


def _letters_and_digits(name: str) -> str:
    return re.sub(r"[\W_]+", "", strip_accents(name)).casefold()


def _split_compound_word(word: str) -> list[str]:
    """The words that a compound is of, each in the singular: ``footballs`` is foot and ball."""
    for whole in (word, word.removesuffix("s")):
        if whole in _BALLS or whole in _OF_SOCCER:
            return [whole]
        if whole.endswith("ball"):
            return [*_split_compound_word(whole.removesuffix("ball")), "ball"]
    return [word]
