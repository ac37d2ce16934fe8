"""The help inside the product and the documents say the same, and have every word."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.review.queue.fields import BY_NAME
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
    lone stadium priors
    choice give hand handed back lease leases on people work
    take takes gold guidelines mixing copying copies own errors parts guideline datasets
    adjudicate compare differences distance limits other panel rater summary weigh workspace
    comment comments talk threads mentions bells past deeds window before after
    full tall scroll stalls settling exposure ends many naming tracing local lookup css
    cluster serving hosts executors packing day browser database
    stadium priors
    private kept another smaller index
    stored tree trees safe path attempt cookie fit
    categories corner finder ids joins like
    compiler dialect postgresql sqlite statements transfer triggers
    attempts lived processes shared sharing short shown web
    addresses messages sender signing
    challenges enrol task
    invitation invitations invite mail maintenance quota
    joined turns
    proof provider identities sign
    access account join links login logins passwords roles team tokens
    bearer codes devices me remote rules tries users
    characters null examples property paging endings dismiss dismissals
    adopt aliases asked concealment needs ownership rights sight
    actors
    candidate drawn proposal propose scoring search straight
    3d accept admission action actions address adjust adjustments advice ahead anchor annotate answers app
    application archives arrays arrival ask axis backup bar bars batches best binned bodies
    bundle body boxes bulk button buttons cache calibrate canonical canvas caption card cards cell changes chart
    chip chooser class cli client clock codec codecs colours command comparison completion
    conditions config confirm connections contact copy cross csv cursor curve damped delete deps details
    detect diagram dialog diff doctor document documents drags drawing durable editor empty
    encoded engine estimator etags evaluate event events exact examination export
    exports facets facts fan faults fields figure figures files finite first fixes fixture
    folder folders follow form format formats found frozen gathered gestures glossary grass grid guess guide header
    headers heads health heat help histograms history hit home hooks idempotency identity if image images
    import imports in info init insight items jaccard json judged key keys known konva last latest lazy
    least leftovers legend lens lesson lessons letter licence list listing live locks look loupe
    kernels profile trace
    main map markdown marks match matches matrix membership menu merge metrics migrate mini missing
    model modules name names navigation neighbours notice nudge numbers object
    observability onnx open openapi opened options order origin orphans output overlap page pages
    paint palette parquet parse patch pen pins pitch pitches pixel place places plain plural png pointer
    policies pool popover pose position preopen preview problem process progress projection props query rail reader reasons receiving
    recompute record remedies removal render report requests resect resource respond restore result
    revert reviewers rotation router row rows run runs sample save scale scene scene3d scenes score
    scoreboard sending server service session sets shadows sheet singular site smallest solve
    solving source sources sphere spill spread squares stacks stage staging standpoints starts
    state statistics steps storage store stream submit surface swap synloc tab table tally term
    terminal text textures threshold ticks tools triangulate truth types undo undrawn unknown upload uploads
    v3 v3d video viewport viewports virtual wal walk warm what when whiskers words worker write writer zip
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

    @pytest.mark.parametrize("word", ["carry", "spare", "lineage", "ledger", "upstream"])
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
