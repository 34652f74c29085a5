# SPDX-License-Identifier: Apache-2.0
"""`fcsl new`: starts a machine, an algorithm, a plant or a vehicle."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.files import write_whole
from ..base.usage_error import UsageError
from .scaffold import algorithm_files, machine_files
from .scaffold_plant import plant_files
from .scaffold_vehicle import vehicle_files


def run(options: argparse.Namespace) -> int:
    return _KINDS[options.kind](options)


def _new_machine(options: argparse.Namespace) -> int:
    files = machine_files(options.name, options.package)
    if Path(options.name).exists():
        raise UsageError(f"`{options.name}` exists; nothing was written")
    _write(files)
    print(f"next: fcsl test {options.name}; then change it, as {options.name}/README.md says")
    return 0


def _new_algorithm(options: argparse.Namespace) -> int:
    _write(algorithm_files(options.name))
    print(
        f"next: fcsl test test/test_{options.name}.py; then change it, and name algorithms/{options.name}.py in your machine"
    )
    return 0


def _new_plant(options: argparse.Namespace) -> int:
    made = plant_files(options.name, options.machine)
    _write(made.files)
    if made.remark:
        print(made.remark)
    first = f"fcsl plot {made.simulation}" if made.simulation else f"fcsl describe {options.name}.c"
    print(f"next: {first}; fcsl test test/test_{options.name}_plant.py; then change {options.name}.c")
    return 0


def _new_vehicle(options: argparse.Namespace) -> int:
    files = vehicle_files(options.name, options.like)
    if Path(options.name).exists():
        raise UsageError(f"`{options.name}` exists; nothing was written")
    _write(files)
    print(f"next: fcsl test {options.name}; then change it, as {options.name}/README.md says")
    return 0


def _write(files: dict[Path, str]) -> None:
    """Writes new files. Existing files are never overwritten."""
    for path in files:
        if path.exists() or path.is_symlink():
            raise UsageError(f"`{path}` exists; nothing was written")
    for path, text in files.items():
        write_whole(path, text)
        print(path)


_KINDS = {"machine": _new_machine, "algorithm": _new_algorithm, "plant": _new_plant, "vehicle": _new_vehicle}
