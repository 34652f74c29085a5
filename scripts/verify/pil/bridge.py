#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A simulator's wire (a Unix socket of packets) on one side, a board's serial line (a Unix stream socket) on the other.

    python3 bridge.py WIRE SERIAL

Every packet crosses as it is, on the serial side behind its size (u16, little-endian). Ends when either side does.
"""

from __future__ import annotations

import socket
import sys
import threading
import time
from pathlib import Path

_PACKET_MAX = 1 << 16
_PATIENCE_S = 30.0


def connect(path: Path, kind: socket.SocketKind) -> socket.socket:
    """Waits for whoever listens there. Raises OSError when nobody does in time."""
    deadline = time.monotonic() + _PATIENCE_S
    while True:
        found = socket.socket(socket.AF_UNIX, kind)
        try:
            found.connect(str(path))
            return found
        except (FileNotFoundError, ConnectionRefusedError):
            found.close()
            if time.monotonic() > deadline:
                raise
            time.sleep(0.01)


def receive_exactly(serial: socket.socket, size: int) -> bytes:
    """`size` bytes, fewer at the end of the line."""
    data = b""
    while len(data) < size:
        piece = serial.recv(size - len(data))
        if not piece:
            return data
        data += piece
    return data


def to_board(wire: socket.socket, serial: socket.socket) -> None:
    while packet := wire.recv(_PACKET_MAX):
        serial.sendall(len(packet).to_bytes(2, "little") + packet)


def to_simulator(serial: socket.socket, wire: socket.socket) -> None:
    while len(size := receive_exactly(serial, 2)) == 2:
        packet = receive_exactly(serial, int.from_bytes(size, "little"))
        try:
            wire.send(packet)
        except (BrokenPipeError, ConnectionResetError):
            return  # the simulator ended the run; the board is told by the other thread


def bridge(wire: Path, serial: Path) -> None:
    """Until the simulator ends the run or the board stops. Raises OSError."""
    with connect(serial, socket.SOCK_STREAM) as board, connect(wire, socket.SOCK_SEQPACKET) as simulator:
        back = threading.Thread(target=to_simulator, args=(board, simulator), daemon=True)
        back.start()
        to_board(simulator, board)
        back.join(_PATIENCE_S)  # the board closes its line when it has read the end; closed before, a line may lose it


if __name__ == "__main__":
    bridge(Path(sys.argv[1]), Path(sys.argv[2]))
