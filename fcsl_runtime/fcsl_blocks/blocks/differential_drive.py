# SPDX-License-Identifier: Apache-2.0
"""Two driven wheels on one axle: from a body's speeds to the wheels, and from the wheels to a pose."""

from fcsl_builtins import (
    all,
    clamp,
    cos,
    isfinite,
    max,
    outer,
    sin,
    wrap_angle,
    zeros,
)
from planar_odometry import along_arc, carried, pose_covariance, turned, twist_covariance


class DifferentialDrive:
    """Wheel speeds of a differential drive for a forward speed and a yaw rate, with limits that keep the curvature.

    left = (v - w wheel_separation / 2) / left_radius
    right = (v + w wheel_separation / 2) / right_radius
    ratio = max(1, |v| / max_speed, |w| / max_yaw_rate, |left| / max_wheel_speed, |right| / max_wheel_speed)
    v, w, left and right are divided by the ratio, so that w / v, the curvature, is that of the command.

    Axes are those of REP-103: x forward, y left, yaw counterclockwise from above. The point that moves with v is the
    middle of the axle. The block has no memory: first run, breaks and period make no difference.

    Source: ros2_controllers, diff_drive_controller (kinematics); REP-103 (axes, units). The one ratio instead of separate
    limits follows from left and right being linear in (v, w).
    Limits: no slip. A limit of 0 stops the vehicle. If an input is not finite, the run is passed over: outputs stay, and
    health is degraded.
    """

    inputs = {
        "speed": "f64 m/s",  # v, forward
        "yaw_rate": "f64 rad/s",  # w, counterclockwise
    }
    parameters = {
        "wheel_separation": "f64 m in 1e-6..",  # between the middles of the wheels
        "left_radius": "f64 m in 1e-6..",  # of the left wheel
        "right_radius": "f64 m in 1e-6..",  # of the right wheel
        "max_speed": "f64 m/s in 0.. = 1e308",
        "max_yaw_rate": "f64 rad/s in 0.. = 1e308",
        "max_wheel_speed": "f64 rad/s in 0.. = 1e308",
    }
    outputs = {
        "left": "f64 rad/s",  # left wheel, positive forward
        "right": "f64 rad/s",  # right wheel, positive forward
        "limited_speed": "f64 m/s",  # v within the limits
        "limited_yaw_rate": "f64 rad/s",  # w within the limits
        "saturated": "bool",  # a limit is active
    }

    def execute(self):
        if not (isfinite(self.speed) and isfinite(self.yaw_rate)):
            self.health = "degraded"
            return
        half = 0.5 * self.wheel_separation
        left = (self.speed - self.yaw_rate * half) / self.left_radius
        right = (self.speed + self.yaw_rate * half) / self.right_radius
        wheel = max(abs(left), abs(right)) / self.max_wheel_speed
        ratio = max(1.0, abs(self.speed) / self.max_speed, abs(self.yaw_rate) / self.max_yaw_rate, wheel)
        self.limited_speed = self.speed / ratio
        self.limited_yaw_rate = self.yaw_rate / ratio
        # from the limited speeds, since the first ones may have overflowed
        left = (self.limited_speed - self.limited_yaw_rate * half) / self.left_radius
        right = (self.limited_speed + self.limited_yaw_rate * half) / self.right_radius
        self.left = clamp(left, -self.max_wheel_speed, self.max_wheel_speed)
        self.right = clamp(right, -self.max_wheel_speed, self.max_wheel_speed)
        self.saturated = ratio > 1.0


class DifferentialOdometry:
    """Pose, twist and their covariances of a differential drive, from the angles or the speeds of its two wheels.

    ds = (dr + dl) / 2, dh = (dr - dl) / wheel_separation    (dl, dr: the ways of the wheels since the run before)
    x += ds sinc(dh / 2) cos(heading + dh / 2), y += ds sinc(dh / 2) sin(heading + dh / 2), heading += dh
    P = F P F' + G Q G', F = d pose / d pose, G = d pose / d (dl, dr), Q = diag(slip |dl|, slip |dr|)

    These are the end of the arc of constant curvature and its exact Jacobians; sinc(a) = sin(a) / a. With use_speeds, a
    way is the present speed times the time since the sample before. Frames are those of REP-105: pose in `odom`, which
    never jumps, twist in `base_link` at the middle of the axle; axes and units those of REP-103. Of the 6x6 covariances
    (x, y, z, roll, pitch, yaw), `planar_variance` is on the diagonal of what a plane fixes.

    The first run takes the angles as they are: no way. The same in the first run after a break (`resumed`): pose and
    covariance stay, whatever the wheels did meanwhile. `reset` puts pose and covariance to zero before the step of its run.
    Each step uses the time since the last sample, so the period may change.

    Source: ros2_controllers, diff_drive_controller/src/odometry.cpp (kinematics, exact integration); REP-105, REP-103. The
    covariance is first-order propagation: independent errors of the wheels, whose variance grows with the way (a random
    walk), through the derivatives of the equations above.
    Limits: no slip beyond that random walk; |dh| below about 1 rad per run keeps the linearization good. A sample that is
    not finite, or that makes the pose so, is passed over: outputs stay, health is degraded, and the next sample's way
    covers the gap.
    """

    inputs = {
        "left_angle": "f64 rad",  # of the left wheel, grows forward; without use_speeds
        "right_angle": "f64 rad",  # of the right wheel
        "left_speed": "f64 rad/s",  # of the left wheel, positive forward; with use_speeds
        "right_speed": "f64 rad/s",  # of the right wheel
        "reset": "bool",  # begin at the origin
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "wheel_separation": "f64 m in 1e-6..",  # between the middles of the wheels
        "left_radius": "f64 m in 1e-6..",  # of the left wheel
        "right_radius": "f64 m in 1e-6..",  # of the right wheel
        "use_speeds": "bool = false",  # speeds instead of angles
        "angle_range": "f64 rad in 0.. = 0",  # after which angles begin anew, such as 2 pi; 0: they never do
        "slip": "f64 m in 0.. = 0",  # variance of a wheel's way per metre, m^2/m
        "speed_deviation": "f64 rad/s in 0.. = 0",  # standard deviation of a wheel's speed, for the twist alone
        "planar_variance": "f64 in 0.. = 1e-6",  # of z, roll, pitch and of their rates
    }
    outputs = {
        "position": "f64[3] m",  # of base_link in odom; z = 0
        "attitude": "f64[4]",  # quaternion w, x, y, z, base_link to odom
        "heading": "f64 rad",  # in -pi to pi, counterclockwise from x
        "linear": "f64[3] m/s",  # forward speed, 0, 0
        "angular": "f64[3] rad/s",  # 0, 0, yaw rate
        "covariance": "f64[3][3]",  # of x, y (m), heading (rad)
        "pose_covariance": "f64[6][6]",  # of x, y, z (m), rotation about x, y, z (rad); in odom
        "twist_covariance": "f64[6][6]",  # of the velocities along and about x, y, z; in base_link
    }
    state = {
        "last_left": "f64 rad",  # angles of the sample before
        "last_right": "f64 rad",
        "since": "f64 s",  # time since the sample before
        "begun": "bool",  # there is a sample before
    }

    def start(self):
        self.attitude[0] = 1.0

    def execute(self):
        if self.resumed:
            self.begun = False
        if self.reset:
            self.position = [0.0, 0.0, 0.0]
            self.heading = 0.0
            self.attitude = [1.0, 0.0, 0.0, 0.0]
            self.covariance = zeros(3, 3)
            self.pose_covariance = pose_covariance(self.covariance, self.planar_variance)
        self.since += self.period
        if self.use_speeds:
            rates = [self.left_speed, self.right_speed]
            turns = rates * (self.since if self.begun else 0.0)
        else:
            angles = [self.left_angle, self.right_angle]
            turns = turned(angles, [self.last_left, self.last_right], self.angle_range) * (1.0 if self.begun else 0.0)
            rates = turns / self.since
        radii = [self.left_radius, self.right_radius]
        ways = radii * turns
        speeds = radii * rates
        forward = 0.5 * (ways[0] + ways[1])
        turn = (ways[1] - ways[0]) / self.wheel_separation
        step, by_forward, by_turn = along_arc(self.heading, forward, turn)
        narrow = 1.0 / self.wheel_separation
        by_left = 0.5 * by_forward - narrow * by_turn
        by_right = 0.5 * by_forward + narrow * by_turn
        noise = self.slip * abs(ways)
        grown = carried(self.covariance, step)
        grown += noise[0] * outer(by_left, by_left) + noise[1] * outer(by_right, by_right)
        place = self.position[0:2] + step
        wheel = noise / (self.since * self.since)
        for i in range(2):
            wheel[i] += (radii[i] * self.speed_deviation) ** 2
        speed = 0.5 * (speeds[0] + speeds[1])
        yaw_rate = (speeds[1] - speeds[0]) * narrow
        yaw_variance = (wheel[0] + wheel[1]) * narrow * narrow
        finite = all(isfinite(place)) and isfinite(speed) and isfinite(yaw_rate) and isfinite(yaw_variance)
        for i in range(3):
            finite = finite and all(isfinite(grown[i]))
        if not finite:
            self.health = "degraded"
            return
        self.position[0:2] = place
        self.heading = wrap_angle(self.heading + turn)
        self.attitude = [cos(0.5 * self.heading), 0.0, 0.0, sin(0.5 * self.heading)]
        self.covariance = grown
        self.linear[0] = speed
        self.angular[2] = yaw_rate
        self.pose_covariance = pose_covariance(grown, self.planar_variance)
        speed_variance = 0.25 * (wheel[0] + wheel[1])
        joint = 0.5 * (wheel[1] - wheel[0]) * narrow
        self.twist_covariance = twist_covariance(speed_variance, joint, yaw_variance, self.planar_variance)
        self.last_left = self.left_angle
        self.last_right = self.right_angle
        self.since = 0.0
        self.begun = True
