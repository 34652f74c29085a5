# SPDX-License-Identifier: Apache-2.0
"""`fcsl`: the verbs of all installed packages of FCSL, under one name."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from itertools import groupby

from ..base.verb import Commands, Verb, installed
from ..base.version import package_version

#: Groups of verbs in the order of --help; another one stands at the end.
_GROUPS = ("machines", "simulation", "recordings", "running machines", "hardware", "build systems")
_USAGE = "usage: fcsl [-h] [--version] VERB ...\n"
_EPILOG = """
`fcsl VERB --help` has the options of a verb, with an example. On a flight computer the programs are fcsl-fc and fcsl-guard.
Exit status: 0 success; 1 the input was read and the answer is no; 2 wrong usage, or a file or a machine is not there.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: that of the verb; 2 for one that there is not."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        status = _run(words)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE  # as of a program that the signal ends: the reader wanted no more
    except KeyboardInterrupt:
        print("fcsl: interrupted", file=sys.stderr)
        return 130


def _run(words: list[str]) -> int:
    if words[:1] == ["--version"]:
        print(f"fcsl {package_version('fcsl_compiler', __file__)}")
        return 0
    packages = installed()
    if words[:1] in (["-h"], ["--help"]):
        print(help_text(packages), end="")
        return 0
    if not words or words[0].startswith("-"):
        return _wrong("a verb is missing" if not words else f"there is no option {words[0]}")
    name, *rest = words
    if name in ("complete", "complete-line"):  # what the scripts of `fcsl completion` call
        from .complete import print_candidates, words_of

        every = {n: verb for p in reversed(packages) for n, verb in p.verbs.items()}
        return print_candidates(every, rest if name == "complete" else words_of(" ".join(rest))[1:])
    offered = [package.verbs[name] for package in packages if name in package.verbs]
    if not offered:
        like = get_close_matches(name, sorted({n for p in packages for n in p.verbs}), 1)
        return _wrong(f"there is no verb `{name[:80]}`{f' (did you mean `{like[0]}`?)' if like else ''}")
    chosen = _chosen(offered, rest)
    if chosen.takes_files:
        from .mixed_files import parts_of, run_parts

        parts = parts_of(offered, rest)
        if len(parts) > 1:
            return run_parts(parts)
    return chosen.run(rest)


def _chosen(offered: Sequence[Verb], arguments: Sequence[str]) -> Verb:
    """The first that takes the arguments, else the one that takes the rest."""
    special = [verb for verb in offered if verb.takes is not None and verb.takes(arguments)]
    return [*special, *(verb for verb in offered if verb.takes is None), *offered][0]


def _wrong(why: str) -> int:
    print(f"{_USAGE}fcsl: error: {why}; `fcsl --help` lists the verbs", file=sys.stderr)
    return 2


def help_text(packages: Sequence[Commands]) -> str:
    """All verbs by group, each with a sentence."""
    verbs = {name: verb for package in packages for name, verb in package.verbs.items() if verb.takes is None}
    width = max(map(len, verbs))
    parts = [_USAGE, "\nFlight software: write, test, fly and look at machines.\n"]

    def place(item: tuple[str, Verb]) -> tuple[int, str]:
        group = item[1].group
        return (_GROUPS.index(group) if group in _GROUPS else len(_GROUPS), group)

    for (_, group), members in groupby(sorted(verbs.items(), key=place), key=place):
        parts.append(f"\n{group}:\n")
        parts += [f"  {name:<{width}}  {verb.help}\n" for name, verb in members]
    return "".join([*parts, _EPILOG])
