"""Splits by the names that folders and files of other tools give them: ``val2017``, ``Validation``."""

from __future__ import annotations

import re

_SPLIT = re.compile(r"(train|val|test|challenge)(?:ing|id|idation)?(?:[-_ ]?(?:set|\d{1,4}))?")
_WORDS = re.compile(r"[^a-z0-9]+")


def split_of(name: str) -> str:
    """The split that a name is; empty where it is none.

    Example:
        >>> [split_of(name) for name in ("train2017", "Validation", "val", "cam1")]
        ['train', 'valid', 'valid', '']
    """
    found = _SPLIT.fullmatch(name.strip().lower())
    return "" if found is None else {"val": "valid"}.get(found[1], found[1])


def split_in(name: str) -> str:
    """The split that one word of a name says; empty where none does, or two contradict.

    Example:
        >>> split_in("instances_train2017"), split_in("train_or_test"), split_in("_annotations.coco")
        ('train', '', '')
    """
    found = {split for word in _WORDS.split(name.lower()) if (split := split_of(word))}
    return found.pop() if len(found) == 1 else ""
