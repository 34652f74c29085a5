# SPDX-License-Identifier: Apache-2.0
"""Commands for authors of machines and plants: graph, schema, new."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.diagnostics import nearest
from ..base.files import write_whole
from ..base.usage import UsageError
from ..driver.passes import compile_machine


def add_authoring(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the commands to fcslc's parser."""
    graph = commands.add_parser("graph", help="draw dataflow and state machine")
    graph.add_argument("config", type=Path, help="machine JSON")
    graph.add_argument("--state", help="show one state (default: all)")
    graph.add_argument("-o", "--output", type=Path, help=".svg, .mmd (Mermaid) or .md; default: Mermaid on stdout")
    graph.set_defaults(run=_graph)

    schema = commands.add_parser("schema", help="print the JSON Schema of a machine or a board, for editors")
    schema.add_argument("--board", action="store_true", help="that of a board")
    schema.set_defaults(run=_schema)

    new = commands.add_parser("new", help="start a machine, an algorithm, a plant or a vehicle, with a test")
    kinds = new.add_subparsers(required=True, metavar="KIND")
    machine = kinds.add_parser("machine", help="a folder NAME with a machine, two algorithms and a test")
    machine.add_argument("name", help="lower_snake_case")
    machine.add_argument("--package", action="store_true", help="as a ROS 2 package, for colcon")
    machine.set_defaults(run=_new_machine)
    algorithm = kinds.add_parser(
        "algorithm", help="NAME.py and a test of it, in the folder of a machine or in this one"
    )
    algorithm.add_argument("name", help="lower_snake_case; the class has it in CamelCase")
    algorithm.set_defaults(run=_new_algorithm)
    plant = kinds.add_parser(
        "plant", help="NAME.c, a model for fcsl-sim, and NAME.sim.json with a machine of this folder; with a test"
    )
    plant.add_argument("name", help="lower_snake_case; of the model")
    plant.add_argument("--machine", type=Path, metavar="FILE", help="machine JSON that the simulation flies")
    plant.set_defaults(run=_new_plant)
    vehicle = kinds.add_parser(
        "vehicle", help="a package NAME with machine, simulation and tests of a vehicle that there is"
    )
    vehicle.add_argument("name", help="lower_snake_case")
    vehicle.add_argument("--like", required=True, metavar="VEHICLE", help="a package, such as quadrotor, or its folder")
    vehicle.set_defaults(run=_new_vehicle)


def _graph(options: argparse.Namespace) -> int:
    from ..graph import FORMATS, render

    output: Path | None = options.output
    suffix = output.suffix if output else ".mmd"
    if suffix not in FORMATS:
        raise UsageError(f"-o `{output}`: a picture's name ends in {', '.join(FORMATS)}")
    machine = compile_machine(options.config, "", until="schedule").checked
    names = [s.name for s in machine.states]
    if options.state is not None and options.state not in names:
        hint = nearest(options.state, names) or f"the states are {', '.join(names)}"
        raise UsageError(f"no state `{options.state}`; {hint}")
    state = machine.states[names.index(options.state)] if options.state is not None else None
    text = render(machine, state, suffix)
    if output is None:
        print(text, end="")
    else:
        write_whole(output, text)
        print(output)
    return 0


def _schema(options: argparse.Namespace) -> int:
    from ..board.board import SCHEMA as BOARD_SCHEMA
    from .scaffold import SCHEMA

    print((BOARD_SCHEMA if options.board else SCHEMA).read_text(), end="")
    return 0


def _new_machine(options: argparse.Namespace) -> int:
    from .scaffold import machine_files

    files = machine_files(options.name, options.package)
    if Path(options.name).exists():
        raise UsageError(f"`{options.name}` exists; nothing was written")
    _write(files)
    print(f"next: python3 -m pytest {options.name}/test; then change it, as {options.name}/README.md says")
    return 0


def _new_algorithm(options: argparse.Namespace) -> int:
    from .scaffold import algorithm_files

    _write(algorithm_files(options.name))
    print(
        f"next: python3 -m pytest test/test_{options.name}.py; then change it, and name algorithms/{options.name}.py in your machine"
    )
    return 0


def _new_plant(options: argparse.Namespace) -> int:
    from .scaffold_plant import plant_files

    made = plant_files(options.name, options.machine)
    _write(made.files)
    if made.remark:
        print(made.remark)
    first = f"fcsl-sim plot {made.simulation}" if made.simulation else f"fcsl-sim describe {options.name}.c"
    print(f"next: {first}; python3 -m pytest test/test_{options.name}_plant.py; then change {options.name}.c")
    return 0


def _new_vehicle(options: argparse.Namespace) -> int:
    from .scaffold_vehicle import vehicle_files

    files = vehicle_files(options.name, options.like)
    if Path(options.name).exists():
        raise UsageError(f"`{options.name}` exists; nothing was written")
    _write(files)
    print(f"next: python3 -m pytest {options.name}/test; then change it, as {options.name}/README.md says")
    return 0


def _write(files: dict[Path, str]) -> None:
    """Writes new files. Existing files are never overwritten."""
    for path in files:
        if path.exists() or path.is_symlink():
            raise UsageError(f"`{path}` exists; nothing was written")
    for path, text in files.items():
        write_whole(path, text)
        print(path)
