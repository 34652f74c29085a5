# SPDX-License-Identifier: Apache-2.0
"""Link inputs of externs for one kind of computer."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

#: Default target. Tests, twins and simulators use it.
DEFAULT_TARGET = "simulation"


@dataclass(frozen=True)
class Target:
    """Link inputs of externs. Empty if the machine JSON has no `targets`."""

    name: str
    sources: tuple[Path, ...] = ()
    include: tuple[Path, ...] = ()
    libraries: tuple[str, ...] = ()  # names for -l
    archives: tuple[Path, ...] = ()  # static libraries in the machine's folder
    headers: tuple[Path, ...] = ()
    contents: tuple[tuple[str, bytes], ...] = field(default=(), repr=False)  # contents of all these files by name

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that are read for this target."""
        return (*self.sources, *self.headers, *self.archives)

    @property
    def is_empty(self) -> bool:
        return not (self.sources or self.include or self.libraries or self.archives)

    @property
    def digest_parts(self) -> tuple[str | bytes, ...]:
        """The parts that enter a build's hash. Empty for a machine without externs."""
        if self.is_empty:
            return ()
        named = [part for pair in self.contents for part in pair]
        return (self.name, *named, "", *self.libraries)
