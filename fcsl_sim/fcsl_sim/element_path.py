# SPDX-License-Identifier: Apache-2.0
"""Paths of values and of their parts: `wind.parameters.wind_north`, `wind.parameters.wind_north[2]`."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

_PATH = re.compile(r"(.+?)((?:\[\d+\])*)")


def split_path(path: str) -> tuple[str, tuple[int, ...]]:
    """The path of the whole field, and the index of the part."""
    parts = _PATH.fullmatch(path)
    whole, brackets = parts.groups() if parts else (path, "")
    return whole, tuple(map(int, re.findall(r"\d+", brackets)))


def row_major_index(index: Sequence[int], shape: Sequence[int]) -> int | None:
    """Row-major index of an element, or of the first one of a row. None: the field has no such part."""
    if len(index) > len(shape) or any(i >= extent for i, extent in zip(index, shape, strict=False)):
        return None
    return sum(i * math.prod(shape[axis + 1 :]) for axis, i in enumerate(index))


def name_an_element(whole: str, shape: Sequence[int]) -> str:
    """Help for a path that is none."""
    return f"name an element: `{whole}{'[0]' * len(shape)}`" if shape else f"write `{whole}`"
