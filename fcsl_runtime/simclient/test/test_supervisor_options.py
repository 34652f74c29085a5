# SPDX-License-Identifier: Apache-2.0
"""Options of a request become arguments of the program, or are refused with what was expected: every option's bounds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from simclient.supervisor.files import Root
from simclient.supervisor.http_error import HttpError
from simclient.supervisor.options import KINDS, arguments_of

ACCEPTED: list[tuple[str, str, Any, list[str]]] = [
    ("simulation", "seed", 0, ["--seed=0"]),
    ("simulation", "seed", 2**64 - 1, ["--seed=18446744073709551615"]),
    ("simulation", "duration", 1e9, ["--duration=1000000000.0"]),
    ("simulation", "duration", 0.25, ["--duration=0.25"]),
    ("simulation", "speed", 0, ["--speed=0"]),
    ("simulation", "speed", 1e-9, ["--speed=1e-09"]),
    ("simulation", "speed", 1e9, ["--speed=1000000000.0"]),
    ("simulation", "set", {}, []),
    (
        "simulation",
        "set",
        {"altimeter.parameters.sigma": 0.5, "g.v[1][0]": [True, 2]},
        ["--set=altimeter.parameters.sigma=0.5", "--set=g.v[1][0]=[true, 2]"],
    ),
    ("simulation", "set", {"p" * 1024: 1}, [f"--set={'p' * 1024}=1"]),
    ("simulation", "set", {f"p{n}": n for n in range(64)}, [f"--set=p{n}={n}" for n in range(64)]),
    ("flight", "lock_memory", True, ["--lock-memory"]),
    ("flight", "lock_memory", False, []),
    ("flight", "realtime_priority", 99, ["--realtime-priority=99"]),
    ("flight", "record_policy", "wait", ["--record-policy=wait"]),
    ("flight", "record_split", "seconds=60,files=10", ["--record-split=seconds=60,files=10"]),
]
REFUSED: list[tuple[str, str, Any, str]] = [
    ("simulation", "seed", -1, "an integer from 0 to 18446744073709551615"),
    ("simulation", "seed", 2**64, "an integer from 0 to"),
    ("simulation", "seed", True, "an integer from 0 to"),
    ("simulation", "duration", 0, "a number of seconds above 0, 1e9 at most"),
    ("simulation", "duration", 1.1e9, "a number of seconds above 0, 1e9 at most"),
    ("simulation", "duration", True, "a number of seconds"),
    ("simulation", "speed", 1e-10, "simulated seconds per second"),
    ("simulation", "speed", 1.1e9, "simulated seconds per second"),
    ("simulation", "speed", math.nan, "simulated seconds per second"),
    ("simulation", "set", [], "an object of at most 64 parameters"),
    ("simulation", "set", {f"p{n}": n for n in range(65)}, "an object of at most 64 parameters"),
    ("simulation", "set", {"-p": 1}, 'paths such as altimeter.parameters.sigma, not "-p"'),
    ("simulation", "set", {"a b": 1}, "paths such as altimeter.parameters.sigma"),
    ("simulation", "set", {"p" * 1025: 1}, "paths such as altimeter.parameters.sigma"),
    ("simulation", "set", {"p": "1"}, "finite numbers, true, false or lists of them"),
    ("simulation", "set", {"p": [1, [math.inf]]}, "finite numbers, true, false or lists of them"),
    ("flight", "lock_memory", 1, "true or false"),
    ("flight", "realtime_priority", 0, "an integer from 1 to 99"),
    ("flight", "realtime_priority", 100, "an integer from 1 to 99"),
    ("flight", "record_policy", "lose", "wait or drop"),
]


@pytest.mark.parametrize(("kind", "option", "value", "arguments"), ACCEPTED)
def test_an_option_becomes_one_argument_per_value(
    kind: str, option: str, value: Any, arguments: list[str], tmp_path: Path
) -> None:
    assert arguments_of(KINDS[kind], {option: value}, Root(tmp_path)) == arguments


@pytest.mark.parametrize(("kind", "option", "value", "expected"), REFUSED)
def test_a_value_out_of_its_bounds_is_refused(
    kind: str, option: str, value: Any, expected: str, tmp_path: Path
) -> None:
    with pytest.raises(HttpError) as caught:
        arguments_of(KINDS[kind], {option: value}, Root(tmp_path))
    assert caught.value.status == 400 and f"option {option!r}: expected {expected}" in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_a_parameter_file_lies_below_the_root(kind: str, tmp_path: Path) -> None:
    (tmp_path / "tuned.yaml").write_text("")
    arguments = arguments_of(KINDS[kind], {"parameters": "tuned.yaml"}, Root(tmp_path))
    assert arguments == [f"--parameters={tmp_path.resolve()}/tuned.yaml"]
    with pytest.raises(HttpError):
        arguments_of(KINDS[kind], {"parameters": "../tuned.yaml"}, Root(tmp_path))
