/* SPDX-License-Identifier: Apache-2.0
 *
 * A rigid pendulum that a motor turns, with viscous damping; angle 0 hangs down:
 *
 *   J angle'' = torque - damping angle' - m g l sin(angle)
 */
#include "fcsl/fcsl_model.hpp"

namespace
{

struct pendulum {
    struct continuous {
        double angle, rate;
    };
    struct {
        double torque;
    } inputs;
    struct {
        double mass, length, inertia, damping, gravity, angle, rate;
    } parameters;
    continuous state;
    struct {
        double angle, rate, acceleration;
    } outputs;

    const char *init(const fcsl::context &)
    {
        if (!(parameters.inertia > 0.0)) {
            return "parameters.inertia must be positive";
        }
        state = {parameters.angle, parameters.rate};
        return nullptr;
    }

    continuous derivative(double, const continuous &x) const
    {
        const double weight = parameters.mass * parameters.gravity * parameters.length;
        const double torque = inputs.torque - parameters.damping * x.rate - weight * cr_sin(x.angle);
        return {x.rate, torque / parameters.inertia};
    }

    void output(double t, const continuous &x)
    {
        outputs.angle = x.angle;
        outputs.rate = x.rate;
        outputs.acceleration = derivative(t, x).rate;
    }
};

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(pendulum, FCSL_ROLE_##role, path, unit, doc)

constexpr fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.torque, "N*m", "of the motor"),
    FIELD(PARAMETER, parameters.mass, "kg", ""),
    FIELD(PARAMETER, parameters.length, "m", "from the axis to the centre of mass"),
    FIELD(PARAMETER, parameters.inertia, "kg*m^2", "about the axis"),
    FIELD(PARAMETER, parameters.damping, "N*m*s/rad", ""),
    FIELD(PARAMETER, parameters.gravity, "m/s^2", ""),
    FIELD(PARAMETER, parameters.angle, "rad", "at the start"),
    FIELD(PARAMETER, parameters.rate, "rad/s", "at the start"),
    FIELD(STATE, state.angle, "rad", ""),
    FIELD(STATE, state.rate, "rad/s", ""),
    FIELD(OUTPUT, outputs.angle, "rad", "0 hangs down"),
    FIELD(OUTPUT, outputs.rate, "rad/s", ""),
    FIELD(FEEDTHROUGH, outputs.acceleration, "rad/s^2", "with the torque of the same instant"),
};

} // namespace

FCSL_MODEL_EXPORT(pendulum, "a pendulum with damping and a motor", fields);
