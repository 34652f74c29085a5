# SPDX-License-Identifier: Apache-2.0
"""First process of the guest: mounts, brings up the loopback, runs the command of ORDERS, hands its exit status to the kernel, powers off.

Started as `python3 -I -S init.py FOLDER`, so it imports the standard library only.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import socket
import struct
import subprocess
import sys
import traceback
import tty
from pathlib import Path
from typing import Any

ORDERS = "orders.json"  # machine.ORDERS
_CANNOT_START = 127
_RB_POWER_OFF = 0x4321FEDC
_MS_RDONLY = 1
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 1
#: Folder, file system, options. /proc and /sys are folders of the host, empty in the guest until they are mounted.
_MOUNTS = (
    ("/proc", "proc", ""),
    ("/sys", "sysfs", ""),
    ("/sys/kernel/config", "configfs", ""),
    ("/dev", "devtmpfs", ""),
    ("/dev/pts", "devpts", "ptmxmode=0666"),
    ("/dev/shm", "tmpfs", "mode=1777"),
    ("/run", "tmpfs", ""),
    ("/tmp", "tmpfs", "mode=1777"),
)
_OUTPUT, _ERRORS = "/dev/tty1", "/dev/tty2"
_libc = ctypes.CDLL(None, use_errno=True)


def mount(folder: str, kind: str, options: str, flags: int = 0) -> None:
    if _libc.mount(b"none", folder.encode(), kind.encode(), flags, options.encode()) != 0:
        raise OSError(ctypes.get_errno(), f"mount {kind}", folder)


def mount_all(readable: list[str], writable: list[str]) -> None:
    for folder, kind, options in _MOUNTS:
        Path(folder).mkdir(exist_ok=True)
        mount(folder, kind, options)
    for folder, flags in (*((folder, _MS_RDONLY) for folder in readable), *((folder, 0) for folder in writable)):
        Path(folder).mkdir(parents=True, exist_ok=True)
        mount(folder, "hostfs", folder, flags)
    os.symlink("/proc/self/fd", "/dev/fd")


def open_console(path: str) -> int:
    """Opens it for output, raw: a line ends as the program wrote it."""
    console = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(console)
    return console


def raise_loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sH14x", b"lo", 0)
        (flags,) = struct.unpack_from("H", fcntl.ioctl(any_socket, _SIOCGIFFLAGS, request), 16)
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", flags | _IFF_UP))


def run(orders: dict[str, Any]) -> int:
    output, errors = open_console(_OUTPUT), open_console(_ERRORS)
    try:
        done = subprocess.run(
            orders["command"],
            env=orders["env"],
            cwd=orders["cwd"],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=errors,
        )
    except OSError as error:
        os.write(errors, f"{error}\n".encode())
        return _CANNOT_START
    return done.returncode if done.returncode >= 0 else 128 - done.returncode


def main() -> None:
    orders = json.loads((Path(sys.argv[1]) / ORDERS).read_text())
    mount_all(orders["readable"], orders["writable"])
    raise_loopback()
    status = run(orders)
    Path("/proc/exitcode").write_text(f"{status}\n")
    os.sync()
    _libc.reboot(_RB_POWER_OFF)


if __name__ == "__main__":
    try:
        main()
    except Exception:
        traceback.print_exc()  # on the kernel's console; the kernel panics as soon as this process is gone
