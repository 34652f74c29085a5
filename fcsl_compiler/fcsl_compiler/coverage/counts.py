# SPDX-License-Identifier: Apache-2.0
"""Reads the counts that hosts wrote (file format: fcsl_cover.h), and rejects counts that no machine can produce."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..base.files import SourceError, read_regular
from .mcdc import Vector, is_evaluation
from .probe_map import MAX_WORDS, CoverError, CoverMap, Decision, FileMap, read_map

_MAGIC = 0x32564F434C534346  # FCSL_COVER_MAGIC
_HEAD = struct.Struct("<4Q")
_MAX_MAP = 1 << 26
#: Of fcsl_cover_check_of.
_CHECK_FACTOR, _ALL_BITS = 0x9E3779B97F4A7C15, 2**64 - 1
SUFFIX = ".cover"


@dataclass(frozen=True)
class Counts:
    """One build of a machine, with the combined counter words of all processes that ran it."""

    map: CoverMap
    words: tuple[int, ...]

    def vectors(self, decision: Decision) -> list[Vector]:
        """All different combinations of its conditions that occurred."""
        stored = self.words[decision.word + 3 : decision.word + decision.words]
        return [v for v in map(Vector.unpack, stored) if v is not None]

    def outcomes(self, decision: Decision) -> set[bool]:
        """All outcomes that occurred."""
        return {outcome for outcome in (False, True) if self.words[decision.word + outcome]}

    def lost(self, decision: Decision) -> bool:
        """Whether combinations were lost because the table was full."""
        return bool(self.words[decision.word + 2])


def read_folder(folder: Path) -> list[Counts]:
    """Reads all coverage files of a folder, sorted by name. Raises CoverError for a damaged file, and OSError."""
    return [read_counts(path) for path in sorted(folder.glob(f"*{SUFFIX}"))]


def read_counts(path: Path) -> Counts:
    """Reads one coverage file. Raises CoverError with file and reason, and OSError."""
    try:
        return _parse(read_regular(path, _HEAD.size + _MAX_MAP + 16 * MAX_WORDS))
    except (CoverError, SourceError) as error:
        raise CoverError(f"{path}: not the coverage of a machine: {error}; remove it and run again") from None


def _parse(data: bytes) -> Counts:
    if len(data) < _HEAD.size or _HEAD.unpack_from(data)[0] != _MAGIC:
        raise CoverError("it does not begin like a coverage file")
    _, length, count, checksum = _HEAD.unpack_from(data)
    room = (length + 7) // 8 * 8
    if length > _MAX_MAP or count > MAX_WORDS or len(data) != _HEAD.size + room + 16 * count:
        raise CoverError("its size differs from the size in its header")
    text = data[_HEAD.size : _HEAD.size + length]
    if zlib.crc32(text) != checksum:
        raise CoverError("its map does not match its checksum")
    found = read_map(text)
    if max(1, found.word_count) not in (count, max(1, count)):
        raise CoverError(f"it has {count} words, but its map has {found.word_count}")
    counts = Counts(found, confirmed(struct.unpack_from(f"<{2 * count}Q", data, _HEAD.size + room)))
    validate(counts)
    return counts


def check_of(word: int, value: int) -> int:
    """The check that a word of this value has (fcsl_cover.h)."""
    return (~value ^ (word + 1) * _CHECK_FACTOR) & _ALL_BITS


def confirmed(memory: Sequence[int]) -> tuple[int, ...]:
    """The words of a memory that has their checks behind them. A word without a check does not count: its process was
    killed before it stored that. Raises CoverError for a word with a wrong one."""
    count = len(memory) // 2
    words, checks = memory[:count], memory[count:]
    for word, (value, check) in enumerate(zip(words, checks, strict=True)):
        if check and check != check_of(word, value):
            raise CoverError(f"count {word} does not match its check")
    return tuple(value if check else 0 for value, check in zip(words, checks, strict=True))


def validate(counts: Counts) -> None:
    """Raises CoverError for words that no machine with this map can produce."""
    flags = [word for file in counts.map.files for _, word in file.lines.values()]
    for file in counts.map.files:
        flags += [loop.word + n for loop in file.loops.values() for n in (0, 1)]
        for decision in file.decisions.values():
            flags += range(decision.word, decision.word + 3)
            _validate_decision(counts, decision, file.name)
    if any(counts.words[word] > 1 for word in flags):
        raise CoverError("a word that must be 0 or 1 has another value")


def _validate_decision(counts: Counts, decision: Decision, file: str) -> None:
    where = f"{file}:{decision.at[0]}:{decision.at[1]}"
    seen: set[int] = set()
    for word in counts.words[decision.word + 3 : decision.word + decision.words]:
        vector = Vector.unpack(word)
        if word and (vector is None or vector.pack() != word or not is_evaluation(decision.tree, vector)):
            raise CoverError(f"an evaluation of the decision at {where} is impossible")
        if vector is not None and (word in seen or vector.outcome not in counts.outcomes(decision)):
            raise CoverError(f"the counts of the decision at {where} contradict each other")
        seen.add(word)


# ---- a machine and its parts -----------------------------------------------------------------------------------------


def added(every: Sequence[Counts]) -> list[Counts]:
    """Combines builds of one machine JSON with the same sources: the whole machine and its subsets
    (config/subset_machine.py)."""
    groups: list[list[Counts]] = []
    for counts in every:
        group = next((g for g in groups if all(_fits(counts.map, other.map) for other in g)), None)
        if group is None:
            groups.append([counts])
        else:
            group.append(counts)
    return [group[0] if len(group) == 1 else _sum(group) for group in groups]


def _fits(one: CoverMap, other: CoverMap) -> bool:
    """Whether two maps agree in all items that both contain."""
    known = {file.name: file for file in other.files}
    pairs = [(file, known[file.name]) for file in one.files if file.name in known]
    return (one.machine, one.config) == (other.machine, other.config) and all(
        a.digest == b.digest
        and all(
            (d.branch, d.tree, d.conditions) == (e.branch, e.tree, e.conditions)
            for d, e in ((a.decisions[at], b.decisions[at]) for at in a.decisions.keys() & b.decisions.keys())
        )
        for a, b in pairs
    )


def _sum(group: Sequence[Counts]) -> Counts:
    group = sorted(group, key=lambda counts: -len(counts.map.files))  # the whole machine determines the order
    first = group[0].map
    made, words = CoverMap(first.machine, first.config, []), list[int]()
    for name in dict.fromkeys(file.name for counts in group for file in counts.map.files):
        having = [(counts, file) for counts in group for file in counts.map.files if file.name == name]
        made.files.append(_sum_file(having, words))
    made.word_count = len(words)
    return Counts(made, tuple(words))


def _sum_file(having: Sequence[tuple[Counts, FileMap]], words: list[int]) -> FileMap:
    """Combines one file of several builds. Appends its words to `words`. A condition is constant only if it is so in
    every build."""
    first = having[0][1]
    algorithms = list(dict.fromkeys(name for _, file in having for name in file.algorithms))
    made = FileMap(first.name, first.path, first.digest, algorithms)
    for line in sorted({line for _, file in having for line in file.lines}):
        lines = [(counts, *file.lines[line]) for counts, file in having if line in file.lines]
        made.lines[line] = (lines[0][1], len(words))
        words.append(max(counts.words[word] for counts, _, word in lines))
    for at in sorted({at for _, file in having for at in file.decisions}):
        decisions = [(counts, file.decisions[at]) for counts, file in having if at in file.decisions]
        constant = set.intersection(*(set(decision.constant) for _, decision in decisions))
        decision = replace(decisions[0][1], word=len(words), constant=tuple(sorted(constant)))
        made.decisions[at] = decision
        vectors = list(dict.fromkeys(v.pack() for counts, one in decisions for v in counts.vectors(one)))
        no, yes, lost = (max(counts.words[one.word + n] for counts, one in decisions) for n in range(3))
        words += (no, yes, max(lost, int(len(vectors) > decision.slots)))
        words += (vectors + [0] * decision.slots)[: decision.slots]
    for at in sorted({at for _, file in having for at in file.loops}):
        loops = [(counts, file.loops[at]) for counts, file in having if at in file.loops]
        made.loops[at] = replace(loops[0][1], word=len(words))
        words += (max(counts.words[loop.word + n] for counts, loop in loops) for n in (0, 1))
    return made
