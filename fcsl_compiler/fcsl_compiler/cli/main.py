# SPDX-License-Identifier: Apache-2.0
"""fcslc: checks machines, compiles them, writes their ROS 2 messages and the plans of their boards."""

from __future__ import annotations

import argparse
import io
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from ..base.codes.pages import UnknownCode, pages, table
from ..base.diagnostics import Diagnostic, DiagnosticError, DiagnosticSink, nearest
from ..base.files import write_whole
from ..base.usage import UsageError
from ..base.version import add_version
from ..check.verify import IrError
from ..driver.library import check_machine, stack_bounds
from ..driver.passes import compile_machine
from ..driver.stack import bound_text
from ..driver.toolchain import ToolchainError
from ..emit.messages import message_texts
from ..model.target import DEFAULT_TARGET
from ..parse.machine_files import parse_machine
from ..parse.targets import choose_target
from .authoring import add_authoring
from .board import add_board
from .build import (
    STRICT_HELP,
    TARGET_HELP,
    add_build,
    add_format,
    compiler_files,
    machine_files,
    print_extern_calls,
    print_report,
    refuse_file,
)
from .cover import add_cover, split_command
from .function_page import function_names, function_page
from .report import Summary, document


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs fcslc. Returns the exit status: 0 success, 1 an error in the program or in its environment, 2 usage error,
    130 interrupted."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # avoid exceptions for characters that it cannot show
            stream.reconfigure(errors="backslashreplace")
    own, command = split_command(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(own, argparse.Namespace(command=command))
    try:
        status: int = options.run(options)
        return status
    except DiagnosticError as error:
        print_report(options, error.diagnostics)
    except KeyboardInterrupt:
        print("fcslc: interrupted", file=sys.stderr)
        return 130
    except UsageError as error:
        print(f"fcslc: {error}", file=sys.stderr)
        return 2
    except (ToolchainError, IrError) as error:
        _fail(options, str(error))
    except BrokenPipeError:
        sys.stderr.close()
    except OSError as error:
        _fail(options, f"{error.filename or ''}: {error.strerror}")
    return 1


def _fail(options: argparse.Namespace, failure: str) -> None:
    """Reports that the tool could not complete its work."""
    print(f"fcslc: {failure}", file=sys.stderr)
    if getattr(options, "format", "text") != "text":
        print(document(options.format, (), failure=failure), end="")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fcslc", description="Compiles machines (JSON and algorithms) to native C.")
    add_version(parser, "fcsl_compiler", __file__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    check = commands.add_parser("check", help="report errors; write nothing")
    check.add_argument("config", type=Path, nargs="+", help="machine JSON")
    check.add_argument("--strict", action="store_true", help=STRICT_HELP)
    add_format(check)
    check.set_defaults(run=_check)

    add_build(commands)
    add_board(commands)

    why = commands.add_parser("explain", help="explain a diagnostic code, with an example, or a function")
    why.add_argument("what", nargs="*", help="a code such as E402, or a function such as kf_gain; none: list all codes")
    why.set_defaults(run=_explain)

    scan = commands.add_parser("scan", help="check that machine libraries call only functions allowed in a step")
    scan.add_argument("library", type=Path, nargs="+", help="shared library of machines")
    scan.add_argument("--objects", type=Path, help="folder of the machines' object files; also print stack bounds")
    scan.add_argument("--emitted", type=Path, help="folder of the generated C; allows calls of the declared externs")
    scan.set_defaults(run=_scan)

    externs = commands.add_parser("externs", help="print the link inputs of a target, for build systems")
    externs.add_argument("config", type=Path, nargs="+", help="machine JSON")
    externs.add_argument("--target", default=DEFAULT_TARGET, help=TARGET_HELP)
    externs.set_defaults(run=_externs)

    messages = commands.add_parser("messages", help="write the ROS 2 .msg files of the instances and their structs")
    messages.add_argument("config", type=Path, nargs="+", help="machine JSON")
    messages.add_argument("-o", "--output", type=Path, required=True, help="folder for the .msg files")
    messages.add_argument("--package", help="the ROS 2 package that builds them; it must contain the machines")
    messages.add_argument(
        "--sources", type=Path, help="write the list of input files here, one per line, for build systems"
    )
    messages.set_defaults(run=_messages)
    add_authoring(commands)
    add_cover(commands)
    return parser


def _check(options: argparse.Namespace) -> int:
    found: list[Diagnostic] = []
    passed: list[Summary] = []
    for path in options.config:
        try:
            compilation = compile_machine(path, "", until="verify", strict=options.strict)
        except DiagnosticError as error:
            found += error.diagnostics
            continue
        found += compilation.sink.diagnostics
        passed.append(Summary(path, compilation.checked))
    if options.format == "text":
        for machine in passed:
            print(machine.text())
    print_report(options, found, passed)
    return 1 if len(passed) < len(options.config) else 0


def _explain(options: argparse.Namespace) -> int:
    try:
        texts = [function_page(word) or pages([word], table(), "fcsl-sim explain") for word in options.what]
    except UnknownCode as error:
        like = [nearest(word, function_names()) for word in options.what if not word[-1:].isdigit()]
        raise UsageError("; ".join([str(error), *filter(None, like)])) from None
    print("\n".join(texts) if texts else pages([], table(), "fcsl-sim explain"), end="")
    return 0


def _scan(options: argparse.Namespace) -> int:
    objects = sorted(options.objects.rglob("*.o")) if options.objects else []
    maps = sorted(options.emitted.glob("*.map.json")) if options.emitted else []
    externs = sorted({name for file in maps for name in _externs_of(file)})
    calls = [call for library in options.library for call in check_machine(library, objects, externs)]
    if options.objects:
        for name, bound in stack_bounds(options.objects, externs).items():
            print(bound_text(name, bound, externs))
    print_extern_calls(calls)
    return 0


def _externs_of(map_file: Path) -> list[str]:
    try:
        return [str(name) for name in json.loads(map_file.read_text())["externs"]]
    except (ValueError, KeyError, TypeError):
        raise UsageError(f"--emitted: `{map_file}` is not a map of this fcslc version") from None


def _externs(options: argparse.Namespace) -> int:
    """Prints one line per link input, for build systems that need them before compilation."""
    found: dict[str, None] = {}
    for path in options.config:
        sink = DiagnosticSink()
        parsed = parse_machine(path, sink)
        sink.raise_if_failed()
        assert parsed is not None
        at = parsed.keys["targets"].span if "targets" in parsed.keys else parsed.source.whole()
        target = choose_target(parsed.targets, options.target, at)
        found |= {f"source {p.absolute()}": None for p in target.sources}
        found |= {f"include {p.absolute()}": None for p in target.include}
        found |= {f"archive {p.absolute()}": None for p in target.archives}
        found |= {f"library {name}": None for name in target.libraries}
    print("".join(f"{line}\n" for line in found), end="")
    return 0


def _messages(options: argparse.Namespace) -> int:
    """Writes changed messages and lists all. Each message belongs to one machine."""
    refuse_file(options.output)
    texts: dict[str, str] = {}
    read = compiler_files()
    for path in options.config:
        compilation = compile_machine(path, "", until="schedule")
        read += machine_files(compilation)
        m = compilation.checked
        if options.package not in (None, m.package):
            raise UsageError(
                f"`{path}` is in package `{m.package}` (the nearest package.xml above it), so that package "
                f"`{options.package}` cannot build its messages; move the machine there, or build them in `{m.package}`"
            )
        own = message_texts(m)
        if twice := sorted(texts.keys() & own.keys()):
            raise UsageError(
                f"`{path}`: message `{twice[0]}` also belongs to another machine; rename one of the instances"
            )
        texts |= own
    for name, text in texts.items():
        file = options.output / f"{name}.msg"
        write_whole(file, text)
        print(file)
    if options.sources:
        write_whole(options.sources, "".join(f"{file}\n" for file in read))
    return 0


if __name__ == "__main__":
    sys.exit(main())
