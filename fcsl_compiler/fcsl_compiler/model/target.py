# SPDX-License-Identifier: Apache-2.0
"""The link inputs of externs for one kind of computer."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Target:
    """Link inputs of externs. Empty if the machine JSON has no `targets`."""

    name: str
    sources: tuple[Path, ...] = ()
    include: tuple[Path, ...] = ()
    libraries: tuple[str, ...] = ()  # names for -l
    archives: tuple[Path, ...] = ()  # static libraries in the machine's folder
    archive_contents: tuple[tuple[str, bytes], ...] = field(default=(), repr=False)  # by name

    @property
    def is_empty(self) -> bool:
        return not (self.sources or self.include or self.libraries or self.archives)

    @property
    def digest_parts(self) -> tuple[str | bytes, ...]:
        """The parts that enter a build's hash, apart from the C files (driver/c_dependencies.py). Empty for a machine
        without externs."""
        if self.is_empty:
            return ()
        named = [part for pair in self.archive_contents for part in pair]
        return (self.name, *named, "", *self.libraries)
