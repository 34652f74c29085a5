# SPDX-License-Identifier: Apache-2.0
"""Compiles the C and Nim of a user's externs separately from the machines. The symbol scan of machines does not apply to it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..base.files import digest
from ..model import ir
from ..model.choices import DEFAULT_TARGET
from ..model.target import Target
from .c_dependencies import extern_inputs
from .cache_entry import cached
from .nim import compile_externs
from .passes import Compilation, compile_machine
from .toolchain import ToolchainError, compile_objects, include_dirs, link_shared, toolchain, unwritten


@dataclass(frozen=True)
class LinkInputs:
    """Inputs that the externs of some targets add to a link: files, followed by flags."""

    files: tuple[Path, ...]
    flags: tuple[str, ...]


def link_inputs(
    targets: Sequence[Target], folder: Path, headers: Path, externs: Sequence[ir.Extern] = ()
) -> LinkInputs:
    """Compiles the sources of targets into `folder`. `headers`: folder with the machines' headers. `externs`: to compare
    with those in Nim. Raises ToolchainError."""
    files: list[Path] = []
    for number, target in enumerate(targets):
        own = folder / str(number)
        includes = [*target.include, headers, *include_dirs(), own]
        files += compile_objects(c_sources(target, externs, own), includes, own)
    archives = [a for t in targets for a in t.archives]
    return LinkInputs((*files, *archives), tuple(f"-l{name}" for t in targets for name in t.libraries))


def c_sources(target: Target, externs: Sequence[ir.Extern], folder: Path) -> list[Path]:
    """The sources of a target, with C in `folder` in place of Nim. Raises ToolchainError."""
    of_c = [source for source in target.sources if source.suffix != ".nim"]
    return [*of_c, *compile_externs(target.sources, externs, folder)]


@contextlib.contextmanager
def explained(externs: Sequence[str], targets: Sequence[Target]) -> Iterator[None]:
    """Adds the origin of externs to compiler errors about a missing header or definition."""
    try:
        yield
    except ToolchainError as error:
        if not externs:
            raise
        lines = [f"The machine calls the externs {', '.join(externs)}."]
        if not targets:
            lines.append(
                "It has no `targets`; list there the C sources that define them and the folders of their headers."
            )
        for target in targets:
            sources = ", ".join(map(str, target.sources)) or "no source"
            include = ", ".join(map(str, target.include)) or "no include folder"
            lines.append(f"Target `{target.name}` has {sources}; {include}.")
            if any(source.suffix == ".nim" for source in target.sources):
                lines.append(
                    "Nim's own library is not linked: an extern in Nim has no `seq`, `string`, `ref` or `echo`."
                )
        raise ToolchainError("\n".join([str(error), *lines])) from None


def build_externs(config: Path, target: str = DEFAULT_TARGET) -> Path:
    """The externs of one target as a cached shared library that exports them. PyTwin calls them through it.

    Raises DiagnosticError if the machine JSON has an error or lacks the target, and ToolchainError.
    """
    made = compile_machine(config, toolchain(), target=target)
    parsed = made.parsed
    assert parsed is not None

    def key() -> str:
        linked = extern_inputs(parsed, made.target)
        return digest(toolchain(), made.header, *made.target.digest_parts, *linked.digest_parts, linked.probed)

    try:
        return cached("externs", key, "libexterns.so", lambda library: _build(made, library), config).library
    except OSError as error:
        raise unwritten(error, config) from None


def _build(made: Compilation, library: Path) -> dict[str, str]:
    folder, target = library.parent, made.target
    flags = ["-fvisibility=default", "-Wl,--no-as-needed", *(f"-l{name}" for name in target.libraries)]
    archives = ["-Wl,--whole-archive", *map(str, target.archives), "-Wl,--no-whole-archive"] if target.archives else []
    empty = folder / "empty.c"
    empty.write_text("")  # externs that are all in the C library have no source
    (folder / f"{made.checked.name}.h").write_text(made.header)
    link_shared(
        [empty, *c_sources(target, made.checked.externs, folder)],
        [folder, *target.include, *include_dirs()],
        library,
        flags=[*archives, *flags],
    )
    return {}
