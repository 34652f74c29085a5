# SPDX-License-Identifier: Apache-2.0
"""Boots user-mode Linux on this computer's files and runs one command inside."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

HERE = Path(__file__).resolve().parent
#: Of the file in the folder of a run from which init.py reads what to do.
ORDERS = "orders.json"
#: Exit status of a run that took too long, as timeout(1) has it; of one whose kernel failed.
TIMED_OUT, KERNEL_FAILED = 124, 125
#: Folders that are the guest's own; init.py mounts them.
_OWN = ("/tmp", "/run", "/dev/shm")
_PANIC = "Kernel panic"
_CHUNK_BYTES = 65536
_MEMORY_MIB = 512


@dataclass(frozen=True)
class Machine:
    """`kernel` is what build.sh printed. The host's files are the guest's, and cannot be written, but for `writable`:
    /tmp, /run and /dev/shm are the guest's own and empty, but for what it needs below them: this workspace, its Python, the
    kernel's folder and this one."""

    kernel: Path
    writable: Sequence[Path] = field(default=())

    def run(self, command: Sequence[str], env: Mapping[str, str], limit_s: float) -> int:
        """Runs `command` as root of the guest, in this folder. Returns its exit status, TIMED_OUT or KERNEL_FAILED."""
        with tempfile.TemporaryDirectory(prefix="fcsl-hardware-") as name:
            folder = Path(name)
            (folder / ORDERS).write_text(json.dumps(self._orders(command, env)))
            return self._boot(folder, limit_s)

    def _orders(self, command: Sequence[str], env: Mapping[str, str]) -> dict[str, object]:
        inside = {name: value for name, value in env.items() if name != "TMPDIR"}  # /tmp is the guest's own
        paths = [str(HERE.parent), *filter(None, [inside.get("PYTHONPATH")])]
        inside |= {"PYTHONPATH": ":".join(paths), "FCSL_I2C_STUB": str(self.kernel.with_name("i2c-stub.ko"))}
        writable = [str(path.resolve(strict=True)) for path in self.writable]
        places = {"cwd": os.getcwd(), "readable": self._hidden(), "writable": writable}
        return {"command": list(command), "env": inside, **places}

    def _hidden(self) -> list[str]:
        """Folders that the guest needs and would not see, those that hold others first."""
        needed = (HERE.parents[1], Path(sys.prefix), Path(sys.base_prefix), self.kernel.parent, Path.cwd())
        found = {path.resolve() for path in needed}
        return sorted(str(path) for path in found if any(Path(own) in path.parents for own in _OWN))

    def _line(self, folder: Path, output: int, errors: int) -> list[str]:
        """The kernel's command line: its messages go to standard output, tty1 and tty2 are the command's output."""
        python = os.path.realpath(sys.executable)
        options = f"mem={_MEMORY_MIB}M root=/dev/root rootfstype=hostfs rootflags=/ ro uml_dir={folder} umid=guest"
        consoles = f"con=null con0=null,fd:1 con1=null,fd:{output} con2=null,fd:{errors}"
        first = f"init={python} -- -I -S {HERE / 'init.py'} {folder}"
        return [str(self.kernel), *options.split(), *consoles.split(), *shlex.split(first)]

    def _boot(self, folder: Path, limit_s: float) -> int:
        pipes = [os.pipe(), os.pipe()]
        messages = folder / "messages.txt"
        with messages.open("wb") as log:
            kernel = subprocess.Popen(
                self._line(folder, pipes[0][1], pipes[1][1]),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                pass_fds=[write for _, write in pipes],
                start_new_session=True,
            )
        copies = [
            threading.Thread(target=_copy, args=(read, write, to))
            for (read, write), to in zip(pipes, (sys.stdout, sys.stderr), strict=True)
        ]
        for copy in copies:
            copy.start()
        status = _wait(kernel, limit_s)
        for copy in copies:
            copy.join()
        return _judge(status, messages.read_text(errors="replace"))


def _copy(read: int, write: int, to: TextIO) -> None:
    """Copies a pipe until its last writer is gone; the kernel's end of it is none of ours."""
    os.close(write)
    with os.fdopen(read, "rb", buffering=0) as source:
        while chunk := source.read(_CHUNK_BYTES):
            to.buffer.write(chunk)
            to.flush()


def _wait(kernel: subprocess.Popen[bytes], limit_s: float) -> int:
    try:
        return kernel.wait(limit_s)
    except subprocess.TimeoutExpired:
        return TIMED_OUT
    finally:
        _kill(kernel)


def _kill(kernel: subprocess.Popen[bytes]) -> None:
    """Ends the kernel and the processes in which its own run."""
    try:
        os.killpg(kernel.pid, signal.SIGKILL)
    except ProcessLookupError:
        return
    kernel.wait()


def _judge(status: int, messages: str) -> int:
    if status >= 0 and _PANIC not in messages:
        return status
    print(messages, file=sys.stderr)
    return KERNEL_FAILED
