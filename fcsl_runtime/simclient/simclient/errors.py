# SPDX-License-Identifier: Apache-2.0
"""What simclient raises. Every message is complete: it names what is wrong and, where known, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class TwinError(ValueError):
    """A twin refused something: a library, a path, a value, an operation."""


class OverwrittenWarning(UserWarning):
    """A twin wrote what the machine overwrites: a connected input."""


class BagError(ValueError):
    """A bag that cannot be used: missing, not a bag, or without what is asked of it."""


class ViewError(ValueError):
    """A viewer that cannot be had, or is gone."""


class MapError(ValueError):
    """A map file, or a bag that does not have what the map names."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """'; did you mean `…`?' for the closest choice, or the empty string."""
    close = difflib.get_close_matches(word, list(choices), n=1, cutoff=0.5)
    return f"; did you mean `{close[0]}`?" if close else ""
