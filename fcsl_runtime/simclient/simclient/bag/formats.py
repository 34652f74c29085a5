# SPDX-License-Identifier: Apache-2.0
"""Opens a bag of any format: MCAP, sqlite3 (compressed by file or by message, or not; split or not) and ROS 1.

In every format, a Bag returns ROS 2 messages (little-endian CDR) and their definitions, so that one decoder serves all.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import yaml
import zstandard

from ..errors import BagError
from .bag import Bag
from .definitions import JAZZY, Definitions
from .files import STORAGE, ZSTD, bag_files, metadata_of, storage_suffix
from .packed import PackedMcapBag, PackedSqliteBag
from .ros1_bag import Ros1Bag
from .sqlite_bag import SqliteBag
from .unpack import TooLarge, unzstd_file

#: By suffix: the reader class, and the one for bags whose messages are each compressed.
_READERS: dict[str, tuple[type[Bag], type[Bag]]] = {
    ".mcap": (Bag, PackedMcapBag),
    ".db3": (SqliteBag, PackedSqliteBag),
    ".bag": (Ros1Bag, Ros1Bag),
}


def open_bag(path: str | Path, msg_path: Sequence[str | Path] = ()) -> Bag:
    """The bag at `path`: a directory, or a single file (.mcap or .db3, either with .zstd appended, or .bag of ROS 1).

    `msg_path` are folders with definitions of messages (<package>/msg/<name>.msg), for a bag that has none itself. Raises BagError if it cannot be read. `notes` of the result name definitions that were taken from elsewhere.
    """
    where = Path(path)
    files = bag_files(where)
    suffixes = sorted({storage_suffix(file) for file in files})
    if len(suffixes) > 1:
        raise BagError(f"{where}: holds files of several formats ({', '.join(suffixes)}); name one of them")
    if suffixes[0] not in STORAGE:
        raise BagError(f"{where}: not a bag; its name should end in {', '.join(STORAGE)}, or be that of a directory")
    mode = metadata_of(where if where.is_dir() else where.parent).get("compression_mode")
    by_message = isinstance(mode, str) and mode.lower() == "message"
    reader = _READERS[suffixes[0]][by_message]
    bag = _unpacked(where, files, reader) if files[0].name.endswith(ZSTD) else reader(where)
    _complete_definitions(bag, Definitions(msg_path))
    return bag


def opened(bag: str | Path | Bag) -> Bag:
    """The bag itself, or the one at this place. Raises BagError."""
    return bag if isinstance(bag, Bag) else open_bag(bag)


def _unpacked(path: Path, files: Sequence[Path], reader: type[Bag]) -> Bag:
    """The bag whose files are compressed as a whole, read from a copy that is deleted with the Bag."""
    scratch = tempfile.TemporaryDirectory(prefix="simclient-bag-")
    plain = [Path(scratch.name) / file.name.removesuffix(ZSTD) for file in files]
    for source, target in zip(files, plain, strict=True):
        try:
            unzstd_file(source, target)
        except TooLarge as error:
            text = f"{source}: {error} (half of what is free in {scratch.name}); set TMPDIR to a larger disk"
            raise BagError(text) from None
        except zstandard.ZstdError as error:
            raise BagError(f"{source}: not a zstd file, or a damaged one ({error})") from None
    listed = {"rosbag2_bagfile_information": {"relative_file_paths": [file.name for file in plain]}}
    (Path(scratch.name) / "metadata.yaml").write_text(yaml.safe_dump(listed))
    bag = reader(Path(scratch.name))
    bag.path = path
    weakref.finalize(bag, scratch.cleanup)
    return bag


def _complete_definitions(bag: Bag, definitions: Definitions) -> None:
    """Adds definitions to topics that have none in the bag, where they are found elsewhere, and notes it."""
    sources: dict[str, set[str]] = {}
    for topic in [topic for topic in bag.topics.values() if not topic.schema]:
        text, source = definitions.text(topic.type)
        if text:
            bag.topics[topic.name] = replace(topic, schema_encoding="ros2msg", schema=text)
            sources.setdefault(source, set()).add(topic.type)
    for source, types in sorted(sources.items()):
        whose = f"{source}'s" if source == JAZZY else f"those of {source}"
        bag.notes.append(f"the bag does not define its types; {whose} are taken for {', '.join(sorted(types))}")
