# SPDX-License-Identifier: Apache-2.0
"""Values as the command line of fcsl var has them."""

from __future__ import annotations

import contextlib
import json
import math
import re
from typing import Any

_SCALAR = re.compile(r'"(?:[^"\\]|\\.)*"|[^\s,\[\]"]+')
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf, "True": True, "False": False}


def read_value(text: str) -> Any:
    """Parses a number, true, false, nan, inf, a name (quoted or not), or a list of those."""
    for json_text in (text, _SCALAR.sub(_as_json, text)):
        with contextlib.suppress(ValueError, RecursionError):
            return json.loads(json_text)
    return text


def _as_json(scalar: re.Match[str]) -> str:
    try:
        return json.dumps(json.loads(scalar[0]))
    except ValueError:
        return json.dumps(_WORDS.get(scalar[0], scalar[0]))
