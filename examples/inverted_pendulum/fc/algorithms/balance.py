"""Balance by linear quadratic control around a reference that the linear plant can follow."""

from capture import best_lead, least_value
from fcsl_builtins import abs, clamp, dot, exp, f64
from plant import G, inertia_of, moment_of


class Reference:
    """Where cart and pole shall be: five equal lags behind the target, and what follows from them by flatness.

        w1' = p (target - w1),  w2' = p (w1 - w2),  ..  w5' = p (w4 - w5),    y = w5

    The second equation of the plant, near upright and without friction of the pivot, is y'' = g a for
    y = s + (J / m l) a. So y is a flat output: all states and the force follow from y and four derivatives, which are
    differences of the lags.

        a = y'' / g,    s = y - (J / m l) a,    F = (M + m) s'' + m l a'' + cart_friction s'

    Five lags and not four: so the force does not jump when the target does. Each step is exact for a target that stays.

    It begins at rest where the state is deepest in the ellipsoid of capture.py.
    """

    inputs = {
        "target": "f64 m",
        "position": "f64 m",  # estimates
        "tilt": "f64 rad",
        "speed": "f64 m/s",
        "rate": "f64 rad/s",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "goal": "f64[4]",  # position, angle, speed, rate that shall be
        "force": "f64 N",  # that keeps the plant on it
    }
    parameters = {
        "plant": "Plant",
        "cost": "f64[4][4]",
        "pole": "f64 1/s in 0.1..",
        "target_limit": "f64 m in 0..",
    }
    state = {"lags": "f64[5]"}

    def execute(self):
        if self.resumed:
            begin = self.position - best_lead(self.cost, self.tilt, self.speed, self.rate)
            for i in range(5):
                self.lags[i] = begin
        p = self.pole
        w1, w2, w3, w4, y = self.lags
        y1 = p * (w4 - y)
        y2 = p * p * (w3 - 2.0 * w4 + y)
        y3 = p * p * p * (w2 - 3.0 * w3 + 3.0 * w4 - y)
        y4 = p * p * p * p * (w1 - 4.0 * w2 + 6.0 * w3 - 4.0 * w4 + y)
        moment = moment_of(self.plant)
        arm = inertia_of(self.plant) / moment  # from the pivot to the centre of percussion
        speed = y1 - arm / G * y3
        self.goal = [y - arm / G * y2, y2 / G, speed, y3 / G]
        mass = self.plant.cart_mass + self.plant.pole_mass
        self.force = mass * (y2 - arm / G * y4) + moment * y4 / G + self.plant.cart_friction * speed

        # e' = p (e of the lag before - e) of the deviations e from the target: exp(-p dt) sum (p dt)^n / n! e.
        end = clamp(self.target, -self.target_limit, self.target_limit)
        left = exp(-p * self.dt)
        for i in range(5):
            total = 0.0
            weight = left
            for n in range(5 - i):
                total += weight * (self.lags[4 - i - n] - end)
                weight *= p * self.dt / f64(n + 1)
            self.lags[4 - i] = end + total


class Balance:
    """F = F_ref - k (x - x_ref).

    k is the discrete linear quadratic regulator of the plant near upright, for a force held for a tick; weights by
    Bryson's rule: 0.1 m, 0.1 rad, 2 N. test/design.py computes it, a test compares.

    Bumpless: it begins with the force that the motor has, and comes to its own by at most `force_rate`.

    The pole is lost when the least value of capture.py exceeds `lost_value`. To go on would drive the cart into the end
    of its rail; swing-up brings it back.
    """

    inputs = {
        "position": "f64 m",
        "tilt": "f64 rad",
        "speed": "f64 m/s",
        "rate": "f64 rad/s",
        "reference": "f64[4]",
        "reference_force": "f64 N",
        "applied": "f64 N",  # by the motor, in the tick before
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"force": "f64 N", "transition_request": "TransitionRequest"}
    parameters = {
        "k": "f64[4]",
        "force_limit": "f64 N in 0..",
        "force_rate": "f64 N/s in 0..",
        "cost": "f64[4][4]",
        "lost_value": "f64 in 1..",
    }
    state = {"joined": "bool"}  # the force is the wanted one

    def execute(self):
        x = [self.position, self.tilt, self.speed, self.rate]
        wanted = self.reference_force - dot(self.k, x - self.reference)
        wanted = clamp(wanted, -self.force_limit, self.force_limit)
        if self.resumed:
            self.joined = False
        step = self.force_rate * self.dt
        if abs(wanted - self.applied) <= step:
            self.joined = True
        self.force = wanted if self.joined else self.applied + clamp(wanted - self.applied, -step, step)
        if least_value(self.cost, self.tilt, self.speed, self.rate) > self.lost_value:
            self.transition_request = "SWING_UP"
