# SPDX-License-Identifier: Apache-2.0
"""`fcsl build`, and what other commands share with it."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from ..base.files import write_whole
from ..base.usage_error import UsageError
from ..build_report import compiled_facts, report_text
from ..build_report import document as cost_document
from ..build_report.facts import Facts
from ..driver.library import Inspect, build_library, emit
from ..driver.passes import DUMPS, Compilation, compile_machine
from ..driver.record import SUFFIX, write_record
from ..driver.stack import bound_text
from ..driver.toolchain import toolchain
from ..model.choices import DEFAULT_BACKEND, DEFAULT_TARGET
from ..parse.machine_files import is_machine_name
from .progress import progress
from .report import Summary, print_extern_calls, print_report


def run(options: argparse.Namespace) -> int:
    if options.dump and options.processor:
        raise UsageError("--dump prints the result of a pass, which is that of every processor; remove --processor")
    if options.dump and options.format != "text":
        raise UsageError("--dump prints the result of a pass; it has no --json or --sarif")
    if options.dump and options.report:
        raise UsageError("--dump stops before the compilation that --report needs; give one of them")
    if options.dump:
        until, dump = DUMPS[options.dump]
        for path in options.config:
            compiled = compile_machine(
                path, toolchain(), until, options.strict, backend=options.backend, times=options.times
            )
            print(dump(compiled), end="")
        return 0
    first: Path = options.config[0]
    if options.instances is not None and len(options.config) > 1:
        raise UsageError("--instances selects from one machine; build the others separately")
    instances = None if options.instances is None else [name for name in options.instances.split(",") if name]
    folder: Path = options.output or first.parent / "build"
    if options.name is not None and not is_machine_name(options.name):
        raise UsageError(f"--name `{options.name}` is not a valid library name: lower_snake_case, not a keyword of C")
    refuse_file(folder)
    if options.processor is not None:
        from .firmware import build

        return build(options, options.output, options.name or first.stem, instances)
    if options.report and options.c_only:
        raise UsageError("--report needs compiled machines; remove --c-only")
    if options.report and options.format == "sarif":
        raise UsageError("--report does not go with --sarif, which has no place for it; write --json")
    costs: list[Facts] = []
    library = folder / f"lib{options.name or first.stem}.so"
    if options.c_only:
        compilations = emit(
            options.config, folder, options.strict, options.target, instances, options.backend, options.times
        )
    else:
        inspect = _collect_facts(costs) if options.report else lambda *_: None
        with progress(f"fcslc: compiling {library.name} ..."):
            compilations = build_library(
                options.config,
                library,
                options.strict,
                options.target,
                inspect=inspect,
                instances=instances,
                backend=options.backend,
                times=options.times,
            )
    record = Path(f"{folder / 'fcsl_machines' if options.c_only else library}{SUFFIX}")
    write_record(record, compilations, "" if options.c_only else _command(options, folder))
    if options.depfile:
        _write_depfile(options.depfile, folder / "fcsl_machines.c", compilations)
    output = folder / "fcsl_machines.c" if options.c_only else library
    made = [Summary(c.path, c.checked, output, c.stack_bound) for c in compilations]
    report = cost_document(costs, toolchain()) if options.report else None
    print_report(options, [d for c in compilations for d in c.sink.diagnostics], made, report)
    if options.format != "text":
        return 0
    print(output)
    for facts in costs:
        print(f"\n{report_text(facts)}", end="")
    for compilation in compilations:
        if compilation.stack_bound is not None and not options.report:  # the report contains it
            externs = [e.name for e in compilation.checked.externs]
            print(bound_text(compilation.checked.name, compilation.stack_bound, externs))
    print_extern_calls(compilations[0].extern_calls)
    return 0


def _command(options: argparse.Namespace, folder: Path) -> str:
    """A shell command that builds the same library again from any folder."""
    words = ["fcsl", "build", *(str(path.resolve()) for path in options.config), "-o", str(folder.resolve())]
    for name in ("name", "instances"):
        value = getattr(options, name)
        words += [] if value is None else [f"--{name}", value]
    words += ["--backend", options.backend] if options.backend != DEFAULT_BACKEND else []
    words += ["--target", options.target] if options.target != DEFAULT_TARGET else []
    words += ["--times"] if options.times else []
    return shlex.join([*words, *(["--strict"] if options.strict else [])])


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


def refuse_file(folder: Path) -> None:
    """Raises UsageError if `folder` is an existing file."""
    if folder.is_file():
        raise UsageError(f"-o `{folder}` is a file; a folder is needed")


def compiler_files() -> list[Path]:
    """The files of the compiler itself. They are dependencies of its output."""
    return sorted(Path(__file__).parents[1].rglob("*.py"))


def machine_files(compilation: Compilation) -> list[Path]:
    """The machine JSON and all files that it is made from."""
    from ..parse.machine_texts import read_texts
    from ..parse.source_path import resolve_source
    from ..ros.channels import definitions_used
    from ..ros.interfaces import definition_files

    texts = read_texts(compilation.path)
    own = (source.name for source in compilation.checked.sources if source not in compilation.checked.made_sources)
    names = [*own, *(texts.files if texts is not None else ())]
    files = [resolve_source(name, config=compilation.path).resolve() for name in dict.fromkeys(names)]
    definitions = definition_files(definitions_used(compilation.checked.channels), compilation.path)
    return [compilation.path.resolve(), *files, *(path.resolve() for path in definitions)]
