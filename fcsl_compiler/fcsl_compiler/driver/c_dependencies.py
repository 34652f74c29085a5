# SPDX-License-Identifier: Apache-2.0
"""The files that C sources include, as the C compiler itself lists them. System headers do not count."""

from __future__ import annotations

import ast
import os
import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..base.files import digest
from ..model.target import Target
from ..parse.machine_files import ParsedMachine
from .toolchain import LANGUAGES, C, Language, ToolchainError, include_dirs, run_compiler, run_compilers

#: A word in a dependency list of make: everything but an unescaped blank.
_WORD = re.compile(r"(?:\\.|\$\$|[^\s\\])+", re.DOTALL)


@dataclass(frozen=True)
class CFile:
    """A file that the C compiler reads. Its name in hashes is relative to the folder of the machine or the model."""

    name: str
    path: Path
    content: bytes | None  # None: it does not exist, so that its appearance changes the hash


@dataclass(frozen=True)
class CInputs:
    """What C sources are compiled from."""

    files: tuple[CFile, ...] = ()
    #: Hash of the preprocessed text if a file asks `__has_include`: no list contains a file that is only asked for.
    probed: str = ""

    @property
    def digest_parts(self) -> tuple[str | bytes, ...]:
        parts: list[str | bytes] = []
        for file in self.files:
            parts += [file.name, "absent" if file.content is None else "present", file.content or b""]
        return tuple(parts)

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files that exist."""
        return tuple(file.path for file in self.files if file.content is not None)


def c_inputs(sources: Sequence[Path], includes: Sequence[Path], root: Path, generated: Path | None = None) -> CInputs:
    """The sources and every file that they include, compiled with these include folders.

    `root`: folder to which names are relative. `generated`: folder of files that are not inputs. Missing files are
    listed as such; the compilation reports them. The sources have one language. Raises ToolchainError if they cannot be
    preprocessed.
    """
    language = LANGUAGES.get(sources[0].suffix, C)
    # Absolute, so that only a missing file is listed with a relative path.
    files = [str(source.absolute()) for source in sources]
    options = [*language.flags, *(f"-I{folder.absolute()}" for folder in includes)]
    command = [*language.compiler(), *options, "-MM", "-MG", "-MT", "x"]
    # Of one file at a time: zig lists those of several by another compiler, which does not know its options.
    listed = os.fsdecode(b"\n".join(run_compilers([[*command, file] for file in files], language)))
    paths = [Path(word) for word in dict.fromkeys(_words(listed))]
    found = [_read(path, root) for path in paths if generated is None or not path.is_relative_to(generated)]
    tests_for_headers = any(file.content is not None and b"__has_include" in file.content for file in found)
    return CInputs(tuple(found), _preprocessed(files, options, language) if tests_for_headers else "")


def _words(rules: str) -> list[str]:
    """The dependencies of all rules, whose targets are `x`."""
    words = [word for word in _WORD.findall(rules.replace("\\\n", " ")) if word != "x:"]
    return [re.sub(r"\\(.)", r"\1", word.replace("$$", "$")) for word in words]


def _read(path: Path, root: Path) -> CFile:
    place = Path(os.path.normpath(path))
    inside = place.is_relative_to(root.absolute())
    name = str(place.relative_to(root.absolute())) if inside else place.name
    try:
        return CFile(name, path, path.read_bytes() if path.is_absolute() else None)
    except OSError:  # it vanished since it was listed
        return CFile(name, path, None)


def _preprocessed(files: Sequence[str], options: Sequence[str], language: Language) -> str:
    command = [*language.compiler(), *options, "-E", "-P"]
    try:
        # Without line markers, which contain paths; with a fixed time.
        texts = [run_compiler([*command, file], {"SOURCE_DATE_EPOCH": "0"}, language) for file in files]
    except ToolchainError:
        return "failed"  # the compilation reports it
    return digest(*texts)


def extern_inputs(parsed: ParsedMachine, target: Target) -> CInputs:
    """What the externs of a machine are compiled from: the sources of the target, and the headers that the machine's
    own C includes. Raises ToolchainError."""
    if target.is_empty:
        return CInputs()
    with tempfile.TemporaryDirectory(prefix="fcsl-") as scratch:
        folder = Path(scratch).resolve()
        # In place of the generated header: it defines no macro, so that the preprocessor needs only what it includes.
        (folder / f"{parsed.name}.h").write_text("#include <fcsl/fcsl_machine.h>\n")
        headers = [f'#include "{parsed.name}.h"\n', *(f"#include <{header}>\n" for header in _extern_headers(parsed))]
        machine = folder / "machine.c"
        machine.write_text("".join(headers))
        includes = [*target.include, folder, *include_dirs()]
        try:
            of_c = [source for source in target.sources if source.suffix != ".nim"]
            found = c_inputs([machine, *of_c], includes, parsed.folder, folder)
        except ToolchainError as error:
            why = f"Target `{target.name}` of {parsed.source.path} cannot be preprocessed; CC must be its C compiler."
            raise ToolchainError(f"{error}\n{why}") from None
        of_nim = tuple(_read(source.absolute(), parsed.folder) for source in target.sources if source.suffix == ".nim")
        return CInputs((*found.files, *of_nim), found.probed)


def _extern_headers(parsed: ParsedMachine) -> list[str]:
    """The headers of C that @extern declarations of the algorithm files name. Empty for a file that is not valid Python."""
    found: dict[str, None] = {}
    for file in parsed.files:
        try:
            tree = file.tree or ast.parse(file.source.text)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            continue
        for keyword in (k for node in ast.walk(tree) if isinstance(node, ast.Call) for k in node.keywords):
            header = str(keyword.value.value) if isinstance(keyword.value, ast.Constant) else ""
            if keyword.arg == "header" and header and not header.endswith(".nim"):
                found[header] = None
    return list(found)
