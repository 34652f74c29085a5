# SPDX-License-Identifier: Apache-2.0
"""The bus of the kernel's i2c-stub: chips that are 256 registers each, which the drivers and this process read and write.

A chip computes nothing: what a driver writes to a command register stays there, and a reset resets nothing.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
from pathlib import Path

from . import sysfs

_DEVICES = Path("/sys/bus/i2c/devices")
_STUB_NAME = "SMBus stub driver"
#: i2c-stub's own limit.
CHIPS_MAX = 10
_BLOCK_BYTES = 32
_I2C_SLAVE_FORCE, _I2C_SMBUS = 0x0706, 0x0720
_WRITE, _READ = 0, 1
_WORD_DATA, _BLOCK_DATA = 3, 8


class _Data(ctypes.Union):
    _fields_ = [("byte", ctypes.c_uint8), ("word", ctypes.c_uint16), ("block", ctypes.c_uint8 * (_BLOCK_BYTES + 2))]


class _Transfer(ctypes.Structure):
    _fields_ = [
        ("direction", ctypes.c_uint8),
        ("command", ctypes.c_uint8),
        ("size", ctypes.c_uint32),
        ("data", ctypes.POINTER(_Data)),
    ]


def _load_module(path: str, parameters: str) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    with open(path, "rb") as module:
        if libc.syscall(313, module.fileno(), parameters.encode(), 0) != 0:  # finit_module
            raise OSError(ctypes.get_errno(), "cannot load", path)


class I2cBus:
    """Chips at these addresses, all registers 0, and no driver yet. One bus per boot."""

    def __init__(self, *addresses: int) -> None:
        if not 0 < len(addresses) <= CHIPS_MAX:
            raise ValueError(f"{len(addresses)} chips; i2c-stub has 1 to {CHIPS_MAX}")
        _load_module(os.environ["FCSL_I2C_STUB"], "chip_addr=" + ",".join(f"{a:#04x}" for a in addresses))
        self._folder = sysfs.find(_DEVICES, "name", _STUB_NAME)
        self._file = os.open(f"/dev/{self._folder.name}", os.O_RDWR)

    def _transfer(self, address: int, direction: int, register: int, size: int, data: _Data) -> None:
        # Forced: the addresses belong to their drivers.
        fcntl.ioctl(self._file, _I2C_SLAVE_FORCE, address)
        fcntl.ioctl(self._file, _I2C_SMBUS, _Transfer(direction, register, size, ctypes.pointer(data)))

    def write(self, address: int, register: int, values: bytes) -> None:
        """Writes up to 32 neighbouring registers; no driver sees some of them old and some new."""
        if not 0 < len(values) <= _BLOCK_BYTES:
            raise ValueError(f"{len(values)} bytes; a transfer has 1 to {_BLOCK_BYTES}")
        data = _Data()
        data.block[0 : len(values) + 1] = bytes([len(values)]) + values
        self._transfer(address, _WRITE, register, _BLOCK_DATA, data)

    def read(self, address: int, register: int, count: int = 1) -> bytes:
        data = _Data()
        data.block[0] = count
        self._transfer(address, _READ, register, _BLOCK_DATA, data)
        return bytes(data.block[1 : count + 1])

    def write_word(self, address: int, register: int, value: int) -> None:
        """Writes a register of 16 bits, high byte first."""
        self._transfer(address, _WRITE, register, _WORD_DATA, _Data(word=(value >> 8 & 0xFF) | (value & 0xFF) << 8))

    def device(self, address: int) -> Path:
        """Folder of the device at this address, below which its driver's is."""
        return _DEVICES / f"{self._folder.name.removeprefix('i2c-')}-{address:04x}"

    def plug(self, address: int, name: str) -> None:
        """Gives the chip to the driver of this name. Raises OSError where the driver does not take it."""
        sysfs.put(self._folder / "new_device", f"{name} {address:#04x}")
        if not (self.device(address) / "driver").exists():
            self.unplug(address)
            raise OSError(f"the driver of {name} refuses the chip at {address:#04x}")

    def unplug(self, address: int) -> None:
        """Takes it from its driver; the registers stay."""
        sysfs.put(self._folder / "delete_device", f"{address:#04x}")
