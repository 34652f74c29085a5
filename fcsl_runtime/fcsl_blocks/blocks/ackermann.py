# SPDX-License-Identifier: Apache-2.0
"""Ackermann steering: from speed and curvature to steered and driven wheels, and from the wheels to a pose."""

from fcsl_builtins import (
    abs,
    all,
    atan,
    atan2,
    clamp,
    copysign,
    cos,
    f64,
    hypot,
    isfinite,
    max,
    min,
    outer,
    sin,
    sqrt,
    tan,
    wrap_angle,
    zeros,
)
from planar_odometry import along_arc, carried, pose_covariance, turned, twist_covariance


def approach(target: f64, last: f64, faster: f64, slower: f64, period: f64) -> f64:
    """The speed after a period from `last` toward `target`, with the accelerations away from and toward standstill."""
    least = abs(last) - min(slower * period, 1e308)
    if least < 0.0:
        least *= faster / slower  # what remains of the period accelerates the other way
    way = copysign(1.0, last)
    return way * clamp(way * target, least, abs(last) + faster * period)


class AckermannSteering:
    """Angles of two steered front wheels and speeds of two driven wheels, for a speed and a curvature or yaw rate.

    steering = atan(wheelbase curvature), with use_yaw_rate curvature = yaw_rate / speed    (of the bicycle model)
    c = tan(steering) / wheelbase    (of the limited steering: limited_curvature)
    left_steering = atan2(wheelbase c, 1 - e c), right_steering = atan2(wheelbase c, 1 + e c), e = steering_track / 2
    left = v (1 - g c) / left_radius, right = v (1 + g c) / right_radius, g = traction_track / 2    (rear wheels)
    with front_drive: left = v hypot(1 - g c, wheelbase c) / left_radius, right likewise with 1 + g c
    |v| <= min(max_speed, sqrt(max_lateral_acceleration / |c|), the v at which a wheel has max_wheel_speed)

    All wheels turn about one point on the rear axle, at 1 / c to the left. Limits of speed leave the steering alone, so
    the curvature stays that of the command: with use_yaw_rate, that of the commanded yaw rate at the commanded speed.
    Where the steering is limited, in angle or in rate, the speed stays and the yaw rate follows. Wheel speeds are those
    of the limited steering, so that no wheel slips while it turns. With use_yaw_rate, the steering stays while |speed|
    is at most hold_speed: at rest there is no curvature.

    Axes are those of REP-103: x forward, y left, yaw and steering counterclockwise from above. The point that moves
    with v is the middle of the rear axle. Angle and speed move on from those of the run before; in the first run and
    after a break (`resumed`) from track_steering, within max_steering, and track_speed. With another period or another
    rate they only move on faster or slower. An angle or speed that a changed limit no longer allows comes back at these
    rates.

    Source: ros2_controllers, steering_controllers_library/src/steering_odometry.cpp and doc/mobile_robot_kinematics.rst
    (kinematics); diff_drive_controller/src/speed_limiter.cpp (limits); REP-103 (axes, units). The angles are the
    directions, the speeds the lengths, of (1 - c y, c x): the velocity, over v, of a point (x, y) of a body that turns
    about (0, 1 / c).
    Limits: no slip; the driven front wheels turn about their points of contact. Beyond 2 / traction_track of curvature,
    the inner rear wheel turns backward. A command that is not finite, or whose wheel speeds are not, is passed over:
    outputs stay, so it drives on, and health is degraded: a stop needs a finite command. In the first run
    after a break, the tracked values count as well, and the next run begins in its place.
    """

    inputs = {
        "speed": "f64 m/s",  # of the middle of the rear axle, forward
        "curvature": "f64 1/m",  # positive to the left; without use_yaw_rate
        "yaw_rate": "f64 rad/s",  # counterclockwise; with use_yaw_rate
        "track_steering": "f64 rad",  # steering to begin at after a break, of the bicycle model
        "track_speed": "f64 m/s",  # speed to begin at after a break
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "wheelbase": "f64 m in 1e-6..",  # between the axles
        "steering_track": "f64 m in 0..",  # between the kingpins of the steered wheels; 0: one wheel
        "traction_track": "f64 m in 0..",  # between the middles of the driven wheels
        "left_radius": "f64 m in 1e-6..",  # of the left driven wheel
        "right_radius": "f64 m in 1e-6..",  # of the right driven wheel
        "max_steering": "f64 rad in 0..1.57",  # of the bicycle model; that of the inner wheel is greater
        "max_steering_rate": "f64 rad/s in 0.. = 1e308",  # of the bicycle model
        "max_speed": "f64 m/s in 0.. = 1e308",
        "max_acceleration": "f64 m/s^2 in 0.. = 1e308",  # away from standstill
        "max_deceleration": "f64 m/s^2 in 0.. = 1e308",  # toward standstill
        "max_lateral_acceleration": "f64 m/s^2 in 0.. = 1e308",
        "max_wheel_speed": "f64 rad/s in 0.. = 1e308",  # of the driven wheels
        "use_yaw_rate": "bool = false",  # yaw_rate instead of curvature
        "hold_speed": "f64 m/s in 0.. = 0",  # up to which the steering stays, with use_yaw_rate; at 0, noise at rest turns it
        "front_drive": "bool = false",  # the steered wheels are driven
    }
    outputs = {
        "left_steering": "f64 rad",  # of the left front wheel
        "right_steering": "f64 rad",  # of the right front wheel
        "steering": "f64 rad",  # of the bicycle model, within the limits
        "left": "f64 rad/s",  # left driven wheel, positive forward
        "right": "f64 rad/s",  # right driven wheel, positive forward
        "limited_speed": "f64 m/s",  # v within the limits
        "limited_curvature": "f64 1/m",  # c
        "limited_yaw_rate": "f64 rad/s",  # v c
        "saturated": "bool",  # a limit is active
    }
    state = {"begun": "bool"}  # steering and limited_speed are of this side of the last break

    def execute(self):
        if self.resumed:
            self.begun = False
        turning = self.yaw_rate if self.use_yaw_rate else self.curvature
        known = isfinite(self.speed) and isfinite(turning)
        if not known or not (self.begun or isfinite(self.track_steering) and isfinite(self.track_speed)):
            self.health = "degraded"
            return
        angle = self.steering if self.begun else clamp(self.track_steering, -self.max_steering, self.max_steering)
        speed = self.limited_speed if self.begun else self.track_speed

        asked = atan(self.wheelbase * (turning / self.speed if self.use_yaw_rate else turning))
        if self.use_yaw_rate and abs(self.speed) <= self.hold_speed:
            asked = angle
        way = self.max_steering_rate * self.period
        angle = clamp(clamp(asked, -self.max_steering, self.max_steering), angle - way, angle + way)
        curvature = tan(angle) / self.wheelbase

        ahead = self.wheelbase * curvature
        steered = 0.5 * self.steering_track * curvature
        driven = 0.5 * self.traction_track * curvature
        left = 1.0 - driven
        right = 1.0 + driven
        if self.front_drive:
            left = hypot(left, ahead)
            right = hypot(right, ahead)
        left /= self.left_radius
        right /= self.right_radius
        most = min(self.max_speed, self.max_wheel_speed / max(abs(left), abs(right)))
        most = min(most, sqrt(self.max_lateral_acceleration / abs(curvature)))
        wanted = clamp(self.speed, -most, most)
        speed = approach(wanted, speed, self.max_acceleration, self.max_deceleration, self.period)
        left *= speed
        right *= speed
        yaw_rate = speed * curvature
        if not (isfinite(left) and isfinite(right) and isfinite(yaw_rate)):
            self.health = "degraded"
            return
        self.left_steering = atan2(ahead, 1.0 - steered)
        self.right_steering = atan2(ahead, 1.0 + steered)
        self.steering = angle
        self.left = left
        self.right = right
        self.limited_speed = speed
        self.limited_curvature = curvature
        self.limited_yaw_rate = yaw_rate
        self.saturated = angle != asked or speed != self.speed
        self.begun = True


class AckermannOdometry:
    """Pose, twist and their covariances of a vehicle with Ackermann steering, from its driven and its steered wheels.

    c = (tan(dl) / (wheelbase + e tan(dl)) + tan(dr) / (wheelbase - e tan(dr))) / 2, e = steering_track / 2
    n = 2, with front_drive n = hypot(1 - c g, wheelbase c) + hypot(1 + c g, wheelbase c), g = traction_track / 2
    ds = (ways of the two driven wheels since the run before) / n, dh = c ds
    x += ds sinc(dh / 2) cos(heading + dh / 2), y += ds sinc(dh / 2) sin(heading + dh / 2), heading += dh
    P = F P F' + slip (|left way| + |right way|) / n^2 G G' + steering_slip |ds| H H'
    F = d pose / d pose, G = d pose / d ds with dh = c ds, H = d pose / d dh alone

    dl and dr are the angles of the steered wheels; for one sensor of the angle of the bicycle model, connect it to both
    and leave steering_track 0. For one sensor of speed at a differential, connect it to both driven wheels. The pose is
    the end of the arc of constant curvature, G and H are its exact derivatives; sinc(a) = sin(a) / a. Without
    use_speeds, c is the mean of its values at both ends of the way; with use_speeds, a way is the present speed times
    the time since the sample before, and c the present one. Frames are those of REP-105: pose in `odom`, which never
    jumps, twist in `base_link` at the middle of the rear axle; axes and units those of REP-103. Of the 6x6 covariances
    (x, y, z, roll, pitch, yaw), `planar_variance` is on the diagonal of what a plane fixes. That of the twist has
    besides, with slip and steering_slip over the time of the way, the deviations of speed and steering through the
    derivatives of v = ds / dt and c v.

    The first run takes the angles as they are: no way. The same in the first run after a break (`resumed`): pose and
    covariance stay, whatever the wheels did meanwhile. `reset` puts pose and covariance to zero before the step of its
    run. Each step uses the time since the last sample, so the period may change.

    Source: ros2_controllers, steering_controllers_library/src/steering_odometry.cpp and doc/mobile_robot_kinematics.rst
    (kinematics, exact integration); REP-105, REP-103. ds is the sum of the ways over that of the wheels' shares of v,
    instead of the mean of their quotients: at the rear it is the way of the middle of the axle, whatever the steering.
    The covariance is first-order propagation: independent errors of the ways, and of the turn from steering and side
    slip, whose variances grow with the way (random walks), through the derivatives of the equations above.
    Limits: no slip beyond these random walks; a constant error of the steering angle is no random walk. |dh| below
    about 1 rad per run keeps the linearization good. A sample that is not finite, or that makes the pose so, is passed
    over: outputs stay, health is degraded, and the next sample's way covers the gap.
    """

    inputs = {
        "left_angle": "f64 rad",  # of the left driven wheel, grows forward; without use_speeds
        "right_angle": "f64 rad",  # of the right driven wheel
        "left_speed": "f64 rad/s",  # of the left driven wheel, positive forward; with use_speeds
        "right_speed": "f64 rad/s",  # of the right driven wheel
        "left_steering": "f64 rad",  # of the left front wheel, counterclockwise
        "right_steering": "f64 rad",  # of the right front wheel
        "reset": "bool",  # begin at the origin
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "wheelbase": "f64 m in 1e-6..",  # between the axles
        "steering_track": "f64 m in 0.. = 0",  # between the kingpins; 0: both steering inputs are of the bicycle model
        "traction_track": "f64 m in 0.. = 0",  # between the middles of the driven wheels, with front_drive
        "left_radius": "f64 m in 1e-6..",  # of the left driven wheel
        "right_radius": "f64 m in 1e-6..",  # of the right driven wheel
        "front_drive": "bool = false",  # the driven wheels are the steered ones
        "use_speeds": "bool = false",  # speeds instead of angles
        "angle_range": "f64 rad in 0.. = 0",  # after which angles of driven wheels begin anew, such as 2 pi; 0: never
        "slip": "f64 m in 0.. = 0",  # variance of a wheel's way per metre, m^2/m
        "steering_slip": "f64 rad^2/m in 0.. = 0",  # variance of the turn per metre, from steering and side slip
        "speed_deviation": "f64 rad/s in 0.. = 0",  # standard deviation of a wheel's speed, for the twist alone
        "steering_deviation": "f64 rad in 0.. = 0",  # of both steering angles at once, for the twist alone
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
        "last_curvature": "f64 1/m",
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
        radii = [self.left_radius, self.right_radius]
        if self.use_speeds:
            rates = [self.left_speed, self.right_speed]
            turns = rates * (self.since if self.begun else 0.0)
        else:
            angles = [self.left_angle, self.right_angle]
            turns = turned(angles, [self.last_left, self.last_right], self.angle_range) * (1.0 if self.begun else 0.0)
            rates = turns / self.since
        ways = radii * turns

        # curvature, and by how much it grows with both steering angles
        offset = 0.5 * self.steering_track
        left = self.wheelbase * cos(self.left_steering) + offset * sin(self.left_steering)
        right = self.wheelbase * cos(self.right_steering) - offset * sin(self.right_steering)
        present = 0.5 * (sin(self.left_steering) / left + sin(self.right_steering) / right)
        by_steering = 0.5 * (self.wheelbase / left / left + self.wheelbase / right / right)
        curvature = present
        if self.begun and not self.use_speeds:
            curvature = 0.5 * (present + self.last_curvature)

        # the driven wheels' speeds over that of the vehicle: their sum, and its derivative
        shares = 2.0
        by_curvature = 0.0
        if self.front_drive:
            aside = 0.5 * self.traction_track
            ahead = self.wheelbase * curvature
            left = hypot(1.0 - aside * curvature, ahead)
            right = hypot(1.0 + aside * curvature, ahead)
            shares = left + right
            by_curvature = (self.wheelbase * ahead - aside * (1.0 - aside * curvature)) / left
            by_curvature += (self.wheelbase * ahead + aside * (1.0 + aside * curvature)) / right

        forward = (ways[0] + ways[1]) / shares
        turn = curvature * forward
        step, straight, by_turn = along_arc(self.heading, forward, turn)
        place = self.position[0:2] + step
        by_forward = straight + curvature * by_turn
        way_variance = self.slip * (abs(ways[0]) + abs(ways[1])) / shares / shares
        turn_variance = self.steering_slip * abs(forward)
        grown = carried(self.covariance, step)
        grown += way_variance * outer(by_forward, by_forward) + turn_variance * outer(by_turn, by_turn)

        speed = (radii[0] * rates[0] + radii[1] * rates[1]) / shares
        yaw_rate = curvature * speed
        wheels = (radii[0] * self.speed_deviation / shares) ** 2 + (radii[1] * self.speed_deviation / shares) ** 2
        wheels += way_variance / (self.since * self.since)
        bend = by_steering * self.steering_deviation
        slowing = -speed * by_curvature / shares * bend
        turning = speed * bend + curvature * slowing
        speed_variance = wheels + slowing * slowing
        joint = curvature * wheels + slowing * turning
        yaw_variance = curvature * curvature * wheels + turning * turning
        yaw_variance += turn_variance / (self.since * self.since)

        finite = all(isfinite(place)) and isfinite(speed) and isfinite(yaw_rate)
        finite = finite and isfinite(speed_variance) and isfinite(joint) and isfinite(yaw_variance)
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
        self.twist_covariance = twist_covariance(speed_variance, joint, yaw_variance, self.planar_variance)
        self.last_left = self.left_angle
        self.last_right = self.right_angle
        self.last_curvature = present
        self.since = 0.0
        self.begun = True
