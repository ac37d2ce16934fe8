"""The help inside the product and the documents say the same, and have every word."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from app.soccer.policy import STRICT
from tests.docs.pages import (
    GLOSSARY_PAGE,
    GUIDE,
    ROOT,
    glossary_page,
    guide_text,
    sections,
)

AGAIN = "run: python -m tests.docs"
PLAIN_WORDS = """
    accept accepted address answers archive body boxes budget bulk camera cameras changes clock
    compare contents corner count cover datasets delete difference digest edit export exports
    fan fields first folder folders format formats frames fresh geometry guide history home image
    images import imports in index init jobs key keys kind known labels large last lesson lessons
    lines link list logs look make many members membership missing model models more name names
    nearest new of onnx options order out pages part parse parts past path pitch place policies
    predictions progress query read reader recompute result rows score sample share shared size
    solve solver sources spread state stations statistics status store submit summary table tables
    text texts train truth undo use value values versions view views warm wide words write yields
    ball balls box best bounds score start starts find findings sides solved observations gates
    jaccard resect triangulate calibrate annotation group solution policy soccer reviewers verdicts
    etags idempotency codec cache diff facts remedies source merge licence detect evaluations fixes influence exact jobs
"""
PLAIN = frozenset(PLAIN_WORDS.split())
"""Words of file names that everybody knows; any other has to stand in the glossary."""


def ids() -> set[str]:
    return {word["id"] for section in sections() for word in section["words"]}


class TestPages:
    def test_the_glossary_page_is_the_glossary(self):
        assert GLOSSARY_PAGE.read_text(encoding="utf-8") == glossary_page(), AGAIN

    def test_the_guide_in_the_product_is_the_guide_page(self):
        assert GUIDE.read_text(encoding="utf-8") == guide_text(), AGAIN


class TestGlossary:
    def test_every_word_is_explained_once_in_a_sentence(self):
        all_ids = [word["id"] for section in sections() for word in section["words"]]
        assert len(all_ids) == len(set(all_ids))
        for section in sections():
            for word in section["words"]:
                assert word["meaning"].endswith((".", "?", ")")), word
                assert len(word["meaning"]) > 12

    def test_every_gate_is_explained(self):
        labels = (ROOT / "static" / "views" / "gate_names.js").read_text(encoding="utf-8")
        titles = re.search(r"GATE_TITLES = .*?\({(.*?)}\);", labels, re.S)
        assert titles is not None
        gates = re.findall(r"^\t(\w+):", titles[1], re.M)
        assert len(gates) == 8
        assert STRICT.max_sigma_m is not None
        assert {f"gate:{gate}" for gate in gates} <= ids()

    def test_every_column_and_every_word_that_a_view_asks_for_is_explained(self):
        asked = set()
        for file in (ROOT / "static" / "views").rglob("*.js"):
            text = file.read_text(encoding="utf-8")
            asked |= set(re.findall(r"""(?:data-term|word)=["']([\w:]+)["']""", text))
        table = (ROOT / "static" / "views" / "queue_table.js").read_text(encoding="utf-8")
        sorts = set(re.findall(r"sort: '(\w+)'", table)) - {"number"}
        assert len(asked) >= 8
        assert asked | {f"column:{name}" for name in sorts} <= ids()

    def test_every_kind_of_finding_is_explained(self):
        source = (ROOT / "static" / "state" / "completion.js").read_text(encoding="utf-8")
        kinds = set(re.findall(r"'([a-z]+_[a-z_]+)'", source))
        assert "upstream_changed" in kinds
        missing = {kind for kind in kinds if f"finding:{kind}" not in ids()}
        assert not {kind for kind in missing if kind in _finding_kinds()}

    @pytest.mark.parametrize("folder", ["soccer", "solving", "review"])
    def test_every_domain_word_of_a_file_name_is_explained(self, folder: str):
        said = json.dumps([section["words"] for section in sections()]).lower()
        files = [path.stem for path in (ROOT / "app" / folder).glob("*.py")]
        words = {word for stem in files for word in stem.split("_") if len(word) > 2}
        unknown = {word for word in words - PLAIN if word.rstrip("s") not in said}
        assert not unknown, "put them into static/help/glossary.json"

    @pytest.mark.parametrize("word", ["carry", "spare", "lineage", "ledger", "upstream"])
    def test_the_words_of_moving_data_are_explained(self, word: str):
        assert word in ids()


def _finding_kinds() -> set[str]:
    text = (ROOT / "app" / "solving" / "findings.py").read_text(encoding="utf-8")
    return set(re.findall(r'"([a-z]+_[a-z_]+)"', text))


class TestReadme:
    def test_its_pictures_are_there_and_small(self):
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        pictures = [Path(name) for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)]
        assert len(pictures) >= 3
        for picture in pictures:
            assert (ROOT / picture).stat().st_size < 300_000
