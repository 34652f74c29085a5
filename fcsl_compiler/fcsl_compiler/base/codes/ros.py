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
        "`ros` maps a channel to any message whose definition is standard, installed, or stored beside the machine by "
        "`fcsl interfaces`. Where it is stored and installed, both must be equal. Refused are messages without fields, with "
        "an unbounded list of bytes (images, point clouds: bulk data), with a wstring, or of more than 65536 bytes: let a "
        "node reduce them to numbers. All outputs of a machine are also in its own messages, one per instance, without any mapping.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/IMU", "field": "angular_velocity"'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E237": Code(
        "a field that the message does not have",
        "`field` is the path of numbers in the message: one (pose.position.z), a group (angular_velocity), an "
        "array or one of its elements (axes[1], poses[2].position), a joint of a JointState (position[left_wheel]), an "
        "element that is found by a string of it (transforms[child_frame_id=base_link].transform.translation), the "
        "length of a list (ranges.count), a string with `choices`. Channels cannot be mapped to the header: frames are "
        "set by `frame` and `child_frame`, and the stamp is the time of the sample or of the tick.",
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
    "E258": Code(
        "choices that do not fit",
        "`choices` says what the indices 0, 1, … that the machine has stand for in the message: strings for a string; "
        "for an integer names of constants of its message, or whole numbers. The value is an i32 or a u32. What comes "
        "in and is none of them is refused and counted.",
        Kind.JSON,
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity", "choices": ["x", "y"]'),
        _mapped('"type": "sensor_msgs/Imu", "field": "angular_velocity"'),
    ),
    "E259": Code(
        "a service that cannot be offered",
        "With `service` the `ros` entry of a sensor channel, a bool, offers a service, std_srvs/Trigger or SetBool. Its "
        "calls are the samples of the channel, which has no `max_age_ticks`: a value holds until the next call. The "
        "conditions `accepted` and `refused` are about fields as they stand after a tick, and say how a call ends.",
        Kind.JSON,
        '"channels": [{"name": "arm", "id": 1, "field": "control.inputs.armed", "direction": "sensor",\n'
        '              "ros": {"type": "std_srvs/SetBool", "service": "arm", "accepted": "control.outputs.redy"}}]',
        '"channels": [{"name": "arm", "id": 1, "field": "control.inputs.armed", "direction": "sensor",\n'
        '              "ros": {"type": "std_srvs/SetBool", "service": "arm", "accepted": "control.outputs.ready"}}]',
    ),
}
