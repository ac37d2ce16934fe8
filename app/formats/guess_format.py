"""Which format a folder, a zip or a file most likely holds, from names alone or by its first bytes."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path, PurePosixPath

from app.errors import ReviewError
from app.formats.file_tree import BROKEN, FileTree, Root
from app.formats.frame_names import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_system_file
from app.formats.json_reader import EVALUATE, EXPORT
from app.formats.report import ReaderReport
from app.formats.safe_path import MAX_PART
from app.formats.trees import open_tree_context
from app.object_store.path import StoredPath
from app.zip_file import list_first_member_names

MAX_NAMES = 2000
"""Names that are looked at; a large folder must not hold a request up."""
MAX_DEPTH = 4
_NAMES: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("touchline", re.compile(r"touchline\.json")),
    ("soccernet-v3d", re.compile(r"Labels-v3D\.json|SNv3D\.csv")),
    ("soccernet-v3", re.compile(r"Labels-v3\.json")),
    ("gamestate", re.compile(r"Labels-GameState\.json")),
    ("issia-3d", re.compile(r"ISSIA-3D\.csv")),
    ("issia", re.compile(r"(?:.*\.xgtf|cam.*\.xml)(?:\.gz)?", re.IGNORECASE)),
    ("parquet", re.compile(r".*\.parquet", re.IGNORECASE)),
    ("coco", re.compile(r"(?:instances_|annotations|(?=.*coco)).*\.json")),
    ("sn-calibration", re.compile(r"(?:\d{1,9}|(?:per_)?match_info)\.json")),
    ("cameras", re.compile(r"(?:camera_.*|issia_calibration)\.json")),
)
"""By the last part of a name; the first one that any fits: exports hold cameras beside labels."""
_DOCUMENTS = re.compile(
    r"(?:readme|licen[cs]e|copying|notes?|about)(?:\.\w{1,5})?|.*\.(?:md|pdf|html?|docx?|rtf)",
    re.IGNORECASE,
)
"""What people put beside pictures for other people."""


def guess_format(path: Path | StoredPath) -> str | None:
    """Name of the format for ``touchline import``, or None where nothing looks familiar."""
    return guess_format_from_names(islice(_list_file_names(path), MAX_NAMES))


def guess_format_from_names(found: Iterable[str]) -> str | None:
    """The same of names of files."""
    parts = (name.rpartition("/")[2] for name in found if not is_system_file(name))
    names = [part for part in parts if 0 < len(part) <= MAX_PART]
    for name, pattern in _NAMES:
        if any(map(pattern.fullmatch, names)):
            return name
    rest = _suffixes(name for name in names if not _DOCUMENTS.fullmatch(name))
    pictures, videos = rest & set(IMAGE_SUFFIXES), set(VIDEO_SUFFIXES)
    return "frames" if pictures and rest <= pictures | videos else None


def holds_only_videos(path: Path | StoredPath) -> bool:
    """Whether a folder, a zip or a file is a video, or holds nothing but videos and documents."""
    names = [name for name in islice(_list_file_names(path), MAX_NAMES) if not is_system_file(name)]
    parts = (name.rpartition("/")[2] for name in names if not name.endswith("/"))
    suffixes = _suffixes(part for part in parts if not _DOCUMENTS.fullmatch(part))
    return bool(suffixes) and suffixes <= set(VIDEO_SUFFIXES)


def _suffixes(names: Iterable[str]) -> set[str]:
    return {PurePosixPath(name).suffix.lower() for name in names}


def _list_file_names(path: Path | StoredPath) -> Iterable[str]:
    if isinstance(path, StoredPath):
        return _object_names(path)
    if path.is_dir():
        return _names_below(path, "", MAX_DEPTH)
    if path.suffix.lower() != ".zip" or not path.is_file():
        return [path.name]
    try:
        return list_first_member_names(path, MAX_NAMES)
    except OSError:
        return []


def _object_names(path: StoredPath) -> Iterable[str]:
    if not path.is_dir():
        return [path.name]
    start = len(path.key) + 1 if path.key else 0
    return (item.key[start:] for item in path.store.iterate_objects_below(path.key))


def _names_below(root: Path, inside: str, depth: int) -> Iterator[str]:
    """Names below a folder, files before folders; links are not followed."""
    folders = []
    try:
        with os.scandir(root / inside) as entries:
            for entry in islice(entries, MAX_NAMES):
                if entry.is_dir(follow_symlinks=False):
                    folders.append(f"{inside}{entry.name}/")
                elif entry.is_file(follow_symlinks=False):
                    yield inside + entry.name
    except OSError:
        return
    for folder in sorted(folders)[:20] if depth > 1 else ():
        yield from _names_below(root, folder, depth - 1)


MAX_FILES = 40
"""Files of which the beginning is read."""
HEAD_BYTES = 64 * 1024
CONVERT = f"Touchline does not import that; {EXPORT}"
YOLO = f"they contain no cameras and no groups; {EXPORT}, or give predictions to {EVALUATE}"
MOT = (
    f"they contain no cameras and no groups; give them to {EVALUATE} as predictions, or import the pictures "
    "as frames"
)
NO_PLACES = "it contains no positions in pictures"
PREDICTED = f"it holds predictions, not annotations; give it to {EVALUATE}"


@dataclass(frozen=True)
class FormatGuess:
    """What files look like.

    Attributes:
        name: The format, as people call it.
        format: Name of the import format, or None where there is none.
        advice: What to do about it, after the name.
    """

    name: str
    format: str | None = None
    advice: str = CONVERT

    @property
    def advice_sentence(self) -> str:
        """What to tell whoever gave the files for something else."""
        if self.format is None:
            return f"It looks like {self.name}: {self.advice}."
        return f"It looks like {self.format}: choose that format and import it again."

    def is_advice_in_problem(self, problem: str) -> bool:
        """Whether a problem says already what to do about such files, as ``describe_document`` does."""
        if self.format is not None:
            return f"import it as {self.format}" in problem
        return any(advice in self.advice and advice in problem for advice in (EVALUATE, EXPORT))


LABELME = FormatGuess("LabelMe, a JSON file for each picture")
VIA = FormatGuess("a project of the VGG Image Annotator (VIA)")
FIFTYONE = FormatGuess("FiftyOne")
DATUMARO = FormatGuess("Datumaro")
YOLO_LABELS = FormatGuess("YOLO labels", None, YOLO)


def _compile_key_patterns(*names: str) -> tuple[re.Pattern[bytes], ...]:
    """That all of some keys stand in a JSON text."""
    return tuple(re.compile(rb'"%s"\s*:' % name.encode()) for name in names)


_MARKING = (
    rb'"(?:Side line|Middle line|Circle|Big rect\.|Small rect\.|Goal) ?[a-z ]{0,30}"\s*:\s*\['
)
_NUMBER = rb"-?\d{1,9}(?:\.\d{1,20})?(?:e-?\d{1,3})?"
_YOLO = re.compile(rb"\A\s*\d{1,4}(?:[ \t]+%s){4,4000}[ \t]*(?:\r?\n|\Z)" % _NUMBER)
_MOT = re.compile(rb"\A\s*\d{1,9}, ?-?\d{1,9}(?:, ?%s){4,8}\s*(?:\r?\n|\Z)" % _NUMBER)

_TRACAB = re.compile(rb"\A\s*\d{1,9}:(?:[-\d.,]{1,60};){0,60}:(?:[-\d.,]{1,60},\w{0,4},\w{1,8}|;)")
_STUDIO = rb"(?:rectangle|keypoint|polygon|ellipse|brush)labels"

_Kinds = tuple[tuple[tuple[re.Pattern[bytes], ...], FormatGuess], ...]
"""What is found where all of some patterns are; the first one that fits."""
_JSON: _Kinds = (
    (
        _compile_key_patterns("imageMetadata", "calibration"),
        FormatGuess("soccernet-v3d", "soccernet-v3d"),
    ),
    (_compile_key_patterns("imageMetadata"), FormatGuess("soccernet-v3", "soccernet-v3")),
    (_compile_key_patterns("bbox_image"), FormatGuess("gamestate", "gamestate")),
    (
        _compile_key_patterns("shapes", "imagePath"),
        LABELME,
    ),
    (
        _compile_key_patterns("file_attributes", "regions"),
        VIA,
    ),
    (_compile_key_patterns("fid", "fname"), VIA),
    (_compile_key_patterns("from_name", "to_name"), FormatGuess("Label Studio's own JSON")),
    ((re.compile(rb'"%s"' % _STUDIO),), FormatGuess("Label Studio's JSON-MIN")),
    (_compile_key_patterns("data_row", "projects"), FormatGuess("Labelbox")),
    (_compile_key_patterns("item", "slots"), FormatGuess("Darwin JSON of V7")),
    (_compile_key_patterns("filepath", "samples"), FIFTYONE),
    (_compile_key_patterns("classes", "labels", "bounding_box"), FIFTYONE),
    (
        _compile_key_patterns("frame_id", "teams", "ball"),
        FormatGuess("tracking of the Common Data Format", None, NO_PLACES),
    ),
    (_compile_key_patterns("classTitle"), FormatGuess("Supervisely")),
    (_compile_key_patterns("dm_format_version"), DATUMARO),
    (_compile_key_patterns("items", "label_id"), DATUMARO),
    (_compile_key_patterns("image", "annotations", "coordinates"), FormatGuess("Create ML")),
    (_compile_key_patterns("images", "annotations"), FormatGuess("coco", "coco")),
    (_compile_key_patterns("images", "categories"), FormatGuess("coco", "coco")),
    (_compile_key_patterns("images", "file_name"), FormatGuess("coco", "coco")),
    (_compile_key_patterns("imageData"), LABELME),
    (
        _compile_key_patterns("image_id", "score"),
        FormatGuess("COCO results of a detector", None, PREDICTED),
    ),
    (
        _compile_key_patterns("gameTime", "label"),
        FormatGuess("SoccerNet's action spotting", None, NO_PLACES),
    ),
    (_compile_key_patterns("pan_degrees"), FormatGuess("cameras", "cameras")),
    ((re.compile(_MARKING),), FormatGuess("sn-calibration", "sn-calibration")),
)
_XML: _Kinds = (
    ((re.compile(rb"<(?:\w{1,40}:)?viper\b"),), FormatGuess("issia", "issia")),
    (
        (re.compile(rb"<annotations\b"), re.compile(rb"<(?:meta|track|image)\b")),
        FormatGuess("CVAT's own XML"),
    ),
    (
        (re.compile(rb"<annotation\b"), re.compile(rb"<(?:object|filename)\b")),
        FormatGuess("Pascal VOC, an XML file for each picture"),
    ),
)
_TEXT: _Kinds = (
    ((_YOLO,), YOLO_LABELS),
    ((_MOT,), FormatGuess("tracks of the MOT challenge", None, MOT)),
)
_DAT: _Kinds = (((_TRACAB,), FormatGuess("tracking of TRACAB", None, NO_PLACES)),)
_CSV: _Kinds = (
    (
        (re.compile(rb"\A[^\n]*main_action"), re.compile(rb"\A[^\n]*ball_bbox")),
        FormatGuess("soccernet-v3d", "soccernet-v3d"),
    ),
    ((re.compile(rb"\A[^\n]*x_cam\d"),), FormatGuess("issia-3d", "issia-3d")),
    ((re.compile(rb"\A[^\n]*region_shape_attributes"),), VIA),
    ((re.compile(rb'""%s""' % _STUDIO),), FormatGuess("Label Studio's CSV")),
    (
        (re.compile(rb"\A[^\n]*(?:xmin|x_min|bbox)", re.IGNORECASE),),
        FormatGuess("a table of boxes (CSV)"),
    ),
)
_EMPTY_LABELS = re.compile(r"(?:^|/)labels/(?:[^/]+/){0,2}[^/]+\.txt$", re.IGNORECASE)
"""Of YOLO, of pictures without an object where nothing stands in any."""
_PACKED = re.compile(
    r"\.(?:tar|tgz|tbz2|txz|7z|rar|zst|(?:tar|jsonl?|csv|txt)\.(?:gz|bz2|xz))$", re.IGNORECASE
)
_HEADS = {
    ".json": _JSON, ".jsonl": _JSON, ".ndjson": _JSON, ".xml": _XML, ".xgtf": _XML, ".txt": _TEXT,
    ".csv": _CSV, ".dat": _DAT,
}  # fmt: skip


def guess_other_format(path: Root, format_: str) -> FormatGuess | None:
    """What the files at a path look like, other than the format for which they were given.

    Args:
        path: Folder, zip or file.
        format_: The format that they were given for.
    """
    try:
        with open_tree_context(path, ReaderReport()) as tree:
            found = None if tree is None else _guess_format_of_tree(tree)
    except (*BROKEN, ReviewError, ValueError):
        found = None
    if found is not None:
        return None if found.format == format_ else found
    guess = guess_format(path)
    return None if guess is None or guess == format_ else FormatGuess(guess, guess)


def _guess_format_of_tree(tree: FileTree) -> FormatGuess | None:
    """What most of the first files are."""
    names = tree.names()
    suffixes = Counter(PurePosixPath(name).suffix.lower() for name in names)
    if suffixes[".parquet"]:
        return FormatGuess("parquet", "parquet")
    heads = [name for name in names if PurePosixPath(name).suffix.lower() in _HEADS]
    seen = Counter(
        look
        for name in islice(heads, MAX_FILES)
        if (look := _guess_format_from_file_start(tree, name)) is not None
    )
    if seen:
        return seen.most_common(1)[0][0]
    if any(_EMPTY_LABELS.search(name) and _is_empty(tree, name) for name in heads[:MAX_FILES]):
        return YOLO_LABELS
    shown = any(suffixes[suffix] for suffix in (*IMAGE_SUFFIXES, *VIDEO_SUFFIXES))
    if not (heads or shown) and (packed := next(filter(_PACKED.search, names), None)) is not None:
        name = PurePosixPath(packed).name
        return FormatGuess(
            f"a packed file ({name})", None, "unpack it; of packed files only zip is read"
        )
    if not heads and any(suffixes[suffix] for suffix in VIDEO_SUFFIXES):
        return FormatGuess("a video", None, "it has no annotations")
    if not heads and any(suffixes[suffix] for suffix in IMAGE_SUFFIXES):
        return FormatGuess("pictures alone", None, "there are no annotations beside them")
    return None


def _is_empty(tree: FileTree, name: str) -> bool:
    return _read_file_start(tree, name, 1) == b""


def _read_file_start(tree: FileTree, name: str, size: int) -> bytes | None:
    """The first bytes of a file, None where it cannot be read."""
    try:
        with tree.open(name) as file:
            return file.read(size)
    except (*BROKEN, ReviewError, ValueError):
        return None


def _guess_format_from_file_start(tree: FileTree, name: str) -> FormatGuess | None:
    if (head := _read_file_start(tree, name, HEAD_BYTES)) is None:
        return None
    patterns = _HEADS[PurePosixPath(name).suffix.lower()]
    return next(
        (look for some, look in patterns if all(pattern.search(head) for pattern in some)), None
    )
