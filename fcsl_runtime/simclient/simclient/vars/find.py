# SPDX-License-Identifier: Apache-2.0
"""Finds the address of a variable server: the user's, or that of the only server of this user."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from .wire import VarError

#: Programs with a variable server.
_PROGRAMS = ("fcsl-fc", "fcsl-sim")
_OPTION = "--socket"
VARIABLE = "FCSL_SOCKET"


class Server(NamedTuple):
    """A running program with a variable server; its address is as given to its `--socket`."""

    address: str
    program: str
    process: int

    def __str__(self) -> str:
        return f"{self.program} (process {self.process}) on {self.address}"


def named_address(given: str | None) -> str | None:
    """`given`, else the environment's FCSL_SOCKET, else None."""
    return given or os.environ.get(VARIABLE)


def find_server() -> Server:
    """This user's only running flight program or simulator with a variable server. Raises VarError for none, or several."""
    found = running_servers()
    if len(found) == 1:
        return found[0]
    reason = (
        "none of your fcsl-fc and fcsl-sim serves variables"
        if not found
        else f"several run: {', '.join(map(str, found))}"
    )
    raise VarError("unreachable", f"which machine? {reason}; name its address with --socket or {VARIABLE}")


def _program_of(arguments: list[str]) -> str | None:
    """Which of the programs with a variable server this command line starts. A Python program has its interpreter before it."""
    names = [Path(argument).name for argument in arguments[:3]]
    for name, verb in zip(names[:2], names[1:], strict=False):
        if name in _PROGRAMS:
            return name
        if (name, verb) == ("fcsl", "sim"):
            return "fcsl-sim"
    return None


def running_servers(proc: Path = Path("/proc")) -> list[Server]:
    """This user's running programs with a variable server, by address."""
    found = []
    for folder in proc.iterdir():
        if not folder.name.isdigit():
            continue
        try:
            if folder.stat().st_uid != os.getuid():
                continue
            arguments = (folder / "cmdline").read_text("utf-8", "surrogateescape").split("\0")
            program = _program_of(arguments)
            if program is None:
                continue
            address = _address_in(arguments)
            if address and not address.startswith("tcp:"):
                address = str((folder / "cwd").readlink() / address)
        except OSError:
            continue  # it has ended, or is not readable
        if address and (address.startswith("tcp:") or Path(address).is_socket()):
            found.append(Server(address, program, int(folder.name)))
    return sorted(found)


def _address_in(arguments: list[str]) -> str:
    for option, value in zip(arguments, [*arguments[1:], ""], strict=True):
        if option == _OPTION:
            return value
        if option.startswith(f"{_OPTION}="):
            return option.partition("=")[2]
    return ""
