# SPDX-License-Identifier: Apache-2.0
"""The C compiler and its flags; for models also the C++ compiler."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple, cast

from ..base.packages import PackageNotFound, package_prefix

#: Flags for every machine, the same as in fcsl_add_machine. Contraction and fast-math stay off, because they would
#: change results.
FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-fvisibility=hidden")
#: Linker flags. Symbols are bound at link or load time, never later.
LINK_FLAGS = ("-Wl,-z,now", "-Wl,--no-undefined")
#: The functions of fcsl_math are bound within the library, so that other libraries of the process cannot replace them.
_MATH_FUNCTIONS = "cr_*"
#: What zig compiles for: what every processor of this kind has, and the oldest glibc on which FCSL runs.
ZIG_TARGET = ("-target", f"{os.uname().machine}-linux-gnu.2.28", "-mcpu=baseline")
#: Makes gcc, since version 10, write one .ci file per source beside its output.
_CALL_GRAPH_FLAGS = ("-fcallgraph-info=su,da",)
_CALL_GRAPH_PROBE = (*_CALL_GRAPH_FLAGS, "-E", "-x", "c", os.devnull)
_COMPILE_TIMEOUT_S = 300


#: Options of compilers that change results. The header fcsl_exact_math.h finds some of them wherever a compiler is called.
_CHANGES_BITS = {
    *("-ffast-math", "-Ofast", "-funsafe-math-optimizations", "-fassociative-math", "-freciprocal-math"),
    *("-ffinite-math-only", "-fno-signed-zeros", "-fapprox-func", "-ffp-model=fast", "-ffp-model=aggressive"),
    *("-fsingle-precision-constant", "-mfpmath=387", "-mdaz-ftz"),
}


class ToolchainError(RuntimeError):
    """The C compiler is missing or failed. str() gives the remedy; what the compiler printed follows on lines of its
    own."""


class Language(NamedTuple):
    """A language of sources: the variable that names its compiler, the command without it, the distribution's package
    that brings this command, the flags, what the Python package ziglang calls its compiler, and flags that make errors
    of warnings."""

    name: str
    variable: str
    command: str
    package: str
    flags: tuple[str, ...]
    zig: str = ""
    checks: tuple[str, ...] = ()

    def compiler(self) -> list[str]:
        """The compiler command. Raises ToolchainError for options that change results."""
        given = shlex.split(os.environ.get(self.variable, ""))
        refuse_inexact(given, self.variable)
        if given or not self.zig or shutil.which(self.command):
            return given or [self.command]
        return zig_compiler(self.zig) or [self.command]

    def absent(self, command: str) -> ToolchainError:
        """The error for a command that does not run."""
        or_zig = " or the Python package ziglang (python3 -m pip install ziglang)" if self.zig else ""
        fix = f"install {self.package}{or_zig}, or set {self.variable}"
        return ToolchainError(f"no {self.name} compiler: `{command}` does not run; {fix}")


def refuse_inexact(words: Sequence[str], where: str) -> None:
    """Raises ToolchainError for an option of a compiler that changes results."""
    changing = [word for word in words if word in _CHANGES_BITS]
    if changing:
        raise ToolchainError(
            f"{where} has {changing[0]}, which changes results: machines and models have the same bits everywhere; remove it"
        )


def zig_compiler(name: str) -> list[str]:
    """The command of zig's compiler, `cc` or `c++`; empty without the Python package ziglang."""
    found = find_spec("ziglang")
    if found is None or not found.submodule_search_locations:
        return []
    return [f"{found.submodule_search_locations[0]}/zig", name, *ZIG_TARGET]


#: What a model's functions must not do: have another prototype than fcsl_model.h says, or return nothing. The same as in
#: fcsl_add_model.
_C_CHECKS = tuple(
    f"-Werror={name}"
    for name in (
        "incompatible-pointer-types",
        "int-conversion",
        "implicit-function-declaration",
        "cast-function-type",
        "return-type",
    )
)
_CXX_CHECKS = ("-Werror=narrowing", "-Werror=cast-function-type", "-Werror=return-type")
C = Language("C", "CC", "cc", "gcc", FLAGS, "cc", _C_CHECKS)
#: Only models are written in C++. No exception may leave one.
CXX = Language(
    "C++", "CXX", "c++", "g++", ("-std=c++17", *FLAGS[1:], "-fno-exceptions", "-fno-rtti"), "c++", _CXX_CHECKS
)
#: The language of a source by the suffix of its name.
LANGUAGES = {".c": C, ".cpp": CXX, ".cc": CXX, ".cxx": CXX}


def compiler() -> list[str]:
    """The C compiler command: $CC, else cc, else zig of the Python package ziglang."""
    return C.compiler()


def start_version_query() -> None:
    """Begins to ask the C compiler for its version: it answers while the caller does something else."""
    with suppress(OSError, ToolchainError):
        _query((*compiler(), "--version"))


def start_call_graph_query() -> None:
    """Likewise begins to ask it whether it writes call graphs."""
    with suppress(OSError, ToolchainError):
        _query((*compiler(), *_CALL_GRAPH_PROBE))


class _Answer:
    """What a command prints to its standard output. Any thread may wait for it."""

    def __init__(self, command: tuple[str, ...]):
        self._lock, self._printed = threading.Lock(), ""
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, errors="replace"
        )

    def wait(self) -> tuple[int, str]:
        """Exit status, and what it printed. Raises TimeoutExpired."""
        with self._lock:
            if self._process.returncode is None:
                try:
                    self._printed, _ = self._process.communicate(timeout=30)
                except subprocess.TimeoutExpired:
                    self._process.kill()
                    raise
        return self._process.returncode, self._printed


_query = cache(_Answer)


@cache
def _version(command: tuple[str, ...], language: Language) -> str:
    try:
        status, printed = _query((*command, "--version")).wait()
    except (OSError, subprocess.TimeoutExpired):
        raise language.absent(" ".join(command)) from None
    if status != 0:
        fix = f"set {language.variable} to a {language.name} compiler"
        raise ToolchainError(f"`{' '.join(command)} --version` failed; {fix}")
    return printed.splitlines()[0] if printed else ""


def toolchain(language: Language = C) -> str:
    """Compiler version and flags, as included in build_hash. Raises ToolchainError."""
    return toolchain_of(language.compiler(), language)


def toolchain_of(command: Sequence[str], language: Language = C) -> str:
    """Compiler version and flags for another compiler command. Raises ToolchainError."""
    return " ".join([_version(tuple(command), language), *command[1:], *language.flags])


def cache_dir() -> Path:
    """Folder of the cache: $FCSL_CACHE_DIR, else fcsl below $XDG_CACHE_HOME or ~/.cache."""
    own = os.environ.get("FCSL_CACHE_DIR")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fcsl"


def unwritten(error: OSError, path: Path) -> ToolchainError:
    """Error for a build that failed in the file system. Names `path` if the OSError names no file."""
    cache = cache_dir()
    at = Path(error.filename or path)
    fix = (
        f"; the cache of builds is {cache}: set FCSL_CACHE_DIR to a folder that can be written"
        if cache in (at, *at.parents) or at in cache.parents
        else ""
    )
    return ToolchainError(f"{at}: {error.strerror}{fix}")


def include_dirs() -> list[Path]:
    """Header folders of the machine ABI and the math library. Raises ToolchainError if they are not installed."""
    try:
        return [package_prefix("fcsl_compiler") / "include"]
    except PackageNotFound as error:
        raise ToolchainError(str(error)) from None


def math_library() -> Path:
    """Path of the static library fcsl_math. Raises ToolchainError if it is not installed."""
    try:
        return package_prefix("fcsl_compiler") / "lib" / "libfcsl_math.a"
    except PackageNotFound as error:
        raise ToolchainError(str(error)) from None


@cache
def call_graph_flags(command: tuple[str, ...]) -> tuple[str, ...]:
    """The flags for call graphs, if this compiler has them; clang does not."""
    try:
        status, _ = _query((*command, *_CALL_GRAPH_PROBE)).wait()
    except (OSError, subprocess.TimeoutExpired):
        return ()
    return _CALL_GRAPH_FLAGS if status == 0 else ()


def run_compiler(command: Sequence[str], environment: Mapping[str, str] | None = None, language: Language = C) -> bytes:
    """What a compiler prints. `environment` adds variables. Raises ToolchainError with the compiler's errors."""
    child = _start(command, environment or {}, language)
    try:
        return _end(child)
    finally:
        _end_group(child)


def run_compilers(commands: Sequence[Sequence[str]], language: Language = C) -> list[bytes]:
    """Runs so many at once as there are cores, and returns what each prints. Raises ToolchainError with the errors of
    the first command that fails."""
    running: deque[subprocess.Popen[bytes]] = deque()
    printed: list[bytes] = []
    try:
        for command in commands:
            if len(running) >= len(os.sched_getaffinity(0)):
                printed.append(_end(running[0]))
                running.popleft()
            running.append(_start(command, {}, language))
        while running:
            printed.append(_end(running[0]))
            running.popleft()
        return printed
    finally:
        for child in running:
            _end_group(child)


def _start(command: Sequence[str], environment: Mapping[str, str], language: Language) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, **environment},
            start_new_session=True,
        )
    except OSError:
        raise language.absent(command[0]) from None


def _end(child: subprocess.Popen[bytes]) -> bytes:
    """What it prints until it ends. Raises ToolchainError with its errors."""
    name = cast(Sequence[str], child.args)[0]
    try:
        printed, errors = child.communicate(timeout=_COMPILE_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise ToolchainError(f"`{name}` took longer than {_COMPILE_TIMEOUT_S} s") from None
    if child.returncode != 0:
        raise ToolchainError(f"`{name}` failed:\n{errors.decode(errors='replace').strip()}")
    return printed


def _end_group(child: subprocess.Popen[bytes]) -> None:
    """Kills a running compiler and the processes that it started (cc1, as, ld)."""
    if child.poll() is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()


def as_argument(path: Path) -> str:
    """A path that a compiler does not take for an option."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def compile_objects(
    sources: Sequence[Path], includes: Sequence[Path], folder: Path, command: Sequence[str] = ()
) -> list[Path]:
    """Compiles each C source to an object in `folder`, with its call graph beside it if the compiler writes them.
    `command`: another compiler, with its flags.

    Raises ToolchainError with the compiler's output.
    """
    folder.mkdir(parents=True, exist_ok=True)
    line = [*(command or (*compiler(), *FLAGS, *call_graph_flags(tuple(compiler())))), *(f"-I{d}" for d in includes)]
    # Numbered, because sources of two folders may have the same name.
    objects = [folder / f"{number}-{source.stem}.o" for number, source in enumerate(sources)]
    run_compilers([[*line, "-c", as_argument(s), "-o", str(made)] for s, made in zip(sources, objects, strict=True)])
    return objects


def link_shared(
    inputs: Sequence[Path],
    includes: Sequence[Path],
    output: Path,
    check: Callable[[Path], None] = lambda _: None,
    flags: Sequence[str] = (),
    language: Language = C,
    exports: Sequence[str] = (),
) -> None:
    """Links sources of a language, objects, archives and the math library to a shared library. `flags` follow them on
    the command line.

    exports: if there are any, the library has no other symbols. `output` appears atomically after `check` has passed. Raises ToolchainError with the compiler's output, and the
    exceptions of `check`.
    """
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".build-") as folder:
        made = Path(folder) / output.name
        command = [
            *language.compiler(),
            *language.flags,
            "-shared",
            *(f"-I{d}" for d in includes),
            *map(as_argument, inputs),
        ]
        command += [str(math_library()), *flags, "-lm", *LINK_FLAGS, "-o", str(made)]
        names = Path(folder) / "exports.map"
        shared = (
            f"global: {' '.join(f'{name};' for name in exports)} local: *;" if exports else f"local: {_MATH_FUNCTIONS};"
        )
        names.write_text(f"{{ {shared} }};\n")
        command += ["-Xlinker", f"--version-script={names}"]  # -Wl would split a path at its commas
        run_compiler(command, language=language)
        check(made)
        made.replace(output)
