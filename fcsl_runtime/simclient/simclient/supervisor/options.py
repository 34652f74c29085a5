# SPDX-License-Identifier: Apache-2.0
"""Options of a run in a request: closed lists; each value is checked and converted to program arguments.

Every value is joined to its flag (`--ticks=5`), so that no value can be read as a flag.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .files import Root
from .http_error import HttpError, nearest

#: Converts (flag, value, root) to arguments. Raises HttpError.
Reader = Callable[[str, Any, Root], list[str]]
_TEXT_BYTES = 1024
_SETS = 64
_EVERY_MAX = 1_000_000


def _bad(flag: str, value: object, expected: str) -> HttpError:
    shown = json.dumps(value, default=str)
    return HttpError(400, "bad_value", f"option {flag!r}: expected {expected}, not {shown[:80]}")


def _integer(least: int, most: int) -> Reader:
    def read(flag: str, value: Any, root: Root) -> list[str]:
        if type(value) is not int or not least <= value <= most:
            raise _bad(flag, value, f"an integer from {least} to {most}")
        return [f"{_dashed(flag)}={value}"]

    return read


def _flag(flag: str, value: Any, root: Root) -> list[str]:
    if not isinstance(value, bool):
        raise _bad(flag, value, "true or false")
    return [_dashed(flag)] if value else []


def _word(*words: str) -> Reader:
    def read(flag: str, value: Any, root: Root) -> list[str]:
        if value not in words or not isinstance(value, str):
            raise _bad(flag, value, " or ".join(words))
        return [f"{_dashed(flag)}={value}"]

    return read


def _text(pattern: str) -> Reader:
    def read(flag: str, value: Any, root: Root) -> list[str]:
        if not isinstance(value, str) or len(value) > _TEXT_BYTES or not re.fullmatch(pattern, value, re.ASCII):
            raise _bad(flag, value, f"a text of {pattern}")
        return [f"{_dashed(flag)}={value}"]

    return read


def _file(suffix: str) -> Reader:
    return lambda flag, value, root: [f"{_dashed(flag)}={root.existing(f'option {flag!r}', value, suffix)}"]


def _new_file(flag: str, value: Any, root: Root) -> list[str]:
    return [f"{_dashed(flag)}={root.new(f'option {flag!r}', value)}"]


def _speed(flag: str, value: Any, root: Root) -> list[str]:
    if type(value) not in (int, float) or not (value == 0 or 1e-9 <= value <= 1e9):
        raise _bad(flag, value, "simulated seconds per second from 1e-9 to 1e9, or 0 for as fast as possible")
    return [f"{_dashed(flag)}={value!r}"]


def _seconds(flag: str, value: Any, root: Root) -> list[str]:
    if type(value) not in (int, float) or not 0 < value <= 1e9:
        raise _bad(flag, value, "a number of seconds above 0, 1e9 at most")
    return [f"{_dashed(flag)}={value!r}"]


def _sets(flag: str, value: Any, root: Root) -> list[str]:
    if not isinstance(value, dict) or len(value) > _SETS:
        raise _bad(flag, value, f"an object of at most {_SETS} parameters, from path to value")
    arguments = []
    for path, number in value.items():
        if not re.fullmatch(r"[A-Za-z_][\w.\[\],]*", path, re.ASCII) or len(path) > _TEXT_BYTES:
            raise _bad(flag, path, "paths such as altimeter.parameters.sigma")
        if not _plain(number):
            raise _bad(flag, number, "finite numbers, true, false or lists of them")
        arguments.append(f"{_dashed(flag)}={path}={json.dumps(number)}")
    return arguments


def _plain(value: Any) -> bool:
    if isinstance(value, list):
        return all(_plain(item) for item in value)
    return isinstance(value, (bool, int)) or (isinstance(value, float) and math.isfinite(value))


def _every(flag: str, value: Any, root: Root) -> list[str]:
    """A part of the telemetry address, which the run adds."""
    _integer(1, _EVERY_MAX)(flag, value, root)
    return []


def _dashed(flag: str) -> str:
    return "--" + flag.replace("_", "-")


_NAME, _NAMESPACE, _GLOBS = r"[A-Za-z_]\w*", r"/?[A-Za-z_][\w/]*", r"[\w.*?\[\],-]+"
_SPLIT = r"[a-z]+=[\d.]+(,[a-z]+=[\d.]+)*"
_ANY_TICKS = 2**63 - 1
_COMMON: Mapping[str, Reader] = {
    "paused": _flag,
    "record": _new_file,
    "namespace": _text(_NAMESPACE),
    "telemetry_every": _every,
    "telemetry_fields": _text(_GLOBS),
    "parameters": _file(""),
}


@dataclass(frozen=True)
class Kind:
    """A program that can be started, with the options that a request may set."""

    package: str
    program: str
    command: tuple[str, ...]
    #: Suffix of the files that it takes.
    suffix: str
    #: Suffix of source files that are compiled first; or empty.
    source_suffix: str
    options: Mapping[str, Reader]
    #: Whether it always ends soon after SIGTERM; otherwise only SIGKILL is reliable.
    ends_itself: bool
    #: Prefix of the line that it prints once its variable server listens.
    serving: bytes
    #: Meanings of its exit statuses.
    meanings: Mapping[int, str]


KINDS: Mapping[str, Kind] = {
    "flight": Kind(
        package="fcsl_runtime",
        program="fcsl-fc",
        command=(),
        suffix=".so",
        source_suffix=".json",
        options={
            **_COMMON,
            "machine": _text(_NAME),
            "board": _file(".so"),
            "ticks": _integer(1, _ANY_TICKS),
            "restore": _file(""),
            "ignore_source_hash": _flag,
            "rate": _word("realtime", "max"),
            "missed_deadline": _word("catch-up", "skip", "stop"),
            "realtime_priority": _integer(1, 99),
            "lock_memory": _flag,
            "cpu": _integer(0, 1023),
            "watchdog_ms": _integer(1, 3_600_000),
            "no_overrun_check": _flag,
            "record_fields": _text(_GLOBS),
            "record_policy": _word("wait", "drop"),
            "record_split": _text(_SPLIT),
            "summary": _new_file,
        },
        ends_itself=True,
        serving=b"fcsl-fc: commands on ",
        meanings={
            0: "all ticks completed, or terminated on request",
            1: "something could not be opened, failed in flight or could not be written; see its last line",
            2: "wrong command line or machine; see its lines",
            3: "a deadline was missed, with missed_deadline: stop",
            4: "terminated on request while a step was stuck",
        },
    ),
    "simulation": Kind(
        package="fcsl_sim",
        program="fcsl-sim",
        command=("run",),
        suffix=".sim.json",
        source_suffix="",
        options={**_COMMON, "seed": _integer(0, 2**64 - 1), "duration": _seconds, "speed": _speed, "set": _sets},
        ends_itself=False,
        serving=b"variables on ",
        meanings={
            0: "completed",
            1: "the duration is over, and `until` never held",
            2: "wrong files or options; see its last lines",
            143: "terminated on request",
        },
    ),
}


def _meant(name: str, kind: Kind) -> str:
    """The hint for an option that this kind does not have."""
    owner = next((other for other, one in KINDS.items() if name in one.options), "")
    return f"only a {owner} has it" if owner else nearest(name, kind.options) or ", ".join(kind.options)


def arguments_of(kind: Kind, options: Mapping[str, Any], root: Root) -> list[str]:
    """The program arguments for these options. Raises HttpError."""
    arguments = []
    for name, value in options.items():
        read = kind.options.get(name)
        if read is None:
            raise HttpError(400, "unknown_option", f"no option {name[:80]!r} of {kind.program}", _meant(name, kind))
        arguments += read(name, value, root)
    return arguments
