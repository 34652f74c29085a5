/* SPDX-License-Identifier: Apache-2.0
 *
 * A battery of cells in series: open-circuit voltage from a table over the charge, a resistance and one RC pair.
 *
 *   i = current + current_2 + ... + current_8,  positive discharges
 *   charge' = -i / (3600 capacity)
 *   p' = (polarisation_resistance i - p) / polarisation_time_constant
 *   voltage = cells (open_circuit_voltage(charge) - p - resistance i), not below 0
 *
 * The table is linear between its rows, and its ends hold. At charge 0 (event `empty`) the voltage is 0, and the charge
 * stays until a current charges it. At charge 1 (event `full`) the charge stays until a current discharges it.
 *
 * Source: G. L. Plett, Battery Management Systems, vol. 1 (2015), chapter 2.
 *
 * Limits: no temperature, no ageing, no self-discharge, no hysteresis of the open-circuit voltage; nothing is lost in
 * charging but in the resistances.
 */
#include "fcsl/fcsl_model.h"
#include "linear_table.h"

#define SECONDS_PER_HOUR 3600.0

enum { CAPACITY = 16 };
enum { CHARGE, POLARISATION, CONTINUOUS_STATES };
enum { EMPTY, FULL, LEAVES_END, EVENTS };

typedef struct {
    struct {
        double current, current_2, current_3, current_4, current_5, current_6, current_7, current_8;
    } inputs;
    struct {
        double capacity;
        double cells;
        double charge[CAPACITY];
        double open_circuit_voltage[CAPACITY];
        double resistance;
        double polarisation_resistance;
        double polarisation_time_constant;
        double initial_charge;
    } parameters;
    struct {
        double charge; /* this and the next one are integrated */
        double polarisation;
        int32_t end; /* -1: held at empty, 1: held at full */
    } state;
    struct {
        double voltage;
        double charge;
    } outputs;
} battery_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    battery_t *battery = self;
    (void)context;
    if (!(battery->parameters.capacity > 0.0)) {
        return "parameters.capacity must be positive";
    }
    if (!(battery->parameters.cells > 0.0)) {
        return "parameters.cells must be positive";
    }
    if (!table_increases(battery->parameters.charge, CAPACITY)) {
        return "parameters.charge must increase from row to row";
    }
    if (!(battery->parameters.resistance >= 0.0)) {
        return "parameters.resistance must not be negative";
    }
    if (!(battery->parameters.polarisation_resistance >= 0.0)) {
        return "parameters.polarisation_resistance must not be negative";
    }
    if (!(battery->parameters.polarisation_time_constant > 0.0)) {
        return "parameters.polarisation_time_constant must be positive";
    }
    if (!(battery->parameters.initial_charge >= 0.0) || !(battery->parameters.initial_charge <= 1.0)) {
        return "parameters.initial_charge must be from 0 to 1";
    }
    battery->state.charge = battery->parameters.initial_charge;
    return NULL;
}

static double current_of(const battery_t *battery)
{
    return battery->inputs.current + battery->inputs.current_2 + battery->inputs.current_3 + battery->inputs.current_4 +
           battery->inputs.current_5 + battery->inputs.current_6 + battery->inputs.current_7 +
           battery->inputs.current_8;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const battery_t *battery = self;
    (void)t;
    const double current = current_of(battery);
    dx[CHARGE] = battery->state.end != 0 ? 0.0 : -current / (SECONDS_PER_HOUR * battery->parameters.capacity);
    dx[POLARISATION] = (battery->parameters.polarisation_resistance * current - x[POLARISATION]) /
                       battery->parameters.polarisation_time_constant;
}

static void output(void *self, double t, const double *x)
{
    battery_t *battery = self;
    (void)t;
    const table_place_t place = table_find(battery->parameters.charge, CAPACITY, x[CHARGE]);
    const double cell = table_value(battery->parameters.open_circuit_voltage, place) - x[POLARISATION] -
                        battery->parameters.resistance * current_of(battery);
    battery->outputs.voltage = battery->state.end < 0 || cell < 0.0 ? 0.0 : battery->parameters.cells * cell;
    battery->outputs.charge = x[CHARGE];
}

static void event(const void *self, double t, const double *x, double *value)
{
    const battery_t *battery = self;
    const int is_between = battery->state.end == 0;
    (void)t;
    value[EMPTY] = is_between ? x[CHARGE] : 1.0;
    value[FULL] = is_between ? 1.0 - x[CHARGE] : 1.0;
    value[LEAVES_END] = is_between ? 1.0 : -(double)battery->state.end * current_of(battery);
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    battery_t *battery = self;
    (void)context;
    if (number == EMPTY) {
        battery->state.charge = 0.0;
        battery->state.end = -1;
    } else if (number == FULL) {
        battery->state.charge = 1.0;
        battery->state.end = 1;
    } else {
        battery->state.end = 0;
    }
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(battery_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(battery_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.current, "A", "positive discharges"),
    SCALAR(OPTIONAL_INPUT, inputs.current_2, "A", "of a further consumer"),
    SCALAR(OPTIONAL_INPUT, inputs.current_3, "A", ""),
    SCALAR(OPTIONAL_INPUT, inputs.current_4, "A", ""),
    SCALAR(OPTIONAL_INPUT, inputs.current_5, "A", ""),
    SCALAR(OPTIONAL_INPUT, inputs.current_6, "A", ""),
    SCALAR(OPTIONAL_INPUT, inputs.current_7, "A", ""),
    SCALAR(OPTIONAL_INPUT, inputs.current_8, "A", ""),
    SCALAR(PARAMETER, parameters.capacity, "A*h", ""),
    SCALAR(PARAMETER, parameters.cells, "", "in series"),
    VECTOR(TABLE, parameters.charge, "", "increasing, 0 to 1, at most 16 rows"),
    VECTOR(TABLE, parameters.open_circuit_voltage, "V", "of one cell at each charge"),
    SCALAR(PARAMETER, parameters.resistance, "Ohm", "of one cell"),
    SCALAR(PARAMETER, parameters.polarisation_resistance, "Ohm", "of the RC pair of one cell"),
    SCALAR(PARAMETER, parameters.polarisation_time_constant, "s", "of the RC pair"),
    SCALAR(PARAMETER, parameters.initial_charge, "", "0 to 1"),
    SCALAR(STATE, state.charge, "", "0 to 1"),
    SCALAR(STATE, state.polarisation, "V", "over the RC pair of one cell"),
    SCALAR(STATE, state.end, "", "-1: held at empty, 1: held at full"),
    SCALAR(FEEDTHROUGH, outputs.voltage, "V", "at the terminals"),
    SCALAR(OUTPUT, outputs.charge, "", "0 to 1"),
};

static const fcsl_model_event_t events[EVENTS] = {
    [EMPTY] = {"empty", FCSL_FALLING, "the charge reaches 0"},
    [FULL] = {"full", FCSL_FALLING, "the charge reaches 1"},
    [LEAVES_END] = {"leaves_end", FCSL_FALLING, "the current turns around at an end"},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "battery",
    .doc = "a battery of cells in series, with resistance and one RC pair",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(battery_t),
    .align = _Alignof(battery_t),
    .continuous_offset = offsetof(battery_t, state),
    .continuous_count = CONTINUOUS_STATES,
    .sampled_offset = FCSL_NO_OFFSET,
    .events = events,
    .event_count = EVENTS,
    .init = init,
    .derivative = derivative,
    .output = output,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
