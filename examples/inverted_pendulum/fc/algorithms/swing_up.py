"""Swing-up by energy."""

from capture import best_lead, least_value
from fcsl_builtins import abs, clamp, cos, sin
from plant import G, inertia_of, moment_of


class SwingUp:
    """Pumps energy into the pole by the acceleration of its pivot, until balance can take over.

    The energy of the pole is zero where it stands upright:

        E = J a'^2 / 2 + m g l (cos a - 1),    E' = -m l u a' cos a        (u = s'', friction apart)
        u = sat(gain (E - aim) sign(a' cos a)) - natural^2 s - 2 damping natural s',  within +- acceleration_limit

    The first term brings E to the aim; the others bring the cart back to the middle. The force that gives u follows
    from the equations of the cart, and changes by at most `force_rate`.

    The aim is 0 at first. The centring takes energy, and that of a fast pole is known as well as its inertia. So the
    aim learns: where the pole turns back or passes upright, E is nearly all height and known well, and what is missing
    there counts for the next swing, aim' = aim - learn_share E.

    Balance takes over in the ellipsoid of capture.py, near upright, if its reference would begin on the rail.

    Source: K. J. Astrom, K. Furuta, Swinging up a pendulum by energy control, Automatica 36 (2000) 287-295.
    """

    inputs = {
        "position": "f64 m",
        "tilt": "f64 rad",
        "speed": "f64 m/s",
        "rate": "f64 rad/s",
        "applied": "f64 N",  # by the motor, in the tick before
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "force": "f64 N",
        "energy": "f64 J",
        "aim": "f64 J",  # the energy that is wanted
        "acceleration": "f64 m/s^2",  # of the pivot, as asked for
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "plant": "Plant",
        "gain": "f64 in 0..",  # m/s^2 per J
        "learn_share": "f64 in 0..1",
        "learn_band": "f64 J in 0..",  # of the energy at a miss
        "acceleration_limit": "f64 m/s^2 in 0..",
        "natural": "f64 rad/s in 0..",
        "damping": "f64 in 0..",
        "force_limit": "f64 N in 0..",
        "force_rate": "f64 N/s in 0..",
        "cost": "f64[4][4]",
        "capture_tilt": "f64 rad in 0..",
        "capture_position": "f64 m in 0..",  # of the reference that balance would begin with
    }
    state = {"last_rate": "f64 rad/s", "last_tilt": "f64 rad"}

    def execute(self):
        sine, cosine = sin(self.tilt), cos(self.tilt)
        moment, inertia = moment_of(self.plant), inertia_of(self.plant)
        self.energy = 0.5 * inertia * self.rate * self.rate + moment * G * (cosine - 1.0)
        if self.resumed:
            self.aim = 0.0
        turns = self.rate * self.last_rate < 0.0
        passes = self.tilt * self.last_tilt < 0.0
        if cosine > 0.0 and (turns or passes) and abs(self.energy) < self.learn_band:
            self.aim -= self.learn_share * self.energy
        self.last_rate = self.rate
        self.last_tilt = self.tilt
        way = -1.0 if self.rate * cosine < 0.0 else 1.0  # at rest: either
        most = self.acceleration_limit
        pump = clamp(self.gain * (self.energy - self.aim) * way, -most, most)
        centre = self.natural * (self.natural * self.position + 2.0 * self.damping * self.speed)
        self.acceleration = clamp(pump - centre, -most, most)
        turning = moment * (G * sine - self.acceleration * cosine) - self.plant.pivot_friction * self.rate
        pull = moment * (turning / inertia * cosine - self.rate * self.rate * sine)
        mass = self.plant.cart_mass + self.plant.pole_mass
        wanted = mass * self.acceleration + pull + self.plant.cart_friction * self.speed
        wanted = clamp(wanted, -self.force_limit, self.force_limit)
        step = self.force_rate * self.dt
        self.force = self.applied + clamp(wanted - self.applied, -step, step)

        value = least_value(self.cost, self.tilt, self.speed, self.rate)
        begin = self.position - best_lead(self.cost, self.tilt, self.speed, self.rate)
        on_rail = abs(begin) < self.capture_position
        if value < 1.0 and on_rail and abs(self.tilt) < self.capture_tilt:
            self.transition_request = "BALANCE"
