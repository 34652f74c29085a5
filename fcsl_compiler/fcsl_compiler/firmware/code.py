# SPDX-License-Identifier: Apache-2.0
"""What compiled objects refer to: sizes of what a linker keeps, what is missing, and the stack of a function.

Compiled with -ffunction-sections, each function is a section, and the relocations of a section are its calls. So this is
known of every processor, from its compiler's -fstack-usage and from no disassembler. Two kinds of calls are not seen: those
through a pointer, of which a step has none but those of its host's functions, and those of a function to itself, of which the
language has none.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ..driver.elf import ObjectFile, read_object
from ..driver.stack import LEAF_BYTES, RED_ZONE_BYTES
from ..driver.toolchain import ToolchainError

_NUMBER = re.compile(r"\.\d+$")
#: A section: number of the object, and its own.
Place = tuple[int, int]


class Sizes(NamedTuple):
    """Bytes, by what they are."""

    code: int
    constants: int
    data: int
    zeros: int


class Code:
    """Some objects. `frames`: the stack of each function; None where its size is not bounded."""

    def __init__(self, objects: Sequence[Path]):
        self._objects = [_read(path) for path in objects]
        self._exported = {
            name: (n, section) for n, o in enumerate(self._objects) for name, section in o.exported.items()
        }
        self._frames: dict[Place, int | None] = {}
        self._parts: dict[Place, Place] = {}
        for number, path in enumerate(objects):
            self._read_frames(number, path.with_suffix(".su"))

    def _read_frames(self, number: int, path: Path) -> None:
        functions = self._objects[number].functions
        for (
            name,
            section,
        ) in functions.items():  # gcc puts what is rarely executed elsewhere; its frame is that of the whole
            whole = name.removesuffix(".cold")
            if whole != name and whole in functions:
                self._parts[number, section] = (number, functions[whole])
        sections: dict[str, list[int]] = {}
        for name, section in functions.items():  # gcc numbers the copies of a function, and does not report the numbers
            sections.setdefault(_NUMBER.sub("", name), []).append(section)
        for line in path.read_text(errors="replace").splitlines() if path.is_file() else ():
            place, size, kind = line.split("\t")
            fixed = kind == "static" or "bounded" in kind
            for section in sections.get(_NUMBER.sub("", place.rpartition(":")[2]), ()):
                at = (number, section)
                known = self._frames.get(at, 0)
                self._frames[at] = max(known, int(size)) if fixed and known is not None else None

    def exported(self, number: int) -> list[str]:
        """The symbols that an object offers to others."""
        return sorted(self._objects[number].exported)

    def size_of(self, symbol: str) -> int:
        """Bytes of a variable that an object exports."""
        return self._objects[self._exported[symbol][0]].sizes[symbol]

    def reached(self, roots: Iterable[str], within: str | None = None, stop: Collection[str] = ()) -> set[Place]:
        """All sections that these symbols need, themselves included, but not those of the symbols `stop`. `within` an object with
        this exported symbol, a root may also be a static function."""
        waiting = [self._place(name, within) for name in roots]
        ends = {self._exported[name] for name in stop if name in self._exported}
        found: set[Place] = set()
        while waiting:
            at = waiting.pop()
            if at not in found and at not in ends:
                found.add(at)
                waiting += [to for to in self._references(at) if not isinstance(to, str)]
        return found

    def missing(self, places: Iterable[Place]) -> set[str]:
        """Symbols that these sections need, and no object defines."""
        return {to for at in places for to in self._references(at) if isinstance(to, str)}

    def sizes(self, places: Iterable[Place]) -> Sizes:
        found = dict.fromkeys(Sizes._fields, 0)
        for number, section in places:
            kind, size = self._objects[number].sections[section]
            found[kind] += size
        return Sizes(**found)

    def stack(self, function: str, within: str) -> int | None:
        """The most that a call of this function needs; LEAF_BYTES for each that is missing. None without a bound."""
        at = self._place(function, within)
        deepest = self._deepest(at, {}, ())
        return None if deepest is None else deepest + (RED_ZONE_BYTES if self._objects[at[0]].is_x86_64 else 0)

    def _deepest(self, at: Place, known: dict[Place, int], above: tuple[Place, ...]) -> int | None:
        if at in above:
            return None
        if at not in known:
            frame, below = self._frames.get(at), 0
            if frame is None:
                return None
            for to in self._calls(at):
                if isinstance(to, str):
                    below = max(below, LEAF_BYTES)
                elif self._objects[to[0]].sections[to[1]].kind == "code":
                    depth = self._deepest(to, known, (*above, at))
                    if depth is None:
                        return None
                    below = max(below, depth)
            known[at] = frame + below
        return known[at]

    def _calls(self, at: Place) -> set[Place | str]:
        """Those of a function, with its rarely executed parts."""
        found: set[Place | str] = set()
        for place in (at, *(part for part, whole in self._parts.items() if whole == at)):
            found.update(to if isinstance(to, str) else self._parts.get(to, to) for to in self._references(place))
        return found - {at}

    def _references(self, at: Place) -> list[Place | str]:
        number, section = at
        found: list[Place | str] = []
        for to in self._objects[number].references.get(section, ()):
            found.append((number, to) if isinstance(to, int) else self._exported.get(to, to))
        return found

    def _place(self, name: str, within: str | None) -> Place:
        if name in self._exported or within is None:
            return self._exported[name]
        number = self._exported[within][0]
        return number, self._objects[number].functions[name]


def _read(path: Path) -> ObjectFile:
    try:
        return read_object(path)
    except ValueError as error:
        raise ToolchainError(f"{path.name}: {error}: fcslc reads what compilers write as ELF, without -flto") from None
