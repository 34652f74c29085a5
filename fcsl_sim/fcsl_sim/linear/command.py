# SPDX-License-Identifier: Apache-2.0
"""`fcsl trim`, `fcsl linearise` and `fcsl response`."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

from ..config import SimConfig, load
from ..errors import SimError
from ..output import show
from .linearise import linearise
from .plant import Plant
from .response import Response, spaced
from .response_report import Measured, check_picture, heading, row
from .trim import read_trim, trim, write_trimmed

EXIT_NO_EQUILIBRIUM = 1
EXIT_NOTHING_MEASURED = 1
_TRIM = ".trim.json"
#: The highest frequency of a response, as part of half of the ticks' frequency.
_OF_NYQUIST = 0.9


def run_trim(options: Any) -> int:
    """Exit status: 0, or 1 where no equilibrium was found. Raises SimError or DiagnosticError."""
    problem = read_trim(options.file)
    _warn(problem.config)
    with Plant(problem.config) as plant:
        trimmed = trim(problem, plant)
    if options.output is not None and trimmed.is_equilibrium:
        write_trimmed(problem, trimmed, options.output)
    show(json.dumps(trimmed.as_json(), indent=2)) if options.json else print(trimmed.text())
    return 0 if trimmed.is_equilibrium else EXIT_NO_EQUILIBRIUM


def run_linearise(options: Any) -> int:
    """Around a time of a simulation, or around the equilibrium of a trim file. Raises SimError or DiagnosticError."""
    problem = read_trim(Path(options.config)) if options.config.endswith(_TRIM) else None
    if problem and options.at is not None:
        raise SimError("`--at` is a time of a simulation; a trim file says the point itself")
    config = problem.config if problem else load(options.config)
    _warn(config)
    with Plant(config, options.at) as plant:
        if problem and not (found := trim(problem, plant)).is_equilibrium:
            raise SimError(f"{options.config}: {found.text()}")
        linear = linearise(plant, options.inputs, options.outputs, options.states)
    if options.output is not None:
        linear.write(options.output)
    show(json.dumps(linear.as_json(), indent=1)) if options.json else print(linear.text())
    return 0


def run_response(options: Any) -> int:
    """Exit status: 0, or 1 where nothing was measured. Raises SimError or DiagnosticError."""
    config = load(
        options.config, seed=options.seed, sets=options.sets, events=options.events, parameters=options.parameters
    )
    _warn(config)
    high = options.high or _OF_NYQUIST * math.pi * config.machine.tick_hz
    if high >= math.pi * config.machine.tick_hz:
        limit = math.pi * config.machine.tick_hz
        raise SimError(f"`--to` {high:g} rad/s is not below {limit:g} rad/s, half of the ticks' frequency")
    if not options.low < high:
        raise SimError(f"`--from` {options.low:g} rad/s is not below `--to` {high:g} rad/s")
    if options.plot is not None:
        check_picture(options.plot)
    with Response(config, options.inputs, options.outputs, options.at, options.amplitude, options.within) as response:
        if not options.json:
            print(heading(response))
        points = []
        for point in response.points(spaced(options.low, high, options.points)):
            points.append(point)
            if not options.json:
                show(row(point))
        measured = Measured(response, points)
    if options.output is not None:
        measured.write(options.output)
    if options.plot is not None and measured.points:
        from .response_picture import draw  # imported here, because it takes a second

        draw(measured, options.plot, config.path.name)
    show(json.dumps(measured.as_json(), indent=1)) if options.json else print(measured.text())
    return 0 if measured.points else EXIT_NOTHING_MEASURED


def _warn(config: SimConfig) -> None:
    for warning in config.warnings:
        print(warning, file=sys.stderr)
