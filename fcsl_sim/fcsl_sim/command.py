# SPDX-License-Identifier: Apache-2.0
"""Runs a command of fcsl-sim, and reports why it cannot do its work."""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from pathlib import Path
from types import FrameType

from fcsl_compiler.api.diagnostics import DiagnosticError
from simclient.cli import missing_package
from simclient.requirements import summary as requirement_lines
from simclient.vars.top import table_lines

from . import plot
from .config import SERIAL_LINK, SimConfig, load
from .errors import SimError
from .external import FREE_RUNNING, TIMEOUT_MS
from .model_list import find_model, find_models
from .model_page import describe_json, describe_text, list_json, list_text
from .models import Scalar
from .output import show
from .runner import Sender, Server, StateChange, Summary, Watcher, run

EXIT_UNTIL_NOT_HELD = 1
EXIT_ERRORS = 1
EXIT_DIFFERENT = 1
EXIT_BAD_INPUT = 2
#: How an address on the bus begins.
_BUS = ("zenoh:", "zenoh-client:")


class _Terminated(KeyboardInterrupt):
    """SIGTERM arrived. It ends a run as SIGINT does, so that the bag is closed and the socket removed."""


def _terminate(number: int, frame: FrameType | None) -> None:
    raise _Terminated


def run_command(options: argparse.Namespace) -> int:
    """The exit status (cli.py)."""
    try:
        signal.signal(signal.SIGTERM, _terminate)
        status = _COMMANDS[options.command](options)
        sys.stdout.flush()
        return status
    except (DiagnosticError, SimError) as error:
        _fail_as_json(options, str(error))
        return _report(error)
    except ModuleNotFoundError as error:
        message = missing_package(error)
        _fail_as_json(options, message)
        print(f"fcsl-sim: error: {message}", file=sys.stderr)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:
        message = (f"{error.filename}: " if error.filename else "") + (error.strerror or str(error))
        _fail_as_json(options, message)
        print(f"fcsl-sim: error: {message}", file=sys.stderr)
    except _Terminated:
        return _interrupted(options, signal.SIGTERM)
    except KeyboardInterrupt:
        return _interrupted(options, signal.SIGINT)
    return EXIT_BAD_INPUT


def _report(error: DiagnosticError | SimError) -> int:
    """On standard error; returns the exit status."""
    if isinstance(error, SimError):
        print(f"fcsl-sim: error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    print(error, file=sys.stderr)
    count = len(error.diagnostics)
    print(f"fcsl-sim: {count} error{'s' if count > 1 else ''}", file=sys.stderr)
    # One of an argument is wrong usage.
    return EXIT_ERRORS if all(d.span.source.path for d in error.diagnostics) else EXIT_BAD_INPUT


def _fail_as_json(options: argparse.Namespace, message: str) -> None:
    if getattr(options, "json", False):
        check = {"ok": False} if options.command == "check" else {"end": "error"}
        show(json.dumps({**check, "error": message}, indent=2))


def _interrupted(options: argparse.Namespace, number: signal.Signals) -> int:
    bag = getattr(options, "record", None)
    kept = f"; {bag} has the ticks flown until then" if bag and Path(bag).exists() else ""
    print(f"fcsl-sim: interrupted{kept}", file=sys.stderr)
    return 128 + number


def _load(options: argparse.Namespace) -> SimConfig:
    config = load(
        options.config,
        seed=options.seed,
        duration_s=options.duration,
        sets=options.sets,
        events=options.events,
        parameters=getattr(options, "parameters", None),
    )
    for warning in config.warnings:
        print(warning, file=sys.stderr)
    return config


def _check(options: argparse.Namespace) -> int:
    """Every file, whatever the others say. As JSON one document; what is known of a single file stands at its top, too."""
    status, rows = 0, []
    for file in options.config:
        try:
            text, facts = _checked_study(file) if file.endswith(".study.json") else _checked(file, options)
            rows.append({"file": file, "ok": True, **facts})
            if not options.json:
                show(f"{file}: ok: {text}")
        except (DiagnosticError, SimError) as error:
            rows.append({"file": file, "ok": False, "error": str(error)})
            status = max(status, _report(error))
    if options.json:
        single = rows[0] if len(rows) == 1 else {}
        show(json.dumps({**single, "ok": status == 0, "simulations": rows}, indent=2))
    return status


def _checked(file: str, options: argparse.Namespace) -> tuple[str, dict[str, object]]:
    """What a sound simulation is, as text and as facts."""
    config = _load(argparse.Namespace(**{**vars(options), "config": file}))
    seconds = config.machine.time_ns(config.ticks) / 1e9
    text = f"`{config.machine.name}` and {', '.join(config.tables)} for at most {seconds:g} s"
    return text, {"machine": config.machine.name, "models": list(config.tables), "duration_s": seconds}


def _checked_study(file: str) -> tuple[str, dict[str, object]]:
    from .campaign.study import read_study

    study = read_study(Path(file))
    text = f"{study.cases} cases, metrics {', '.join(study.metrics)}"
    return text, {"machine": study.machine.name, "cases": study.cases, "metrics": list(study.metrics)}


def _list_models(options: argparse.Namespace) -> int:
    models = find_models(options.folder)
    print(json.dumps(list_json(models), indent=2) if options.json else list_text(models))
    return 0


def _describe(options: argparse.Namespace) -> int:
    model = find_model(options.model)
    table = model.table()
    print(json.dumps(describe_json(model, table), indent=2) if options.json else describe_text(model, table))
    return 0


def _campaign(options: argparse.Namespace) -> int:
    from .campaign.command import run_campaign  # imported here, because it takes long to load

    return run_campaign(options)


def _tune(options: argparse.Namespace) -> int:
    from .tune.command import run_tune

    return run_tune(options)


def _trim(options: argparse.Namespace) -> int:
    from .linear.command import run_trim

    return run_trim(options)


def _linearise(options: argparse.Namespace) -> int:
    from .linear.command import run_linearise

    return run_linearise(options)


def _response(options: argparse.Namespace) -> int:
    from .linear.command import run_response

    return run_response(options)


def _plot(options: argparse.Namespace) -> int:
    picture = plot.picture_name(options.config, options.output)
    left_out = plot.draw(_load(options), picture, options.paths, options.against)
    print(f"{picture}: {picture.stat().st_size} bytes")
    if left_out:
        print(f"left out: {', '.join(left_out)}; PATHs choose what is drawn")
    return 0


def _run(options: argparse.Namespace) -> int:
    external: str | None = options.external
    if external is not None and not external.startswith(("wire:", *_BUS)):
        raise SimError(
            f"--external {external}: write wire:SPEC, as in wire:unix:PATH or wire:udp:127.0.0.1:7600, "
            "or zenoh:tcp:HOST:PORT"
        )
    if options.socket is None and (options.paused or options.token or options.checkpoints):
        raise SimError("`--paused`, `--token` and `--checkpoints` need `--socket`: they configure the variable server")
    if options.telemetry_fields is not None and options.telemetry is None:
        raise SimError("`--telemetry-fields` needs `--telemetry`: it selects the values to send")
    on_bus = options.observers is not None or options.ros is not None or (external or "").startswith(_BUS)
    if options.namespace and options.record is None and not on_bus:
        raise SimError(
            "`--namespace` needs `--record`, `--observers`, `--ros` or `--external zenoh:…`: it is of topics, and of keys "
            "of the bus"
        )
    if options.record_split and options.record is None:
        raise SimError("`--record-split` needs `--record`: it splits the bag")
    if options.timeout is not None and external is None and options.pil is None:
        raise SimError("`--timeout` needs `--external` or `--pil`: it limits the wait for the controller")
    if options.timeout is not None and external is not None and external.endswith(FREE_RUNNING):
        raise SimError("`--timeout` does not go with `,free-running`: nobody waits for the controller")
    timeout_ms = TIMEOUT_MS if options.timeout is None else min(2**31 - 1, max(1, int(options.timeout * 1000)))
    if options.pil is not None:
        return _fly_on_processor(options, timeout_ms)
    server = None
    if options.socket is not None:
        server = Server(options.socket, options.token, options.checkpoints, options.paused)
    config = _load(options)
    _check_parameters(options, config)
    summary = run(
        config,
        bag=options.record,
        split=options.record_split,
        name_space=options.namespace,
        external=external,
        timeout_ms=timeout_ms,
        speed=options.speed,
        server=server,
        sender=None if options.telemetry is None else Sender(options.telemetry, options.telemetry_fields),
        observers=options.observers,
        ros=options.ros,
        watcher=Watcher(as_json=True) if options.json else _Printer(config, external),
        restore=options.restore,
        save=options.save,
    )
    if options.json:
        show(json.dumps(summary.as_json(), indent=2))
    else:
        _print_summary(config, summary)
    return EXIT_UNTIL_NOT_HELD if summary.until_held is False else 0


def _check_parameters(options: argparse.Namespace, config: SimConfig) -> None:
    """Raises SimError where the controllers cannot begin with those that are given."""
    if config.plan.parameters is None:
        return
    what = "`--parameters`" if options.parameters is not None else "`--set` of a controller's parameter"
    if options.external is not None:
        raise SimError(
            f"{what} is for controllers in this process; give them to the external one: fcsl-fc --parameters"
        )
    if options.restore is not None:
        raise SimError(f"{what} does not go with `--restore`: the checkpoint has the parameters of its flight")
    if options.pil is not None:
        raise SimError(f"{what} does not go with `--pil`: the processor flies the compiled values")


#: Options of `run` that need a flight which is not compared with another.
_ONE_FLIGHT = ("external", "record", "socket", "telemetry", "observers", "ros", "restore", "save", "speed")


def _fly_on_processor(options: argparse.Namespace, timeout_ms: int) -> int:
    from .pil import check_peer, compare

    check_peer(options.pil)
    others = [f"`--{name}`" for name in _ONE_FLIGHT if getattr(options, name)]
    if others:
        raise SimError(
            f"`--pil` flies twice and compares; it does not go with {', '.join(others)}. A board on a serial line flies once with "
            "`--external wire:uart:DEVICE:BAUD`"
        )
    config = _load(options)
    _check_parameters(options, config)
    found = compare(config, options.pil, timeout_ms)
    if options.json:
        show(json.dumps(found.as_json(), indent=2))
    else:
        for name, flight in (("in this process", found.here), (f"on {found.peer}", found.there)):
            fields = f", fields {flight.fields}" if flight.fields else ""
            show(f"{name}: {len(flight.truth)} ticks in {flight.seconds:.3f} s, truth {flight.digest}{fields}")
        show(f"the flights differ: {found.difference}" if found.difference else "the flights are the same, bit for bit")
    return EXIT_DIFFERENT if found.difference else 0


class _Printer(Watcher):
    """Tells people."""

    def __init__(self, config: SimConfig, external: str | None):
        super().__init__()
        self._config, self._external = config, external

    def listening(self) -> None:
        serial = str(self._external).startswith("wire:uart:")
        end = "wire:uart:DEVICE:BAUD with the device at the other end of the line" if serial else self._external
        waits = "a controller may come" if str(self._external).endswith(FREE_RUNNING) else "waiting for a controller"
        show(f"{waits}: fcsl-fc {self._config.library} --hal {end}")

    def serving(self, address: str) -> None:
        show(f"variables on {address}")

    def changed(self, change: StateChange) -> None:
        show(f"{change.time_s:10.3f} s  {change.from_state} -> {change.to_state}")


def _value_text(value: Scalar | list[Scalar]) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_value_text(v) for v in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _factor_text(factor: float) -> str:
    return f"{factor:.0f}" if factor >= 100 else f"{factor:.3g}"


def _print_summary(config: SimConfig, summary: Summary) -> None:
    why = "the stop condition held" if summary.end == "until" else "the duration is over"
    show(f"{summary.time_s:10.3f} s  end: {why}")
    values = []
    for name, table in config.tables.items():
        if table.integrated or table.name == SERIAL_LINK:
            for field in table.of_role("output"):
                value = _value_text(summary.truth[f"{name}.{field.path}"])
                values.append(f"  {name}.{field.path} = {value}{' ' + field.unit if field.unit else ''}")
    if values:
        show("\n".join([f"{summary.truth_time_s:10.3f} s  values of the last tick:", *values]))
    show(
        f"seed {summary.seed}: {summary.ticks - summary.from_tick} ticks in {summary.wall_s:.3f} s, "
        f"{_factor_text(summary.real_time_factor)} times real time"
    )
    for transition, count in (summary.lost_requests or {}).items():
        show(f"lost requests: {transition} {count}")
    for line in requirement_lines(list((summary.requirements or {}).values())):
        show(line)
    if summary.times:
        show("\n".join(table_lines(summary.times, config.machine.tick_hz)))
    if summary.telemetry:
        counts = summary.telemetry
        show(
            f"telemetry: {counts['packets']} packets, {counts['overwritten']} overwritten, {counts['configurations']} configurations, "
            f"{counts['datagrams']} datagrams sent, {counts['failures']} were returned or not accepted"
        )
    if summary.commands:
        counts = summary.commands
        show(
            f"commands: in {counts['commands']} ticks; none in {counts['ticks_without']}, at most "
            f"{counts['longest_without']} in a row"
        )
    if summary.observers:
        show(f"observers: {summary.observers['ticks']} ticks, {summary.observers['dropped']} dropped")
    if summary.ros:
        show(
            f"ROS 2 topics: {summary.ros['ticks']} ticks, {summary.ros['dropped']} dropped, {summary.ros['refused']} messages refused"
        )
    for name, companion in summary.companions.items():
        show(f"controller {name}: {companion['ticks']} ticks, {companion['state']}")
        for transition, count in companion["lost_requests"].items():
            show(f"controller {name}: lost requests: {transition} {count}")
        for line in requirement_lines(list(companion["requirements"].values())):
            show(f"controller {name}: {line}")
        if companion["times"]:
            show("\n".join([f"controller {name}:", *table_lines(companion["times"], config.machines[name].tick_hz)]))
    if summary.bag:
        show(f"bag: {', '.join([summary.bag, *(str(c['bag']) for c in summary.companions.values())])}")
    if summary.until_held is False:
        show(f"until never held: {config.until}")


_COMMANDS = {
    "check": _check,
    "run": _run,
    "plot": _plot,
    "campaign": _campaign,
    "tune": _tune,
    "trim": _trim,
    "linearise": _linearise,
    "response": _response,
    "list-models": _list_models,
    "describe": _describe,
}
