# SPDX-License-Identifier: Apache-2.0
"""Identifiers of Nim for those of C.

Nim ignores underscores, and the case of all but the first letter. An identifier neither ends in an underscore nor has
two in a row. Names that would be one get a number.
"""

from __future__ import annotations

import re

_KEYWORDS = frozenset(
    """
    addr and as asm bind block break case cast concept const continue converter defer discard distinct div do elif else
    end enum except export finally for from func if import in include interface is isnot iterator let macro method mixin
    mod nil not notin object of or out proc ptr raise ref return shl shr static template try tuple type using var when
    while xor yield
    """.split()
)
#: Words that allocate, raise or keep a reference. No generated code has them; keywords among them stand in backquotes
#: where they are names.
REFUSED = frozenset(
    """
    alloc alloc0 allocShared async await closure create dealloc defer echo except finally include method new newSeq
    newString raise realloc ref seq setLen string thread try HashSet Table
    """.split()
)
#: What generated code uses of the module system, after the macros of nimbase.h.
_SYSTEM = """
    NB8 NC NF NF32 NF64 NI NI8 NI16 NI32 NI64 NU NU8 NU16 NU32 NU64 IL64 COMMA
    array bool cdecl copyMem cstring false float32 float64 high inf int int32 int64 low nan pointer result sizeof true
    uint32 uint64 uint8 unsafeAddr uncheckedArray zeroMem
    """.split()


def key(name: str) -> str:
    """Equal for identifiers that are one to Nim."""
    return name[0] + name[1:].replace("_", "").lower()


def is_keyword(name: str) -> bool:
    return key(name) in _KEYWORDS


def quoted(name: str) -> str:
    return f"`{name}`" if is_keyword(name) else name


class Names:
    """Identifiers of one scope. `outer`: those of the scope around it, which this one does not hide."""

    def __init__(self, outer: Names | None = None):
        self._outer = outer
        self._known: dict[str, str] = {}
        self._taken: set[str] = (
            set() if outer is not None else {key(word) for word in (*_SYSTEM, *REFUSED)} - _KEYWORDS | {"Inf", "Nan"}
        )

    def of(self, c_identifier: str, wanted: str = "") -> str:
        """The identifier for one of C; always the same one. `wanted`: more like it than the identifier of C."""
        found = self._found(c_identifier)
        if found is None:
            found = self._known[c_identifier] = self._new(wanted or c_identifier)
        return found

    def all(self) -> set[str]:
        """The identifiers of this scope so far."""
        return {name.strip("`") for name in self._known.values()}

    def _found(self, c_identifier: str) -> str | None:
        scope: Names | None = self
        while scope is not None:
            if c_identifier in scope._known:
                return scope._known[c_identifier]
            scope = scope._outer
        return None

    def _new(self, c_identifier: str) -> str:
        plain = re.sub("_+", "_", c_identifier.strip("_")) or "x"
        name, number = plain, 2
        while self._is_taken(key(name)):
            name, number = f"{plain}{number}", number + 1
        self._taken.add(key(name))
        return quoted(name)

    def _is_taken(self, name: str) -> bool:
        return name in self._taken or (self._outer is not None and self._outer._is_taken(name))
