# SPDX-License-Identifier: Apache-2.0
"""The machine and the algorithms that the examples of diagnostic codes modify."""

#: The machine that JSON examples modify. Its control.py contains the BODY examples.
EXAMPLE_MACHINE = """\
{
  "tick_hz": 100,
  "initial_state": "COAST",
  "structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s"}},
  "algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}},
  "instances": {
    "nav": {"algorithm": "Nav"},
    "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}
  },
  "connections": [{"from": "nav.speed", "to": "control.speed"}],
  "states": {
    "COAST": {"schedule": {"nav": 100, "control": 50}},
    "SAFE": {"schedule": {"nav": 10}}
  },
  "transitions": [
    {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}
  ],
  "requests": ["ABORT"]
}
"""

EXAMPLE_NAV = '''\
class Nav:
    """Where the vehicle is."""

    inputs = {"pressure": "f64 Pa"}
    outputs = {
        "altitude": "f64 m",
        "speed": "f64 m/s",
        "rate": "f64[3] rad/s",
        "mode": "i32",
    }

    def execute(self):
        climb = (101325.0 - self.pressure) / 12.0 - self.altitude
        self.altitude += climb
        self.speed = 100.0 * climb
        self.rate = [0.0, 0.0, self.speed]
        self.mode = 1 if self.speed > 0.0 else 0
'''

EXAMPLE_CONTROL = '''\
class Control:
    """What the vehicle does about it."""

    inputs = {
        "speed": "f64 m/s",
        "rate": "f64[3] rad/s",
        "mode": "i32",
        "armed": "bool",
        "height": "f64 m",
        "dt": "f64 s",
    }
    parameters = {"gain": "f64 N*s/m"}
    outputs = {
        "force": "f64 N",
        "torque": "f64[3] N*m",
        "steps": "i32",
        "ready": "bool",
        "transition_request": "TransitionRequest",
    }
    state = {"integral": "f64 m", "goal": "Goal"}

    def execute(self):
        self.goal.speed = 0.0 if self.armed else self.speed
        self.integral += (self.goal.speed - self.speed) * self.dt
        self.force = self.gain * (self.goal.speed - self.speed) + self.integral
        self.torque = self.rate * -0.5
        self.steps = self.mode
        self.ready = self.height > 0.0
        if not self.ready:
            self.transition_request = "ABORT"
'''

EXAMPLE_PILOT = '''\
class Pilot:
    """Requests what its parameter says."""

    parameters = {"on_done": "TransitionRequest"}
    outputs = {"transition_request": "TransitionRequest"}

    def execute(self):
        self.transition_request = self.on_done
'''

#: A part, `part.json`.
EXAMPLE_PART = """\
{
  "tick_hz": 100,
  "initial_state": "RUN",
  "structs": {"Order": {"word": "TransitionRequest"}},
  "algorithms": {"Pilot": {"source": "pilot.py"}},
  "instances": {"pilot": {"algorithm": "Pilot", "parameters": {"on_done": "DONE"}}},
  "states": {"RUN": {"schedule": {"pilot": 50}}},
  "requests": ["DONE"]
}
"""

EXAMPLE_LAMP = '''\
class Lamp:
    """Is lit while the vehicle is armed."""

    inputs = {"armed": "bool"}

    def execute(self):
        hw_write_gpio(4, self.armed)
'''

#: Members that the example machine has as the machine of the example board.
EXAMPLE_CHANNELS = """\
"channels": [
  {"name": "baro.pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor", "max_age_ticks": 20},
  {"name": "imu.gyro", "id": 2, "field": "control.inputs.rate", "direction": "sensor", "max_age_ticks": 5},
  {"name": "torque", "id": 3, "field": "control.outputs.torque", "direction": "actuator"}
]"""

#: The board that BOARD examples modify.
EXAMPLE_BOARD = """\
{
  "machine": "craft.json",
  "devices": {
    "mpu": {"driver": "iio", "device": "mpu6500", "rate_hz": 100},
    "bmp": {"driver": "iio", "device": "bmp280", "rate_hz": 50}
  },
  "sensors": {
    "imu": {"kind": "inertial", "channels": {"gyro": "imu.gyro"}, "backends": [{"device": "mpu"}]},
    "baro": {"kind": "barometer", "channels": {"pressure": "baro.pressure"}, "backends": [{"device": "bmp"}]}
  }
}
"""
