from fcsl_builtins import max


class Vehicle:
    outputs = {
        "tilt": "f64 deg",  # between attitude and target
        "armed": "bool",
        "landed": "bool",
        "mode": "i32",  # 0: angles are controlled, 1: ACRO, 2: FLIP
        "pulled": "bool",  # the pilot wants the parachute
    }

    def execute(self):
        pass


class Flight:
    inputs = {"climb": "f64 m/s", "period": "f64 s"}
    outputs = {"altitude": "f64 m"}
    parameters = {"first_altitude": "f64 m"}
    state = {"risen": "f64 m"}

    def execute(self):
        self.risen += self.climb * self.period
        self.altitude = self.first_altitude + self.risen


class Parachute:
    """Releases a parachute at the pilot's wish, or after `limit` ticks out of control in which the vehicle sinks."""

    inputs = {
        "altitude": "f64 m",
        "tilt": "f64 deg",
        "armed": "bool",
        "landed": "bool",
        "mode": "i32",
        "pulled": "bool",
    }
    outputs = {"released": "bool"}
    parameters = {"least_altitude": "f64 m", "limit": "i32"}
    state = {"lost": "i32", "lost_at": "f64 m"}

    def execute(self):
        if self.pulled and not self.landed and self.altitude >= self.least_altitude:
            self.released = True
        if not self.armed or self.mode != 0 or self.landed:
            self.lost = 0
        elif self.lost == 0 and self.altitude < self.least_altitude:
            pass
        elif self.tilt <= 30.0:
            self.lost = max(self.lost - 1, 0)
        else:
            self.lost += 1
            if self.lost == 1:
                self.lost_at = self.altitude
            elif self.altitude >= self.lost_at:
                self.lost = 0
            elif self.lost >= self.limit:
                self.lost = 0
                self.released = True
