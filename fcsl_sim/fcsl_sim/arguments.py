# SPDX-License-Identifier: Apache-2.0
"""The command line of `fcsl-sim`: commands, options and the forms of their values. It imports no command, so that help
and errors of usage come at once."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fractions import Fraction
from math import isfinite, isnan
from pathlib import Path

from fcsl_compiler.api.command_line import add_examples, add_version, subcommands

from .external import TIMEOUT_MS

_EXAMPLES = {
    "": "run craft.sim.json --record flight",
    "check": "craft.sim.json --set altimeter.parameters.sigma=0.8",
    "run": "craft.sim.json --record flight --seed 7",
    "plot": "craft.sim.json -o craft.png",
    "campaign": "craft.study.json --cases 200",
    "tune": "craft.study.json -o gains",
    "trim": "hover.trim.json -o hover.sim.json",
    "linearise": "craft.sim.json --input engine.inputs.throttle --measure body.outputs.height -o craft.json",
    "response": "craft.sim.json --input controller.throttle --measure body.outputs.height --plot response.png",
    "list-models": "models --json",
    "describe": "noisy_sensor",
}
_CONFIG = "*.sim.json, or package://PACKAGE/PATH below its share folder"


def parse(arguments: Sequence[str] | None, program: str = "") -> argparse.Namespace:
    """The options; `command` names the command. Wrong ones end the program with status 2. `program` is what help calls the
    command, if not fcsl-sim COMMAND."""
    parser = _parser(program)
    options, rest = parser.parse_known_args(arguments)
    if options.command == "plot":  # argparse takes paths behind an option for unknown ones
        options.paths += [text for text in rest if not text.startswith("-")]
        rest = [text for text in rest if text.startswith("-")]
    if rest:
        subcommands(parser)[options.command].error(f"unrecognized arguments: {' '.join(rest)}")
    return options


def command_parser(name: str, program: str) -> argparse.ArgumentParser:
    """That of one command."""
    return subcommands(_parser(program))[name]


def _parser(program: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fcsl-sim", description="Flies a compiled machine against plant models.")
    add_version(parser, "fcsl_sim", __file__)
    commands = parser.add_subparsers(dest="command", required=True)
    check = _add(commands, "check", "check simulations and studies, run nothing")
    check.add_argument("config", nargs="+", help=f"{_CONFIG}; or *.study.json")
    check.add_argument("--json", action="store_true", help="print one JSON object")
    _add_flight(check)
    run = _add(commands, "run", "run a simulation to its end")
    run.add_argument("config", help=_CONFIG)
    _add_flight(run)
    _add_parameters(run)
    _add_run(run)
    _add_plot(_add(commands, "plot", "draw a simulation"))
    _add_campaign(_add(commands, "campaign", "fly a simulation many times, with dispersed parameters"))
    _add_tune(_add(commands, "tune", "find parameters of controllers, as the `tune` of a study says"))
    _add_trim(_add(commands, "trim", "find an equilibrium of a plant"))
    _add_linearise(_add(commands, "linearise", "print and write the linear equations of a plant around a point"))
    _add_response(_add(commands, "response", "measure the frequency response of the loop with the compiled controller"))
    _add_model_commands(commands)
    if program:
        for command in commands.choices.values():
            command.prog = program
    add_examples(parser, _EXAMPLES)
    return parser


def _add(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, text: str
) -> argparse.ArgumentParser:
    return commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")


def _add_flight(command: argparse.ArgumentParser) -> None:
    """What replaces members of the simulation file."""
    command.add_argument(
        "--duration", type=_seconds, metavar="SECONDS", help="longest simulated time in s; replaces the file's"
    )
    _add_changes(command)


def _add_changes(command: argparse.ArgumentParser) -> None:
    """The same without the duration."""
    command.add_argument("--seed", type=_seed, metavar="N", help="random seed; replaces the file's")
    help_set = (
        "sets a parameter of a model or a controller, or an element of one: altimeter.parameters.sigma=0.8 (repeatable)"
    )
    command.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", dest="sets", help=help_set)
    help_event = 'adds an event: "14.0 altimeter.parameters.dropout=true", at 14 s (repeatable)'
    command.add_argument("--event", action="append", default=[], metavar="EVENT", dest="events", help=help_event)


def _add_parameters(command: argparse.ArgumentParser) -> None:
    help_parameters = (
        "parameter file for the controllers (docs/reference/variables.md), instead of their compiled values"
    )
    command.add_argument("--parameters", metavar="FILE", help=help_parameters)


def _add_run(command: argparse.ArgumentParser) -> None:
    command.add_argument("--record", type=Path, metavar="BAG", help="new directory for the bag")
    help_split = "split the bag by some of seconds=60,megabytes=100,files=10,around=30 (docs/guide/recording.md)"
    command.add_argument("--record-split", metavar="SPLIT", default="", help=help_split)
    command.add_argument(
        "--namespace",
        metavar="NAMESPACE",
        default="",
        help="ROS namespace of the bag's topics, and of the keys on the bus",
    )
    command.add_argument(
        "--external",
        metavar="PEER",
        help="the controller is another process (fcsl-fc --hal PEER): at the other end of a wire, with wire:unix:PATH, "
        "wire:udp:HOST:PORT, wire:tcp:HOST:PORT, wire:uart:DEVICE:BAUD or wire:zenoh:tcp:HOST:PORT; or on the bus, "
        "each channel under its key, with zenoh:tcp:HOST:PORT, or zenoh-client: where another simulation listens; with "
        ",free-running behind that, neither waits for the other",
    )
    command.add_argument(
        "--pil",
        metavar="PROCESSOR",
        help="processor in the loop (docs/hardware/firmware.md): fly with the controller on qemu:mps2-an500, which is built and started, or "
        "on the board at uart:DEVICE:BAUD; compare with the flight of this process",
    )
    help_speed = "limit on simulated seconds per second: 1 for real time; 0 (default): as fast as possible"
    command.add_argument("--speed", type=_speed, default=0.0, metavar="FACTOR", help=help_speed)
    help_timeout = f"seconds to wait for the external controller, or the processor (default {TIMEOUT_MS // 1000})"
    command.add_argument("--timeout", type=_seconds, metavar="SECONDS", help=help_timeout)
    command.add_argument("--restore", type=Path, metavar="FILE", help="go on from this checkpoint of the simulation")
    help_save = "write a checkpoint at the end (docs/guide/recording.md), whose time --duration chooses"
    command.add_argument("--save", type=Path, metavar="FILE", help=help_save)
    command.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")
    _add_servers(command)


def _add_servers(command: argparse.ArgumentParser) -> None:
    help_socket = (
        "serve all variables (docs/reference/variables.md) on this Unix socket, or on tcp:HOST:PORT with --token"
    )
    command.add_argument("--socket", metavar="ADDRESS", help=help_socket)
    help_checkpoints = "folder of the checkpoint files that clients name"
    command.add_argument("--checkpoints", type=Path, metavar="DIR", help=help_checkpoints)
    command.add_argument("--token", type=Path, metavar="FILE", help="token file of a TCP server; created if absent")
    command.add_argument("--paused", action="store_true", help="start paused: only commands run ticks until `resume`")
    help_telemetry = (
        "send values as UDP (docs/guide/monitoring.md) to udp:HOST:PORT, or of every N-th tick to udp:HOST:PORT/N"
    )
    command.add_argument("--telemetry", metavar="ADDRESS", help=help_telemetry)
    help_fields = (
        "fields to send, as path globs separated by commas (default: inputs, outputs, state, health, counters)"
    )
    command.add_argument("--telemetry-fields", metavar="GLOBS", help=help_fields)
    help_observers = (
        "put the values of all channels on a bus of their own (docs/reference/transports.md), which listens there"
    )
    command.add_argument("--observers", metavar="tcp:HOST:PORT", help=help_observers)
    help_ros = (
        "publish the machine's ROS 2 topics and /clock: tcp:HOST:PORT, to listen on for a bridge of DDS, or "
        "rmw_zenoh:tcp/HOST:PORT, the router of rmw_zenoh (docs/reference/transports.md)"
    )
    command.add_argument("--ros", metavar="ADDRESS", help=help_ros)


def _add_plot(command: argparse.ArgumentParser) -> None:
    command.add_argument("config", help=_CONFIG)
    help_paths = "what to draw, a panel for each, as for a bag (fcsl plot); none: the views of the run"
    command.add_argument("paths", nargs="*", metavar="PATH", help=help_paths)
    help_output = "picture to write: .png, .svg or .pdf (default: the simulation's name with .png, here)"
    command.add_argument("-o", "--output", type=Path, metavar="FILE", help=help_output)
    command.add_argument("--against", default="", metavar="PATH", help="the horizontal axis, instead of time")
    _add_flight(command)
    _add_parameters(command)


def _add_campaign(command: argparse.ArgumentParser) -> None:
    command.add_argument("study", type=Path, help="*.study.json (docs/guide/campaigns.md)")
    help_output = "folder of the results; a campaign that was interrupted goes on in it (default: NAME.campaign, here)"
    command.add_argument("-o", "--output", type=Path, metavar="FOLDER", help=help_output)
    command.add_argument("--cases", type=_count, metavar="N", help="number of cases; replaces the file's")
    command.add_argument("--case", type=int, metavar="I", help="fly this case alone and print what it gives")
    command.add_argument("--record", type=Path, metavar="BAG", help="with --case: new directory for its bag")
    _add_many_flights(command)


def _add_tune(command: argparse.ArgumentParser) -> None:
    command.add_argument("study", type=Path, help="*.study.json with `tune` (docs/guide/campaigns.md)")
    help_output = "folder of the results; a search that was interrupted goes on in it (default: NAME.tune, here)"
    command.add_argument("-o", "--output", type=Path, metavar="FOLDER", help=help_output)
    _add_many_flights(command)


def _add_many_flights(command: argparse.ArgumentParser) -> None:
    _add_parameters(command)
    command.add_argument("--jobs", type=_count, metavar="N", help="processes (default: one for each core)")
    command.add_argument(
        "--restart", action="store_true", help="remove the results that the folder has, and begin anew"
    )
    help_engine = "who flies: processes of this machine (default), or a Ray cluster (needs the Python package ray)"
    command.add_argument("--engine", choices=("local", "ray"), default="local", help=help_engine)
    command.add_argument("--json", action="store_true", help="print the summary as JSON, and nothing else")


def _add_trim(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="*.trim.json (docs/guide/campaigns.md)")
    help_output = "write a simulation that extends the file's with the inputs and parameters found"
    command.add_argument("-o", "--output", type=Path, metavar="FILE", help=help_output)
    command.add_argument("--json", action="store_true", help="print one JSON object")


def _add_linearise(command: argparse.ArgumentParser) -> None:
    command.add_argument("config", help=f"{_CONFIG}; or *.trim.json, whose equilibrium is the point")
    help_input = "an input of the plant: instance.inputs.name, or an element of it (repeatable)"
    command.add_argument("--input", action="append", default=[], metavar="PATH", dest="inputs", help=help_input)
    help_result = "an output of the plant: instance.outputs.name (repeatable)"
    command.add_argument("--measure", action="append", default=[], metavar="PATH", dest="outputs", help=help_result)
    help_states = "keep the states that match, such as 'body.*'; the others are held (repeatable; default: all)"
    command.add_argument("--states", action="append", metavar="GLOB", help=help_states)
    help_at = "fly with the controller until then (s); default: the beginning"
    command.add_argument("--at", type=_seconds, metavar="SECONDS", help=help_at)
    command.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the matrices as JSON")
    command.add_argument("--json", action="store_true", help="print them as JSON")


def _add_response(command: argparse.ArgumentParser) -> None:
    command.add_argument("config", help=_CONFIG)
    help_input = (
        "where a sine is added: instance.inputs.name, an element of it, or controller.channel, a sensor's or an "
        "actuator's (repeatable)"
    )
    command.add_argument(
        "--input", action="append", default=[], metavar="PATH[=WEIGHT]", dest="inputs", help=help_input
    )
    help_result = "a value of a model or of the machine whose response is wanted (repeatable)"
    command.add_argument("--measure", action="append", default=[], metavar="PATH", dest="outputs", help=help_result)
    command.add_argument(
        "--at", type=_seconds, metavar="SECONDS", help="fly until then first (s); default: the beginning"
    )
    _add_changes(command)
    _add_parameters(command)
    help_from = "the lowest frequency (default: 1 rad/s)"
    command.add_argument("--from", type=_positive, default=1.0, metavar="RAD_S", dest="low", help=help_from)
    help_to = "the highest one (default: 0.9 of half of the ticks' frequency)"
    command.add_argument("--to", type=_positive, metavar="RAD_S", dest="high", help=help_to)
    command.add_argument("--points", type=_count, default=25, metavar="N", help="how many frequencies (default: 25)")
    help_amplitude = "of the sine, in the unit of the input (default: 0.001)"
    command.add_argument("--amplitude", type=_positive, default=1e-3, metavar="A", help=help_amplitude)
    help_within = "two windows in a row agree if no amplitude changes by more than this part of it (default: 0.001)"
    command.add_argument("--within", type=_positive, default=1e-3, metavar="PART", help=help_within)
    command.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the response as JSON")
    help_plot = "draw it: .png, .svg or .pdf"
    command.add_argument("--plot", type=Path, metavar="FILE", help=help_plot)
    command.add_argument("--json", action="store_true", help="print it as JSON, and nothing else")


def _add_model_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    listing = _add(commands, "list-models", "list the models of installed packages and of a folder")
    help_folder = "where to look for C and C++ files with models (default: this folder)"
    listing.add_argument("folder", nargs="?", type=Path, default=Path(), metavar="FOLDER", help=help_folder)
    listing.add_argument("--json", action="store_true", help="print them as a JSON list")
    description = _add(commands, "describe", "print the fields and events of a model, and JSON to paste")
    description.add_argument(
        "model", help="a C or C++ file, package://PACKAGE/PATH, or a name that `fcsl models` prints"
    )
    description.add_argument("--json", action="store_true", help="print one JSON object")


# ---- forms of values -----------------------------------------------------------------------------------------------


def _seed(text: str) -> int:
    value = int(text, 10)
    if not 0 <= value < 2**64:
        raise ValueError
    return value


def _count(text: str) -> int:
    value = int(text, 10)
    if value < 1:
        raise ValueError
    return value


def _seconds(text: str) -> Fraction:
    about = float(text)
    if isnan(about):
        raise ValueError
    if not 0 < about <= 1e9:
        raise argparse.ArgumentTypeError(f"{text} s is {'not above zero' if about <= 0 else 'more than 1e+09 s'}")
    return Fraction(text)  # exact; without the checks above, 1e99999999 would take minutes


def _speed(text: str) -> float:
    value = float(text)
    if not (isfinite(value) and value >= 0):
        raise ValueError
    return value


def _positive(text: str) -> float:
    value = float(text)
    if not (isfinite(value) and value > 0):
        raise ValueError
    return value


# argparse uses these names in its error messages.
_count.__name__ = "number of at least 1"
_seed.__name__ = "seed (0 to 2^64 - 1)"
_seconds.__name__ = "number of seconds"
_speed.__name__ = "speed (a number above zero, or 0 for as fast as possible)"
_positive.__name__ = "number above zero"
