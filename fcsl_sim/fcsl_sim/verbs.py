# SPDX-License-Identifier: Apache-2.0
"""The simulator's verbs of `fcsl`; most are a command of fcsl-sim."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fcsl_compiler.api.command_line import Commands, Verb

if TYPE_CHECKING:
    from fcsl_compiler.api.codes import Code

_GROUP = "simulation"
#: Options, of the bags' `plot` too, behind which another JSON file stands.
_NAMES_A_FILE = ("--views", "-o", "--output")
#: JSON Schemas of a simulation file and of a study.
SIMULATION_SCHEMA = Path(__file__).parent / "simulation.schema.json"
STUDY_SCHEMA = Path(__file__).parent / "study.schema.json"


def _command(name: str, verb: str, arguments: Sequence[str]) -> int:
    from .cli import main

    return main([name, *arguments], program=f"fcsl {verb}")


def _parser(name: str, verb: str) -> argparse.ArgumentParser:
    from .arguments import command_parser

    return command_parser(name, f"fcsl {verb}")


def _verb(verb: str, text: str, name: str = "") -> tuple[str, Verb]:
    """`name`: the command of fcsl-sim, if it is called otherwise."""
    name = name or verb
    return verb, Verb(_GROUP, text, partial(_command, name, verb), parser=partial(_parser, name, verb))


def _of_simulation(verb: str, text: str, takes_files: bool = False) -> tuple[str, Verb]:
    """One that another package has too, for other files."""
    return verb, _verb(verb, text)[1]._replace(takes=_is_simulation, takes_files=takes_files)


def _is_simulation(arguments: Sequence[str]) -> bool:
    """Whether a file that is named there has models, or is a study. The file behind an option is no such file: `--views`."""
    before = ["", *arguments]
    for name in (
        w for w, last in zip(arguments, before, strict=False) if w.endswith(".json") and last not in _NAMES_A_FILE
    ):
        if name.startswith("-"):
            continue
        if name.endswith((".sim.json", ".study.json")):
            return True
        try:
            found = json.loads(Path(name).read_bytes())
        except (OSError, ValueError, RecursionError):
            continue
        if isinstance(found, dict) and ("models" in found or {"simulation", "design"} <= found.keys()):
            return True
    return False


def _codes() -> Mapping[str, Code]:
    from .codes import SIM_CODES

    return SIM_CODES


COMMANDS = Commands(
    verbs=dict(
        [
            _verb("sim", "fly a machine against plant models, as a *.sim.json says", "run"),
            _verb("campaign", "fly a simulation many times, with dispersed parameters"),
            _verb("tune", "find parameters of a controller by flights of a study"),
            _verb("trim", "find an equilibrium of a plant"),
            _verb("linearise", "print and write the linear equations of a plant around a point"),
            _verb("response", "measure the frequency response of the loop with the compiled controller"),
            _verb("models", "list the models of installed packages and of a folder", "list-models"),
            _verb("describe", "print the fields and events of a model, and JSON to paste"),
            _of_simulation("check", "check a simulation, run nothing", takes_files=True),
            _of_simulation("plot", "draw a simulation"),
        ]
    ),
    codes=_codes,
    schemas={
        "simulation": partial(SIMULATION_SCHEMA.read_text, encoding="utf-8"),
        "study": partial(STUDY_SCHEMA.read_text, encoding="utf-8"),
    },
)
