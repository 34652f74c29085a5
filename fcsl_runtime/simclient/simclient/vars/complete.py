# SPDX-License-Identifier: Apache-2.0
"""Completion of `fcsl var`: the paths and states of the running machine."""

from __future__ import annotations

from .client import VarClient
from .find import find_server, named_address
from .wire import VarError

_VALUED = ("--socket", "--token")
_TAKE_PATHS = ("list", "get", "set", "watch", "plot", "describe")
_TIMEOUT_S = 1.0


def complete(words: list[str]) -> list[str]:
    """Candidates for the last of `words` (those behind `fcsl var`); empty if it is no path or state, or no machine runs."""
    *before, word = words or [""]
    command = next(
        (w for w, last in zip(before, ["", *before], strict=False) if w[0:1] != "-" and last not in _VALUED), ""
    )
    if word.startswith("-") or command not in (*_TAKE_PATHS, "set-state"):
        return []
    return _names(command, word, before)


def _names(command: str, word: str, before: list[str]) -> list[str]:
    """Paths up to their next dot, which keeps the list short; or states."""
    try:
        with VarClient(
            named_address(_value_of("--socket", before)) or find_server().address,
            _value_of("--token", before),
            _TIMEOUT_S,
        ) as client:
            if command == "set-state":
                return list(client.describe().get("states", []))
            paths = client.list(word)
    except VarError:
        return []
    whole = len(word)
    groups = {path[: path.index(".", whole) + 1] if "." in path[whole:] else path for path in paths}
    return sorted(f"{group}=" if command == "set" and not group.endswith(".") else group for group in groups)


def _value_of(option: str, words: list[str]) -> str | None:
    """The value of an option that precedes the word to complete."""
    for i, word in enumerate(words):
        if word == option and i + 1 < len(words):
            return words[i + 1]
        if word.startswith(f"{option}="):
            return word.partition("=")[2]
    return None
