# SPDX-License-Identifier: Apache-2.0
"""fcslc: check machines, compile them, write their ROS 2 messages."""

from __future__ import annotations

import argparse
import io
import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from .authoring import add_authoring
from .build import Inspect, build_library, check_machine, emit, stack_bounds
from .build_record import SUFFIX, write_record
from .build_report import compiled_facts, refuse_foreign, report_text
from .build_report import document as cost_document
from .build_report.facts import Facts
from .codes import UnknownCode, pages, table
from .cover_cli import add_cover, split_command
from .diagnostics import Diagnostic, DiagnosticError, DiagnosticSink, nearest
from .function_page import function_names, function_page
from .messages import message_texts
from .parse import is_machine_name, parse_machine
from .passes import PASSES, Compilation, compile_machine
from .report import FORMATS, Summary, document, error_count
from .stack import bound_text
from .targets import DEFAULT_TARGET, choose_target
from .toolchain import ToolchainError, toolchain, write_whole
from .usage import UsageError
from .verify import IrError

_TARGET = f"which of the machine's `targets` its externs are linked from (default: {DEFAULT_TARGET})"
_STRICT = "every input without connection or channel must be listed in the `inputs` of its instance"


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns the exit status: 0 done, 1 the program or the machine it runs on is wrong, 2 usage, 130 interrupted."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # what this terminal cannot show must not end the program
            stream.reconfigure(errors="backslashreplace")
    own, command = split_command(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(own, argparse.Namespace(command=command))
    try:
        status: int = options.run(options)
        return status
    except DiagnosticError as error:
        _report(options, error.diagnostics)
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


def _report(options: argparse.Namespace, found: Sequence[Diagnostic], machines: Sequence[Summary] = ()) -> None:
    """What was found: on stderr as text, or on stdout as the one document that was asked for."""
    form = getattr(options, "format", "text")
    if form != "text":
        print(document(form, found, machines), end="")
        return
    for diagnostic in found:
        print(diagnostic.render(), file=sys.stderr)
    if error_count(found):
        print(f"\n{error_count(found)}", file=sys.stderr)


def _fail(options: argparse.Namespace, failure: str) -> None:
    """The tool could not do its work."""
    print(f"fcslc: {failure}", file=sys.stderr)
    if getattr(options, "format", "text") != "text":
        print(document(options.format, (), failure=failure), end="")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fcslc", description="Compiles machines (JSON and algorithms) to native C.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    check = commands.add_parser("check", help="report what is wrong; write nothing")
    check.add_argument("config", type=Path, nargs="+", help="machine JSON")
    check.add_argument("--strict", action="store_true", help=_STRICT)
    _add_format(check)
    check.set_defaults(run=_check)

    build = commands.add_parser("build", help="compile to a shared library, or to C only")
    build.add_argument("config", type=Path, nargs="+", help="machine JSON; several go into one library")
    build.add_argument(
        "-o", "--output", type=Path, help="folder for what is made (default: build beside the first config)"
    )
    build.add_argument("--name", help="library name (default: the first machine's)")
    build.add_argument("--c-only", action="store_true", help="write C, header and map, do not compile them")
    build.add_argument("--depfile", type=Path, help="write what the C files depend on, for make and ninja")
    build.add_argument("--target", default=DEFAULT_TARGET, help=_TARGET)
    build.add_argument(
        "--instances", metavar="NAME,…", help="only these, as a machine of their own (a subset of one config)"
    )
    build.add_argument("--strict", action="store_true", help=_STRICT)
    build.add_argument("--dump", choices=[p.name for p in PASSES], help="print what a pass made and stop there")
    what = "print what it will cost: order, latencies, operations, instructions, stack, sizes, load; FILE: as JSON, too"
    build.add_argument("--report", nargs="?", const="", metavar="FILE.json", help=what)
    _add_format(build)
    build.set_defaults(run=_build)

    why = commands.add_parser("explain", help="what a diagnostic code means, with an example; what a function computes")
    why.add_argument("what", nargs="*", help="a code such as E402, or a function such as kf_gain; none: list all codes")
    why.set_defaults(run=_explain)

    scan = commands.add_parser("scan", help="check that machine libraries call nothing a step may not call")
    scan.add_argument("library", type=Path, nargs="+", help="shared library of machines")
    scan.add_argument("--objects", type=Path, help="look at the machines' own objects below here; print stack bounds")
    scan.add_argument(
        "--emitted", type=Path, help="folder of the generated C: machines may call the externs they declare"
    )
    scan.set_defaults(run=_scan)

    externs = commands.add_parser("externs", help="print what a target links, for build systems")
    externs.add_argument("config", type=Path, nargs="+", help="machine JSON")
    externs.add_argument("--target", default=DEFAULT_TARGET, help=_TARGET)
    externs.set_defaults(run=_externs)

    messages = commands.add_parser("messages", help="write the ROS 2 .msg files of the instances and their structs")
    messages.add_argument("config", type=Path, nargs="+", help="machine JSON")
    messages.add_argument("-o", "--output", type=Path, required=True, help="folder for the .msg files")
    messages.add_argument("--package", help="the ROS 2 package they are built into; the machines must stand in it")
    messages.add_argument("--sources", type=Path, help="write here what was read, one file a line, for build systems")
    messages.set_defaults(run=_messages)
    add_authoring(commands)
    add_cover(commands)
    return parser


def _add_format(command: argparse.ArgumentParser) -> None:
    what = "text for people (default); json or sarif: one document on stdout, for editors and other programs"
    command.add_argument("--format", choices=FORMATS, default="text", help=what)


def _check(options: argparse.Namespace) -> int:
    found: list[Diagnostic] = []
    passed: list[Summary] = []
    for path in options.config:
        try:
            compilation = compile_machine(path, "", until="ir", strict=options.strict)
        except DiagnosticError as error:
            found += error.diagnostics
            continue
        found += compilation.sink.diagnostics
        passed.append(Summary(path, compilation.checked))
    if options.format == "text":
        for machine in passed:
            print(machine.text())
    _report(options, found, passed)
    return 1 if len(passed) < len(options.config) else 0


def _explain(options: argparse.Namespace) -> int:
    try:
        texts = [function_page(word) or pages([word], table(), "fcsl-sim explain") for word in options.what]
    except UnknownCode as error:
        like = [nearest(word, function_names()) for word in options.what if not word[-1:].isdigit()]
        raise UsageError("; ".join([str(error), *filter(None, like)])) from None
    print("\n".join(texts) if texts else pages([], table(), "fcsl-sim explain"), end="")
    return 0


def _build(options: argparse.Namespace) -> int:
    if options.dump and options.format != "text":
        raise UsageError("--dump prints what a pass made; it has no --format")
    if options.dump and options.report is not None:
        raise UsageError("--dump stops before there is anything for --report to look at; give one of them")
    if options.dump:
        step = next(p for p in PASSES if p.name == options.dump)
        for path in options.config:
            print(step.dump(compile_machine(path, toolchain(), until=step.name, strict=options.strict)), end="")
        return 0
    first: Path = options.config[0]
    if options.instances is not None and len(options.config) > 1:
        raise UsageError("--instances chooses among those of one machine; build the others by themselves")
    instances = None if options.instances is None else [name for name in options.instances.split(",") if name]
    folder: Path = options.output or first.parent / "build"
    if options.name is not None and not is_machine_name(options.name):
        raise UsageError(f"--name `{options.name}` is not a library's name: lower_snake_case, and no word of C")
    _refuse_file(folder)
    _check_report(options)
    costs: list[Facts] = []
    library = folder / f"lib{options.name or first.stem}.so"
    if options.c_only:
        compilations = emit(options.config, folder, options.strict, options.target, instances)
    else:
        look = _look_into(costs) if options.report is not None else lambda *_: None
        compilations = build_library(
            options.config, library, options.strict, options.target, inspect=look, instances=instances
        )
    record = Path(f"{folder / 'fcsl_machines' if options.c_only else library}{SUFFIX}")
    write_record(record, compilations, "" if options.c_only else _command(options, folder))
    if options.depfile:
        _write_depfile(options.depfile, folder / "fcsl_machines.c", compilations)
    output = folder / "fcsl_machines.c" if options.c_only else library
    made = [Summary(c.path, c.checked, output, c.stack_bound) for c in compilations]
    if options.report:
        write_whole(Path(options.report), cost_document(costs, toolchain()))
    _report(options, [d for c in compilations for d in c.sink.diagnostics], made)
    if options.format != "text":
        return 0
    print(output)
    for facts in costs:
        print(f"\n{report_text(facts)}", end="")
    for compilation in compilations:
        if compilation.stack_bound is not None and options.report is None:  # the report has it
            externs = [e.name for e in compilation.checked.externs]
            print(bound_text(compilation.checked.name, compilation.stack_bound, externs))
    _print_extern_calls(compilations[0].extern_calls)
    return 0


def _command(options: argparse.Namespace, folder: Path) -> str:
    """What builds the same library again, from any folder."""
    words = ["fcslc", "build", *(str(path.resolve()) for path in options.config), "-o", str(folder.resolve())]
    for name in ("name", "instances"):
        value = getattr(options, name)
        words += [] if value is None else [f"--{name}", value]
    words += ["--target", options.target] if options.target != DEFAULT_TARGET else []
    return shlex.join([*words, *(["--strict"] if options.strict else [])])


def _check_report(options: argparse.Namespace) -> None:
    if options.report is None:
        return
    if options.c_only:
        raise UsageError("--report looks at compiled machines; leave --c-only out")
    if options.report:
        refuse_foreign(Path(options.report))
    elif options.format != "text":
        raise UsageError(
            f"--report prints text, and --format {options.format} has stdout; name a file: --report FILE.json"
        )


def _look_into(costs: list[Facts]) -> Inspect:
    return lambda compilation, compiled, includes: costs.append(compiled_facts(compilation, compiled, includes))


def _print_extern_calls(calls: Sequence[str]) -> None:
    if calls:
        print(f"what its externs call: {', '.join(calls)}")


def _refuse_file(folder: Path) -> None:
    if folder.is_file():
        raise UsageError(f"-o `{folder}` is a file; a folder is needed")


def _write_depfile(path: Path, target: Path, compilations: list[Compilation]) -> None:
    needs = _compiler_files()
    for compilation in compilations:
        needs += [*_machine_files(compilation), *(file.absolute() for file in compilation.target.files)]
    listed = " ".join(map(_make_word, needs))
    write_whole(path, f"{_make_word(target)}: {listed}\n")


def _compiler_files() -> list[Path]:
    return sorted(Path(__file__).parent.rglob("*.py"))


def _machine_files(compilation: Compilation) -> list[Path]:
    """The machine JSON and its algorithms, wherever they lie."""
    from .source_path import resolve_source

    sources = compilation.checked.sources
    return [compilation.path.resolve(), *(resolve_source(s.name, config=compilation.path).resolve() for s in sources)]


def _make_word(path: Path) -> str:
    """A file name as make reads it."""
    return str(path).replace(" ", "\\ ").replace("#", "\\#").replace("$", "$$")


def _scan(options: argparse.Namespace) -> int:
    objects = sorted(options.objects.rglob("*.o")) if options.objects else []
    maps = sorted(options.emitted.glob("*.map.json")) if options.emitted else []
    externs = sorted({name for file in maps for name in _externs_of(file)})
    calls = [call for library in options.library for call in check_machine(library, objects, externs)]
    if options.objects:
        for name, bound in stack_bounds(options.objects, externs).items():
            print(bound_text(name, bound, externs))
    _print_extern_calls(calls)
    return 0


def _externs_of(map_file: Path) -> list[str]:
    try:
        return [str(name) for name in json.loads(map_file.read_text())["externs"]]
    except (ValueError, KeyError, TypeError):
        raise UsageError(f"--emitted: `{map_file}` is not a map that this fcslc wrote") from None


def _externs(options: argparse.Namespace) -> int:
    """One line per thing to link, for build systems that ask before anything is compiled."""
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
    """Writes what changed and lists all; a message belongs to one machine."""
    _refuse_file(options.output)
    texts: dict[str, str] = {}
    read = _compiler_files()
    for path in options.config:
        compilation = compile_machine(path, "", until="schedule")
        read += _machine_files(compilation)
        m = compilation.checked
        if options.package not in (None, m.package):
            raise UsageError(
                f"`{path}` stands in package `{m.package}` (the nearest package.xml above it), so that package "
                f"`{options.package}` cannot build its messages; move the machine there, or build them in `{m.package}`"
            )
        own = message_texts(m)
        if twice := sorted(texts.keys() & own.keys()):
            raise UsageError(
                f"`{path}`: message `{twice[0]}` is also one of another machine; rename an instance of one"
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
