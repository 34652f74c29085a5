# SPDX-License-Identifier: Apache-2.0
"""How Nim writes the operations of the op table."""

from __future__ import annotations

from . import convert, floats, integers, ordered

SPELLINGS = dict(entry for module in (floats, ordered, convert, integers) for entry in module.spellings())
