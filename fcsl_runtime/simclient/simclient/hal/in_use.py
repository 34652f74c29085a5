# SPDX-License-Identifier: Apache-2.0
"""Whether a program of FCSL that runs now has an actuator device, or flies with its board.

The command lines of processes tell: fcsl-guard with `--board PLAN` or `--actuator CHANNEL=DRIVER:DEVICE`, fcsl-fc with `--hal
linux:PLAN` or `composite:PLAN,…`. Other programs, and FCSL in another container, are not seen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..board.plan import read_plan
from ..errors import TwinError

_GUARD, _FLIGHT = "fcsl-guard", "fcsl-fc"
_HAL = re.compile(r"linux:(?P<plan>.*)|composite:(?P<composite>.*?),(wire:|zenoh).*", re.DOTALL)


def user_of(address: str, proc: Path = Path("/proc")) -> str:
    """A program that has the device, for people; "" if none is seen."""
    for folder in sorted(path for path in proc.iterdir() if path.name.isdigit()):
        try:
            arguments = (folder / "cmdline").read_text("utf-8", "surrogateescape").split("\0")
        except OSError:
            continue  # it has ended
        program = next((name for name in (Path(a).name for a in arguments[:2]) if name in (_GUARD, _FLIGHT)), "")
        if program and (why := _use(program, arguments, folder, address)):
            return f"{program} (process {folder.name}) {why}"
    return ""


def _use(program: str, arguments: Sequence[str], folder: Path, address: str) -> str:
    """How it uses the device; "" if it does not."""
    if program == _GUARD:
        plans = list(_values_of("--board", arguments))
        if any(_is_same(text.partition("=")[2], address) for text in _values_of("--actuator", arguments)):
            return "drives this device"
    else:
        hals = filter(None, map(_HAL.fullmatch, _values_of("--hal", arguments)))
        plans = [hal["plan"] or hal["composite"] for hal in hals]
    for plan in plans:
        try:
            found = read_plan(str((folder / "cwd").readlink() / plan))
        except (OSError, TwinError):
            return f"runs with a board that cannot be read, {plan}"
        used = {output.device for output in found.outputs} | {p.device for p in found.pins if p.safe is not None}
        if any(_is_same(f"{d.driver}:{d.address}", address) for d in found.devices.values() if d.name in used):
            return f"runs with the board {plan}, which has this device"
    return ""


def _values_of(option: str, arguments: Sequence[str]) -> Iterator[str]:
    """getopt_long takes the beginning of an option for the option."""
    for argument, value in zip(arguments, [*arguments[1:], ""], strict=True):
        name, equals, given = argument.partition("=")
        if len(name) > len("--") and option.startswith(name):
            yield given if equals else value


def _is_same(text: str, address: str) -> bool:
    """Whether DRIVER[.SIGNAL][:DEVICE] names this device. What stands behind its @, such as a rate, does not tell devices apart."""
    plain = re.escape(address.partition("@")[0])
    return re.fullmatch(rf".*:{plain}(@.*)?", text, re.DOTALL) is not None
