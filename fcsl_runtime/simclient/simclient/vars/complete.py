# SPDX-License-Identifier: Apache-2.0
"""Completion of fcsl-var: commands, options, and the paths and states of the running machine."""

from __future__ import annotations

import argparse
import contextlib
import shlex

from .client import VarClient
from .find import find_server, named_address
from .wire import VarError

#: Scripts for the shells. `fcsl-var complete WORDS` (bash: complete-line LINE) prints a candidate per line; one that
#: ends in . or = is partial.
_BASH = """\
_fcsl_var() {
    local cur=${COMP_WORDS[COMP_CWORD]}
    case ${COMP_WORDS[COMP_CWORD-1]} in
        --socket|--token) COMPREPLY=($(compgen -f -- "$cur")); return ;;
    esac
    COMPREPLY=($(fcsl-var complete-line "${COMP_LINE:0:COMP_POINT}" 2>/dev/null))
    if [ ${#COMPREPLY[@]} -eq 0 ]; then COMPREPLY=($(compgen -f -- "$cur")); fi
    case ${COMPREPLY[0]} in *=|*.) compopt -o nospace ;; esac
}
complete -F _fcsl_var fcsl-var"""
_ZSH = """\
_fcsl_var() {
    local -a found
    case ${words[CURRENT-1]} in
        --socket|--token) _files; return ;;
    esac
    found=(${(f)"$(fcsl-var complete "${(@Q)words[2,CURRENT]}" 2>/dev/null)"})
    if (( ! $#found )); then _files; return; fi
    compadd -S '' -- ${(M)found:#*[.=]}
    compadd -- ${found:#*[.=]}
}
compdef _fcsl_var fcsl-var"""
SHELLS = {"bash": _BASH, "zsh": _ZSH}

_COMMANDS = (
    "list get set watch plot eval tick pause resume state set-state save restore describe stats completion".split()
)
_OPTIONS = ["--socket", "--token", "--json", "--help"]
_VALUED = ("--socket", "--token")
#: Options of a command beside those; "": before the command.
_OF_COMMAND = {
    "": ["--version"],
    "set": ["--allow-non-finite"],
    "save": ["--remote"],
    "restore": ["--remote", "--ignore-source-hash"],
    "watch": ["--every", "--ticks"],
    "plot": ["--every", "--ticks", "--window"],
}
_TAKE_PATHS = ("list", "get", "set", "watch", "plot", "describe")
_TIMEOUT_S = 1.0


def print_script(chosen: argparse.Namespace) -> None:
    print(SHELLS[chosen.shell])


def words_of(line: str) -> list[str]:
    """The words of a command line up to the cursor; bash splits words at : and =, and keeps quotes."""
    for quote in ("", "'", '"'):
        with contextlib.suppress(ValueError):  # an open quote
            *before, word = shlex.split(f"{line}|{quote}")
            return [*before, word[:-1]]
    return []


def complete(words: list[str]) -> list[str]:
    """Candidates for the last of `words` (those after `fcsl-var`); empty if there are none."""
    *before, word = words or [""]
    command = next(
        (w for w, last in zip(before, ["", *before], strict=False) if w[0:1] != "-" and last not in _VALUED), ""
    )
    if not command and not word.startswith("-"):
        candidates = _COMMANDS
    elif word.startswith("-"):
        candidates = _OPTIONS + _OF_COMMAND.get(command, [])
    elif command == "completion":
        candidates = list(SHELLS)
    elif command in _TAKE_PATHS or command == "set-state":
        candidates = _names(command, word, before)
    else:
        candidates = []
    return [candidate for candidate in candidates if candidate.startswith(word)]


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
