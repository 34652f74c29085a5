# SPDX-License-Identifier: Apache-2.0
"""Completion of `fcsl` in shells: verbs, commands, options and their choices; and what a verb adds, such as paths of a running
machine. Where there is no candidate, the shell completes names of files."""

from __future__ import annotations

import argparse
import contextlib
import shlex
from collections.abc import Mapping, Sequence

from ..base.command import Command
from ..base.examples import add_examples, subcommands
from ..base.verb import Verb

#: Scripts for the shells. `fcsl complete WORD…` (bash, fish: complete-line LINE) prints a candidate per line; one that ends in .
#: or = is partial.
_BASH = """\
_fcsl() {
    COMPREPLY=($(fcsl complete-line "${COMP_LINE:0:COMP_POINT}" 2>/dev/null))
    case ${COMPREPLY[0]} in *=|*.) compopt -o nospace ;; esac
}
complete -o default -F _fcsl fcsl"""
_ZSH = """\
_fcsl() {
    local -a found
    found=(${(f)"$(fcsl complete "${(@Q)words[2,CURRENT]}" 2>/dev/null)"})
    if (( ! $#found )); then _files; return; fi
    compadd -S '' -- ${(M)found:#*[.=]}
    compadd -- ${found:#*[.=]}
}
compdef _fcsl fcsl"""
_FISH = """\
function __fcsl
    set -l found (fcsl complete-line (commandline -cp) 2>/dev/null)
    if test (count $found) -eq 0
        __fish_complete_path (commandline -ct)
    else
        printf '%s\\n' $found
    end
end
complete -c fcsl -f -a '(__fcsl)'"""
SHELLS = {"bash": _BASH, "zsh": _ZSH, "fish": _FISH}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl completion",
        description="Prints a shell script that completes verbs, options and paths of a running machine.",
    )
    parser.add_argument("shell", choices=tuple(SHELLS))
    add_examples(parser, {"": 'bash; in .bashrc: eval "$(fcsl completion bash)"'})
    return parser


def main(arguments: Sequence[str]) -> int:
    print(SHELLS[make_parser().parse_args(arguments).shell])
    return 0


def print_candidates(verbs: Mapping[str, Verb], words: Sequence[str]) -> int:
    print("\n".join(candidates(verbs, words or [""])))
    return 0


def words_of(line: str) -> list[str]:
    """The words of a command line up to the cursor; bash splits words at : and =, and keeps quotes."""
    for quote in ("", "'", '"'):
        with contextlib.suppress(ValueError):  # an open quote
            *before, word = shlex.split(f"{line}|{quote}")
            return [*before, word[:-1]]
    return []


def candidates(verbs: Mapping[str, Verb], words: Sequence[str]) -> list[str]:
    """Candidates for the last of the words behind `fcsl`."""
    *before, word = words
    if not before:
        found = ["--help", "--version"] if word.startswith("-") else list(verbs)
    elif before[0] not in verbs:
        found = []
    else:
        verb = verbs[before[0]]
        parser = verb.parser() if verb.parser is not None else None
        own = verb.complete(list(words[1:])) if verb.complete is not None else []
        found = own or (_of_parser(parser, before[1:], word) if parser is not None else [])
    return [candidate for candidate in dict.fromkeys(found) if candidate.startswith(word)]


def _of_parser(parser: argparse.ArgumentParser, before: Sequence[str], word: str) -> list[str]:
    """Commands, options and choices of the parser to which the words before have led."""
    for given in before:
        deeper = subcommands(parser).get(given)
        if deeper is not None:
            parser = deeper.filled() if isinstance(deeper, Command) else deeper
    valued = {name: a for a in parser._actions for name in a.option_strings if a.nargs != 0}
    if before and before[-1] in valued:
        return list(map(str, valued[before[-1]].choices or ()))
    if word.startswith("-"):
        return [name for action in parser._actions for name in action.option_strings if name.startswith("--")]
    positional = [a for a in parser._actions if not a.option_strings]
    return [str(choice) for action in positional for choice in action.choices or ()]
