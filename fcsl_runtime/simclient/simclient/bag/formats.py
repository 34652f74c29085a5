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
from rosbags.typesys import Stores, get_typestore

from ..errors import BagError
from .bag import Bag
from .files import STORAGE, ZSTD, bag_files, metadata_of, storage_suffix
from .foreign import PackedMcapBag, PackedSqliteBag, Ros1Bag, SqliteBag
from .unpack import TooLarge, unzstd_file

#: By suffix: the reader class, and the one for bags whose messages are each compressed.
_READERS: dict[str, tuple[type[Bag], type[Bag]]] = {
    ".mcap": (Bag, PackedMcapBag),
    ".db3": (SqliteBag, PackedSqliteBag),
    ".bag": (Ros1Bag, Ros1Bag),
}


def open_bag(path: str | Path) -> Bag:
    """The bag at `path`: a directory, or a single file (.mcap or .db3, either with .zstd appended, or .bag of ROS 1).

    Raises BagError if it cannot be read. `notes` of the result name definitions that were taken from elsewhere.
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
    _complete_definitions(bag)
    return bag


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


def _complete_definitions(bag: Bag) -> None:
    """Adds ROS 2 Jazzy's definition to topics whose definition the bag lacks, where Jazzy has the type, and notes it."""
    store = get_typestore(Stores.ROS2_JAZZY)
    lacking = [topic for topic in bag.topics.values() if not topic.schema and topic.type in store.fielddefs]
    for topic in lacking:
        text = store.generate_msgdef(topic.type, ros_version=2)[0]
        bag.topics[topic.name] = replace(topic, schema_encoding="ros2msg", schema=text)
    if lacking:
        types = ", ".join(sorted({topic.type for topic in lacking}))
        bag.notes.append(f"the bag does not define its types; ROS 2 Jazzy's are taken for {types}")
