# SPDX-License-Identifier: Apache-2.0
"""Diagnostic codes of channels that are mapped to standard ROS 2 messages."""

from __future__ import annotations

from .code import Code, Kind


def _mapped(rate: str, pressure: str = "") -> str:
    """Channels of the example machine: the rate with this mapping, and the pressure with this name."""
    channels = (
        '"channels": [{"name": "imu.rate", "id": 1, "field": "control.inputs.rate", "direction": "sensor",\n'
        f'              "ros": {{{rate}}}}}'
    )
    if pressure:
        channels += (
            f',\n             {{"name": "{pressure}", "id": 2, "field": "nav.inputs.pressure", "direction": "sensor",\n'
            '              "ros": {"type": "sensor_msgs/FluidPressure", "field": "fluid_pressure"}}'
        )
    return channels + "]"


ROS_CODES: dict[str, Code] = {
    "E236": Code(
        "a message that no channel can be mapped to",
        "`ros` maps a channel to one of the supported standard messages: those of std_msgs, geometry_msgs, "
        "sensor_msgs and nav_msgs that consist of numbers. All outputs of a machine are also in its own messages, "
        "one per instance, without any mapping.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/IMU", "field": "angular_velocity"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E237": Code(
        "a field that the message does not have",
        "`field` is the path of numbers in the message: one (pose.position.z), a group (angular_velocity), an "
        "array or one of its elements (axes[1]), a joint of a JointState (position[left_wheel]). Channels cannot "
        "be mapped to the header or to strings: frames are set by `frame` and `child_frame`, and the stamp is the "
        "time of the sample or of the tick.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "gyro"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E238": Code(
        "a field that does not fit its channel",
        "A field and its channel must have equally many numbers, with a conversion that is free of loss: floats to"
        " floats, integers to floats, integers and bools to one another. A value in a received message that does "
        "not fit is rejected and counted. The field must be able to hold the `safe` value of an actuator: 300 does not "
        "fit a uint8.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "orientation"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E239": Code(
        "axes or a frame on a field that has none",
        "`axes` gives the axes of the machine's value: for a vector or a covariance enu, ned, flu or frd, for a "
        "quaternion world/body such as ned/frd. A single number has no axes. `frame` requires a message with a "
        "header, `child_frame` one with a child_frame_id.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity", "axes": "ned/frd"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity", "axes": "frd"'),
    ),
    "E241": Code(
        "channels of one topic that do not form one message",
        "Channels with the same topic are parts of one message. They must agree on its type, frame and "
        "child_frame, must have different fields, and must be all sensors or all actuators. Otherwise a node could"
        " receive its own commands as measurements.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"', "imu.pressure"),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"', "baro.pressure"),
    ),
}
