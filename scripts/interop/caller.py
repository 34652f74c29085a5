# SPDX-License-Identifier: Apache-2.0
"""Calls the services of the flight computer, and prints what it was told."""

from __future__ import annotations

import json
from typing import Any

import rclpy
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

LIMIT_S = 30.0


def call(node: Node, kind: Any, name: str, **fields: Any) -> tuple[bool, str]:
    client = node.create_client(kind, name)
    if not client.wait_for_service(LIMIT_S):
        return False, f"no service {name}"
    future = client.call_async(kind.Request(**fields))
    rclpy.spin_until_future_complete(node, future, timeout_sec=LIMIT_S)
    answer = future.result() if future.done() else None
    return (answer.success, answer.message) if answer is not None else (False, "no answer")


def main() -> None:
    rclpy.init()
    node = Node("caller")
    answers = [
        call(node, Trigger, "mark"),
        call(node, SetBool, "hold", data=True),
        call(node, Trigger, "mark"),
        call(node, SetBool, "hold", data=False),
    ]
    print(json.dumps(answers))


if __name__ == "__main__":
    main()
