"""The equations of cart and pole, as fcsl_sim/models/inverted_pendulum.c has them.

With the position s of the cart, the angle a of the pole from upright, the force F on the cart and the inertia
J = pole_inertia + pole_mass pole_length^2 about the pivot

    (M + m) s'' + m l (a'' cos a - a'^2 sin a) = F - cart_friction s'
    J a'' + m l s'' cos a                      = m g l sin a - pivot_friction a'
"""

from __future__ import annotations

from fcsl_builtins import cos, f64, sin, zeros

G = 9.81  # m/s^2


def moment_of(plant: Plant) -> f64:
    """m l, kg m."""
    return f64(plant.pole_mass * plant.pole_length)


def inertia_of(plant: Plant) -> f64:
    """J, kg m^2."""
    return f64(plant.pole_inertia + plant.pole_mass * plant.pole_length * plant.pole_length)


def slopes(plant: Plant, x: f64[4], force: f64) -> f64[4]:
    """x' of x = position, angle, speed, rate."""
    sine, cosine = sin(x[1]), cos(x[1])
    moment, inertia = moment_of(plant), inertia_of(plant)
    mass = plant.cart_mass + plant.pole_mass
    coupling = moment * cosine
    push = force - plant.cart_friction * x[2] + moment * x[3] * x[3] * sine
    torque = moment * G * sine - plant.pivot_friction * x[3]
    determinant = mass * inertia - coupling * coupling
    return [
        x[2],
        x[3],
        (inertia * push - coupling * torque) / determinant,
        (mass * torque - coupling * push) / determinant,
    ]


def jacobian(plant: Plant, x: f64[4], force: f64) -> f64[4][4]:
    """The partial derivatives of `slopes` by x."""
    sine, cosine = sin(x[1]), cos(x[1])
    moment, inertia = moment_of(plant), inertia_of(plant)
    mass = plant.cart_mass + plant.pole_mass
    coupling = moment * cosine
    determinant = mass * inertia - coupling * coupling
    slope = slopes(plant, x, force)
    # Of push, torque, and both times -coupling' = moment sine, by angle, speed and rate.
    push = [moment * x[3] * x[3] * cosine, -plant.cart_friction, 2.0 * moment * x[3] * sine]
    torque = [moment * G * cosine, 0.0, -plant.pivot_friction]
    cross = [moment * sine, 0.0, 0.0]
    stretch = [2.0 * coupling * moment * sine, 0.0, 0.0]  # of the determinant
    net_push = force - plant.cart_friction * x[2] + moment * x[3] * x[3] * sine
    net_torque = moment * G * sine - plant.pivot_friction * x[3]
    a = zeros(4, 4)
    a[0, 2] = 1.0
    a[1, 3] = 1.0
    for i in range(3):
        forward = inertia * push[i] - coupling * torque[i] + cross[i] * net_torque - slope[2] * stretch[i]
        turning = mass * torque[i] - coupling * push[i] + cross[i] * net_push - slope[3] * stretch[i]
        a[2, i + 1] = forward / determinant
        a[3, i + 1] = turning / determinant
    return a
