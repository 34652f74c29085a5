# SPDX-License-Identifier: Apache-2.0
"""Virtual CAN interfaces, by netlink: the guest need not have iproute2."""

from __future__ import annotations

import fcntl
import os
import socket
import struct

_RTM_NEWLINK = 16
_REQUEST, _ACK, _EXCL, _CREATE = 0x01, 0x04, 0x200, 0x400
_IFLA_IFNAME, _IFLA_LINKINFO, _IFLA_INFO_KIND = 3, 18, 1
_NLMSG_ERROR = 2
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _IFF_UP = 0x8913, 0x8914, 1


def _attribute(kind: int, value: bytes) -> bytes:
    length = 4 + len(value)
    return struct.pack("HH", length, kind) + value + bytes(-length % 4)


def _ask(kind: int, flags: int, attributes: bytes) -> None:
    body = struct.pack("BxHiII", socket.AF_UNSPEC, 0, 0, 0, 0) + attributes
    header = struct.pack("IHHII", 16 + len(body), kind, _REQUEST | _ACK | flags, 1, 0)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as link:
        link.bind((0, 0))
        link.send(header + body)
        answer = link.recv(4096)
    (answered,) = struct.unpack_from("H", answer, 4)
    (error,) = struct.unpack_from("i", answer, 16)
    if answered != _NLMSG_ERROR or error != 0:
        raise OSError(-error, os.strerror(-error))


def add_vcan(name: str) -> None:
    """Makes it and brings it up."""
    info = _attribute(_IFLA_LINKINFO, _attribute(_IFLA_INFO_KIND, b"vcan"))
    _ask(_RTM_NEWLINK, _CREATE | _EXCL, _attribute(_IFLA_IFNAME, name.encode() + b"\0") + info)
    _bring_up(name)


def _bring_up(name: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sH14x", name.encode(), 0)
        (flags,) = struct.unpack_from("H", fcntl.ioctl(any_socket, _SIOCGIFFLAGS, request), 16)
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sH14x", name.encode(), flags | _IFF_UP))
