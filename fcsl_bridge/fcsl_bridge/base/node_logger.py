# SPDX-License-Identifier: Apache-2.0
"""A node's logger whose messages on /rosout can be waited for: rclpy's own may lose the last ones when the node ends."""

from __future__ import annotations

import time
from typing import Any

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: As rcl publishes it.
_ROSOUT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    lifespan=Duration(seconds=10),
)


class NodeLogger:
    """What `get_logger()` of a node returns that was made with `enable_rosout=False`: to console and log file by rclpy's logger,
    and on /rosout."""

    def __init__(self, node: Node):
        self._console = node.get_logger()
        self.publisher = node.create_publisher(
            Log, "/rosout", _ROSOUT, event_callbacks=PublisherEventCallbacks(use_default_callbacks=False)
        )
        node._logger = self  # rclpy has no public way

    def debug(self, message: str, **options: object) -> None:
        self._console.debug(message, **options)

    def info(self, message: str, **options: object) -> None:
        if self._console.info(message, **options):
            self._publish(LoggingSeverity.INFO, message)

    def warning(self, message: str, **options: object) -> None:
        if self._console.warning(message, **options):
            self._publish(LoggingSeverity.WARN, message)

    warn = warning

    def error(self, message: str, **options: object) -> None:
        if self._console.error(message, **options):
            self._publish(LoggingSeverity.ERROR, message)

    def fatal(self, message: str, **options: object) -> None:
        if self._console.fatal(message, **options):
            self._publish(LoggingSeverity.FATAL, message)

    def report(self, level: int, message: str, file: str, function: str, line: int) -> None:
        """A message of another place than the caller's. `level`: as rcl_interfaces/Log has it."""
        console, severity = self._console, LoggingSeverity(level)
        if severity >= LoggingSeverity.ERROR:
            shown = console.error(message)
        elif severity >= LoggingSeverity.WARN:  # rclpy wants one severity in each line
            shown = console.warning(message)
        else:
            shown = console.info(message) if severity >= LoggingSeverity.INFO else console.debug(message)
        if shown:
            self._publish(severity, message, file=file, function=function, line=line)

    def _publish(self, severity: LoggingSeverity, message: str, **place: Any) -> None:
        seconds, nanoseconds = divmod(time.time_ns(), 10**9)
        stamp = Time(sec=seconds, nanosec=nanoseconds)
        log = Log(stamp=stamp, level=severity.value, name=self._console.name, msg=message, **place)
        self.publisher.publish(log)
