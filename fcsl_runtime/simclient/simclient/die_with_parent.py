# SPDX-License-Identifier: Apache-2.0
"""Replaces this process by a program that the kernel kills when the parent process ends for any reason.

    python3 -I -S die_with_parent.py PARENT SIGNAL PROGRAM ARGUMENT...

It is a separate program, because code between fork and exec in a process with threads may block on their locks.
"""

import ctypes
import os
import sys

_PR_SET_PDEATHSIG = 1

if __name__ == "__main__":
    parent, number, *command = sys.argv[1:]
    if ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0) != 0:
        sys.exit(f"fcsl: prctl: {os.strerror(ctypes.get_errno())}")
    if os.getppid() != int(parent):
        sys.exit("fcsl: gone before the program began")
    try:
        os.execv(command[0], command)
    except OSError as error:
        sys.exit(f"fcsl: {command[0]}: {error.strerror}")
