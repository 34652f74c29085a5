# SPDX-License-Identifier: Apache-2.0
"""Whether a value has no NaN and no infinity."""

from __future__ import annotations

import math
from typing import Any

from .arrays import Array
from .structs import Struct, slot


def is_finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, Array):
        return all(map(is_finite, value.data))
    if isinstance(value, Struct):
        return all(is_finite(getattr(value, slot(name))) for name in value.__fcsl_type__.members)
    return True
