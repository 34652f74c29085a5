# SPDX-License-Identifier: Apache-2.0
"""The conversion of a message that is composed from memory: its bytes with every constant in place, and the numbers to fill in.

Constants are frames, names, lengths of sequences, and defaults of fields without a source.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from . import axes
from .conversion import MEMORY, NONE, WIRE, ComposerConversion, ConversionError
from .message_fields import Kind, Piece, Selection, numbers_text
from .rows import Rows, array_of, select_all
from .standard_messages import DEFAULTS, SIZES, Default, Definitions, Member, short_name

_ENCAPSULATION = b"\x00\x01\x00\x00"
_FORMATS = {"bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H"}
_FORMATS |= {"int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}
_MAX_BYTES = 1 << 20


@dataclass(frozen=True)
class Source:
    """A value in memory, and the field of the message that it fills.

    `memory`, `offset` (bytes), `type` and `count` locate it. `axes` are its axes in memory (empty: ROS's axes). `name`
    is used in errors; default: the field.
    """

    field: str
    type: str
    count: int
    offset: int
    axes: str = ""
    memory: int = 0
    name: str = ""


class _Text:
    """The bytes of a message with every constant filled in, and the offset of each number."""

    def __init__(self, definitions: Definitions, message: str, pieces: Sequence[Piece], strings: dict[str, str]):
        self.data = bytearray(_ENCAPSULATION)
        self.places: dict[str, tuple[int, int]] = {}  # path of a number, array or sequence: offset, count
        self._definitions = definitions
        self._message = message
        self._strings = strings
        self._pieces = pieces
        self._defaults: dict[str, float] = {}
        self._members(message, "")
        for path, text in self._strings.items():
            if text:
                raise ConversionError(f"`{short_name(message)}` has no `{path}` for `{text}`")

    def element(self, piece: Piece) -> int:
        """Index of the element of its member that a piece begins with."""
        if isinstance(piece.element, str):
            return self.names(piece.path).index(piece.element)
        return piece.element or 0

    def names(self, path: str) -> list[str]:
        """Element names for the parallel name sequences of the message, in the order of the sources."""
        beside = path.rpartition(".")[0]
        found = [p.element for p in self._pieces if isinstance(p.element, str) and p.path.rpartition(".")[0] == beside]
        return list(dict.fromkeys(found))

    def _members(self, message: str, prefix: str) -> None:
        for default in DEFAULTS.get(message, ()):
            if self._applies(default, prefix):
                self._defaults.setdefault(prefix + default.field, default.value)
        for member in self._definitions[message]:
            self._member(member, prefix + member.name)

    def _applies(self, default: Default, prefix: str) -> bool:
        """A field of a nested message that has its own default outside keeps that one."""
        given = not default.given or self._is_given(prefix + default.given)
        return given and not (default.absent and self._is_given(prefix + default.absent))

    def _is_given(self, path: str) -> bool:
        return any(p.path == path or p.path.startswith((path + ".", path + "[")) for p in self._pieces)

    def _member(self, member: Member, path: str) -> None:
        count = self._length(path) if member.sequence else max(1, member.count)
        if member.sequence:
            self._put("I", count)
        if member.type in SIZES:
            self._numbers(member, path, count)
        elif member.type == "string":
            names = self.names(path) if path.rpartition(".")[2] == "name" and member.sequence else [""] * count
            for name in names if member.sequence else [self._strings.pop(path, "")]:
                self._string(name)
        elif member.type in self._definitions:
            for i in range(count):
                self._members(member.type, f"{path}[{i}]." if member.is_array else f"{path}.")
        else:
            raise ConversionError(f"`{path}` is a {member.type}, which cannot be composed")

    def _length(self, path: str) -> int:
        """The length of a sequence: the number of elements that sources fill."""
        own = [p for p in self._pieces if p.path == path]
        names = self.names(path)
        if names and (path.rpartition(".")[2] == "name" or own):
            return len(names)
        inside = [p.path[len(path) + 1 :].partition("]")[0] for p in self._pieces if p.path.startswith(path + "[")]
        ends = [p.count if p.element is None else self.element(p) + 1 for p in own]
        return max([*ends, *(int(index) + 1 for index in inside)], default=0)

    def _align(self, size: int) -> None:
        self.data += bytes(-(len(self.data) - len(_ENCAPSULATION)) % size)

    def _put(self, code: str, *numbers: float) -> None:
        self._align(struct.calcsize(code))
        self.data += struct.pack(f"<{len(numbers)}{code}", *numbers)
        if len(self.data) > _MAX_BYTES:
            raise ConversionError(f"a `{short_name(self._message)}` of more than {_MAX_BYTES} bytes")

    def _string(self, text: str) -> None:
        data = text.encode() + b"\0"
        self._put("I", len(data))
        self.data += data

    def _numbers(self, member: Member, path: str, count: int) -> None:
        if count == 0:
            return
        unknown = float("nan") if self.names(path) and member.type.startswith("float") else 0
        numbers = [self._defaults.get(f"{path}[{i}]" if member.is_array else path, unknown) for i in range(count)]
        code = _FORMATS[member.type]
        self._put(code, *(numbers if code in "fd" else map(int, numbers)))
        self.places[path] = (len(self.data) - count * SIZES[member.type], count)


def composer_conversion(
    definitions: Definitions,
    message: str,
    sources: Sequence[Source],
    frame: str = "",
    child_frame: str = "",
    stamped: str = "",
) -> ComposerConversion:
    """`message`: full name of the type. `stamped`: where the part with header and frames is, as a prefix of paths
    ("transforms[0]."). Raises ConversionError, which names the source that does not fit and why."""
    if message not in definitions:
        raise ConversionError(f"there is no definition of message type `{short_name(message)}`")
    selections = [_selection(definitions, message, source) for source in sources]
    pieces = [piece for selection in selections for piece in selection.pieces]
    strings = {f"{stamped}header.frame_id": frame, f"{stamped}child_frame_id": child_frame}
    text = _Text(definitions, message, pieces, strings)
    _check_once(sources, selections, text)
    rows = Rows()
    for source, selection in zip(sources, selections, strict=True):
        places = array_of(source.memory, source.offset, MEMORY[source.type], source.count)
        rows.add(_matrix(source, selection), places, list(_targets(selection, text)))
    return ComposerConversion(
        text=bytes(text.data),
        rows=rows.rows,
        terms=rows.terms,
        memory_count=1 + max((s.memory for s in sources), default=0),
        stamp_offset=text.places.get(f"{stamped}header.stamp.sec", (NONE, 0))[0],
    )


def _selection(definitions: Definitions, message: str, source: Source) -> Selection:
    try:
        return select_all(definitions, message, (source.field,), source.count)
    except ConversionError as error:
        raise ConversionError(f"`{source.name or source.field}`: {error}") from None


def _check_once(sources: Sequence[Source], selections: Sequence[Selection], text: _Text) -> None:
    """Checks that no number of the message is filled twice. Raises ConversionError."""
    filled: dict[tuple[str, int], str] = {}
    for source, selection in zip(sources, selections, strict=True):
        numbers = [(p.path, text.element(p) + i) for p in selection.pieces for i in range(p.count)]
        for number in numbers:
            if number in filled:
                raise ConversionError(
                    f"`{source.name or source.field}`: `{source.field}` is filled by `{filled[number]}`, too"
                )
        filled |= dict.fromkeys(numbers, source.name or source.field)


def _targets(selection: Selection, text: _Text) -> Iterator[tuple[int, int]]:
    """Offset and type of each number of a field."""
    for piece in selection.pieces:
        at, count = text.places[piece.path]
        first, size = text.element(piece), SIZES[piece.type]
        if first + piece.count > count:
            raise ConversionError(f"`{piece.path}` has {numbers_text(count)}, not {first + piece.count}")
        for i in range(piece.count):
            yield at + (first + i) * size, WIRE[piece.type]


def _matrix(source: Source, selection: Selection) -> axes.Matrix | None:
    """The matrix from the numbers in memory to those of the message, None where they are the same. Raises ConversionError."""
    if not source.axes and selection.kind is not Kind.QUATERNION:
        return None
    try:
        matrix = axes.conversion(selection.kind, source.count, source.axes, "")
    except axes.AxesError as error:
        raise ConversionError(f"`{source.name or source.field}`: {error}") from None
    if selection.kind is Kind.QUATERNION:
        return axes.product(axes.inverse(axes.permutation(axes.XYZW)), matrix)
    return matrix
