# SPDX-License-Identifier: Apache-2.0
"""Diagnostic codes of boards. Most mistakes in a board file have the codes of a machine JSON (E1xx, E2xx)."""

from __future__ import annotations

from .code import Code, Kind
from .examples import EXAMPLE_CHANNELS

_ESC = '{"driver": "pwm", "device": "pwmchip0"}'
_BARO = '{"kind": "barometer", "channels": {"pressure": "baro.pressure"}, "backends": [{"device": "bmp"}]}'


def _devices(mpu: str, more: str = "") -> str:
    """The devices of the example board with this gyroscope."""
    bmp = '"bmp": {"driver": "iio", "device": "bmp280", "rate_hz": 50}'
    return f'"devices": {{\n  "mpu": {mpu},\n  {bmp}{more}\n}}'


def _sensors(
    channels: str = '{"gyro": "imu.gyro"}', backends: str = '[{"device": "mpu"}]', more: str = "", baro: str = _BARO
) -> str:
    """The sensors of the example board with this gyroscope."""
    imu = f'{{"kind": "inertial", "channels": {channels},\n          "backends": {backends}{more}}}'
    return f'"sensors": {{\n  "imu": {imu},\n  "baro": {baro}\n}}'


def _backend(more: str) -> str:
    return _sensors(backends=f'[{{"device": "mpu", {more}}}]')


def _of_sensor(more: str) -> str:
    return _sensors(more=f",\n          {more}")


def _fast(more: str = "") -> str:
    """The example board with a gyroscope that is faster than the ticks."""
    return _devices('{"driver": "iio", "device": "mpu6500", "rate_hz": 1000}') + ",\n" + _sensors(more=more)


def _outputs(*elements: str, device: str = _ESC) -> str:
    """The example board with one more device, which drives its actuator channel."""
    rows = ",\n    ".join(elements)
    output = f'{{"device": "esc", "elements": [\n    {rows}\n  ]}}'
    return _devices(_MPU, f',\n  "esc": {device}') + f',\n"outputs": {{\n  "torque": {output}\n}}'


#: The machine of the example board with an algorithm that calls a builtin of hardware.
_WITH_LAMP = f"""\
"algorithms": {{"Nav": {{"source": "nav.py"}}, "Control": {{"source": "control.py"}}, "Lamp": {{"source": "lamp.py"}}}},
"instances": {{
  "nav": {{"algorithm": "Nav"}},
  "control": {{"algorithm": "Control", "parameters": {{"gain": 2.0}}}},
  "lamp": {{"algorithm": "Lamp"}}
}},
"states": {{"COAST": {{"schedule": {{"nav": 100, "control": 50, "lamp": 10}}}}, "SAFE": {{"schedule": {{"nav": 10}}}}}},
{EXAMPLE_CHANNELS}"""

_MPU = '{"driver": "iio", "device": "mpu6500", "rate_hz": 100}'

_PULSES = [f'{{"signal": "pulse{i}", "output": [1000, 2000], "safe_output": 1500}}' for i in range(3)]

BOARD_CODES: dict[str, Code] = {
    "E501": Code(
        "a machine where a board is needed",
        "A machine says what is computed, and runs unchanged on any board. A board says which devices are its "
        "sensors and actuators, in a separate JSON file that names the machine.",
        Kind.BOARD,
        '"tick_hz": 100,\n"states": {"COAST": {"schedule": {"nav": 100}}}',
        '"machine": "craft.json"',
    ),
    "E502": Code(
        "a machine that a board cannot use",
        "`machine` is the path of a machine JSON, relative to the board's file, or package://<package>/<path>. It "
        "must compile: the board is checked against its channels.",
        Kind.BOARD,
        '"machine": "no_such.json"',
        '"machine": "craft.json"',
    ),
    "E503": Code(
        "a driver that does not exist",
        "`driver` is one of the drivers that come with FCSL, or LIBRARY.so:NAME for one of a library; the "
        "name of the library has a slash or ends in .so.",
        Kind.BOARD,
        _devices('{"driver": "iiobuffer", "device": "mpu6500", "rate_hz": 100}'),
        _devices('{"driver": "iio_buffer", "device": "mpu6500", "rate_hz": 100}'),
    ),
    "E504": Code(
        "a rate that is missing or misplaced",
        "A device that is polled is read at `rate_hz`, and a buffered one samples at it. Other devices send when "
        "they like; their drivers wait, and take no rate. Drivers of actuators take none either.",
        Kind.BOARD,
        _devices('{"driver": "iio", "device": "mpu6500"}'),
        _devices(_MPU),
    ),
    "E505": Code(
        "something that does not fit the plan",
        "The plan of a board is text, with one statement per line, and has limits: 32 devices, 32 sensors and 16 "
        "outputs, names of 64 characters, drivers and addresses of 500 bytes without control characters.",
        Kind.BOARD,
        _devices('{"driver": "iio", "device": "", "rate_hz": 100}'),
        _devices(_MPU),
    ),
    "E506": Code(
        "a quantity that does not belong here",
        "The kind of a sensor says which quantities it has. A channel can get each of them; corrections, limits and "
        "filters are for those that its devices measure, not for those that are computed from them.",
        Kind.BOARD,
        _sensors(channels='{"rate": "imu.gyro"}'),
        _sensors(channels='{"gyro": "imu.gyro"}'),
    ),
    "E507": Code(
        "a channel that does not fit its quantity",
        "A quantity goes to a sensor channel of f64 or f32 with as many elements (for sticks: or fewer) and, if the "
        "field of the channel has a unit, the same one. Units are not converted, because the algorithm states what it "
        "needs.",
        Kind.BOARD,
        _sensors(channels='{"delta_angle": "imu.gyro"}'),
        _sensors(channels='{"gyro": "imu.gyro"}'),
    ),
    "E508": Code(
        "a channel with two sources",
        "Each sensor would overwrite the values of the other one. If two devices measure the same, list both as "
        "backends of one sensor: it chooses a healthy one.",
        Kind.BOARD,
        _sensors(baro='{"kind": "inertial", "channels": {"gyro": "imu.gyro"}, "backends": [{"device": "bmp"}]}'),
        _sensors(),
    ),
    "E509": Code(
        "a sensor without channels, or with wrong backends",
        "A sensor feeds at least one channel, from 1 to 4 backends in order of preference. Each device is at most "
        "once among them: it cannot replace itself.",
        Kind.BOARD,
        _sensors(backends='[{"device": "mpu"}, {"device": "mpu"}]'),
        _sensors(backends='[{"device": "mpu"}]'),
    ),
    "E510": Code(
        "not a rotation",
        "`rotation` leads from the axes of the device to those of the body: a name such as roll_180_yaw_90 (first roll, "
        "then pitch, then yaw, as in ArduPilot and MAVLink), or a 3x3 matrix with orthogonal rows of length 1 and "
        "determinant 1. Only what is measured along axes of the device can be rotated.",
        Kind.BOARD,
        _backend('"rotation": [[0, 1, 0], [1, 0, 0], [0, 0, 1]]'),
        _backend('"rotation": [[0, 1, 0], [1, 0, 0], [0, 0, -1]]'),
    ),
    "E511": Code(
        "a correction that cannot be made",
        "A scale must be invertible, or the reading is lost. `per_kelvin` needs the temperature of the same device, "
        "which only some kinds of sensors have.",
        Kind.BOARD,
        _backend('"correct": {"gyro": {"scale": [1.01, 0.0, 0.99]}}'),
        _backend('"correct": {"gyro": {"scale": [1.01, 1.0, 0.99]}}'),
    ),
    "E512": Code(
        "the pulses of a stick in a wrong order",
        "The middle of a stick is between its ends (`maximum` below `minimum` reverses it), and the deadband is smaller "
        "than the way to either end. Only sensors of kind rc have sticks, 18 at most.",
        Kind.BOARD,
        _backend('"sticks": [{"minimum": 1000, "middle": 1500, "maximum": 2000}]'),
        _sensors(),
    ),
    "E513": Code(
        "a limit that no device can keep",
        "`max_age_s` is longer than the nominal period of every backend, or each would fail between two readings. The "
        "lower of two `limits` comes first.",
        Kind.BOARD,
        _of_sensor('"health": {"limits": {"gyro": [35, -35]}}'),
        _of_sensor('"health": {"limits": {"gyro": [-35, 35]}}'),
    ),
    "E514": Code(
        "a filter that cannot be built",
        "A filter is computed for the nominal rate of each device. It needs one, all of it must be between 1/10000 and "
        "1/2 of that rate, and a backend has 8 sections at most.",
        Kind.BOARD,
        _of_sensor('"low_pass_hz": {"gyro": 50}'),
        _of_sensor('"low_pass_hz": {"gyro": 40}'),
    ),
    "E515": Code(
        "a channel that cannot be an output",
        "An output is an actuator channel of f64 or f32 with at most 16 elements, and has one entry per element. A bool "
        "or an integer has no values between two ends; let the machine compute a float.",
        Kind.BOARD,
        _outputs(*_PULSES[:2]),
        _outputs(*_PULSES),
    ),
    "E516": Code(
        "an output with wrong numbers",
        "`command` has the lower value first. `output` has two different ends, the lower or the higher one first, and a "
        "middle between them. `safe_output` is between them too, or 0 for no pulse. 0 excludes `slew_per_s`, which would "
        "make the output move through the pulses between 0 and its ends.",
        Kind.BOARD,
        _outputs('{"signal": "pulse0", "output": [1000, 2100, 2000], "safe_output": 1500}', *_PULSES[1:]),
        _outputs('{"signal": "pulse0", "output": [1000, 1450, 2000], "safe_output": 1500}', *_PULSES[1:]),
    ),
    "E517": Code(
        "an output without a safe value",
        "While the machine is disarmed or silent its outputs are safe. Without `safe_output` an element has the output "
        "of the `safe` of its channel in the machine, if the channel has one.",
        Kind.BOARD,
        _outputs('{"signal": "pulse0", "output": [1000, 2000]}', *_PULSES[1:]),
        _outputs(*_PULSES),
    ),
    "E518": Code(
        "a device of the other direction",
        "A driver reads a sensor or drives an actuator, never both. A device of an output has no `rate_hz`. fcsl-guard "
        "drives those of `outputs`, and the flight program those of `hardware`: a device belongs to one of them.",
        Kind.BOARD,
        _outputs(*_PULSES, device='{"driver": "iio", "device": "pca9685", "rate_hz": 50}'),
        _outputs(*_PULSES),
    ),
    "E519": Code(
        "a signal with two sources",
        "Each of them would overwrite the other one. Mixing the commands of several controllers is work of the "
        "machine, which has one element per signal then.",
        Kind.BOARD,
        _outputs(*_PULSES[:2], _PULSES[1]),
        _outputs(*_PULSES),
    ),
    "E520": Code(
        "a device that cannot pace the loop",
        "Each sample of the device that paces the loop is a tick. So it is a backend of a sensor, sends by itself (a driver "
        "that is polled follows a clock of the computer), and its rate, if it has one, is that of the ticks.",
        Kind.BOARD,
        _devices(_MPU) + ',\n"pace": {"device": "mpu", "timeout_s": 0.1}',
        _devices(_MPU.replace('"iio"', '"iio_buffer"')) + ',\n"pace": {"device": "mpu", "timeout_s": 0.1}',
    ),
    "E521": Code(
        "a signal that the driver does not have",
        "The signals of the drivers that come with FCSL are known; those of a library are looked for when the flight "
        "program starts. `fcsl hal describe DRIVER` lists them.",
        Kind.BOARD,
        _outputs(*_PULSES[:2], _PULSES[2].replace("pulse2", "pulse16")),
        _outputs(*_PULSES),
    ),
    "E522": Code(
        "registers that cannot be",
        "A register has 4 bytes: addresses, offsets and sizes are multiples of 4. Addresses have 32 bits, and no two "
        "windows have one in common.",
        Kind.BOARD,
        '"hardware": {"registers": {"0x1000": {"file": "/dev/uio0", "bytes": 6}}}',
        '"hardware": {"registers": {"0x1000": {"file": "/dev/uio0", "bytes": 8}}}',
    ),
    "W501": Code(
        "a device that nothing uses",
        "It is not opened. Usually a backend is missing, and the sensor has less redundancy than the board; or an output.",
        Kind.BOARD,
        _devices(_MPU, ',\n  "spare": {"driver": "iio", "device": "mpu9250", "rate_hz": 100}'),
        _devices(_MPU),
    ),
    "W502": Code(
        "a sensor channel that no sensor feeds",
        "The machine never gets a sample of it. With an age limit its instance fails.",
        Kind.CHANNELS,
        EXAMPLE_CHANNELS.replace(
            "\n]",
            ',\n  {"name": "height", "id": 4, "field": "control.inputs.height", "direction": "sensor", '
            '"max_age_ticks": 5}\n]',
        ),
        EXAMPLE_CHANNELS,
    ),
    "W503": Code(
        "a channel that never becomes invalid",
        "When no backend of a sensor is healthy, its channels get no samples. Only `max_age_ticks` makes them invalid "
        "then; without it the machine flies on with the last values.",
        Kind.CHANNELS,
        EXAMPLE_CHANNELS.replace(', "max_age_ticks": 5', ""),
        EXAMPLE_CHANNELS,
    ),
    "W504": Code(
        "rates or accelerations that are sampled too slowly",
        "A tick takes the last of the readings that came since the one before. Vibration above half the tick rate then "
        "looks like slow motion (aliasing), and no filter in the machine can remove it. Limit the band with "
        "`low_pass_hz`, or use delta_angle and delta_velocity, which are integrals over the tick.",
        Kind.BOARD,
        _fast(),
        _fast(',\n          "low_pass_hz": {"gyro": 40}'),
    ),
    "W505": Code(
        "a tolerance that has no effect",
        "`tolerance` is how far a backend may be from the others. With two, nobody knows which of them is wrong: it "
        "takes three to judge one.",
        Kind.BOARD,
        _of_sensor('"health": {"tolerance": {"gyro": 0.2}}'),
        _sensors(),
    ),
    "W506": Code(
        "an actuator channel that no output drives",
        "A board with `outputs` drives all actuator channels of its machine: a motor that gets nothing would be found in "
        "flight. fcsl-guard refuses such a board.",
        Kind.BOARD,
        '"outputs": {}',
        _outputs(*_PULSES),
    ),
    "W507": Code(
        "a builtin that reaches nothing",
        "An algorithm calls hw_read_gpio or another builtin of hardware, and the board has no `hardware` for it. It would "
        "read false or 0, and what it writes would move nothing.",
        Kind.CHANNELS,
        _WITH_LAMP,
        EXAMPLE_CHANNELS,
    ),
}
