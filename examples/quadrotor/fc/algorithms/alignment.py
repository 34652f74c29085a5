from fcsl_builtins import atan2, hypot, isfinite, norm, quat_from_euler, quat_rotate, wrap_angle, zeros
from rotations import heading

STILL = 0.1  # rad/s: more than that is no rest


class Alignment:
    """The first attitude, at rest: tilt from gravity, yaw from the magnetic field, gyro bias from the mean rate.

        roll = atan2(-f2, -f3),  pitch = atan2(f1, |f2, f3|)      f: mean specific force
        yaw = heading of the field of the Earth - heading of the measured field, turned level

    It ends after `rest_s` without a turn faster than 0.1 rad/s, when GNSS, barometer and magnetometer have been heard.
    """

    inputs = {
        "delta_angle": "f64[3] rad",
        "delta_velocity": "f64[3] m/s",
        "gyro": "f64[3] rad/s",
        "imu_valid": "bool",
        "gnss_position": "f64[3] m",
        "gnss_fresh": "bool",
        "barometer_height": "f64 m",
        "barometer_fresh": "bool",
        "field": "f64[3] T",
        "field_fresh": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "aligned": "bool",
        "attitude": "f64[4]",  # body to NED
        "position": "f64[3] m",
        "gyro_bias": "f64[3] rad/s",
        "barometer_bias": "f64 m",
    }
    parameters = {"field_ned": "f64[3] T", "rest_s": "f64 s"}
    state = {
        "rest": "f64 s",
        "angle": "f64[3] rad",  # sums since it rests
        "velocity": "f64[3] m/s",
        "gnss_heard": "bool",
        "barometer_heard": "bool",
        "field_heard": "bool",
    }

    def start(self):
        self.attitude = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        if not self.aligned:
            if self.gnss_fresh and isfinite(norm(self.gnss_position)):
                self.position = self.gnss_position
                self.gnss_heard = True
            if self.barometer_fresh and isfinite(self.barometer_height):
                self.barometer_bias = self.barometer_height + self.position[2]
                self.barometer_heard = True
            if self.field_fresh and isfinite(norm(self.field)):
                self.field_heard = True
            self.rest += self.dt
            self.angle = self.angle + self.delta_angle
            self.velocity = self.velocity + self.delta_velocity
            if not (self.imu_valid and norm(self.gyro) < STILL):
                self.rest = 0.0
                self.angle = zeros(3)
                self.velocity = zeros(3)
            if self.rest > self.rest_s and self.gnss_heard and self.barometer_heard and self.field_heard:
                f = self.velocity
                roll = atan2(-f[1], -f[2])
                pitch = atan2(f[0], hypot(f[1], f[2]))
                level = quat_rotate(quat_from_euler(roll, pitch, 0.0), self.field)
                yaw = wrap_angle(heading(self.field_ned) - heading(level))
                self.attitude = quat_from_euler(roll, pitch, yaw)
                self.gyro_bias = self.angle / self.rest
                self.aligned = True
            self.health = "degraded"
