# SPDX-License-Identifier: Apache-2.0
"""fcslc: check machines, compile them, write their ROS 2 messages."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from .build import build_library, check_machine, emit, stack_bounds
from .diagnostics import DiagnosticError
from .messages import message_name, message_text
from .parse import is_machine_name
from .passes import PASSES, Compilation, compile_machine
from .stack import bound_text
from .toolchain import ToolchainError, toolchain, write_whole
from .verify import IrError


class UsageError(ValueError):
    """An option that no compilation can honour; str() says why."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns the exit status: 0 done, 1 the program or the machine it runs on is wrong, 2 usage, 130 interrupted."""
    options = _parser().parse_args(arguments)
    try:
        status: int = options.run(options)
        return status
    except DiagnosticError as error:
        print(error, file=sys.stderr)
        count = len(error.diagnostics)
        print(f"\n{count} error{'s' if count != 1 else ''}", file=sys.stderr)
    except KeyboardInterrupt:
        print("fcslc: interrupted", file=sys.stderr)
        return 130
    except UsageError as error:
        print(f"fcslc: {error}", file=sys.stderr)
        return 2
    except (ToolchainError, IrError) as error:
        print(f"fcslc: {error}", file=sys.stderr)
    except BrokenPipeError:
        sys.stderr.close()
    except OSError as error:
        print(f"fcslc: {error.filename or ''}: {error.strerror}", file=sys.stderr)
    return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fcslc", description="Compiles machines (JSON and algorithms) to native C.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    check = commands.add_parser("check", help="report what is wrong; write nothing")
    check.add_argument("config", type=Path, nargs="+", help="machine JSON")
    check.set_defaults(run=_check)

    build = commands.add_parser("build", help="compile to a shared library, or to C only")
    build.add_argument("config", type=Path, nargs="+", help="machine JSON; several go into one library")
    build.add_argument(
        "-o", "--output", type=Path, help="folder for what is made (default: build beside the first config)"
    )
    build.add_argument("--name", help="library name (default: the first machine's)")
    build.add_argument("--c-only", action="store_true", help="write C, header and map, do not compile them")
    build.add_argument("--depfile", type=Path, help="write what the C files depend on, for make and ninja")
    build.add_argument("--dump", choices=[p.name for p in PASSES], help="print what a pass made and stop there")
    build.set_defaults(run=_build)

    scan = commands.add_parser("scan", help="check that machine libraries call nothing a step may not call")
    scan.add_argument("library", type=Path, nargs="+", help="shared library of machines")
    scan.add_argument("--graphs", type=Path, help="print the stack bounds, from the C compiler's .ci files below here")
    scan.set_defaults(run=_scan)

    messages = commands.add_parser("messages", help="write one ROS 2 .msg file per instance")
    messages.add_argument("config", type=Path, nargs="+", help="machine JSON")
    messages.add_argument("-o", "--output", type=Path, required=True, help="folder for the .msg files")
    messages.set_defaults(run=_messages)
    return parser


def _warn(compilation: Compilation) -> None:
    for diagnostic in compilation.sink.diagnostics:
        print(diagnostic.render(), file=sys.stderr)


def _check(options: argparse.Namespace) -> int:
    failed: list[DiagnosticError] = []
    for path in options.config:
        try:
            compilation = compile_machine(path, "", until="ir")
        except DiagnosticError as error:
            failed.append(error)
            continue
        _warn(compilation)
        m = compilation.checked
        print(f"{path}: ok ({len(m.instances)} instances, {len(m.states)} states)")
    if failed:
        raise DiagnosticError([d for error in failed for d in error.diagnostics])
    return 0


def _build(options: argparse.Namespace) -> int:
    if options.dump:
        step = next(p for p in PASSES if p.name == options.dump)
        for path in options.config:
            print(step.dump(compile_machine(path, toolchain(), until=step.name)), end="")
        return 0
    first: Path = options.config[0]
    folder: Path = options.output or first.parent / "build"
    if options.name is not None and not is_machine_name(options.name):
        raise UsageError(f"--name `{options.name}` is not a library's name: lower_snake_case, and no word of C")
    _refuse_file(folder)
    library = folder / f"lib{options.name or first.stem}.so"
    if options.c_only:
        compilations = emit(options.config, folder)
    else:
        compilations = build_library(options.config, library)
    for compilation in compilations:
        _warn(compilation)
    if options.depfile:
        _write_depfile(options.depfile, folder / "fcsl_machines.c", compilations)
    print(folder / "fcsl_machines.c" if options.c_only else library)
    for compilation in compilations:
        if compilation.stack_bound is not None:
            print(bound_text(compilation.checked.name, compilation.stack_bound))
    return 0


def _refuse_file(folder: Path) -> None:
    if folder.is_file():
        raise UsageError(f"-o `{folder}` is a file; a folder is needed")


def _write_depfile(path: Path, target: Path, compilations: list[Compilation]) -> None:
    from .source_path import resolve_source

    needs: list[Path] = sorted(Path(__file__).parent.rglob("*.py"))
    for compilation in compilations:
        needs.append(compilation.path.resolve())
        needs += [resolve_source(s.name, compilation.path.parent).resolve() for s in compilation.checked.sources]
    listed = " ".join(map(_make_word, needs))
    write_whole(path, f"{_make_word(target)}: {listed}\n")


def _make_word(path: Path) -> str:
    """A file name as make reads it."""
    return str(path).replace(" ", "\\ ").replace("#", "\\#").replace("$", "$$")


def _scan(options: argparse.Namespace) -> int:
    for library in options.library:
        check_machine(library)
    if options.graphs:
        for name, bound in stack_bounds(options.graphs).items():
            print(bound_text(name, bound))
    return 0


def _messages(options: argparse.Namespace) -> int:
    _refuse_file(options.output)
    for path in options.config:
        m = compile_machine(path, "", until="schedule").checked
        for instance in m.instances:
            file = options.output / f"{message_name(m, instance)}.msg"
            write_whole(file, message_text(m, instance))
            print(file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
