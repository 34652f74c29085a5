# SPDX-License-Identifier: Apache-2.0
"""The standard ROS 2 messages that a channel can be mapped to: members, units, and the values that mean "not given".

Checks at build time and the conversions that read and write these messages use this table. A test compares it with the
definitions that rosidl installs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

#: Bytes of each number type in messages.
SIZES: dict[str, int] = {
    "bool": 1,
    "byte": 1,
    "char": 1,
    "int8": 1,
    "uint8": 1,
    "int16": 2,
    "uint16": 2,
    "int32": 4,
    "uint32": 4,
    "int64": 8,
    "uint64": 8,
    "float32": 4,
    "float64": 8,
}


#: A constant or a default of a message.
Constant = int | float | str


@dataclass(frozen=True)
class Member:
    """One member of a message. Its type is a number, a string or a message (full name). It is a single value, an array
    of `count` or a sequence."""

    name: str
    type: str
    count: int = 0  # length of a fixed array; 0 for a single value or a sequence
    sequence: bool = False
    unit: str = ""  # unit of each number in it, if the message's documentation gives one
    bound: int = 0  # most elements of a sequence; 0: any number
    text_bound: int = 0  # most characters of a string; 0: any number
    default: tuple[Constant, ...] = ()  # what the definition says of each element; (): zero, or empty

    @property
    def is_array(self) -> bool:
        return self.count > 0 or self.sequence


#: The members of each message by full name, for a message and all messages it contains.
Definitions = Mapping[str, tuple[Member, ...]]


def full_name(name: str) -> str:
    """Full name: sensor_msgs/Imu → sensor_msgs/msg/Imu."""
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") else f"{package}/msg/{rest}"


def short_name(name: str) -> str:
    """Short name as users write it: sensor_msgs/msg/Imu → sensor_msgs/Imu."""
    return name.replace("/msg/", "/")


#: Messages that only occur within other messages, and that of /tf. No channel is mapped to them.
_PARTS = """
builtin_interfaces/Time
    int32 sec
    uint32 nanosec
std_msgs/Header
    builtin_interfaces/Time stamp
    string frame_id
std_msgs/MultiArrayDimension
    string label
    uint32 size
    uint32 stride
std_msgs/MultiArrayLayout
    std_msgs/MultiArrayDimension[] dim
    uint32 data_offset
sensor_msgs/NavSatStatus
    int8 status
    uint16 service
tf2_msgs/TFMessage
    geometry_msgs/TransformStamped[] transforms
"""

#: The unit in brackets after a name applies to every number below it that has no unit of its own.
_SUPPORTED = """
geometry_msgs/Vector3
    float64 x
    float64 y
    float64 z
geometry_msgs/Point
    float64 x [m]
    float64 y [m]
    float64 z [m]
geometry_msgs/Quaternion
    float64 x
    float64 y
    float64 z
    float64 w
geometry_msgs/Pose
    geometry_msgs/Point position
    geometry_msgs/Quaternion orientation
geometry_msgs/PoseWithCovariance
    geometry_msgs/Pose pose
    float64[36] covariance
geometry_msgs/Transform
    geometry_msgs/Vector3 translation [m]
    geometry_msgs/Quaternion rotation
geometry_msgs/TransformStamped
    std_msgs/Header header
    string child_frame_id
    geometry_msgs/Transform transform
geometry_msgs/Twist
    geometry_msgs/Vector3 linear [m/s]
    geometry_msgs/Vector3 angular [rad/s]
geometry_msgs/TwistWithCovariance
    geometry_msgs/Twist twist
    float64[36] covariance
geometry_msgs/Accel
    geometry_msgs/Vector3 linear [m/s^2]
    geometry_msgs/Vector3 angular [rad/s^2]
geometry_msgs/Wrench
    geometry_msgs/Vector3 force [N]
    geometry_msgs/Vector3 torque [N*m]
sensor_msgs/Imu
    std_msgs/Header header
    geometry_msgs/Quaternion orientation
    float64[9] orientation_covariance
    geometry_msgs/Vector3 angular_velocity [rad/s]
    float64[9] angular_velocity_covariance
    geometry_msgs/Vector3 linear_acceleration [m/s^2]
    float64[9] linear_acceleration_covariance
sensor_msgs/MagneticField
    std_msgs/Header header
    geometry_msgs/Vector3 magnetic_field [T]
    float64[9] magnetic_field_covariance
sensor_msgs/FluidPressure
    std_msgs/Header header
    float64 fluid_pressure [Pa]
    float64 variance
sensor_msgs/Temperature
    std_msgs/Header header
    float64 temperature [°C]
    float64 variance
sensor_msgs/NavSatFix
    std_msgs/Header header
    sensor_msgs/NavSatStatus status
    float64 latitude [deg]
    float64 longitude [deg]
    float64 altitude [m]
    float64[9] position_covariance
    uint8 position_covariance_type
sensor_msgs/Range
    std_msgs/Header header
    uint8 radiation_type
    float32 field_of_view [rad]
    float32 min_range [m]
    float32 max_range [m]
    float32 range [m]
    float32 variance
sensor_msgs/BatteryState
    std_msgs/Header header
    float32 voltage [V]
    float32 temperature [°C]
    float32 current [A]
    float32 charge [Ah]
    float32 capacity [Ah]
    float32 design_capacity [Ah]
    float32 percentage
    uint8 power_supply_status
    uint8 power_supply_health
    uint8 power_supply_technology
    bool present
    float32[] cell_voltage [V]
    float32[] cell_temperature [°C]
    string location
    string serial_number
sensor_msgs/Joy
    std_msgs/Header header
    float32[] axes
    int32[] buttons
sensor_msgs/JointState
    std_msgs/Header header
    string[] name
    float64[] position
    float64[] velocity
    float64[] effort
nav_msgs/Odometry
    std_msgs/Header header
    string child_frame_id
    geometry_msgs/PoseWithCovariance pose
    geometry_msgs/TwistWithCovariance twist
"""

#: Each of these has a Stamped variant: a header, and the message as a member of this name.
_STAMPED = {
    "Vector3": "vector",
    "Point": "point",
    "Quaternion": "quaternion",
    "Pose": "pose",
    "PoseWithCovariance": "pose",
    "Twist": "twist",
    "TwistWithCovariance": "twist",
    "Accel": "accel",
    "Wrench": "wrench",
}
_STD_NUMBERS = ("Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64", "Float32", "Float64")

_MEMBER = re.compile(r"([A-Za-z0-9_/]+)(\[([0-9]*)\])? ([a-z0-9_]+)(?: \[(.+)\])?")


def _read(table: str) -> dict[str, tuple[Member, ...]]:
    found: dict[str, tuple[Member, ...]] = {}
    name = ""
    for line in table.strip().splitlines():
        if not line.startswith(" "):
            name = full_name(line)
            found[name] = ()
            continue
        match = _MEMBER.fullmatch(line.strip())
        assert match is not None, line
        kind, array, count, member, unit = match.groups()
        type_ = full_name(kind) if "/" in kind else kind
        found[name] += (Member(member, type_, int(count or 0), array == "[]", unit or ""),)
    return found


def _supported() -> dict[str, tuple[Member, ...]]:
    header = Member("header", "std_msgs/msg/Header")
    found = _read(_SUPPORTED)
    for name, member in _STAMPED.items():
        found[f"geometry_msgs/msg/{name}Stamped"] = (header, Member(member, f"geometry_msgs/msg/{name}"))
    found["std_msgs/msg/Bool"] = (Member("data", "bool"),)
    for name in _STD_NUMBERS:
        found[f"std_msgs/msg/{name}"] = (Member("data", name.lower()),)
        layout = Member("layout", "std_msgs/msg/MultiArrayLayout")
        found[f"std_msgs/msg/{name}MultiArray"] = (layout, Member("data", name.lower(), sequence=True))
    return found


_MAPPABLE = _supported()
#: Message types allowed in `channels[].ros`, by full name.
SUPPORTED: tuple[str, ...] = tuple(sorted(_MAPPABLE))
#: Definitions of these messages and of all messages they contain.
STANDARD: Definitions = {**_read(_PARTS), **_MAPPABLE}


#: Constants: a prefix, the value of the first name, and names of consecutive values.
_CONSTANTS: dict[str, tuple[tuple[str, int, str], ...]] = {
    "sensor_msgs/BatteryState": (
        ("POWER_SUPPLY_STATUS_", 0, "UNKNOWN CHARGING DISCHARGING NOT_CHARGING FULL"),
        ("POWER_SUPPLY_HEALTH_", 0, "UNKNOWN GOOD OVERHEAT DEAD OVERVOLTAGE UNSPEC_FAILURE COLD"),
        ("POWER_SUPPLY_HEALTH_", 7, "WATCHDOG_TIMER_EXPIRE SAFETY_TIMER_EXPIRE"),
        ("POWER_SUPPLY_TECHNOLOGY_", 0, "UNKNOWN NIMH LION LIPO LIFE NICD LIMN TERNARY VRLA"),
    ),
    "sensor_msgs/NavSatFix": (("COVARIANCE_TYPE_", 0, "UNKNOWN APPROXIMATED DIAGONAL_KNOWN KNOWN"),),
    "sensor_msgs/NavSatStatus": (
        ("STATUS_", -2, "UNKNOWN NO_FIX FIX SBAS_FIX GBAS_FIX"),
        ("SERVICE_", 0, "UNKNOWN GPS GLONASS"),
        ("SERVICE_", 4, "COMPASS"),
        ("SERVICE_", 8, "GALILEO"),
    ),
    "sensor_msgs/Range": (("", 0, "ULTRASOUND INFRARED"),),
}
#: The constants of these messages, by name.
CONSTANTS: dict[str, dict[str, Constant]] = {
    full_name(message): {
        prefix + name: first + i for prefix, first, names in rows for i, name in enumerate(names.split())
    }
    for message, rows in _CONSTANTS.items()
}


@dataclass(frozen=True)
class Default:
    """Value of a field in a composed message if no source provides it. With `given`: only if that field is provided.
    With `absent`: only if no part of that field is provided."""

    field: str
    value: float
    given: str = ""
    absent: str = ""


#: Defaults other than zero, by message. The defaults of a message also apply where it is a member of another.
DEFAULTS: dict[str, tuple[Default, ...]] = {
    "geometry_msgs/msg/Quaternion": (Default("w", 1.0),),
    # REP-145: a covariance whose first element is -1 means that the measurement does not exist.
    "sensor_msgs/msg/Imu": tuple(
        Default(f"{group}_covariance[0]", -1.0, absent=group)
        for group in ("orientation", "angular_velocity", "linear_acceleration")
    ),
    # No receiver may take an unknown covariance for a perfect estimate.
    "geometry_msgs/msg/PoseWithCovariance": (Default("covariance[0]", -1.0, absent="covariance"),),
    "geometry_msgs/msg/TwistWithCovariance": (Default("covariance[0]", -1.0, absent="covariance"),),
    "sensor_msgs/msg/MagneticField": tuple(Default(f"magnetic_field.{axis}", math.nan) for axis in "xyz"),
    "sensor_msgs/msg/NavSatStatus": (Default("status", -2.0),),
    "sensor_msgs/msg/NavSatFix": (
        Default("altitude", math.nan),
        Default("position_covariance_type", 3.0, given="position_covariance"),
    ),
    "sensor_msgs/msg/BatteryState": tuple(
        Default(field, math.nan)
        for field in ("temperature", "current", "charge", "capacity", "design_capacity", "percentage")
    ),
}


@dataclass(frozen=True)
class Guard:
    """In a received message, `field` = `value` means that `groups` were not measured."""

    field: str
    value: float
    groups: tuple[str, ...]


GUARDS: dict[str, tuple[Guard, ...]] = {
    "sensor_msgs/msg/Imu": tuple(
        Guard(f"{group}_covariance[0]", -1.0, (group, f"{group}_covariance"))
        for group in ("orientation", "angular_velocity", "linear_acceleration")
    ),
    "sensor_msgs/msg/NavSatFix": (
        Guard("status.status", -1.0, ("latitude", "longitude", "altitude", "position_covariance")),
    ),
}
