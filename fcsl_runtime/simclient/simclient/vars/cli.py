# SPDX-License-Identifier: Apache-2.0
"""fcsl-var: reads and writes the values of a running machine from the command line (docs/variables.md)."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from typing import Any

from fcsl_compiler.base.version import add_version

from ..checkpoint import read_checkpoint, tick_of, write_checkpoint
from ..errors import TwinError
from .client import VarClient
from .complete import SHELLS, complete, words_of
from .find import VARIABLE, find_server, named_address
from .show import flat, jsonable, read_value, show_value, table, with_unit
from .watch import plot, units_of, watch
from .wire import VarError

EXIT_REFUSED, EXIT_UNREACHABLE = 1, 2
_UNREACHABLE = ("unreachable", "unnamed", "closed", "timeout", "protocol", "unauthorized")
_TICKS_PER_REQUEST = 20_000
_EPILOG = """\
The machine is that of --socket (a path, or tcp:HOST:PORT with --token FILE), else of FCSL_SOCKET. Commands that only
read otherwise take the only fcsl-fc or fcsl-sim of this user that runs with --socket, and say which. A path is a field, a part of it (p[0], p[1:3]) or, for get,
a prefix of several (nav.outputs). Exit status: 0; 1 if the machine refuses; 2 if there is none, or for wrong usage.
Completion of commands and paths: eval "$(fcsl-var completion bash)", or zsh"""


def main(arguments: Sequence[str]) -> int:
    asked, *words = arguments or [""]
    if asked in ("complete", "complete-line"):
        print("\n".join(complete(words if asked == "complete" else words_of(" ".join(words))[1:])))
        return 0
    chosen = _parser().parse_args(arguments, argparse.Namespace(socket=None, token=None, json=False))
    try:
        run: Callable[[argparse.Namespace], None] = chosen.run
        run(chosen)
    except VarError as error:
        message = str(error).replace('say "allow_non_finite": true', "say --allow-non-finite")
        message += ": name its file, --token FILE" if error.code == "unauthorized" and chosen.token is None else ""
        print(f"fcsl-var: {message}", file=sys.stderr)
        return EXIT_UNREACHABLE if error.code in _UNREACHABLE else EXIT_REFUSED
    return 0


def _common() -> argparse.ArgumentParser:
    """Options that may precede or follow the command; a missing one must not override a given one."""
    common = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    common.add_argument("--socket", metavar="ADDRESS", help="address of the machine's variable server")
    common.add_argument("--token", metavar="FILE", help="the token of a TCP server")
    common.add_argument("--json", action="store_true", help="output for programs: one JSON value (watch: one per line)")
    return common


def _parser() -> argparse.ArgumentParser:
    common = _common()
    parser = argparse.ArgumentParser(
        prog="fcsl-var",
        parents=[common],
        description="The values of a running machine.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_version(parser, "simclient", __file__)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, run: Callable[[argparse.Namespace], None], text: str) -> argparse.ArgumentParser:
        command: argparse.ArgumentParser = commands.add_parser(name, parents=[common], help=text, description=text)
        command.set_defaults(run=run)
        return command

    add("list", _list, "lists paths, with type, unit and meaning").add_argument("prefix", nargs="?", default="")
    add("get", _get, "prints values, all of one tick").add_argument("paths", nargs="+", metavar="PATH")
    command = add("set", _set, "writes values before the next tick: all, or none if one is refused")
    command.add_argument("values", nargs="+", metavar="PATH=VALUE")
    command.add_argument("--allow-non-finite", action="store_true", help="accept nan, inf and -inf")
    for name, run, text in (
        (
            "watch",
            _watch,
            "prints values while the machine runs: in place on a terminal, else a line per sample; until Ctrl-C",
        ),
        ("plot", _plot, "plots curves in the terminal, until Ctrl-C"),
    ):
        command = add(name, run, text)
        command.add_argument("paths", nargs="+", metavar="PATH")
        command.add_argument("--every", type=_count, default=1, metavar="N", help="every N-th tick (default 1)")
        command.add_argument("--ticks", type=_count, metavar="N", help="end with the last sample due within N ticks")
    command.add_argument("--window", type=_count, default=500, metavar="N", help="samples in the picture (default 500)")
    add("eval", _eval, "computes with fields: 'abs(nav.outputs.x) > 1'").add_argument("expression")
    add("tick", _tick, "runs ticks, while paused").add_argument("count", nargs="?", type=_count, default=1)
    for name, text in (
        ("pause", "stops the machine; then only tick runs it"),
        ("resume", "runs the machine in real time"),
        ("state", "prints tick, state, next state"),
        ("stats", "prints the program's counters and the lateness of its ticks"),
    ):
        add(name, _simple, text).set_defaults(command=name)
    add("set-state", _set_state, "enters a state at once").add_argument("state")
    for name, run, text in (
        ("save", _save, "writes a checkpoint"),
        ("restore", _restore, "restores a checkpoint"),
    ):
        command = add(name, run, text)
        command.add_argument("file")
        command.add_argument(
            "--remote", action="store_true", help="FILE is in the program's own folder (--checkpoints)"
        )
    command.add_argument(
        "--ignore-source-hash",
        action="store_true",
        help="also accept a checkpoint of other sources with the same layout",
    )
    add("describe", _describe, "describes a field; without a path, the machine").add_argument("path", nargs="?")
    completion = commands.add_parser("completion", help="prints a shell script that completes commands and paths")
    completion.add_argument("shell", choices=list(SHELLS))
    completion.set_defaults(run=lambda chosen: print(SHELLS[chosen.shell]))
    return parser


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) < 2**32:
        raise argparse.ArgumentTypeError(f"a whole number from 1 on wanted, not {text!r}")
    return int(text)


def _open(chosen: argparse.Namespace, changes: bool = False) -> VarClient:
    """Of a machine that the user did not name, says which one it is; such a machine is read, and not changed."""
    address = named_address(chosen.socket)
    if address is None:
        server = find_server()
        if changes:
            raise VarError(
                "unnamed",
                f"which machine? {server} runs; name it with --socket or {VARIABLE}, since this command changes it",
            )
        print(f"fcsl-var: {server}", file=sys.stderr)
        address = server.address
    return VarClient(address, chosen.token)


def _print(chosen: argparse.Namespace, value: Any, text: Callable[[], str]) -> None:
    print(json.dumps(jsonable(value)) if chosen.json else text())


def _status(reply: dict[str, Any]) -> str:
    state = reply.get("state", "")
    change = f" → {reply['next_state']}" if reply.get("next_state", state) != state else ""
    return f"tick {reply['tick']}  {state}{change}{'  paused' if reply['paused'] else ''}"


# ---- commands that read ----------------------------------------------------------------------------------------------


def _list(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        fields = [client.describe(path) for path in client.list(chosen.prefix)]
    if not fields and not chosen.json:
        raise VarError("unknown_path", f"no path begins with '{chosen.prefix}'")
    _print(chosen, fields, lambda: table([[f["path"], f["type"], f["unit"], f["doc"]] for f in fields]))


def _get(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        values = client.get(*chosen.paths)
        if chosen.json:
            print(json.dumps(jsonable(values)))
            return
        rows = [row for path, value in values.items() for row in flat(path, value)]
        units = units_of(client, [path for path, _ in rows])
    print(table([[path, with_unit(show_value(value), units[path])] for path, value in rows]))


def _eval(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        value = client.eval(chosen.expression)
    _print(chosen, value, lambda: show_value(value))


def _describe(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        told = _without_ok(client.describe(chosen.path))
    _print(
        chosen,
        told,
        lambda: table([[name, show_value(value)] for name, value in told.items() if value not in ("", [])]),
    )


def _watch(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        try:
            watch(client, chosen.paths, chosen.every, chosen.ticks, chosen.json)
        except KeyboardInterrupt:
            pass  # the normal end


def _plot(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        try:
            plot(client, chosen.paths, chosen.every, chosen.ticks, chosen.window)
        except KeyboardInterrupt:
            pass


# ---- commands that write ---------------------------------------------------------------------------------------------


def _set(chosen: argparse.Namespace) -> None:
    values = {path: read_value(value) for path, value in _assignments(chosen.values)}
    with _open(chosen, changes=True) as client:
        reply = client.set(values, chosen.allow_non_finite)
    _print(chosen, _without_ok(reply), lambda: _status(reply))
    for path, writer in reply["overwritten_by"].items():
        print(f"fcsl-var: note: {path} will be overwritten by {writer}", file=sys.stderr)


def _assignments(words: Sequence[str]) -> list[tuple[str, str]]:
    """`PATH=VALUE …`, or a single `PATH VALUE`."""
    if len(words) == 2 and "=" not in words[0] and "=" not in words[1]:
        return [(words[0].strip(), words[1].strip())]
    found = []
    for word in words:
        path, equals, value = word.partition("=")
        if not equals:
            raise VarError("bad_request", f"set takes PATH=VALUE, one or more times, or one PATH VALUE, not '{word}'")
        found.append((path.strip(), value.strip()))
    return found


def _tick(chosen: argparse.Namespace) -> None:
    with _open(chosen, changes=True) as client:
        left = chosen.count
        while left > 0:  # in portions that are answered within the timeout
            client.tick(min(left, _TICKS_PER_REQUEST))
            left -= _TICKS_PER_REQUEST
        reply = client.state()
    _print(chosen, _without_ok(reply), lambda: _status(reply))


def _simple(chosen: argparse.Namespace) -> None:
    with _open(chosen, changes=chosen.command in ("pause", "resume")) as client:
        reply = _without_ok(getattr(client, chosen.command)())
    if chosen.command != "stats":
        _print(chosen, reply, lambda: _status(reply))
        return
    rows = [row for name, value in reply.items() for row in flat(name, value)]
    # Histogram buckets are printed only with --json.
    _print(chosen, reply, lambda: table([[n, show_value(value)] for n, value in rows if not isinstance(value, list)]))


def _set_state(chosen: argparse.Namespace) -> None:
    with _open(chosen, changes=True) as client:
        reply = _without_ok(client.set_state(chosen.state))
    _print(chosen, reply, lambda: _status(reply))


def _save(chosen: argparse.Namespace) -> None:
    with _open(chosen) as client:
        if chosen.remote:
            reply = client.save_to(chosen.file)
            tick, size = reply["tick"], reply["bytes"]
        else:
            checkpoint = client.save()
            tick, size = tick_of(checkpoint), len(checkpoint)
            try:
                write_checkpoint(chosen.file, checkpoint)
            except TwinError as error:
                raise VarError("bad_value", str(error)) from None
    _print(chosen, {"tick": tick, "bytes": size}, lambda: f"tick {tick}, {size} bytes: {chosen.file}")


def _restore(chosen: argparse.Namespace) -> None:
    try:
        checkpoint = b"" if chosen.remote else read_checkpoint(chosen.file)
    except TwinError as error:
        raise VarError("bad_value", f"{chosen.file}: {error}") from None
    with _open(chosen, changes=True) as client:
        if chosen.remote:
            reply = client.restore_from(chosen.file, chosen.ignore_source_hash)
        else:
            reply = client.restore(checkpoint, chosen.ignore_source_hash)
    _print(chosen, _without_ok(reply), lambda: _status(reply))


def _without_ok(reply: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in reply.items() if name not in ("ok", "id")}
