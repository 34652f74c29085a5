"""Where the thrust shall go. Each state has one of these; `Steering` takes the acceleration of the one that runs."""

from __future__ import annotations

from fcsl_builtins import clamp, dot, f64, hypot, max, min, norm, sqrt, zeros


def time_to_go(weight: f64, away: f64[3], velocity: f64[3], end_velocity: f64[3], begin: f64) -> f64:
    """The largest root of weight t^4 - 2 (v.v + v.w + w.w) t^2 + 12 d.(v + w) t - 18 d.d, by Newton's method.

    d: `away`, to the end; v, w: velocities now and at the end. The search begins at a time that is too long, where the
    polynomial is convex, and so comes down to the root from above.
    """
    quadratic = -2.0 * (dot(velocity, velocity) + dot(velocity, end_velocity) + dot(end_velocity, end_velocity))
    linear = 12.0 * dot(away, velocity + end_velocity)
    constant = -18.0 * dot(away, away)
    t = begin
    for _ in range(40):
        value = ((weight * t * t + quadratic) * t + linear) * t + constant
        slope = (4.0 * weight * t * t + 2.0 * quadratic) * t + linear
        if slope > 0.0:
            t = max(t - value / slope, 0.0)
    return t


def path_end(away: f64[3], velocity: f64[3], end_velocity: f64[3], t: f64) -> f64[3]:
    """The acceleration at the end of the cubic path that takes the time t."""
    return away * (-6.0 / (t * t)) + (velocity + end_velocity * 2.0) * (2.0 / t)


def end_size(away: f64[3], velocity: f64[3], end_velocity: f64[3], gravity: f64, t: f64) -> f64:
    """The size of the acceleration by the thrust there."""
    end = path_end(away, velocity, end_velocity, t)
    return norm([end[0], end[1], end[2] - gravity])


class Standby:
    """On the stand, engine off. It leaves when the filter is ready, the monitor content and the countdown over."""

    inputs = {"ready": "bool", "monitor_health": "Health", "dt": "f64 s"}
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"countdown_s": "f64 s in 0.."}
    state = {"time": "f64 s"}

    def execute(self):
        self.time += self.dt
        if self.time > self.countdown_s and self.ready and self.monitor_health == "nominal":
            self.transition_request = "ASCENT"


class Ascent:
    """Straight up from the stand, with a speed that grows to `speed`, until `height`.

    a = a_ref + kv (v_ref - v) + kp (p_ref - p) - g
    """

    inputs = {
        "position": "f64[3] m",
        "velocity": "f64[3] m/s",
        "height": "f64 m",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"acceleration": "f64[3] m/s^2", "transition_request": "TransitionRequest"}  # of the thrust, NED
    parameters = {
        "gravity": "f64 m/s^2",
        "speed": "f64 m/s",
        "ramp": "f64 m/s^2",
        "top": "f64 m",  # height at which the descent begins
        "kp": "f64 1/s^2",
        "kv": "f64 1/s",
    }
    state = {"stand": "f64[3] m", "wanted": "f64 m/s"}

    def execute(self):
        if self.resumed:
            self.stand = self.position
            self.wanted = 0.0
        rising = self.wanted < self.speed
        self.wanted = min(self.wanted + self.ramp * self.dt, self.speed)
        for i in range(2):
            self.acceleration[i] = self.kp * (self.stand[i] - self.position[i]) - self.kv * self.velocity[i]
        climb = self.ramp if rising else 0.0
        self.acceleration[2] = -climb + self.kv * (-self.wanted - self.velocity[2]) - self.gravity
        if self.height > self.top:
            self.transition_request = "DESCENT"


class Descent:
    """To the gate over the pad: the thrust of least integral of its square, with a price for time.

        a = 6 (r_f - r - v t - g t^2 / 2) / t^2 - 2 (v_f - v - g t) / t

    t is the time to go. It is the largest root of (price + |g|^2 / 2) t^4 - 2 (v.v + v.v_f + v_f.v_f) t^2
    + 12 (r_f - r).(v + v_f) t - 18 |r_f - r|^2, which makes the integral of price + |a|^2 / 2 least. The thrust is
    largest at the end. If it is more than `end_thrust` there, t becomes so much longer (bisection) that it is not.

    The gains 6 / t^2 and 4 / t of this feedback grow beyond what the attitude can follow. So from `last_s` on the
    path that the law has found, a cubic of time, is kept and tracked, with its acceleration `lead_s` ahead, because the
    attitude comes late:

        a = a_plan(t + lead_s) + kv (v_plan - v) + kp (r_plan - r) - g

    Sources: the law: B. Ebrahimi, M. Bahrami, J. Roshanian, Optimal sliding-mode guidance with terminal velocity
    constraint for fixed-interval propulsive maneuvers, Acta Astronautica 62 (2008) 556-562; Y. Guo, M. Hawkins, B. Wie,
    Applications of generalized zero-effort-miss / zero-effort-velocity feedback guidance algorithm, J. of Guidance,
    Control, and Dynamics 36 (2013) 810-820. The time: C. D'Souza, An optimal guidance law for planetary landing, AIAA
    97-3709 (1997), here with a velocity at the end.
    """

    inputs = {
        "position": "f64[3] m",
        "velocity": "f64[3] m/s",
        "mass": "f64 kg",
        "factor": "f64",  # of the thrust
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "acceleration": "f64[3] m/s^2",  # of the thrust, NED
        "time_left": "f64 s",
        "plan_position": "f64[3] m",
        "plan_velocity": "f64[3] m/s",
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "gravity": "f64 m/s^2",
        "price": "f64 m^2/s^4 in 0..",  # of time
        "gate": "f64[3] m",  # of the centre of mass
        "gate_velocity": "f64[3] m/s",
        "end_thrust": "f64 N",
        "last_s": "f64 s in 1..",
        "kp": "f64 1/s^2",
        "kv": "f64 1/s",
        "lead_s": "f64 s in 0..",
        "leave_s": "f64 s in 0..",
    }
    state = {"plan_acceleration": "f64[3] m/s^2", "plan_jerk": "f64[3] m/s^3"}

    def execute(self):
        if self.resumed or self.time_left > self.last_s:
            away = self.gate - self.position
            weight = self.price + 0.5 * self.gravity * self.gravity
            self.time_left = time_to_go(weight, away, self.velocity, self.gate_velocity, 200.0)
            most = self.end_thrust * self.factor / self.mass
            t = max(self.time_left, 1.0)
            if end_size(away, self.velocity, self.gate_velocity, self.gravity, t) > most:
                short = t
                t *= 2.0
                for _ in range(20):
                    middle_time = 0.5 * (short + t)
                    if end_size(away, self.velocity, self.gate_velocity, self.gravity, middle_time) > most:
                        short = middle_time
                    else:
                        t = middle_time
            self.time_left = t
            begin = away * (6.0 / (t * t)) - (self.velocity * 2.0 + self.gate_velocity) * (2.0 / t)
            end = path_end(away, self.velocity, self.gate_velocity, t)
            self.plan_position = self.position
            self.plan_velocity = self.velocity
            self.plan_acceleration = begin
            self.plan_jerk = (end - begin) / t
        else:
            middle = self.plan_acceleration + self.plan_jerk * (0.5 * self.dt)
            self.plan_position = self.plan_position + (self.plan_velocity + middle * (0.5 * self.dt)) * self.dt
            self.plan_velocity = self.plan_velocity + middle * self.dt
            self.plan_acceleration = self.plan_acceleration + self.plan_jerk * self.dt
            self.time_left -= self.dt
        fast = self.plan_velocity - self.velocity
        soon = self.plan_acceleration + self.plan_jerk * self.lead_s
        self.acceleration = soon + fast * self.kv + (self.plan_position - self.position) * self.kp
        self.acceleration[2] -= self.gravity
        if self.time_left <= self.leave_s:
            self.transition_request = "TERMINAL"


class Landing:
    """Straight down. With `hold` over the point `pad`, else wherever it is without horizontal speed.

    The sink rate s follows the height h of the feet, so that braking from it needs `brake`:

        s^2 = touch_speed^2 + 2 brake (h - flare),   at most `speed`
        a   = a_ref + kv (v_ref - v) + i - g,        i' = ki (v_ref - v),    v_ref = kp (pad - p) at most `slide`

    Without a range finder the height is off by that of the GNSS: from `blind_height` on it sinks with `touch_speed`.
    The ground carries it when it has sunk and does not any more for `carried_s`, although it should, below 0.5 m.
    Without the range finder: below `blind_height`, for `blind_carried_s`, with a thrust below `carried_share` of the
    weight.
    """

    inputs = {
        "position": "f64[3] m",
        "velocity": "f64[3] m/s",
        "height": "f64 m",
        "range_age": "f64 s",
        "mass": "f64 kg",
        "thrust": "f64 N",  # that the engine gives, upright
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "acceleration": "f64[3] m/s^2",  # of the thrust, NED
        "sink": "f64 m/s",  # wanted
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "gravity": "f64 m/s^2",
        "hold": "bool",
        "pad": "f64[2] m",
        "kp": "f64 1/s",
        "kv": "f64[3] 1/s",
        "ki": "f64[3] 1/s^2",
        "slide": "f64 m/s",
        "speed": "f64 m/s",
        "touch_speed": "f64 m/s",
        "brake": "f64 m/s^2",
        "flare": "f64 m",
        "blind_height": "f64 m",
        "range_patience": "f64 s",
        "carried_share": "f64",
        "carried_s": "f64 s",
        "blind_carried_s": "f64 s",
    }
    state = {"integral": "f64[3] m/s^2", "sank": "bool", "carried": "f64 s"}

    def execute(self):
        if self.resumed:
            self.integral = zeros(3)
            self.sank = False
            self.carried = 0.0
        blind = self.range_age > self.range_patience
        slow = self.blind_height if blind else self.flare
        above = max(self.height - slow, 0.0)
        curve = sqrt(self.touch_speed * self.touch_speed + 2.0 * self.brake * above)
        self.sink = min(curve, self.speed)
        braking = above > 0.0 and curve < self.speed and self.velocity[2] > 0.8 * self.touch_speed

        wanted = zeros(3)
        wanted[2] = self.sink
        if self.hold:
            for i in range(2):
                wanted[i] = self.kp * (self.pad[i] - self.position[i])
            fast = hypot(wanted[0], wanted[1])
            if fast > self.slide:
                wanted[0:2] = wanted[0:2] * (self.slide / fast)
        for i in range(3):
            error = wanted[i] - self.velocity[i]
            self.integral[i] = clamp(self.integral[i] + self.ki[i] * error * self.dt, -2.0, 2.0)
            self.acceleration[i] = self.kv[i] * error + self.integral[i]
        self.acceleration[2] -= self.gravity + (self.brake if braking else 0.0)

        self.sank = self.sank or self.velocity[2] > 0.5 * self.touch_speed
        rests = self.sank and self.velocity[2] < 0.3 * self.touch_speed
        light = self.thrust < self.carried_share * self.mass * self.gravity
        low = self.height < self.blind_height and light if blind else self.height < 0.5
        self.carried = max(self.carried + (self.dt if rests and low else -self.dt), 0.0)  # it may bounce
        if self.carried > (self.blind_carried_s if blind else self.carried_s):
            self.transition_request = "TOUCHDOWN"


class Monitor:
    """What the sensors and the tank allow.

    | when | health, request |
    |---|---|
    | no IMU | failed: CUT |
    | no GNSS for `gnss_patience` | degraded, SAFE: land where it is |
    | propellant below what a vertical landing from here takes, and `reserve` | degraded, SAFE |
    | propellant below `commit` | degraded, DESCENT: land on the pad, now |

    A vertical landing from the height h takes the flow of a hover for h / speed + brake_s.
    """

    inputs = {
        "imu_valid": "bool",
        "gnss_age": "f64 s",
        "propellant": "f64 kg",
        "mass": "f64 kg",
        "height": "f64 m",
    }
    outputs = {"needed": "f64 kg", "transition_request": "TransitionRequest"}
    parameters = {
        "gravity": "f64 m/s^2",
        "specific_impulse": "f64 s in 1..",
        "gnss_patience": "f64 s",
        "commit": "f64 kg",
        "reserve": "f64 kg",
        "speed": "f64 m/s in 1..",
        "brake_s": "f64 s",
    }

    def execute(self):
        hover = self.mass * self.gravity / (9.80665 * self.specific_impulse)
        self.needed = hover * (max(self.height, 0.0) / self.speed + self.brake_s)
        if not self.imu_valid:
            self.health = "failed"
        elif self.gnss_age > self.gnss_patience or self.propellant < self.needed + self.reserve:
            self.health = "degraded"
            self.transition_request = "SAFE"
        elif self.propellant < self.commit:
            self.health = "degraded"
            self.transition_request = "DESCENT"
