# SPDX-License-Identifier: Apache-2.0
"""JSON that nobody vouches for: files that FCSL or somebody else wrote, and texts from elsewhere."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .files import SourceError, read_regular

#: Maximum size of a file.
MAX_JSON_BYTES = 1 << 28


def json_value(text: str | bytes) -> Any:
    """The value of a JSON text. Raises ValueError, also where lists and objects nest too deeply for Python's parser."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def read_json(path: Path) -> Any:
    """The value of a JSON file, which must be a regular one. Raises OSError, and ValueError."""
    try:
        return json_value(read_regular(path, MAX_JSON_BYTES))
    except SourceError as error:
        raise ValueError(str(error)) from None
