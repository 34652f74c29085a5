"""Where the vehicle shall go. Each state has one of these; `Reference` smooths what it says."""

from __future__ import annotations

from fcsl_builtins import abs, f64, min, norm

HOLD = 1  # orders of the operator
MISSION = 2
LAND = 3


def toward(start: f64[3], end: f64[3], step: f64) -> f64[3]:
    """A point `step` (m) from start on the way to end, or the end."""
    way = end - start
    length = norm(way)
    if length <= step:
        return end
    return start + way * (step / length)


class Standby:
    """On the ground, motors off. An order to hold or to fly the mission starts the vehicle, when it is ready."""

    inputs = {"order": "i32", "ready": "bool", "monitor_health": "Health"}
    outputs = {"transition_request": "TransitionRequest"}

    def execute(self):
        if self.ready and self.monitor_health == "nominal" and (self.order == HOLD or self.order == MISSION):
            self.transition_request = "TAKE_OFF"


class TakeOff:
    """Spools the motors up where it stands, then climbs to `height` above that place."""

    inputs = {
        "order": "i32",
        "here": "f64[3] m",  # where the vehicle is
        "reference": "f64[3] m",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "target": "f64[3] m",
        "spool": "f64",  # share of the thrust that is let through, 0 to 1
        "transition_request": "TransitionRequest",
    }
    parameters = {"height": "f64 m", "speed": "f64 m/s", "spool_s": "f64 s in 0.1..", "radius": "f64 m"}
    state = {"end": "f64[3] m"}

    def execute(self):
        if self.resumed:
            self.spool = 0.0
            self.target = self.here
            self.end = [self.here[0], self.here[1], self.here[2] - self.height]
        self.spool = min(self.spool + self.dt / self.spool_s, 1.0)
        if self.spool == 1.0:
            self.target = toward(self.target, self.end, self.speed * self.dt)
        if self.order == LAND:
            self.transition_request = "LAND"
        elif norm(self.reference - self.end) < self.radius:
            self.transition_request = "HOLD"


class Hold:
    """Stays: the reference glides to its carrot and stops there."""

    inputs = {"order": "i32", "carrot": "f64[3] m", "mission_done": "bool", "resumed": "bool"}
    outputs = {"target": "f64[3] m", "transition_request": "TransitionRequest"}

    def execute(self):
        if self.resumed:
            self.target = self.carrot
        if self.order == LAND:
            self.transition_request = "LAND"
        elif self.order == MISSION and not self.mission_done:
            self.transition_request = "MISSION"


class Mission:
    """Flies along waypoints. The carrot waits at each until the reference has come within `radius`."""

    inputs = {
        "order": "i32",
        "carrot": "f64[3] m",  # where the reference was led to last
        "reference": "f64[3] m",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "target": "f64[3] m",
        "leg": "i32",  # number of the waypoint ahead
        "done": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {"waypoints": "f64[4][3] m", "speed": "f64 m/s", "radius": "f64 m"}

    def execute(self):
        if self.resumed:
            self.target = self.carrot
        end = self.waypoints[self.leg]
        self.target = toward(self.target, end, self.speed * self.dt)
        if norm(self.reference - end) < self.radius:
            if self.leg < len(self.waypoints) - 1:
                self.leg += 1
            else:
                self.done = True
        if self.order == LAND:
            self.transition_request = "LAND"
        elif self.done or self.order == HOLD:
            self.transition_request = "HOLD"


class Land:
    """Sinks until the thrust says that the ground carries the vehicle."""

    inputs = {
        "carrot": "f64[3] m",
        "thrust_share": "f64",  # of the weight
        "velocity": "f64[3] m/s",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"target": "f64[3] m", "transition_request": "TransitionRequest"}
    parameters = {
        "speed": "f64 m/s",
        "carried_share": "f64",  # below it, for `carried_s`, the ground carries
        "carried_s": "f64 s",
    }
    state = {"carried": "f64 s"}

    def execute(self):
        if self.resumed:
            self.target = self.carrot
            self.carried = 0.0
        self.target = [self.carrot[0], self.carrot[1], self.target[2] + self.speed * self.dt]
        rests = self.thrust_share < self.carried_share and abs(self.velocity[2]) < 0.5 * self.speed
        self.carried = self.carried + self.dt if rests else 0.0
        if self.carried > self.carried_s:
            self.transition_request = "STANDBY"
