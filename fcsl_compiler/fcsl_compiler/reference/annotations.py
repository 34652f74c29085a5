# SPDX-License-Identifier: Apache-2.0
"""Parses types in annotations and ports."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from .arrays import array_type
from .types import SCALARS, Type

_TYPE = re.compile(r"\s*(\w+)\s*((?:\[[^\]]*\]\s*)*)")


def split_type(text: str) -> tuple[str, list[str]]:
    """Name and sizes of `f64[2][N] rad/s`: ("f64", ["2", "N"])."""
    match = _TYPE.match(text)
    assert match, text
    return match[1], [extent.strip() for extent in re.findall(r"\[([^\]]*)\]", match[2])]


def parse_type(text: str, sizes: Mapping[str, int], structs: Mapping[str, Type]) -> Type:
    """The type that an annotation names. Sizes are numbers or names in `sizes`."""
    name, extents = split_type(text)
    element: Any = SCALARS[name] if name in SCALARS else structs[name]
    shape = tuple(int(e) if e.isdigit() else int(sizes[e]) for e in extents)
    return array_type(element, shape) if shape else element
