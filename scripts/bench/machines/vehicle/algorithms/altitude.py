class Altitude:
    """Kalman filter of altitude and climb rate, driven by the vertical acceleration, corrected by the barometer."""

    inputs = {"accel": "f64[3]", "barometer": "f64"}
    outputs = {"altitude": "f64", "climb": "f64"}
    parameters = {"period": "f64 s", "q": "f64", "r": "f64"}
    state = {"p00": "f64", "p01": "f64", "p11": "f64"}

    def start(self):
        self.p00 = self.r
        self.p11 = self.r

    def execute(self):
        dt = self.period
        self.altitude = self.altitude + dt * self.climb + 0.5 * dt * dt * self.accel[2]
        self.climb = self.climb + dt * self.accel[2]
        p00 = self.p00 + 2.0 * dt * self.p01 + dt * dt * self.p11 + self.q * dt * dt * dt / 3.0
        p01 = self.p01 + dt * self.p11 + self.q * dt * dt / 2.0
        p11 = self.p11 + self.q * dt
        s = p00 + self.r
        k0 = p00 / s
        k1 = p01 / s
        innovation = self.barometer - self.altitude
        self.altitude += k0 * innovation
        self.climb += k1 * innovation
        self.p00 = (1.0 - k0) * p00
        self.p01 = (1.0 - k0) * p01
        self.p11 = p11 - k1 * p01
