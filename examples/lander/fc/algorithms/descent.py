from fcsl_builtins import abs, clamp, max, sqrt


class Descent:
    """Powered descent along a velocity profile, touchdown detection, engine off.

    Above `final_altitude` the vehicle brakes with the constant deceleration `brake` down to `touchdown_speed` (the
    profile of coast.py), below it sinks at that speed. It has landed when, close to the ground, it has stood still
    for `still_time` although told to sink, or when the estimate lies `burial_depth` under the ground: then there is
    no doubt left.
    """

    inputs = {
        "pos_z": "f64 m",  # estimates
        "vel_z": "f64 m/s",
        "dt": "f64 s",
    }
    outputs = {
        "throttle": "f64",  # 0 to 1
        "target_velocity": "f64 m/s",
        "landed": "bool",
    }
    parameters = {
        "brake": "f64 m/s^2",
        "touchdown_speed": "f64 m/s",
        "final_altitude": "f64 m",
        "gain": "f64 1/s",  # acceleration asked for each m/s of error
        "gravity": "f64 m/s^2",
        "hover_throttle": "f64",  # throttle whose thrust is the vehicle's weight
        "ground_altitude": "f64 m",  # below it, the vehicle may be standing on the ground
        "still_time": "f64 s",
        "burial_depth": "f64 m",
    }
    state = {"still": "f64 s"}  # how long the vehicle has not moved

    def execute(self):
        height = max(self.pos_z - self.final_altitude, 0.0)
        self.target_velocity = -sqrt(self.touchdown_speed * self.touchdown_speed + 2.0 * self.brake * height)
        acceleration = self.gain * (self.target_velocity - self.vel_z)
        if height > 0.0:
            acceleration += self.brake
        self.throttle = clamp(self.hover_throttle * (1.0 + acceleration / self.gravity), 0.0, 1.0)

        still = self.pos_z < self.ground_altitude and abs(self.vel_z) < 0.5 * self.touchdown_speed
        self.still = self.still + self.dt if still else 0.0
        if self.still > self.still_time or self.pos_z < -self.burial_depth:
            self.landed = True
        if self.landed:
            self.throttle = 0.0
