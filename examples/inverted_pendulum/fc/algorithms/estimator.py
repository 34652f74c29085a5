"""Position, angle and their rates from two encoders: an extended Kalman filter."""

from fcsl_builtins import (
    cos,
    diag,
    exp,
    eye,
    kf_gain,
    kf_update_cov_joseph,
    kf_update_state,
    matmul,
    outer,
    sin,
    sqrt,
    symmetric_product,
    transpose,
    wrap_angle,
)
from plant import inertia_of, jacobian, moment_of, slopes

H_POSITION = [[1.0, 0.0, 0.0, 0.0]]
H_ANGLE = [[0.0, 1.0, 0.0, 0.0]]
UNKNOWN_SPEED = 1.0  # m/s, 1 sigma of a cart of which one sample came
UNKNOWN_RATE = 5.0  # rad/s


class Estimator:
    """Extended Kalman filter of x = position, angle, speed, rate.

    Prediction over a tick with the force that the motor gave, by the midpoint rule; A is the Jacobian there:

        x' = x + dt f(x + dt/2 f(x, F), F),    P' = Phi P Phi^T + Q,    Phi = 1 + A dt + A^2 dt^2 / 2

    Q stands for forces on the cart and torques on the pole that nobody told, of standard deviations `force_sigma` and
    `torque_sigma`, each constant for a tick. A sample of an encoder is a whole number of counts: its error is even
    within +- quantum / 2, of variance quantum^2 / 12, and `sigma`^2 more for jitter. Covariances in Joseph's form.

    While all is well innovations are white, and their mean over `trend_s` is near 0, also when the cart is pushed: the
    filter knows how the pole answers. An angle that does not answer, of an encoder that is stuck, makes a trend.

    It begins with the samples, at unknown rates. It begins anew when an encoder that was lost for `restart_s` is back.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), sections 6.3
    (piecewise constant noise) and 10.3 (extended filter).
    """

    inputs = {
        "cart_position": "f64 m",
        "cart_usable": "bool",
        "pole_angle": "f64 rad",
        "pole_usable": "bool",
        "force": "f64 N",  # of the motor, since the last tick
        "dt": "f64 s",
    }
    outputs = {
        "position": "f64 m",
        "angle": "f64 rad",  # through whole turns, as the encoder counts
        "tilt": "f64 rad",  # the same within -pi to pi
        "speed": "f64 m/s",
        "rate": "f64 rad/s",
        "sigma": "f64[4]",  # of position, angle, speed, rate
        "trend": "f64",  # mean of the innovations of the angle, each divided by its standard deviation
        "ready": "bool",  # the rates are known
        "attitude": "f64[4]",  # of the pole, z up, for pictures
    }
    parameters = {
        "plant": "Plant",
        "cart_quantum": "f64 m in 0..",
        "pole_quantum": "f64 rad in 0..",
        "cart_sigma": "f64 m in 0..",
        "pole_sigma": "f64 rad in 0..",
        "force_sigma": "f64 N in 0..",
        "torque_sigma": "f64 N*m in 0..",
        "known_speed": "f64 m/s in 0..",
        "known_rate": "f64 rad/s in 0..",
        "restart_s": "f64 s in 0..",
        "trend_s": "f64 s in 0..",
    }
    state = {"x": "f64[4]", "P": "f64[4][4]", "running": "bool", "blind": "f64 s"}

    def execute(self):
        cart_variance = self.cart_quantum * self.cart_quantum / 12.0 + self.cart_sigma * self.cart_sigma
        pole_variance = self.pole_quantum * self.pole_quantum / 12.0 + self.pole_sigma * self.pole_sigma
        both = self.cart_usable and self.pole_usable
        self.blind = 0.0 if both else self.blind + self.dt
        if self.blind > self.restart_s:
            self.running = False
        if not self.running:
            if both:
                self.running = True
                self.trend = 0.0
                self.x = [self.cart_position, self.pole_angle, 0.0, 0.0]
                self.P = diag(
                    [cart_variance, pole_variance, UNKNOWN_SPEED * UNKNOWN_SPEED, UNKNOWN_RATE * UNKNOWN_RATE]
                )
        else:
            middle = self.x + slopes(self.plant, self.x, self.force) * (0.5 * self.dt)
            a = jacobian(self.plant, middle, self.force) * self.dt
            phi = eye(4) + a + matmul(a, a) * 0.5
            self.x = self.x + slopes(self.plant, middle, self.force) * self.dt
            # Accelerations of a force of 1 N on the cart, of a torque of 1 N m on the pole; what they make of a tick.
            moment, inertia = moment_of(self.plant), inertia_of(self.plant)
            mass = self.plant.cart_mass + self.plant.pole_mass
            coupling = moment * cos(middle[1])
            unit = self.dt / (mass * inertia - coupling * coupling)
            half = 0.5 * self.dt
            pushed = [half * inertia, -half * coupling, inertia, -coupling]
            turned = [-half * coupling, half * mass, -coupling, mass]
            force_step = unit * self.force_sigma
            torque_step = unit * self.torque_sigma
            noise = outer(pushed, pushed) * (force_step * force_step)
            noise = noise + outer(turned, turned) * (torque_step * torque_step)
            self.P = symmetric_product(matmul(phi, self.P), transpose(phi)) + noise
            if self.cart_usable:
                r = [[cart_variance]]
                gain = kf_gain(self.P, H_POSITION, r)
                self.x = kf_update_state(self.x, gain, [self.cart_position], H_POSITION)
                self.P = kf_update_cov_joseph(self.P, gain, H_POSITION, r)
            if self.pole_usable:
                r = [[pole_variance]]
                surprise = (self.pole_angle - self.x[1]) / sqrt(self.P[1, 1] + pole_variance)
                self.trend += (surprise - self.trend) * (1.0 - exp(-self.dt / self.trend_s))
                gain = kf_gain(self.P, H_ANGLE, r)
                self.x = kf_update_state(self.x, gain, [self.pole_angle], H_ANGLE)
                self.P = kf_update_cov_joseph(self.P, gain, H_ANGLE, r)
        self.position = self.x[0]
        self.angle = self.x[1]
        self.tilt = wrap_angle(self.angle)
        self.speed = self.x[2]
        self.rate = self.x[3]
        for i in range(4):
            self.sigma[i] = sqrt(self.P[i, i])
        self.ready = self.running and self.sigma[2] < self.known_speed and self.sigma[3] < self.known_rate
        self.attitude = [cos(0.5 * self.angle), 0.0, sin(0.5 * self.angle), 0.0]
        if not both:
            self.health = "degraded"
