"""The laws of the two modes, and what becomes of their commands: roll, pitch, throttle, yaw from -1 to 1."""

from fcsl_builtins import Health, clamp
from rc import THROTTLE


class Manual:
    """The sticks. It begins with the last command, and the difference fades with the time constant `fade_s`."""

    inputs = {"sticks": "f64[8]", "last": "f64[4]", "resumed": "bool", "dt": "f64 s"}
    outputs = {"command": "f64[4]"}
    parameters = {"fade_s": "f64 s in 0.01.."}
    state = {"difference": "f64[4]"}

    def execute(self):
        sticks = self.sticks[0:4]
        if self.resumed:
            self.difference = self.last - sticks
        self.command = sticks + self.difference
        self.difference = self.difference * (1.0 - min(1.0, self.dt / self.fade_s))


class Auto:
    """Stands for the law of a mission: damps the rates, with the throttle that it found."""

    inputs = {"gyro": "f64[3] rad/s", "last": "f64[4]", "resumed": "bool"}
    outputs = {"command": "f64[4]"}
    parameters = {"gain": "f64 s/rad"}
    state = {"throttle": "f64"}

    def execute(self):
        if self.resumed:
            self.throttle = self.last[THROTTLE]
        roll, pitch, yaw = self.gyro * -self.gain
        self.command = [clamp(roll, -1.0, 1.0), clamp(pitch, -1.0, 1.0), self.throttle, clamp(yaw, -1.0, 1.0)]


def commands(law: Health) -> bool:
    """Whether it has made its output. After a fault it has not: the output is an old one, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Selector:
    """The command of the law that runs in this state, or an idle one."""

    inputs = {"manual": "f64[4]", "auto": "f64[4]", "manual_health": "Health", "auto_health": "Health"}
    outputs = {"command": "f64[4]"}
    parameters = {"idle": "f64[4]"}

    def execute(self):
        if commands(self.manual_health):
            self.command = self.manual
        elif commands(self.auto_health):
            self.command = self.auto
        elif self.manual_health == "stale" and self.auto_health == "stale":
            self.command = self.idle
