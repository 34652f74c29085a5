"""Where the glider shall go. Each state has one of these; `Reference` follows the one that runs."""

from __future__ import annotations

from fcsl_builtins import abs, atan, atan2, clamp, cos, f64, hypot, max, norm, pi, sin, wrap_angle


def line_course(start: f64[2], end: f64[2], here: f64[2], approach: f64) -> f64:
    """Course (rad) onto the line from start to end: straight along it on the line, at right angles to it far away.

        course = line - atan(cross / approach),    cross: m to the right of the line

    Beard, McLain, Small Unmanned Aircraft (2012), section 10.1.
    """
    along = atan2(end[1] - start[1], end[0] - start[0])
    cross = -sin(along) * (here[0] - start[0]) + cos(along) * (here[1] - start[1])
    return along - atan(cross / approach)


class Standby:
    """On the ground: the winch starts the flight, when the filter is ready and the airspeed sensor works."""

    inputs = {
        "specific_force": "f64[3] m/s^2",
        "pitch": "f64 rad",
        "ready": "bool",
        "airspeed_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"gravity": "f64 m/s^2", "pull": "f64 m/s^2", "pull_s": "f64 s"}
    state = {"pulled": "f64 s"}

    def execute(self):
        forward = self.specific_force[0] - self.gravity * sin(self.pitch)
        self.pulled = self.pulled + self.dt if forward > self.pull else 0.0
        if self.ready and self.airspeed_valid and self.pulled > self.pull_s:
            self.transition_request = "LAUNCH"


class Launch:
    """On the winch: wings on the launch course, speed held by pitch. It ends when the cable does not pull any more."""

    inputs = {"specific_force": "f64[3] m/s^2", "resumed": "bool", "dt": "f64 s"}
    outputs = {"command": "Command", "transition_request": "TransitionRequest"}
    parameters = {
        "speed": "f64 m/s",
        "course": "f64 rad",
        "pitch_low": "f64 rad",
        "pitch_high": "f64 rad",
        "pull": "f64 m/s^2",
        "released_s": "f64 s",
        "least_s": "f64 s",
    }
    state = {"time": "f64 s", "slack": "f64 s"}

    def execute(self):
        if self.resumed:
            self.time = 0.0
            self.slack = 0.0
        self.time += self.dt
        self.slack = self.slack + self.dt if self.specific_force[0] < self.pull else 0.0
        self.command = Command(self.speed, self.course, 0.0, self.pitch_low, self.pitch_high, False, True)
        if self.time > self.least_s and self.slack > self.released_s:
            self.transition_request = "GLIDE"


class Glide:
    """Straight on, at the speed of best glide. After `straight_s` to the waypoints, if the place is known."""

    inputs = {
        "course": "f64 rad",
        "height": "f64 m",
        "gnss_age": "f64 s",
        "done": "bool",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"command": "Command", "transition_request": "TransitionRequest"}
    parameters = {
        "speed": "f64 m/s",
        "pitch_low": "f64 rad",
        "pitch_high": "f64 rad",
        "straight_s": "f64 s",
        "patience": "f64 s",
        "land_height": "f64 m",
    }
    state = {"time": "f64 s", "straight": "f64 rad"}

    def execute(self):
        if self.resumed:
            self.time = 0.0
            self.straight = self.course
        self.time += self.dt
        self.command = Command(self.speed, self.straight, 0.0, self.pitch_low, self.pitch_high, False, False)
        if self.height < self.land_height:
            self.transition_request = "LAND"
        elif self.time > self.straight_s and self.gnss_age < self.patience:
            self.transition_request = "LOITER" if self.done else "WAYPOINT"


class Waypoint:
    """Along straight lines from waypoint to waypoint. It goes on to the next where it would pass the present one."""

    inputs = {"position": "f64[3] m", "height": "f64 m", "resumed": "bool"}
    outputs = {
        "command": "Command",
        "leg": "i32",  # number of the waypoint ahead
        "cross": "f64 m",  # right of the line
        "done": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "waypoints": "f64[3][2] m",  # north, east
        "speed": "f64 m/s",
        "pitch_low": "f64 rad",
        "pitch_high": "f64 rad",
        "approach": "f64 m in 1..",
        "early": "f64 m",  # before the waypoint: there the turn begins
        "leave_height": "f64 m",
    }
    state = {"begin": "f64[2] m"}

    def execute(self):
        here = self.position[0:2]
        if self.resumed:
            self.begin = here
        end = self.waypoints[self.leg]
        along = atan2(end[1] - self.begin[1], end[0] - self.begin[0])
        left = cos(along) * (end[0] - here[0]) + sin(along) * (end[1] - here[1])
        self.cross = -sin(along) * (here[0] - self.begin[0]) + cos(along) * (here[1] - self.begin[1])
        course = line_course(self.begin, end, here, self.approach)
        self.command = Command(self.speed, course, 0.0, self.pitch_low, self.pitch_high, False, False)
        if left < self.early:
            if self.leg < len(self.waypoints) - 1:
                self.begin = end
                self.leg += 1
            else:
                self.done = True
        if self.done or self.height < self.leave_height:
            self.transition_request = "LOITER"


class Loiter:
    """Circles to the right around a centre, until it is low and heads into the landing course.

        course = bearing from the centre + pi/2 + atan(2 (d - radius) / radius),    turn = speed over ground / d

    Beard, McLain (2012), section 10.2.
    """

    inputs = {"position": "f64[3] m", "height": "f64 m", "course": "f64 rad", "ground_speed": "f64 m/s"}
    outputs = {
        "command": "Command",
        "distance": "f64 m",  # from the centre
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "centre": "f64[2] m",
        "radius": "f64 m in 10..",
        "speed": "f64 m/s",
        "pitch_low": "f64 rad",
        "pitch_high": "f64 rad",
        "land_height": "f64 m",
        "land_course": "f64 rad",
        "least_height": "f64 m",  # it lands in any direction
    }

    def execute(self):
        north = self.position[0] - self.centre[0]
        east = self.position[1] - self.centre[1]
        self.distance = hypot(north, east)
        out = atan(2.0 * (self.distance - self.radius) / self.radius)
        course = wrap_angle(atan2(east, north) + 0.5 * pi + out)
        near = abs(self.distance - self.radius) < 0.5 * self.radius
        turn = self.ground_speed / self.radius if near else 0.0
        self.command = Command(self.speed, course, turn, self.pitch_low, self.pitch_high, False, False)
        heads = abs(wrap_angle(self.course - self.land_course)) < 0.3
        if self.height < self.least_height or (self.height < self.land_height and heads):
            self.transition_request = "LAND"


class Land:
    """Straight along the landing course, at a speed above that of best glide; low above the ground it flares."""

    inputs = {"position": "f64[3] m", "height": "f64 m", "course": "f64 rad", "gnss_age": "f64 s", "resumed": "bool"}
    outputs = {"command": "Command", "transition_request": "TransitionRequest"}
    parameters = {
        "speed": "f64 m/s",
        "pitch_low": "f64 rad",
        "pitch_high": "f64 rad",
        "approach": "f64 m in 1..",
        "flare_height": "f64 m",
        "level_height": "f64 m",  # below it the wings stay level
        "patience": "f64 s",
    }
    state = {"begin": "f64[2] m", "straight": "f64 rad"}

    def execute(self):
        here = self.position[0:2]
        if self.resumed:
            self.begin = here
            self.straight = self.course
        ahead = [self.begin[0] + cos(self.straight), self.begin[1] + sin(self.straight)]
        course = line_course(self.begin, ahead, here, self.approach)
        if self.gnss_age > self.patience:
            course = self.straight
        level = self.height < self.level_height
        self.command = Command(self.speed, course, 0.0, self.pitch_low, self.pitch_high, level, False)
        if self.height < self.flare_height:
            self.transition_request = "FLARE"


class Flare:
    """Rounds out along an exponential, wings level, until it stands:

    sink_c = max(height / time_constant, least sink),   e = (sink - sink_c) / V
    pitch = i + k e,   i' = k_i e,   V not below `slow`
    """

    inputs = {
        "velocity": "f64[3] m/s",
        "height": "f64 m",
        "airspeed": "f64 m/s",
        "pitch": "f64 rad",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"command": "Command", "transition_request": "TransitionRequest"}
    parameters = {
        "speed": "f64 m/s",
        "time_constant": "f64 s in 0.1..",
        "least_sink": "f64 m/s",
        "k": "f64",
        "ki": "f64 1/s",
        "slow": "f64 m/s in 1..",
        "pitch_low": "f64 rad",
        "pitch_high": "f64 rad",
        "rest_s": "f64 s",
    }
    state = {"rest": "f64 s", "integral": "f64 rad"}

    def execute(self):
        if self.resumed:
            self.rest = 0.0
            self.integral = self.pitch
        sink = max(self.height / self.time_constant, self.least_sink)
        error = (self.velocity[2] - sink) / max(self.airspeed, self.slow)
        self.integral = clamp(self.integral + self.ki * error * self.dt, self.pitch_low, self.pitch_high)
        wanted = clamp(self.integral + self.k * error, self.pitch_low, self.pitch_high)
        self.command = Command(self.speed, 0.0, 0.0, wanted, wanted, True, False)
        self.rest = self.rest + self.dt if norm(self.velocity) < 0.7 else 0.0
        if self.rest > self.rest_s:
            self.transition_request = "STANDBY"


class Safe:
    """Without airspeed: the pitch of a glide that is well above the stall, wings level. It goes on when the sensor does."""

    inputs = {
        "airspeed_valid": "bool",
        "airspeed_age": "f64 s",
        "velocity": "f64[3] m/s",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"command": "Command", "transition_request": "TransitionRequest"}
    parameters = {"pitch": "f64 rad", "speed": "f64 m/s", "good_s": "f64 s", "rest_s": "f64 s"}
    state = {"good": "f64 s", "rest": "f64 s"}

    def execute(self):
        if self.resumed:
            self.good = 0.0
            self.rest = 0.0
        self.command = Command(self.speed, 0.0, 0.0, self.pitch, self.pitch, True, False)
        self.good = self.good + self.dt if self.airspeed_valid and self.airspeed_age < 0.5 else 0.0
        self.rest = self.rest + self.dt if norm(self.velocity) < 0.7 else 0.0
        if self.rest > self.rest_s:
            self.transition_request = "STANDBY"
        elif self.good > self.good_s:
            self.transition_request = "GLIDE"


class Monitor:
    """Fails when the airspeed is lost: not valid, or refused by the filter. Without GNSS it asks for a straight glide."""

    inputs = {
        "imu_valid": "bool",
        "airspeed_valid": "bool",
        "airspeed_age": "f64 s",
        "gnss_age": "f64 s",
        "dt": "f64 s",
    }
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"airspeed_patience": "f64 s", "gnss_patience": "f64 s", "invalid_s": "f64 s"}
    state = {"invalid": "f64 s"}

    def execute(self):
        self.invalid = 0.0 if self.airspeed_valid else self.invalid + self.dt
        if not self.imu_valid or self.invalid > self.invalid_s or self.airspeed_age > self.airspeed_patience:
            self.health = "failed"
        elif self.gnss_age > self.gnss_patience:
            self.health = "degraded"
            self.transition_request = "STRAIGHT"
