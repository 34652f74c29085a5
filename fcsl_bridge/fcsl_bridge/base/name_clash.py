# SPDX-License-Identifier: Apache-2.0
"""Whether another node of the graph has the name of this one: parameters and services would reach either."""

from __future__ import annotations

import time

from rclpy.node import Node

_PERIOD_S = 1.0


class NameClash:
    """Call `look` often: it looks once a second, and logs when another node has come. The other one does the same."""

    def __init__(self, node: Node):
        self._node, self._due_s, self._is_there = node, 0.0, False

    def check(self) -> None:
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + _PERIOD_S
        node = self._node
        own = (node.get_name(), node.get_namespace())
        before, self._is_there = self._is_there, node.get_node_names_and_namespaces().count(own) > 1
        if self._is_there and not before:
            node.get_logger().error(
                f"another node is called {node.get_fully_qualified_name()}, too: parameters and services reach either. "
                "Give one of them a namespace (-r __ns:=/two) or a name (-r __node:=two)"
            )
