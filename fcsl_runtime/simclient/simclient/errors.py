# SPDX-License-Identifier: Apache-2.0
"""The exceptions of simclient. Every message is complete: it names the problem and, where known, the remedy."""

from __future__ import annotations

from collections.abc import Iterable


class TwinError(ValueError):
    """A twin rejected a library, a path, a value or an operation."""


class OverwrittenWarning(UserWarning):
    """A twin wrote a connected input, which the machine overwrites."""


class BagError(ValueError):
    """A bag that cannot be used: missing, not a bag, or without the requested data."""


class ViewError(ValueError):
    """A viewer that cannot be started or has ended."""


class BusError(ValueError):
    """A bus that cannot be reached, or a request to it that is wrong."""


class MapError(ValueError):
    """An invalid map file, or a bag that lacks what the map names."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """'; did you mean `…`?' for the closest choice, or the empty string."""
    import difflib  # here: most runs make no mistake

    from fcsl_compiler.api.diagnostics import longer_paths

    known = list(choices)
    close = longer_paths(word, known) or difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean `{close[0]}`?" if close else ""
