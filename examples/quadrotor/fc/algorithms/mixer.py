from __future__ import annotations

from fcsl_builtins import Health, clamp, f64, max, min, sqrt, zeros

ACROSS = [-1.0, 1.0, 1.0, -1.0]  # roll torque by thrust, times the arm: rotor 1 front right, 2 rear left,
ALONG = [1.0, -1.0, 1.0, -1.0]  # pitch torque                          3 front left, 4 rear right
AROUND = [1.0, 1.0, -1.0, -1.0]  # yaw torque by reaction: the body turns against the rotor


def share(low: f64, high: f64, value: f64, step: f64) -> f64:
    """The largest s in [0, 1] with value + s step within [low, high], for a value that is within."""
    if step > 0.0:
        return clamp((high - value) / step, 0.0, 1.0)
    if step < 0.0:
        return clamp((low - value) / step, 0.0, 1.0)
    return 1.0


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Mixer:
    """Owns the motors: thrust and torques to four throttles, in the order roll and pitch, thrust, yaw.

        T_i = T / 4 + across_i L / (4 b) + along_i M / (4 b) + around_i N / (4 c)        b: arm, c: torque by thrust

    Where a rotor would leave [least, most], first roll and pitch are scaled to fit, then the thrust is moved to make
    room for them, then yaw gets what is left. The throttle inverts the steady motor and rotor:

        w = sqrt(T / kf),    i = kq w^2 kv + i0,    throttle = (w / kv + R i) / voltage

    Motors are off while no controller runs, after a landing in SAFE, and from the first tick without IMU on, for good.
    """

    inputs = {
        "position_health": "Health",
        "thrust": "f64 N",
        "rate_health": "Health",
        "torque": "f64[3] N*m",
        "voltage": "f64 V",
        "voltage_valid": "bool",
        "imu_valid": "bool",
        "descent_health": "Health",
        "landed": "bool",  # in SAFE
    }
    outputs = {
        "throttle_1": "f64",  # 0 to 1
        "throttle_2": "f64",
        "throttle_3": "f64",
        "throttle_4": "f64",
        "thrusts": "f64[4] N",  # of the rotors, as commanded
        "given": "f64[3] N*m",  # torque after the limits
        "limited": "bool",  # not all of the torque is given
        "running": "bool",
    }
    parameters = {
        "arm": "f64 m in 0.01..",  # of a hub from each axis
        "least": "f64 N in 0..",  # thrust of a rotor
        "thrust_factor": "f64 N*s^2",  # kf: thrust / speed^2
        "torque_factor": "f64 N*m*s^2",  # kq
        "kv": "f64 rad/(s*V)",
        "resistance": "f64 Ohm",
        "no_load_current": "f64 A",
        "nominal_voltage": "f64 V",
    }
    state = {"cut": "bool"}

    def execute(self):
        voltage = (
            self.voltage if self.voltage_valid and self.voltage > 0.5 * self.nominal_voltage else self.nominal_voltage
        )
        self.running = self.position_health != "stale" and self.rate_health != "stale"
        if self.running and (not self.imu_valid or (self.descent_health != "stale" and self.landed)):
            self.cut = True
        self.running = self.running and not self.cut
        if not self.running:
            self.limited = False
            self.given = zeros(3)
            self.thrusts = zeros(4)
        elif commands(self.position_health) and commands(self.rate_health):
            # The most of a rotor: the positive root of R kq kv w^2 + w / kv + R i0 - voltage = 0.
            a = self.resistance * self.torque_factor * self.kv
            b = 1.0 / self.kv
            c = voltage - self.resistance * self.no_load_current
            fastest = (sqrt(b * b + 4.0 * a * c) - b) / (2.0 * a)
            most = self.thrust_factor * fastest * fastest

            tilt = zeros(4)
            lowest = 0.0
            highest = 0.0
            for i in range(4):
                tilt[i] = (ACROSS[i] * self.torque[0] + ALONG[i] * self.torque[1]) / (4.0 * self.arm)
                lowest = min(lowest, tilt[i])
                highest = max(highest, tilt[i])
            fit = min(1.0, (most - self.least) / max(highest - lowest, 1e-9))
            level = clamp(0.25 * self.thrust, self.least - fit * lowest, most - fit * highest)
            spin = self.torque[2] * self.thrust_factor / (4.0 * self.torque_factor)
            turn = 1.0
            for i in range(4):
                self.thrusts[i] = level + fit * tilt[i]
                turn = min(turn, share(self.least, most, self.thrusts[i], AROUND[i] * spin))
            for i in range(4):
                self.thrusts[i] = clamp(self.thrusts[i] + turn * AROUND[i] * spin, self.least, most)
            self.given = [fit * self.torque[0], fit * self.torque[1], turn * self.torque[2]]
            self.limited = fit < 1.0 or turn < 1.0
        throttle = zeros(4)
        for i in range(4):
            speed = sqrt(self.thrusts[i] / self.thrust_factor)
            current = self.torque_factor * speed * speed * self.kv + self.no_load_current
            volts = speed / self.kv + self.resistance * current
            throttle[i] = clamp(volts / voltage, 0.0, 1.0) if self.running else 0.0
        self.throttle_1, self.throttle_2, self.throttle_3, self.throttle_4 = throttle
