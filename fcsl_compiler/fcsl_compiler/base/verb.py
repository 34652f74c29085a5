# SPDX-License-Identifier: Apache-2.0
"""What a package adds to the command `fcsl`: an entry point of group `fcsl.commands` names its `Commands`.

The module that holds them is imported at each start of `fcsl`, so it imports next to nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from argparse import ArgumentParser

    from .codes.code import Code

GROUP = "fcsl.commands"


class Verb(NamedTuple):
    """`fcsl VERB ARGUMENT…`. `run` gets the arguments behind the verb and returns the exit status."""

    group: str
    help: str
    run: Callable[[Sequence[str]], int]
    #: Whether these arguments are for this package, where another one has the same verb. None: for whatever nobody else takes.
    takes: Callable[[Sequence[str]], bool] | None = None
    #: `takes` says it of a single file, too, and a line may name files of several packages.
    takes_files: bool = False
    #: What parses the arguments; None: another program does.
    parser: Callable[[], ArgumentParser] | None = None
    #: Candidates of its own for the last of the words behind the verb, in the completion of shells.
    complete: Callable[[list[str]], list[str]] | None = None


class Commands(NamedTuple):
    """What one package adds. `codes` loads the diagnostic codes that `explain` knows, `schemas` has the texts that `schema`
    prints."""

    verbs: Mapping[str, Verb]
    codes: Callable[[], Mapping[str, Code]] = dict
    schemas: Mapping[str, Callable[[], str]] = {}


def installed() -> list[Commands]:
    """Those of every installed package, in the order of the packages' names."""
    from importlib.metadata import entry_points  # here, because it takes 20 ms

    points = {point.name: point for point in reversed(tuple(entry_points(group=GROUP)))}
    return [points[name].load() for name in sorted(points)]
