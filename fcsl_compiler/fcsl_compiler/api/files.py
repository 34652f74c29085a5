# SPDX-License-Identifier: Apache-2.0
"""Files read with a limit and written whole, JSON files, hashes."""

from ..base.files import MAX_SOURCE_BYTES, SourceError, digest, open_regular, read_regular, write_whole
from ..base.json_file import read_json

__all__ = [
    "MAX_SOURCE_BYTES",
    "SourceError",
    "digest",
    "open_regular",
    "read_json",
    "read_regular",
    "write_whole",
]
