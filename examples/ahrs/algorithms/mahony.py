from fcsl_builtins import (
    abs,
    atan2,
    cross3,
    hypot,
    norm,
    quat_conj,
    quat_from_axis_angle,
    quat_from_euler,
    quat_mul,
    quat_normalize,
    quat_rotate,
    quat_to_euler,
)

UP = [0.0, 0.0, 1.0]


class Mahony:
    """Attitude from gyroscope and accelerometer: Mahony's explicit complementary filter with gyro bias.

    The gyro is integrated; the accelerometer, which at rest points up, turns the estimate slowly toward it:

        e = (a / |a|) x up_body,    bias' = -ki e,    q' = 1/2 q (x) (gyro - bias + kp e)

    `kp` is the rate at which a tilt error decays, far slower than the vehicle's own accelerations last. Samples
    whose magnitude is off gravity by more than `accel_gate` say more about these than about the vertical, and are
    passed over. Yaw is not observable: it starts at zero and follows the gyro. Quaternions are scalar first and
    turn body into world coordinates, z up. Rotation over one tick is exact for a constant rate. At the start, and
    after the IMU was lost, roll and pitch come from the first sample that passes the gate.

    Source: R. Mahony, T. Hamel, J.-M. Pflimlin, Nonlinear Complementary Filters on the Special Orthogonal Group, IEEE
    Transactions on Automatic Control 53(5), 2008 (the explicit complementary filter).
    """

    inputs = {
        "gyro": "f64[3] rad/s",  # body axes
        "accel": "f64[3] m/s^2",  # body axes
        "imu_health": "Health",
        "dt": "f64 s",
    }
    outputs = {
        "orientation": "f64[4]",  # unit quaternion w, x, y, z
        "rate": "f64[3] rad/s",  # without bias, body axes
        "bias": "f64[3] rad/s",  # of the gyro
    }
    parameters = {
        "kp": "f64 1/s",  # tilt correction
        "ki": "f64 1/s^2",  # bias correction
        "gravity": "f64 m/s^2",
        "accel_gate": "f64 m/s^2",
    }
    state = {"aligned": "bool"}

    def start(self):
        self.orientation = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        trusted = abs(norm(self.accel) - self.gravity) < self.accel_gate
        if self.imu_health == "failed":
            self.aligned = False
            self.health = "failed"
        elif not self.aligned:
            if trusted:
                roll = atan2(self.accel[1], self.accel[2])
                pitch = atan2(-self.accel[0], hypot(self.accel[1], self.accel[2]))
                euler = quat_to_euler(self.orientation)
                self.orientation = quat_from_euler(roll, pitch, euler[2])
                self.aligned = True
            else:
                self.health = "degraded"
        else:
            self.rate = self.gyro - self.bias
            turn = self.rate
            if trusted:
                up_body = quat_rotate(quat_conj(self.orientation), UP)
                error = cross3(self.accel / norm(self.accel), up_body)
                self.bias = self.bias - error * (self.ki * self.dt)
                turn = turn + error * self.kp
            speed = norm(turn)
            if speed > 0.0:
                step = quat_from_axis_angle(turn / speed, speed * self.dt)
                self.orientation = quat_normalize(quat_mul(self.orientation, step))
