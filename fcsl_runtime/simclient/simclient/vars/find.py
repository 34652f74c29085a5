# SPDX-License-Identifier: Apache-2.0
"""Finds the address of a variable server: the user's, or that of the only server of this user."""

from __future__ import annotations

import os
from pathlib import Path

from .wire import VarError

#: Programs with a variable server.
_PROGRAMS = ("fcsl-fc", "fcsl-sim")
_OPTION = "--socket"
VARIABLE = "FCSL_SOCKET"


def find_address(given: str | None) -> str:
    """`given`, else the environment's FCSL_SOCKET, else the address of this user's only running flight program or
    simulator.

    Raises VarError if there is none, or several.
    """
    wanted = given or os.environ.get(VARIABLE)
    if wanted:
        return wanted
    found = running_servers()
    if len(found) == 1:
        return found[0]
    reason = "none of your fcsl-fc and fcsl-sim serves variables" if not found else f"several run: {', '.join(found)}"
    raise VarError("unreachable", f"which machine? {reason}; name its address with --socket or {VARIABLE}")


def running_servers(proc: Path = Path("/proc")) -> list[str]:
    """Addresses (`--socket`) of this user's running programs."""
    found = []
    for folder in proc.iterdir():
        if not folder.name.isdigit():
            continue
        try:
            if folder.stat().st_uid != os.getuid():
                continue
            arguments = (folder / "cmdline").read_text("utf-8", "surrogateescape").split("\0")
            # For a Python program, the interpreter is the first argument.
            if not any(Path(argument).name in _PROGRAMS for argument in arguments[:2]):
                continue
            address = _address_in(arguments)
            if address and not address.startswith("tcp:"):
                address = str((folder / "cwd").readlink() / address)
        except OSError:
            continue  # it has ended, or is not readable
        if address and (address.startswith("tcp:") or Path(address).is_socket()):
            found.append(address)
    return sorted(found)


def _address_in(arguments: list[str]) -> str:
    for option, value in zip(arguments, [*arguments[1:], ""], strict=True):
        if option == _OPTION:
            return value
        if option.startswith(f"{_OPTION}="):
            return option.partition("=")[2]
    return ""
