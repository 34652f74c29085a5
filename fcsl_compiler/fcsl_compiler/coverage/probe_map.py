# SPDX-License-Identifier: Apache-2.0
"""The items of a machine's algorithms that can be covered, and the counter words of each, with conversion to and from
JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from ..base.json_file import json_value
from ..base.source import Span
from .mcdc import MAX_CONDITIONS, MAX_VECTORS, Tree, combinations, conditions

MAP_VERSION = 1
#: Maximum number of words. A file with more is damaged.
MAX_WORDS = 1 << 22
_MAX_DEPTH = 200

Location = tuple[int, int, int, int]  # line, column, end line, end column, as in Span


class CoverError(ValueError):
    """A file without valid coverage, or a command that cannot measure it. str() names the file and the reason."""


def location(span: Span) -> Location:
    return (span.line, span.column, span.end_line, span.end_column)


@dataclass(frozen=True)
class Decision:
    """A Boolean expression: the condition of an `if` or conditional expression (`branch`), or a value made by
    operators.

    Words from `word` on: 1 if it was False, 1 if it was True, number of evaluations whose combination did not fit, and
    `slots` combinations (mcdc.Vector). A single condition needs no slots, because the outcomes are sufficient.
    """

    at: Location
    branch: bool
    tree: Tree
    conditions: tuple[Location, ...]
    word: int
    constant: tuple[int, ...] = ()  # conditions with one value in every instance

    @property
    def slots(self) -> int:
        """Number of combinations that are stored."""
        count = len(self.conditions)
        return min(sum(combinations(self.tree)), MAX_VECTORS) if 1 < count <= MAX_CONDITIONS else 0

    @property
    def words(self) -> int:
        return 3 + self.slots


@dataclass(frozen=True)
class Loop:
    """A `for` loop that may run no iteration. Words: 1 if it ran one, 1 if it ran none."""

    at: Location
    word: int


@dataclass
class FileMap:
    """One algorithm file."""

    name: str  # path as in the machine JSON
    path: str
    digest: str  # SHA-256 of its text
    algorithms: list[str]  # algorithms whose classes it contains
    lines: dict[int, tuple[Location, int]] = field(default_factory=dict)  # line to its first statement and its word
    decisions: dict[Location, Decision] = field(default_factory=dict)
    loops: dict[Location, Loop] = field(default_factory=dict)


@dataclass
class CoverMap:
    """One machine."""

    machine: str
    config: str  # absolute path
    files: list[FileMap]
    word_count: int = 0

    def to_json(self) -> str:
        files = [
            {
                "name": f.name,
                "path": f.path,
                "digest": f.digest,
                "algorithms": f.algorithms,
                "lines": [[*at, word] for at, word in f.lines.values()],
                "decisions": [
                    [*d.at, int(d.branch), d.tree, [list(c) for c in d.conditions], d.word, list(d.constant)]
                    for d in f.decisions.values()
                ],
                "loops": [[*loop.at, loop.word] for loop in f.loops.values()],
            }
            for f in self.files
        ]
        head = {"version": MAP_VERSION, "machine": self.machine, "config": self.config, "words": self.word_count}
        return json.dumps({**head, "files": files}, separators=(",", ":"))


def read_map(text: bytes) -> CoverMap:
    """Reads the output of `to_json`. Raises CoverError for any other text."""
    try:
        data = json_value(text)
        if data["version"] != MAP_VERSION:
            raise CoverError(f"its map has version {data['version']!r}; this fcslc reads {MAP_VERSION}")
        made = CoverMap(_text(data["machine"]), _text(data["config"]), [], _number(data["words"], 0, MAX_WORDS))
        taken: set[int] = set()
        for f in data["files"]:
            made.files.append(_read_file(f, made.word_count, taken))
        return made
    except CoverError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, AttributeError):
        raise CoverError("its map has an invalid format") from None


def _read_file(data: Any, count: int, taken: set[int]) -> FileMap:
    algorithms = [_text(a) for a in _list(data["algorithms"])]
    made = FileMap(_text(data["name"]), _text(data["path"]), _text(data["digest"]), algorithms)
    for row in _list(data["lines"]):
        at = _location(row[:4])
        made.lines[at[0]] = (at, _words(row[4], 1, count, taken))
    for row in _list(data["decisions"]):
        at, tree, locations = _location(row[:4]), _tree(row[5], 0), tuple(map(_location, _list(row[6])))
        if conditions(tree) != list(range(len(locations))):
            raise ValueError
        constant = tuple(_number(c, 0, len(locations)) for c in _list(row[8]))
        decision = Decision(at, bool(row[4]), tree, locations, _number(row[7], 0, count), constant)
        _words(decision.word, decision.words, count, taken)
        made.decisions[at] = decision
    for row in _list(data["loops"]):
        at = _location(row[:4])
        made.loops[at] = Loop(at, _words(row[4], 2, count, taken))
    return made


def _words(first: Any, size: int, count: int, taken: set[int]) -> int:
    """Checks that `size` words from `first` on are within `count` and unused, and marks them as taken."""
    found = range(_number(first, 0, count - size + 1), first + size)
    if not taken.isdisjoint(found):
        raise ValueError
    taken.update(found)
    return found.start


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _number(value: Any, low: int, end: int) -> int:
    if type(value) is not int or not low <= value < max(end, low + 1):
        raise ValueError
    return value


def _location(row: Any) -> Location:
    line, column, end_line, end_column = (_number(n, 1, 1 << 20) for n in _list(row))
    if (line, column) > (end_line, end_column):
        raise ValueError
    return (line, column, end_line, end_column)


def _tree(value: Any, depth: int) -> Tree:
    if type(value) is int:
        return value
    operator, *parts = _list(value)
    if depth > _MAX_DEPTH or operator not in ("not", "and", "or") or len(parts) != (1 if operator == "not" else 2):
        raise ValueError
    return [operator, *(_tree(part, depth + 1) for part in parts)]
