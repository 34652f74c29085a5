# SPDX-License-Identifier: Apache-2.0
"""A robot's graph: examples/ahrs between an IMU's driver and whoever wants its attitude, with sensor_msgs/Imu only."""

from __future__ import annotations

import math
import signal

from bridge_harness import Domain
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu

from fcsl_bridge.base.machine_index import find_machine
from fcsl_bridge.topics import qos
from simclient.replay import replay

ROLL = 0.3
GRAVITY = 9.80665
#: Tolerance of a float64 sample that passes through a normalising filter.
NEAR = 1e-6


def test_an_imu_in_and_an_attitude_out(domain: Domain) -> None:
    bag = domain.folder / "bag"
    node = domain.start("controller_node", machine="ahrs/ahrs", mode="realtime", record=bag)
    listener = domain.listener()
    driver = listener.node.create_publisher(Imu, "/imu/data", qos.STREAM)
    listener.subscribe(Imu, "/imu/attitude", qos.COMMAND)
    attitudes = listener.received["/imu/attitude"]

    sample = Imu()
    sample.header.frame_id = "imu_link"
    sample.orientation_covariance[0] = -1.0  # by REP-145: this IMU measures no orientation
    sample.linear_acceleration.y = GRAVITY * math.sin(ROLL)
    sample.linear_acceleration.z = GRAVITY * math.cos(ROLL)

    def levelled() -> bool:
        sample.header.stamp = listener.node.get_clock().now().to_msg()
        driver.publish(sample)
        return bool(attitudes) and abs(deserialize_message(attitudes[-1], Imu).orientation.x) > NEAR

    listener.until(levelled)
    answer = deserialize_message(attitudes[-1], Imu)
    q = answer.orientation
    assert math.isclose(q.x, math.sin(ROLL / 2), abs_tol=NEAR) and math.isclose(q.w, math.cos(ROLL / 2), abs_tol=NEAR)
    assert abs(q.y) < NEAR and abs(q.z) < NEAR
    assert answer.header.frame_id == "imu_link" and answer.header.stamp.sec > 0
    assert answer.linear_acceleration_covariance[0] == -1.0 and answer.orientation_covariance[0] == 0.0
    node.signal(signal.SIGINT)
    assert node.finish() == 0
    library, machine = find_machine("ahrs/ahrs")
    assert machine == "ahrs" and replay(bag, library=str(library)).identical
