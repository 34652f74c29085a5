# SPDX-License-Identifier: Apache-2.0
"""Computes coverage from counts: figures for every algorithm file, and its uncovered items sorted by line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from ..base.files import SourceError, digest
from ..base.source import SourceFile, Span
from .counts import Counts
from .mcdc import MAX_CONDITIONS, Tree, conditions, outcome_with, required, shown
from .probe_map import Decision, FileMap, Location, Loop

KINDS = ("line", "branch", "mcdc")
NAMES = {"line": "lines", "branch": "branches", "mcdc": "MC/DC"}


@dataclass(frozen=True)
class Share:
    """`met` of `total` items."""

    met: int
    total: int

    @property
    def percent(self) -> float:
        """100 for a share of no items."""
        return 100.0 * self.met / self.total if self.total else 100.0

    def __add__(self, other: Share) -> Share:
        return Share(self.met + other.met, self.total + other.total)


@dataclass(frozen=True)
class Miss:
    """One uncovered item. `detail`: for a condition, what its pair of evaluations needs."""

    kind: str
    span: Span
    message: str
    detail: str = ""


@dataclass(frozen=True)
class FileFigures:
    """Coverage of one algorithm file."""

    file: FileMap
    changed: bool  # its text differs from the one that ran: messages show no source lines
    shares: dict[str, Share]  # by kind
    misses: tuple[Miss, ...]
    constants: tuple[Miss, ...]  # conditions that cannot vary; they are not counted


def figures(counts: Counts) -> list[FileFigures]:
    """Figures for every file of a machine, in the order of its algorithms."""
    return [_Reader(counts, file).read() for file in counts.map.files]


class _Reader:
    def __init__(self, counts: Counts, file: FileMap):
        self.counts, self.file = counts, file
        text = _text(file)
        self.changed = text is None
        self.source = SourceFile(_shown(file), text or "")

    def read(self) -> FileFigures:
        lines, misses = self._lines()
        unreached = {line for line, (_, word) in self.file.lines.items() if not self.counts.words[word]}
        branch, mcdc = Share(0, 0), Share(0, 0)
        constants: list[Miss] = []
        for decision in self.file.decisions.values():
            constants += self._constants(decision)
            branch += self._branch_share(decision)
            met = self._met(decision)
            mcdc += Share(len(met), len(decision.conditions) - len(decision.constant))
            if self._line_of(decision.at) not in unreached:
                misses += self._of_decision(decision, met)
        for loop in self.file.loops.values():
            branch += Share(sum(self.counts.words[loop.word + n] for n in (0, 1)), 2)
            if loop.at[0] not in unreached:
                misses += self._of_loop(loop)
        misses.sort(key=lambda m: (m.span.line, m.span.column, KINDS.index(m.kind)))
        shares = {"line": lines, "branch": branch, "mcdc": mcdc}
        return FileFigures(self.file, self.changed, shares, tuple(misses), tuple(constants))

    def _span(self, at: Location) -> Span:
        return Span(self.source, *at)

    def _line_of(self, at: Location) -> int:
        """The line of the statement that contains a location."""
        return max((line for line in self.file.lines if line <= at[0]), default=at[0])

    # ---- lines -----------------------------------------------------------------------------------------------------

    def _lines(self) -> tuple[Share, list[Miss]]:
        listed = sorted(self.file.lines)
        missed = [line for line in listed if not self.counts.words[self.file.lines[line][1]]]
        misses: list[Miss] = []
        for first, last in _runs(listed, missed):
            message = "never executed" if first == last else f"lines {first} to {last} were never executed"
            misses.append(Miss("line", self._span(self.file.lines[first][0]), message))
        return Share(len(listed) - len(missed), len(listed)), misses

    # ---- decisions -------------------------------------------------------------------------------------------------

    def _is_constant(self, decision: Decision) -> bool:
        return len(decision.constant) == len(decision.conditions)

    def _branch_share(self, decision: Decision) -> Share:
        return Share(0, 0) if self._is_constant(decision) else Share(len(self.counts.outcomes(decision)), 2)

    def _met(self, decision: Decision) -> set[int]:
        """The conditions for which a pair was seen."""
        if len(decision.conditions) == 1:
            whole = len(self.counts.outcomes(decision)) == 2
            return {0} - set(decision.constant) if whole else set()
        pairs = shown(decision.tree, self.counts.vectors(decision))
        return {c for c, seen in pairs.items() if len(seen) == 2} - set(decision.constant)

    def _of_decision(self, decision: Decision, met: set[int]) -> Iterator[Miss]:
        span, outcomes = self._span(decision.at), self.counts.outcomes(decision)
        if self._is_constant(decision):
            return
        text = self._named(decision.at)
        if not outcomes:
            yield Miss("branch", span, f"{text} was never evaluated")
            return
        for outcome in sorted({False, True} - outcomes, reverse=True):
            yield Miss("branch", span, f"{text} was never {outcome}")
        if len(decision.conditions) == 1:
            return
        if len(decision.conditions) > MAX_CONDITIONS:
            message = (
                f"{len(decision.conditions)} conditions: MC/DC is measured for up to {MAX_CONDITIONS} per decision"
            )
            yield Miss("mcdc", span, message, "split the decision")
            return
        if self.counts.lost(decision) and len(met) + len(decision.constant) < len(decision.conditions):
            message = f"{text} had more combinations than can be stored; a pair that is missing below may have occurred"
            yield Miss("mcdc", span, message, "split the decision")
        pairs = shown(decision.tree, self.counts.vectors(decision))
        for number, at in enumerate(decision.conditions):
            if number not in met and number not in decision.constant:
                yield self._of_condition(decision, number, at, set(pairs[number]))

    def _of_condition(self, decision: Decision, number: int, at: Location, seen: set[bool]) -> Miss:
        missing = [value for value in (True, False) if value not in seen]
        message = " and never ".join(map(str, missing))
        text = f"{self._named(at)} was never {message} while the decision's outcome depended on it"
        return Miss("mcdc", self._span(at), text, self._pair(decision, number, seen))

    def _pair(self, decision: Decision, number: int, seen: set[bool]) -> str:
        """Both evaluations of a pair, and which of them were seen."""
        parts = []
        for value in (True, False):
            others = [
                f"{self._part(decision, part)} {wanted}" for part, wanted in required(decision.tree, number, value)
            ]
            message = ", ".join([f"{self._named(decision.conditions[number])} {value}", *others])
            outcome = outcome_with(decision.tree, number, value)
            parts.append(f"{message}, outcome {outcome} ({'seen' if value in seen else 'missing'})")
        return "; ".join(parts)

    def _part(self, decision: Decision, part: Tree) -> str:
        """Describes an operand: its conditions as written, with the operators between them."""
        if self.changed or isinstance(part, int):
            numbers = conditions(part)
            first, last = decision.conditions[numbers[0]], decision.conditions[numbers[-1]]
            return self._named((*first[:2], *last[2:]))
        return f"`{self._written(decision, part)}`"

    def _written(self, decision: Decision, part: Tree, above: str = "") -> str:
        """Python text of a part of a decision, in parentheses if the operator `above` requires them."""
        if isinstance(part, int):
            return self._named(decision.conditions[part]).strip("`")
        operator, *operands = part
        words = [self._written(decision, operand, operator) for operand in operands]
        text = f"not {words[0]}" if operator == "not" else f" {operator} ".join(words)
        return f"({text})" if (above, operator) in (("not", "and"), ("not", "or"), ("and", "or")) else text

    def _constants(self, decision: Decision) -> list[Miss]:
        found = [self._span(decision.conditions[n]) for n in decision.constant]
        return [Miss("constant", s, f"{self._named(_location(s))} is a constant in this machine") for s in found]

    def _of_loop(self, loop: Loop) -> Iterator[Miss]:
        for offset, message in ((0, "this loop never ran an iteration"), (1, "this loop always ran an iteration")):
            if not self.counts.words[loop.word + offset]:
                yield Miss(
                    "branch", replace(self._span(loop.at), end_line=loop.at[0], end_column=loop.at[1] + 3), message
                )

    def _named(self, at: Location) -> str:
        """The Python text of a location, on one line, in quotes."""
        if self.changed:
            return f"the code at {at[0]}:{at[1]}"
        lines = [self.source.line(n) for n in range(at[0], at[2] + 1)]
        lines[-1] = lines[-1][: at[3] - 1]
        lines[0] = lines[0][at[1] - 1 :]
        return f"`{' '.join(' '.join(line.split('#')[0] for line in lines).split())}`"


def _location(span: Span) -> Location:
    return (span.line, span.column, span.end_line, span.end_column)


def _runs(listed: list[int], missed: list[int]) -> list[tuple[int, int]]:
    """First and last line of each run of missed lines that no covered statement interrupts."""
    runs: list[tuple[int, int]] = []
    for line in missed:
        if runs and listed.index(line) - listed.index(runs[-1][1]) == 1:
            runs[-1] = (runs[-1][0], line)
        else:
            runs.append((line, line))
    return runs


def _shown(file: FileMap) -> str:
    """Path of a file relative to the current folder."""
    path = Path(file.path)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file.path


def _text(file: FileMap) -> str | None:
    """The text of a file as it was compiled. None if it has changed or is missing."""
    try:
        text = SourceFile.read(Path(file.path), file.name).text
    except (SourceError, ValueError):
        return None
    return text if digest(text) == file.digest else None
