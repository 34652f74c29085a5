# SPDX-License-Identifier: Apache-2.0
"""docs/guide/monitoring.md: its flight, received with the page's code, prints the shown output."""

import contextlib
import io
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import simclient
from fcsl_compiler.base.packages import package_prefix

DOC = Path(__file__).resolve().parents[1] / "docs/guide/monitoring.md"


def section() -> str:
    return DOC.read_text().partition("\n### Receiver in Python\n")[2].partition("\n### ")[0]


def block(kind: str) -> str:
    (found,) = re.findall(rf"^```{kind}\n(.*?)^```$", section(), re.DOTALL | re.MULTILINE)
    return str(found)


@pytest.fixture
def flights() -> Iterator[list[subprocess.Popen[str]]]:
    started: list[subprocess.Popen[str]] = []
    yield started
    for flight in started:
        flight.kill()
        flight.communicate()


def test_the_example(flights: list[subprocess.Popen[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    """With a free port instead of the page's: the flight is started once it is known."""
    command = block("sh flight").replace("install/minimal", package_prefix("minimal").as_posix())
    assert command.count("7600") == 1

    class Telemetry(simclient.Telemetry):
        def __init__(self, port: int, *rest: Any):
            assert port == 7600
            super().__init__(0, *rest)
            words = shlex.split(command.replace("7600", str(self.port)))
            flights.append(subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))

    monkeypatch.setattr(simclient, "Telemetry", Telemetry)
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(block("python"), str(DOC), "exec"), {})
    assert printed.getvalue() == block("text")


def test_the_lists_name_every_count() -> None:
    from simclient.telemetry.counts import Counts

    named = re.findall(r"^- `([a-z_]+)`: ", section(), re.MULTILINE)
    assert ["received", *named] == list(Counts.__dataclass_fields__)
