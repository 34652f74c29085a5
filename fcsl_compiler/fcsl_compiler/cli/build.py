# SPDX-License-Identifier: Apache-2.0
"""`fcslc build`, and functions shared with other commands."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from ..base.diagnostics import Diagnostic
from ..base.files import write_whole
from ..base.usage import UsageError
from ..build_report import compiled_facts, refuse_foreign, report_text
from ..build_report import document as cost_document
from ..build_report.facts import Facts
from ..driver.library import Inspect, build_library, emit
from ..driver.passes import DUMPS, Compilation, compile_machine
from ..driver.record import SUFFIX, write_record
from ..driver.stack import bound_text
from ..driver.toolchain import toolchain
from ..model.target import BACKENDS, DEFAULT_BACKEND, DEFAULT_TARGET
from ..parse.machine_files import is_machine_name
from .report import FORMATS, Summary, document, error_count

TARGET_HELP = f"which of the machine's `targets` its externs are linked from (default: {DEFAULT_TARGET})"
STRICT_HELP = "every input without connection or channel must be listed in the `inputs` of its instance"


def add_build(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser."""
    build = commands.add_parser("build", help="compile to a shared library, or to C only")
    build.add_argument("config", type=Path, nargs="+", help="machine JSON; several go into one library")
    build.add_argument("-o", "--output", type=Path, help="output folder (default: build beside the first config)")
    build.add_argument("--name", help="library name (default: the first machine's)")
    build.add_argument("--c-only", action="store_true", help="write C (and Nim), header and map, do not compile them")
    build.add_argument("--depfile", type=Path, help="write the dependencies of the C files, for make and ninja")
    build.add_argument("--backend", choices=BACKENDS, default=DEFAULT_BACKEND, help="language of the generated source")
    build.add_argument("--target", default=DEFAULT_TARGET, help=TARGET_HELP)
    build.add_argument(
        "--instances", metavar="NAME,…", help="build a subset machine with only these instances (one config)"
    )
    build.add_argument("--strict", action="store_true", help=STRICT_HELP)
    build.add_argument(
        "--dump", choices=list(DUMPS), help="print the result of a pass, or the types of locals, and stop"
    )
    what = "print a resource report: order, latencies, operations, instructions, stack, sizes, load; FILE: also as JSON"
    build.add_argument("--report", nargs="?", const="", metavar="FILE.json", help=what)
    add_format(build)
    build.set_defaults(run=_build)


def _build(options: argparse.Namespace) -> int:
    if options.dump and options.format != "text":
        raise UsageError("--dump prints the result of a pass; it has no --format")
    if options.dump and options.report is not None:
        raise UsageError("--dump stops before the compilation that --report needs; give one of them")
    if options.dump:
        until, dump = DUMPS[options.dump]
        for path in options.config:
            print(
                dump(compile_machine(path, toolchain(), until=until, strict=options.strict, backend=options.backend)),
                end="",
            )
        return 0
    first: Path = options.config[0]
    if options.instances is not None and len(options.config) > 1:
        raise UsageError("--instances selects from one machine; build the others separately")
    instances = None if options.instances is None else [name for name in options.instances.split(",") if name]
    folder: Path = options.output or first.parent / "build"
    if options.name is not None and not is_machine_name(options.name):
        raise UsageError(f"--name `{options.name}` is not a valid library name: lower_snake_case, not a keyword of C")
    refuse_file(folder)
    _checkprint_report(options)
    costs: list[Facts] = []
    library = folder / f"lib{options.name or first.stem}.so"
    if options.c_only:
        compilations = emit(options.config, folder, options.strict, options.target, instances, options.backend)
    else:
        inspect = _collect_facts(costs) if options.report is not None else lambda *_: None
        compilations = build_library(
            options.config,
            library,
            options.strict,
            options.target,
            inspect=inspect,
            instances=instances,
            backend=options.backend,
        )
    record = Path(f"{folder / 'fcsl_machines' if options.c_only else library}{SUFFIX}")
    write_record(record, compilations, "" if options.c_only else _command(options, folder))
    if options.depfile:
        _write_depfile(options.depfile, folder / "fcsl_machines.c", compilations)
    output = folder / "fcsl_machines.c" if options.c_only else library
    made = [Summary(c.path, c.checked, output, c.stack_bound) for c in compilations]
    if options.report:
        write_whole(Path(options.report), cost_document(costs, toolchain()))
    print_report(options, [d for c in compilations for d in c.sink.diagnostics], made)
    if options.format != "text":
        return 0
    print(output)
    for facts in costs:
        print(f"\n{report_text(facts)}", end="")
    for compilation in compilations:
        if compilation.stack_bound is not None and options.report is None:  # the report contains it
            externs = [e.name for e in compilation.checked.externs]
            print(bound_text(compilation.checked.name, compilation.stack_bound, externs))
    print_extern_calls(compilations[0].extern_calls)
    return 0


def _command(options: argparse.Namespace, folder: Path) -> str:
    """A shell command that builds the same library again from any folder."""
    words = ["fcslc", "build", *(str(path.resolve()) for path in options.config), "-o", str(folder.resolve())]
    for name in ("name", "instances"):
        value = getattr(options, name)
        words += [] if value is None else [f"--{name}", value]
    words += ["--backend", options.backend] if options.backend != DEFAULT_BACKEND else []
    words += ["--target", options.target] if options.target != DEFAULT_TARGET else []
    return shlex.join([*words, *(["--strict"] if options.strict else [])])


def _checkprint_report(options: argparse.Namespace) -> None:
    if options.report is None:
        return
    if options.c_only:
        raise UsageError("--report needs compiled machines; remove --c-only")
    if options.report:
        refuse_foreign(Path(options.report))
    elif options.format != "text":
        raise UsageError(
            f"--report prints text, and --format {options.format} uses stdout; name a file: --report FILE.json"
        )


def _collect_facts(costs: list[Facts]) -> Inspect:
    return lambda compilation, compiled, includes: costs.append(compiled_facts(compilation, compiled, includes))


def _write_depfile(path: Path, target: Path, compilations: list[Compilation]) -> None:
    needs = compiler_files()
    for compilation in compilations:
        linked = (*compilation.c_inputs.paths, *compilation.target.archives)
        needs += [*machine_files(compilation), *(file.absolute() for file in linked)]
    listed = " ".join(map(_make_word, needs))
    write_whole(path, f"{_make_word(target)}: {listed}\n")


def _make_word(path: Path) -> str:
    """A file name escaped for make."""
    return str(path).replace(" ", "\\ ").replace("#", "\\#").replace("$", "$$")


def print_report(options: argparse.Namespace, found: Sequence[Diagnostic], machines: Sequence[Summary] = ()) -> None:
    """Prints the results: text on stderr, or the requested document on stdout."""
    form = getattr(options, "format", "text")
    if form != "text":
        print(document(form, found, machines), end="")
        return
    for diagnostic in found:
        print(diagnostic.render(), file=sys.stderr)
    if error_count(found):
        print(f"\n{error_count(found)}", file=sys.stderr)


def add_format(command: argparse.ArgumentParser) -> None:
    """Adds the option --format."""
    what = "text for people (default); json or sarif: one document on stdout, for editors and other programs"
    command.add_argument("--format", choices=FORMATS, default="text", help=what)


def print_extern_calls(calls: Sequence[str]) -> None:
    """Prints the external functions that the externs of a library call."""
    if calls:
        print(f"functions called by its externs: {', '.join(calls)}")


def refuse_file(folder: Path) -> None:
    """Raises UsageError if `folder` is an existing file."""
    if folder.is_file():
        raise UsageError(f"-o `{folder}` is a file; a folder is needed")


def compiler_files() -> list[Path]:
    """The files of the compiler itself. They are dependencies of its output."""
    return sorted(Path(__file__).parents[1].rglob("*.py"))


def machine_files(compilation: Compilation) -> list[Path]:
    """The machine JSON and its algorithm files."""
    from ..parse.source_path import resolve_source

    sources = compilation.checked.sources
    return [compilation.path.resolve(), *(resolve_source(s.name, config=compilation.path).resolve() for s in sources)]
