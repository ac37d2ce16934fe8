"""The help inside the product and the documents say the same, and have every word."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.features.queue.fields import BY_NAME
from app.soccer.policy import STRICT
from tests.docs.pages import (
    GLOSSARY_PAGE,
    GUIDE,
    QUERIES_PAGE,
    ROOT,
    glossary_page,
    guide_text,
    queries_page,
    sections,
)
from tests.docs.settings import SETTINGS_PAGE, settings_page

AGAIN = "run: python -m tests.docs"
PLAIN_WORDS = """
    3d accept access account action actions actors address adjudicate adjust adjustments adopt
    again reopen undecided advice after ahead anchor app around arrays arrival ask assign attempt axis backup bar bars
    batches before block blocks body boxes browser bulk bundle button buttons cache calibrate
    candidates canvas caption card cards cell changes chart chip choice chooser class cli client
    clip clock cluster codec colours command comment comments compare comparison completion config
    confirm constraints contact cookies copy copying correct cross css csv cursor curve cuts database
    datasets day delete deps descriptions details detect devices diagram dialect dialog diff
    differences dismissals distance documents drags drawing durable editor empty enrol equations
    errors estimates estimator evaluate event events executors expected export exports facets facts faults
    fields figure figures files film filter finder first fit fixture folder follow followed form format formats
    frozen gestures glossary gold grass grid guess guide guideline guidelines header headers
    heat help histograms history hit home hooks idempotency identity if image images import imports
    index indexing init insert insight invitation invitations invite items jaccard join json kept
    kernels key keys known konva last latest lazy lease leases least legend lens lesson lessons
    letter limits links list listing live local locks login logins lone loupe mail main maintenance
    making many map markdown marks match matches matrix me measurements measures membership mentions
    menu merge messages metrics migrate mini missing models motion name names navigation needs notice nudge
    numbers object on open openapi opentrackio options order other output own ownership packing page
    pages paint palette panel parquet parse parts path pen people permissions pins pitch pitches
    pixel place places play playback player pointer policies pool popover position postgresql
    preopen preview problem process profile progress proof property proposal propose props provider
    queries query quota rail ranking rater reader reasons reassign record refresh reimport remote render repeats
    report requests resect resource restore result return revert reviewers rights roles router sentences
    routes row rows rules run runner running runs safe save scale scene scene3d scenes schemas
    scores scoring scroll search sender sending sequence serve server service session sets shared sharing
    sheet sign snapshot solve solving source sources sphere spread sqlite squares stacks stage
    staging standpoints state statistics steps storage store stored stream stretches submit
    suggested suggestions summary surface swap synloc tab table tall team term terminal text threads
    threshold ticks time tokens tools tracing track tracking transfer transitions tree trees
    triangulate tripod truth types undo undrawn upload v3 v3d video viewport viewports virtual
    visibility walk what when window wording words work worker workspace write writer zip
"""
PLAIN = frozenset(PLAIN_WORDS.split())
"""Words of file names that are plain English, or that every programmer knows; any other has to be
in the glossary."""


def ids() -> set[str]:
    return {word["id"] for section in sections() for word in section["words"]}


def glossary_words() -> list[str]:
    """What the glossary explains: its words as they are read, and the names that texts refer to."""
    words = [word for section in sections() for word in section["words"]]
    return [text.lower() for word in words for text in (word["word"], word["id"])]


def source_files(tree: str) -> list[Path]:
    """The Python and JavaScript files of a part of the product."""
    found = (path for ending in ("py", "js") for path in (ROOT / tree).rglob(f"*.{ending}"))
    others = {"node_modules", "built"}
    return [path.relative_to(ROOT) for path in found if not others & {*path.parts}]


def words_of_names(tree: str) -> Iterator[tuple[str, Path]]:
    """The words of the file names of a part of the product, and the file of each."""
    for path in source_files(tree):
        for word in path.stem.strip("_").split("_"):
            yield word, path


class TestPages:
    def test_the_glossary_page_is_the_glossary(self):
        assert GLOSSARY_PAGE.read_text(encoding="utf-8") == glossary_page(), AGAIN

    def test_the_page_of_queries_is_what_the_parser_knows(self):
        assert QUERIES_PAGE.read_text(encoding="utf-8") == queries_page(), AGAIN

    def test_the_guide_in_the_product_is_the_guide_page(self):
        assert GUIDE.read_text(encoding="utf-8") == guide_text(), AGAIN

    def test_the_page_of_settings_is_what_the_code_reads(self):
        assert SETTINGS_PAGE.read_text(encoding="utf-8") == settings_page(), AGAIN


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
        assert len(gates) == 10
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
        kinds = {*BY_NAME["finding"].values} - {"any", "none"}
        assert "upstream_changed" in kinds
        assert not {kind for kind in kinds if f"finding:{kind}" not in ids()}

    @pytest.mark.parametrize("tree", ["app", "static"])
    def test_every_domain_word_of_a_file_name_is_explained(self, tree: str):
        heads = {part for word in glossary_words() for part in re.findall(r"[a-z0-9]+", word)}
        unknown = {
            word: str(path)
            for word, path in words_of_names(tree)
            if not {word, word.rstrip("s"), f"{word}s"} & (heads | PLAIN)
        }
        assert not unknown, "put them into static/help/glossary.json, or name the files otherwise"

    def test_every_plain_word_stands_once_and_in_the_name_of_a_file(self):
        words = PLAIN_WORDS.split()
        used = {word for tree in ("app", "static") for word, _ in words_of_names(tree)}
        assert [word for word in words if words.count(word) > 1] == []
        assert sorted(PLAIN - used) == []

    @pytest.mark.parametrize(
        "word", ["merge", "unassigned", "revision-chain", "state-snapshot", "upstream"]
    )
    def test_the_words_of_moving_data_are_explained(self, word: str):
        assert word in ids()


class TestArchitecture:
    def test_every_file_that_its_map_names_is_there(self):
        text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
        named = re.findall(r"`((?:app|static|migrations)/[^`<*]*)`", text)
        assert len(named) >= 15
        assert [name for name in named if not (ROOT / name).exists()] == []


class TestReadme:
    def test_its_pictures_are_there_and_small(self):
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        pictures = [Path(name) for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)]
        assert len(pictures) >= 3
        for picture in pictures:
            assert (ROOT / picture).stat().st_size < 300_000
