# SPDX-License-Identifier: Apache-2.0
"""The conversion of a message that is composed from memory: its bytes with every constant in place, and the numbers to fill in.

Constants are frames, names, keys, lengths of sequences, and defaults of fields without a source. Where strings or lists
differ in length from message to message, the bytes have room for the longest, and segments say what closes up.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from . import axes, conversion
from .conversion import MEMORY, NONE, TEXT, WIRE, ComposerConversion, ConversionError, Segment, Term
from .message_fields import LENGTH, Kind, Piece, Selection, key_of, numbers_text
from .rows import Choice, Rows, array_of, select_all
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
    choices: tuple[Choice, ...] = ()


class _Text:
    """The bytes of a message with every constant filled in, and the offset of each number."""

    def __init__(
        self,
        definitions: Definitions,
        message: str,
        pieces: Sequence[Piece],
        strings: dict[str, str],
        rooms: dict[str, int],
    ):
        """`rooms`: of strings that are chosen, by path, the most bytes, the final NUL included."""
        self.data = bytearray(_ENCAPSULATION)
        self.places: dict[str, tuple[int, int]] = {}  # path of a number, array, sequence or length: offset, count
        self.varying: set[str] = set()  # lengths that sources fill: those of lists that one fills as a whole
        self.segments: list[Segment] = [Segment(0, len(_ENCAPSULATION), 1, 0)]
        self._definitions = definitions
        self._message = message
        self._strings = strings
        self._rooms = rooms
        self._pieces = pieces
        self._lengths = {piece.path for piece in pieces if piece.length}
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
        keys = self._keys(path) if member.sequence and member.type in self._definitions else []
        count = self._length(member, path) + len(keys) if member.sequence else max(1, member.count)
        if member.sequence:
            if member.bound and count > member.bound:
                raise ConversionError(f"`{path}` has at most {member.bound} elements, not {count}")
            self._put("I", count)
            self.places[f"{path}.{LENGTH}"] = (len(self.data) - 4, 1)
        if member.type in SIZES:
            self._numbers(member, path, count)
        elif member.type == "string":
            names = self.names(path) if path.rpartition(".")[2] == "name" and member.sequence else [""] * count
            for i, name in enumerate(names if member.is_array else [self._strings.pop(path, "")]):
                self._string(name or self._default_text(member, i), "" if member.is_array else path)
        elif member.type in self._definitions:
            for i in range(count):
                index = str(i) if i < count - len(keys) else keys[i - count]
                if not index.isdigit():
                    name, value = key_of(index)
                    self._strings[f"{path}[{index}].{name}"] = value
                self._members(member.type, f"{path}[{index}]." if member.is_array else f"{path}.")
        else:
            raise ConversionError(f"`{path}` is a {member.type}, which cannot be composed")

    def _default_text(self, member: Member, i: int) -> str:
        return str(member.default[i]) if i < len(member.default) else ""

    def _keys(self, path: str) -> list[str]:
        """The keys of elements of a sequence of messages, in the order of the sources; they stand behind those by number."""
        return list(dict.fromkeys(index for index in self._inside(path) if not index.isdigit()))

    def _inside(self, path: str) -> list[str]:
        """What is written in brackets behind a sequence of messages."""
        return [p.path[len(path) + 1 :].partition("]")[0] for p in self._pieces if p.path.startswith(path + "[")]

    def _length(self, member: Member, path: str) -> int:
        """The length of a sequence: the number of elements that sources fill, else that of its default."""
        own = [p for p in self._pieces if p.path == path]
        names = self.names(path)
        if names and (path.rpartition(".")[2] == "name" or own):
            return len(names)
        ends = [p.count if p.element is None else self.element(p) + 1 for p in own]
        ends += [int(index) + 1 for index in self._inside(path) if index.isdigit()]
        return max(ends, default=len(member.default))

    def _put(self, code: str, *numbers: float) -> None:
        size = struct.calcsize(code)
        self.data += bytes(-(len(self.data) - len(_ENCAPSULATION)) % size)
        self._append(size, struct.pack(f"<{len(numbers)}{code}", *numbers))

    def _append(self, align: int, data: bytes, element: int = 0) -> None:
        """Bytes that are aligned. Those of `element` bytes each, as many as the length before them says, and those with
        another alignment than all before them begin a segment."""
        at = len(self.data)
        last = self.segments[-1]
        if element or last.element or align > last.align or last.offset == 0:
            self.segments.append(Segment(at, len(data), max(align, 8 if at == len(_ENCAPSULATION) else 1), element))
        else:
            self.segments[-1] = replace(last, size=at + len(data) - last.offset)
        self.data += data
        if len(self.data) > _MAX_BYTES:
            raise ConversionError(f"a `{short_name(self._message)}` of more than {_MAX_BYTES} bytes")

    def _string(self, text: str, path: str) -> None:
        """A string; at the path of one that is chosen there is room for the longest."""
        room = self._rooms.get(path, 0)
        data = text.encode() + b"\0"
        self._put("I", room or len(data))
        self.places[path] = (len(self.data) - 4, 1)
        self._append(1, bytes(room) or data, element=1 if room else 0)

    def _numbers(self, member: Member, path: str, count: int) -> None:
        if count == 0:
            return
        unknown = float("nan") if self.names(path) and member.type.startswith("float") else 0
        defaults = [float(d) if isinstance(d, float) else int(d) for d in member.default[:count]]
        defaults += [unknown] * (count - len(defaults))
        paths = [f"{path}[{i}]" if member.is_array else path for i in range(count)]
        numbers = [self._defaults.get(p, default) for p, default in zip(paths, defaults, strict=True)]
        code, size = _FORMATS[member.type], SIZES[member.type]
        values = struct.pack(f"<{count}{code}", *(numbers if code in "fd" else map(int, numbers)))
        self.data += bytes(-(len(self.data) - len(_ENCAPSULATION)) % size)
        self.places[path] = (len(self.data), count)
        varies = f"{path}.{LENGTH}" in self._lengths and any(p.path == path and p.element is None for p in self._pieces)
        self.varying |= {f"{path}.{LENGTH}"} if varies else set()
        self._append(size, values, element=size if varies else 0)


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
    rooms = {
        selection.pieces[0].path: 1 + max(len(str(choice).encode()) for choice in source.choices)
        for source, selection in zip(sources, selections, strict=True)
        if selection.kind is Kind.TEXT
    }
    text = _Text(definitions, message, pieces, strings, rooms)
    _check_once(sources, selections, text)
    rows, choices = Rows(), _Choices()
    for source, selection in zip(sources, selections, strict=True):
        places = array_of(source.memory, source.offset, MEMORY[source.type], source.count)
        if source.choices:
            choices.add(source, [place.term() for place in places], selection, text)
        elif not selection.is_length or selection.pieces[0].path in text.varying:
            rows.add(_matrix(source, selection), places, list(_targets(selection, text)))
    varies = any(segment.element for segment in text.segments)
    return ComposerConversion(
        text=bytes(text.data),
        rows=rows.rows,
        terms=rows.terms,
        memory_count=1 + max((s.memory for s in sources), default=0),
        stamp_offset=text.places.get(f"{stamped}header.stamp.sec", (NONE, 0))[0],
        choices=choices.rows,
        names=choices.names,
        numbers=choices.numbers,
        segments=text.segments if varies else (),
    )


class _Choices:
    """Collects the choices of a conversion."""

    def __init__(self) -> None:
        self.rows: list[conversion.Choice] = []
        self.names: list[bytes] = []
        self.numbers: list[int] = []

    def add(self, source: Source, indices: Sequence[Term], selection: Selection, text: _Text) -> None:
        if selection.kind is Kind.TEXT:
            at = text.places[selection.pieces[0].path][0]
            self.rows.append(conversion.Choice(indices[0], at, TEXT, len(self.names), len(source.choices)))
            self.names += [str(choice).encode() for choice in source.choices]
            return
        for index, (at, type_) in zip(indices, _targets(selection, text), strict=True):
            self.rows.append(conversion.Choice(index, at, type_, len(self.numbers), len(source.choices)))
        self.numbers += [choice for choice in source.choices if isinstance(choice, int)]


def _selection(definitions: Definitions, message: str, source: Source) -> Selection:
    try:
        return select_all(definitions, message, (source.field,), source.count, source.choices)
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
