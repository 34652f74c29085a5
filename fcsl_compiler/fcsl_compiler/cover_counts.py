# SPDX-License-Identifier: Apache-2.0
"""Reads what hosts counted (the files that fcsl_cover.h describes), and refuses what no machine can have counted."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from .cover_map import MAX_WORDS, CoverError, CoverMap, Decision, read_map
from .cover_mcdc import Vector, is_evaluation
from .source import SourceError, read_regular

_MAGIC = 0x31564F434C534346  # FCSL_COVER_MAGIC
_HEAD = struct.Struct("<3Q")
_MAX_MAP = 1 << 26
SUFFIX = ".cover"


@dataclass(frozen=True)
class Counts:
    """One build of a machine, with the words of all processes that ran it."""

    map: CoverMap
    words: tuple[int, ...]

    def vectors(self, decision: Decision) -> list[Vector]:
        """The combinations of its conditions that were seen, each once."""
        stored = self.words[decision.word + 3 : decision.word + decision.words]
        return [v for v in map(Vector.unpack, stored) if v is not None]

    def outcomes(self, decision: Decision) -> set[bool]:
        """The outcomes that were seen."""
        return {outcome for outcome in (False, True) if self.words[decision.word + outcome]}

    def lost(self, decision: Decision) -> bool:
        """Whether some combinations found no room."""
        return bool(self.words[decision.word + 2])


def read_folder(folder: Path) -> list[Counts]:
    """Every file of coverage in a folder, in order of names. Raises CoverError for a damaged one, OSError."""
    return [read_counts(path) for path in sorted(folder.glob(f"*{SUFFIX}"))]


def read_counts(path: Path) -> Counts:
    """Raises CoverError, which names the file and what is wrong with it; OSError."""
    try:
        return _parse(read_regular(path, _HEAD.size + _MAX_MAP + 8 * MAX_WORDS))
    except (CoverError, SourceError) as error:
        raise CoverError(f"{path}: not the coverage of a machine: {error}; remove it and run again") from None


def _parse(data: bytes) -> Counts:
    if len(data) < _HEAD.size or _HEAD.unpack_from(data)[0] != _MAGIC:
        raise CoverError("it does not begin as such a file does")
    _, length, count = _HEAD.unpack_from(data)
    room = (length + 7) // 8 * 8
    if length > _MAX_MAP or count > MAX_WORDS or len(data) != _HEAD.size + room + 8 * count:
        raise CoverError("it is cut short, or longer than it says")
    found = read_map(data[_HEAD.size : _HEAD.size + length])
    if max(1, found.word_count) not in (count, max(1, count)):
        raise CoverError(f"it has {count} words, and its map tells of {found.word_count}")
    counts = Counts(found, struct.unpack_from(f"<{count}Q", data, _HEAD.size + room))
    validate(counts)
    return counts


def validate(counts: Counts) -> None:
    """Raises CoverError for words that no machine of this map can have counted."""
    flags = [word for file in counts.map.files for _, word in file.lines.values()]
    for file in counts.map.files:
        flags += [loop.word + n for loop in file.loops.values() for n in (0, 1)]
        for decision in file.decisions.values():
            flags += range(decision.word, decision.word + 3)
            _validate_decision(counts, decision, file.name)
    if any(counts.words[word] > 1 for word in flags):
        raise CoverError("a word that is 0 or 1 is neither")


def _validate_decision(counts: Counts, decision: Decision, file: str) -> None:
    where = f"{file}:{decision.at[0]}:{decision.at[1]}"
    seen: set[int] = set()
    for word in counts.words[decision.word + 3 : decision.word + decision.words]:
        vector = Vector.unpack(word)
        if word and (vector is None or vector.pack() != word or not is_evaluation(decision.tree, vector)):
            raise CoverError(f"the decision at {where} cannot have been evaluated so")
        if vector is not None and (word in seen or vector.outcome not in counts.outcomes(decision)):
            raise CoverError(f"the counts of the decision at {where} contradict each other")
        seen.add(word)
