/* SPDX-License-Identifier: Apache-2.0
 *
 * everything_c.c in C++.
 */
#include "fcsl/fcsl_model.hpp"

namespace
{

struct everything_cpp {
    struct continuous {
        double position, speed;
    };
    struct {
        std::array<double, 3> wind;
        int32_t count;
        bool enabled;
    } inputs;
    struct {
        float gain[2][3];
        uint64_t limit;
        int64_t identity;
        double curve[4];
    } parameters;
    struct {
        continuous x;
        uint32_t updates, last_event;
    } state;
    struct {
        double value, sample[2];
        bool sampled;
    } outputs;

    static constexpr fcsl_model_event_t events[] = {
        {"ground", FCSL_FALLING, "the position becomes negative"},
        {"second", FCSL_EITHER, ""},
    };
    static constexpr bool is_second_order = true;

    const char *init(const fcsl::context &context)
    {
        if (parameters.limit == 0) {
            return "parameters.limit must not be 0";
        }
        state.x.position = 1.0 + static_cast<double>(context.time_ns());
        return nullptr;
    }

    continuous derivative(double t, const continuous &x) const
    {
        return {x.speed, inputs.wind[0] - x.position + static_cast<double>(parameters.gain[1][2]) * t};
    }

    void output(double t, const continuous &x)
    {
        outputs.value = inputs.wind[2] + cr_sin(x.position) + sqrt(t);
    }

    void update(const fcsl::context &context)
    {
        state.updates++;
        outputs.sample[0] = context.gaussian(1);
        outputs.sample[1] = context.uniform(2);
        outputs.sampled = inputs.enabled;
    }

    void event(double t, const continuous &x, double *value) const
    {
        value[0] = x.position;
        value[1] = t - 1.0;
    }

    void reset(const fcsl::context &, uint32_t number)
    {
        state.x.speed = -state.x.speed;
        state.last_event = number;
    }

    double next_time(double t) const
    {
        return t + static_cast<double>(parameters.identity);
    }
};

#define FIELD(kind, role, path, unit, doc) FCSL_MODEL_##kind(everything_cpp, FCSL_ROLE_##role, path, unit, doc)

constexpr fcsl_field_t fields[] = {
    FIELD(VECTOR, INPUT, inputs.wind, "m/s", "of the air"),
    FIELD(SCALAR, OPTIONAL_INPUT, inputs.count, "", ""),
    FIELD(SCALAR, INPUT, inputs.enabled, "", ""),
    FIELD(MATRIX, PARAMETER, parameters.gain, "", "two rows of three"),
    FIELD(SCALAR, PARAMETER, parameters.limit, "", ""),
    FIELD(SCALAR, OPTIONAL_PARAMETER, parameters.identity, "", ""),
    FIELD(VECTOR, TABLE, parameters.curve, "N", ""),
    FIELD(SCALAR, STATE, state.x.position, "m", ""),
    FIELD(SCALAR, STATE, state.x.speed, "m/s", ""),
    FIELD(SCALAR, STATE, state.updates, "", ""),
    FIELD(SCALAR, STATE, state.last_event, "", ""),
    FIELD(SCALAR, FEEDTHROUGH, outputs.value, "m", ""),
    FIELD(VECTOR, OUTPUT, outputs.sample, "", "of noise"),
    FIELD(SCALAR, OUTPUT, outputs.sampled, "", ""),
};

} // namespace

FCSL_MODEL_EXPORT_SENSOR(everything_cpp, "every function, every type", fields, outputs.sampled);
