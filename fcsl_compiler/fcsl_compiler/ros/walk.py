# SPDX-License-Identifier: Apache-2.0
"""A message definition as the steps of a walk through its bytes, with the places of the selected numbers.

Members at known distances form one block. A sequence of messages is unrolled as far as elements of it are selected; the
rest is a loop. An element that is found by its key has a loop of its own before, from which the walk returns.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from .conversion import (
    BLOCK,
    CHOICE,
    COUNT,
    END,
    FIND,
    FOUND,
    KEY,
    LENGTH,
    NAMES,
    NONE,
    REPEAT,
    SEQUENCE,
    STRING,
    ConversionError,
    Part,
    SequencePick,
)
from .message_fields import Piece, key_of, length_of
from .standard_messages import SIZES, Definitions, Member, short_name

#: Limits of ros_walk.h.
_MAX_PARTS, _MAX_ANCHORS, _MAX_NAMES, _MAX_DEPTH = 1 << 16, 1024, 256, 16
_MAX_BLOCK_BYTES = 1 << 30
#: Most members of a walk. Members repeat per element of a message array; two arrays of 100000 would give 10^10.
_MAX_MEMBERS = 1 << 18


class Walk:
    """The parts, picks and names of a conversion, and the anchor and offset of each selected piece (`places`)."""

    def __init__(
        self,
        definitions: Definitions,
        message: str,
        pieces: Iterable[Piece],
        strings: Mapping[str, str],
        choices: Mapping[str, Sequence[str]] = MappingProxyType({}),
        limited: frozenset[str] = frozenset(),
    ):
        """`strings`: path of a string to its required value; `choices`: to those of which it has the index. `limited`:
        sequences that may be shorter than their piece. Raises ConversionError for a message that cannot be walked."""
        self.parts: list[Part] = []
        self.picks: list[SequencePick] = []
        self.names: list[bytes] = []
        self.places: dict[Piece, tuple[int, int]] = {}
        self.anchor_count = 0
        self._member_count = 0
        self._definitions, self._message, self._strings = definitions, message, strings
        self.limited: set[str] = set()  # those of `limited` that are sequences here
        self._choices, self._limited = choices, limited
        self._key = ""  # path of the string that is the key, in a loop that finds an element
        self._wanted: dict[str, list[Piece]] = {}
        self._elements: dict[tuple[str, str], int] = {}  # path of a sequence of names, and a name: its index in `names`
        self._block: Part | None = None
        self._met: set[str] = set()  # paths of `strings` found
        for piece in dict.fromkeys(pieces):
            self._wanted.setdefault(piece.path, []).append(piece)
        self._members(message, "", 0)
        for path in strings.keys() - self._met:
            raise self._error("", f"has no `{path}`")
        if len(self.parts) > _MAX_PARTS or self.anchor_count > _MAX_ANCHORS or len(self.names) > _MAX_NAMES:
            raise self._error("", "has too many parts")

    def _error(self, path: str, text: str) -> ConversionError:
        return ConversionError(f"`{path or short_name(self._message)}` {text}")

    def _part(self, code: int, align: int = 0, size: int = 0, first: int = NONE, count: int = 0) -> Part:
        part = Part(code, align, size, first, count)
        self.parts.append(part)
        if len(self.parts) > _MAX_PARTS:
            raise self._error("", "has too many parts")
        self._block = part if code == BLOCK else None
        return part

    def _members(self, message: str, prefix: str | None, depth: int) -> None:
        """The members of `message`; `prefix` None: none of them can be selected."""
        if depth > _MAX_DEPTH or not self._definitions.get(message):
            raise self._error(prefix or message, "is nested too deeply, or has no definition in the bag")
        for member in self._definitions[message]:
            self._member_count += 1
            if self._member_count > _MAX_MEMBERS:
                raise self._error("", "has too many parts")
            self._member(member, None if prefix is None else prefix + member.name, depth)

    def _member(self, member: Member, path: str | None, depth: int) -> None:
        if member.type in SIZES:
            if member.sequence:
                self._sequence(member, path)
            else:
                self._numbers(member, path)
        elif member.type == "string":
            if member.sequence:
                self._sequence_of_strings(path)
            else:
                for _ in range(max(1, member.count)):
                    self._string(path)
        elif member.type not in self._definitions:
            raise self._error(path or member.name, f"is a {member.type}, which cannot be walked over")
        elif member.sequence:
            self._sequence_of_messages(member, path, depth)
        elif member.count:
            for i in range(member.count):
                self._members(member.type, None if path is None else f"{path}[{i}].", depth + 1)
        else:
            self._members(member.type, None if path is None else path + ".", depth + 1)

    def _new_anchor(self) -> int:
        self.anchor_count += 1
        return self.anchor_count - 1

    def _name(self, text: str) -> int:
        self.names.append(text.encode())
        return len(self.names) - 1

    def _expected(self, path: str | None) -> int:
        if path is None or path not in self._strings:
            return NONE
        self._met.add(path)
        return self._name(self._strings[path])

    def _string(self, path: str | None) -> None:
        if path is not None and path == self._key:
            self._part(KEY, first=self._name(key_of(path.rpartition("[")[2].partition("]")[0])[1]))
        elif path is not None and path in self._choices and path in self._wanted:
            names = self._choices[path]
            first, anchor = len(self.names), self._new_anchor()
            self.names += [text.encode() for text in names]
            self.places |= dict.fromkeys(self._wanted[path], (anchor, 0))
            self._part(CHOICE, size=anchor, first=first, count=len(names))
        else:
            self._part(STRING, first=self._expected(path))

    def _numbers(self, member: Member, path: str | None) -> None:
        """A number or a fixed array: in the open block, if its offset there is known."""
        size = SIZES[member.type]
        block = self._block
        if block is None or size > block.align:
            block = self._part(BLOCK, align=size if self.parts else 8)
        at = -(-block.size // size) * size
        if at + size * max(1, member.count) > _MAX_BLOCK_BYTES:
            raise self._error(path or member.name, "is too large")
        block.size = at + size * max(1, member.count)
        for piece in self._wanted.get(path or "", ()):
            if block.first == NONE:
                block.first = self._new_anchor()
            element = piece.element if isinstance(piece.element, int) else 0
            self.places[piece] = (block.first, at + size * element)

    def _sequence(self, member: Member, path: str | None) -> None:
        size, first = SIZES[member.type], len(self.picks)
        for piece in self._wanted.get(path or "", ()):
            anchor = self._new_anchor()
            self.places[piece] = (anchor, 0)
            name = NONE
            if isinstance(piece.element, str):
                names = (path or "").rpartition(".")[0]
                name = self._elements.get((f"{names}.name" if names else "name", piece.element), NONE)
                if name == NONE:
                    raise self._error(path or "", "stands before the names of its elements")
            whole = piece.element is None
            limited = path is not None and whole and path in self._limited
            self.limited |= {path} if path is not None and limited else set()
            element = piece.element if isinstance(piece.element, int) else int(limited)
            self.picks.append(SequencePick(anchor, piece.count if whole else 0, element, name))
        length = self._length(path)
        if length != NONE:
            self.picks.append(SequencePick(length, 0, LENGTH, NONE))
        self._part(SEQUENCE, align=size, size=size, first=first, count=len(self.picks) - first)

    def _length(self, path: str | None) -> int:
        """A new anchor for the length of a sequence, if it is selected; else NONE."""
        piece = length_of(path or "")
        if path is None or piece not in self._wanted.get(piece.path, ()):
            return NONE
        self.places[piece] = (self._new_anchor(), 0)
        return self.places[piece][0]

    def _sequence_of_strings(self, path: str | None) -> None:
        """Names of the elements of parallel sequences, where such elements are selected."""
        beside = "" if path is None or "." not in path else path.rpartition(".")[0] + "."
        wanted = [
            piece.element
            for pieces in self._wanted.values()
            for piece in pieces
            if isinstance(piece.element, str) and piece.path.rpartition(".")[0] == beside[:-1]
        ]
        first = len(self.names)
        if path is not None and path == beside + "name":
            for name in dict.fromkeys(wanted):
                self._elements[path, name] = self._name(name)
        self._part(NAMES, first=first, count=len(self.names) - first)

    def _sequence_of_messages(self, member: Member, path: str | None, depth: int) -> None:
        spelled = 0
        if path is not None:
            inside = [p[len(path) + 1 :].partition("]")[0] for p in self._wanted if p.startswith(path + "[")]
            spelled = max((int(index) + 1 for index in inside if index.isdigit()), default=0)
            for index in dict.fromkeys(index for index in inside if not index.isdigit()):
                self._by_key(member, f"{path}[{index}].", index, depth)
        self._part(COUNT, first=self._length(path), count=spelled)
        for i in range(spelled):
            self._members(member.type, f"{path}[{i}].", depth + 1)
        at = len(self.parts)
        repeat = self._part(REPEAT)
        self._members(member.type, None, depth + 1)
        repeat.first = len(self.parts)
        self._part(END, first=at)

    def _by_key(self, member: Member, prefix: str, index: str, depth: int) -> None:
        """Goes through the elements up to the one whose string is that of the key, and back to the first."""
        at, first = len(self.parts), self.anchor_count
        find = self._part(FIND)
        self._key = f"{prefix}{key_of(index)[0]}"
        self._members(member.type, prefix, depth + 1)
        self._key = ""
        find.first, find.size, find.count = len(self.parts), first, self.anchor_count - first
        self._part(FOUND, first=at)
