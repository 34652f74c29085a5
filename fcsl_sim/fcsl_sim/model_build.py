# SPDX-License-Identifier: Apache-2.0
"""The library of a model in C or C++, found again by what its source includes, as text: the preprocessor need not run.

The compiler's own cache asks the preprocessor for the list of included files, which takes 25 to 45 ms for each model. Here every
`#include` counts, also one in a comment or below an `#if` that does not hold. So the files whose content makes the key are
those that the preprocessor reads, or more. Where text alone does not say what is included, the compiler is asked.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from fcsl_compiler.api.build import (
    LANGUAGES,
    SHARED_RULES,
    build_shared,
    cached,
    include_dirs,
    math_library,
    toolchain,
    unwritten,
)
from fcsl_compiler.api.files import digest

_EXPORTS = ("fcsl_models",)
_CONTINUED = re.compile(rb"\\[ \t]*\r?\n")
_BLANK = rb"(?:[ \t\v\f]|/\*.*?\*/)*"
_DIRECTIVE = re.compile(
    rb"(?:#|%:|\?\?=)" + _BLANK + rb"(include_next|include|import|embed)\b" + _BLANK + rb'("[^"\n]*"|<[^>\n]*>)?',
    re.DOTALL,
)
#: What reads files, or asks for them, in other ways; the first is a continued line as a trigraph.
_OTHER_WAYS = (b"??/", b"__has_include", b"__has_embed", b"incbin")
#: They add folders to those that are searched.
_VARIABLES = ("CPATH", "C_INCLUDE_PATH", "CPLUS_INCLUDE_PATH")


class _Unsaid(Exception):
    """Text does not say which files are read."""


def build_model(source: Path, includes: Sequence[Path]) -> Path:
    """The library of one source, from the cache if nothing has changed. Raises ToolchainError."""
    folders = [folder.absolute() for folder in (*includes, *include_dirs())]

    def compiled() -> Path:
        return build_shared([source], includes, exports=_EXPORTS)

    def build(library: Path) -> dict[str, str]:
        shutil.copyfile(compiled(), library)
        return {}

    try:
        name = f"lib{source.stem}.so"
        return cached("models", lambda: _key(source.absolute(), folders), name, build, source).library
    except _Unsaid:
        return compiled()
    except OSError as error:
        raise unwritten(error, source) from None


def _key(source: Path, folders: Sequence[Path]) -> str:
    """Hash of all that makes the library. Raises _Unsaid."""
    language = LANGUAGES[source.suffix]
    if len(language.compiler()) > 1 or any(os.environ.get(name) for name in _VARIABLES):
        raise _Unsaid
    made_by = toolchain(language), str(math_library().stat().st_mtime_ns)
    rules = [file.read_bytes() for file in SHARED_RULES]
    return digest(*made_by, *rules, *_EXPORTS, source.name, *_closure(source, folders))


def _closure(source: Path, folders: Sequence[Path]) -> list[str | bytes]:
    """The content of the source and of every file that it may include, each behind how and where it was found."""
    parts: list[str | bytes] = []
    seen, waiting = {source}, [source]
    while waiting:
        file = waiting.pop()
        try:
            content = file.read_bytes()
        except OSError:
            raise _Unsaid from None
        parts.append(content)
        for quote, name in _included(content):
            searched = [*([file.parent] if quote == '"' else []), *folders]
            place = next((i for i, folder in enumerate(searched) if (folder / name).is_file()), None)
            parts.append(f"{quote}{name} {place}")  # None: a header of the system, or none
            found = None if place is None else searched[place] / name
            if found and found not in seen:
                seen.add(found)
                waiting.append(found)
    return parts


@lru_cache(maxsize=1024)
def _included(content: bytes) -> tuple[tuple[str, str], ...]:
    """How each `#include` is quoted, and what it names. Raises _Unsaid."""
    if any(way in content for way in _OTHER_WAYS):
        raise _Unsaid
    found = []
    for directive, name in _DIRECTIVE.findall(_CONTINUED.sub(b"", content)):
        if directive != b"include" or not name:
            raise _Unsaid
        found.append((name[:1].decode(), os.fsdecode(name[1:-1])))
    return tuple(found)
