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
        "a message that no channel can be mapped onto",
        "`ros` maps a channel onto one of the standard messages that FCSL knows: of std_msgs, geometry_msgs, "
        "sensor_msgs and nav_msgs those made of numbers. What a machine computes besides is in its own messages, one "
        "per instance, without any mapping.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/IMU", "field": "angular_velocity"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E237": Code(
        "a field that the message does not have",
        "`field` is the path of numbers in the message: one (pose.position.z), a group (angular_velocity), an array or "
        "one of its elements (axes[1]), a joint of a JointState (position[left_wheel]). Header and strings are not "
        "for channels: frames are `frame` and `child_frame`, the stamp is the time of the sample or of the tick.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "gyro"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E238": Code(
        "a field that does not fit its channel",
        "A field and its channel have as many numbers, and these convert without loss: floats to floats, whole numbers "
        "to floats, whole numbers and bools to one another. What does not fit in a particular message is refused "
        "then, and counted.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "orientation"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E239": Code(
        "axes or a frame where there are none",
        "`axes` says in which axes the machine holds a vector (enu, ned, flu, frd), a covariance (the same) or a "
        "quaternion (world/body, such as ned/frd); a single number has none. `frame` needs a message with a "
        "header, `child_frame` one with a child_frame_id.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity", "axes": "ned/frd"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity", "axes": "frd"'),
    ),
    "E241": Code(
        "channels of one topic that do not make one message",
        "Channels with the same topic are parts of one message. So they agree on its type, frame and child_frame, each "
        "has a field of its own, and all are sensors or all actuators: a node that takes what it publishes itself "
        "would fly on its own commands.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"', "imu.pressure"),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"', "baro.pressure"),
    ),
}
