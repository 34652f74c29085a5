"""Speed by pitch, course by bank, attitude by the surfaces."""

from __future__ import annotations

from fcsl_builtins import Health, atan, clamp, cos, max, sin, sqrt, tan, wrap_angle


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Reference:
    """The pitch and bank that are flown. It obeys the guidance of the state that runs.

    Speed by pitch, with the energies of TECS. A glider has no throttle, so of the two energies only their exchange can
    be controlled. With the kinetic energy as a height, E = V^2 / (2 g), E' = -V (sin path + drag / weight):

        e = (V_c^2 - V^2) / (2 g),   pitch = i - k e / V_c,   i' = -k_i k e / V_c

    So e' = -k e, at every speed. Course by bank, in a coordinated turn:

        turn = k_course (course_c - course) + turn_c,   bank = atan(ground speed turn / g)

    Pitch, bank and speed that are commanded move with limited rates, through all changes of state. While the pitch is
    given, or at a limit, the integral follows it. When the winch lets go, the integral becomes `glide_pitch`.
    """

    inputs = {
        "launch_health": "Health", "launch": "Command",
        "glide_health": "Health", "glide": "Command",
        "waypoint_health": "Health", "waypoint": "Command",
        "loiter_health": "Health", "loiter": "Command",
        "land_health": "Health", "land": "Command",
        "flare_health": "Health", "flare": "Command",
        "safe_health": "Health", "safe": "Command",
        "here_pitch": "f64 rad",
        "here_roll": "f64 rad",
        "course": "f64 rad",
        "ground_speed": "f64 m/s",
        "airspeed": "f64 m/s",
        "waypoints_over": "bool",
        "resumed": "bool",
        "dt": "f64 s",
    }  # fmt: skip
    outputs = {
        "pitch": "f64 rad",
        "bank": "f64 rad",
        "speed": "f64 m/s",
        "course_error": "f64 rad",
        "energy_error": "f64 m",  # as a height; positive: too slow
        "waypoints_done": "bool",
    }
    parameters = {
        "gravity": "f64 m/s^2",
        "k": "f64 1/s",
        "ki": "f64 1/s",
        "k_course": "f64 1/s",
        "bank_limit": "f64 rad",
        "bank_rate": "f64 rad/s",
        "pitch_rate": "f64 rad/s",
        "speed_rate": "f64 m/s^2",
        "launch_pitch": "f64 rad",
        "glide_pitch": "f64 rad",
    }
    state = {"integral": "f64 rad", "pulled": "bool"}

    def execute(self):
        c = Command(self.speed, self.course, 0.0, self.pitch, self.pitch, True, self.pulled)
        if commands(self.launch_health):
            c = self.launch
        elif commands(self.glide_health):
            c = self.glide
        elif commands(self.waypoint_health):
            c = self.waypoint
            self.waypoints_done = self.waypoints_over
        elif commands(self.loiter_health):
            c = self.loiter
        elif commands(self.land_health):
            c = self.land
        elif commands(self.flare_health):
            c = self.flare
        elif commands(self.safe_health):
            c = self.safe
        if self.resumed:
            self.pitch = self.here_pitch
            self.bank = self.here_roll
            self.speed = c.speed
            self.integral = self.launch_pitch
        elif self.pulled and not c.pull:
            self.integral = self.glide_pitch
        self.pulled = c.pull

        # ---- speed by pitch
        self.speed += clamp(c.speed - self.speed, -self.speed_rate * self.dt, self.speed_rate * self.dt)
        self.energy_error = (self.speed * self.speed - self.airspeed * self.airspeed) / (2.0 * self.gravity)
        push = self.k * self.energy_error / self.speed
        wanted = clamp(self.integral - push, c.pitch_low, c.pitch_high)
        if c.pitch_low == c.pitch_high:
            self.integral = wanted
        elif wanted == self.integral - push:
            self.integral -= self.ki * push * self.dt
        self.pitch += clamp(wanted - self.pitch, -self.pitch_rate * self.dt, self.pitch_rate * self.dt)

        # ---- course by bank
        self.course_error = wrap_angle(c.course - self.course)
        turn = self.k_course * self.course_error + c.turn
        bank = clamp(atan(self.ground_speed * turn / self.gravity), -self.bank_limit, self.bank_limit)
        if c.level or self.airspeed < 8.0:
            bank = 0.0
        self.bank += clamp(bank - self.bank, -self.bank_rate * self.dt, self.bank_rate * self.dt)


class Control:
    """Attitude by the surfaces, scheduled by dynamic pressure: s = (design speed / V)^2.

        elevator = -s (k_pitch e + i) + sqrt(s) k_q (q - q_turn),   e = pitch_c - pitch,  i' = ki_pitch e
        aileron  =  s (k_roll e + i) - sqrt(s) k_p p,               e = bank_c - roll,    i' = ki_roll e
        rudder   = sqrt(s) (k_r (r - r_turn) - k_rp p) - k_ra aileron
        q_turn = g sin(roll) tan(roll) / V,   r_turn = g sin(roll) cos(pitch) / V

    The last two terms of the rudder cancel the yaw that ailerons and rolling make. The integrals stand still below
    `flying_speed` and while their surface is at its limit.
    """

    inputs = {
        "pitch_command": "f64 rad",
        "bank_command": "f64 rad",
        "pitch": "f64 rad",
        "roll": "f64 rad",
        "rate": "f64[3] rad/s",
        "airspeed": "f64 m/s",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"elevator": "f64 rad", "aileron": "f64 rad", "rudder": "f64 rad"}
    parameters = {
        "gravity": "f64 m/s^2",
        "design_speed": "f64 m/s",
        "flying_speed": "f64 m/s",
        "k_pitch": "f64",
        "ki_pitch": "f64 1/s",
        "k_q": "f64 s",
        "k_roll": "f64",
        "ki_roll": "f64 1/s",
        "k_p": "f64 s",
        "k_r": "f64 s",
        "k_ra": "f64",
        "k_rp": "f64 s",
        "limit": "f64 rad",
    }
    state = {"pitch_integral": "f64 rad", "roll_integral": "f64 rad"}

    def execute(self):
        if self.resumed:
            self.pitch_integral = 0.0
            self.roll_integral = 0.0
        v = max(self.airspeed, 0.7 * self.design_speed)
        s = self.design_speed * self.design_speed / (v * v)
        root = sqrt(s)
        roll = clamp(self.roll, -1.0, 1.0)
        q_turn = self.gravity * sin(roll) * tan(roll) / v
        r_turn = self.gravity * sin(roll) * cos(self.pitch) / v
        flies = self.airspeed > self.flying_speed
        pitch_error = self.pitch_command - self.pitch
        roll_error = wrap_angle(self.bank_command - self.roll)

        elevator = -s * (self.k_pitch * pitch_error + self.pitch_integral) + root * self.k_q * (self.rate[1] - q_turn)
        self.elevator = clamp(elevator, -self.limit, self.limit)
        if flies and self.elevator == elevator:
            self.pitch_integral += self.ki_pitch * pitch_error * self.dt

        aileron = s * (self.k_roll * roll_error + self.roll_integral) - root * self.k_p * self.rate[0]
        self.aileron = clamp(aileron, -self.limit, self.limit)
        if flies and self.aileron == aileron:
            self.roll_integral += self.ki_roll * roll_error * self.dt

        rudder = root * (self.k_r * (self.rate[2] - r_turn) - self.k_rp * self.rate[0]) - self.k_ra * self.aileron
        self.rudder = clamp(rudder, -self.limit, self.limit)


class Surfaces:
    """Owns the servos: obeys the control while it runs and the IMU is alive, else all surfaces are neutral."""

    inputs = {
        "control_health": "Health",
        "imu_valid": "bool",
        "elevator_command": "f64 rad",
        "aileron_command": "f64 rad",
        "rudder_command": "f64 rad",
    }
    outputs = {"elevator": "f64 rad", "aileron": "f64 rad", "rudder": "f64 rad"}

    def execute(self):
        alive = self.control_health == "nominal" and self.imu_valid
        self.elevator = self.elevator_command if alive else 0.0
        self.aileron = self.aileron_command if alive else 0.0
        self.rudder = self.rudder_command if alive else 0.0
