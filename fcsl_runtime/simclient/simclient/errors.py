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


def longer_paths(path: str, choices: Iterable[str]) -> list[str]:
    """The choices that have more names at a dot of `path`. `att.outputs.u` is a port of part `att`; the field is
    `att.rate.outputs.u`."""
    ends = [(path[: n + 1], path[n:]) for n, char in enumerate(path) if char == "."]
    return [c for c in choices if any(c.startswith(a) and c.endswith(b) and len(c) > len(path) for a, b in ends)]


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """'; did you mean `…`?' for the closest choice, or the empty string."""
    import difflib  # here: most runs make no mistake

    known = list(choices)
    close = longer_paths(word, known) or difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean `{close[0]}`?" if close else ""
