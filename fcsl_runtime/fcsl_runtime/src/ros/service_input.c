/* SPDX-License-Identifier: Apache-2.0
 *
 * Calls of services become samples of bool channels. A Trigger's channel is true while a call waits; a SetBool's has the value of
 * the call that waits, or of the last one that was accepted.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_expression.h"
#include "fcsl/fcsl_service_input.h"

struct fcsl_service_input {
    fcsl_run_t *run;
    const fcsl_service_t *service;
    fcsl_expression_t accepted;
    fcsl_expression_t refused; /* no steps: none */
    uint64_t called_tick;      /* the first tick that sees the call */
    uint64_t seen_tick;        /* where the run was after its last tick */
    uint8_t waits;
    uint8_t restored; /* the run is elsewhere since */
    uint8_t value;  /* of the call that waits */
    uint8_t before; /* what the channel had, and has again if it fails */
    uint8_t returns; /* the coming tick gets `before` */
    uint8_t returned; /* it did, and the tick after that may get a call */
    uint64_t returned_tick;
};

static int find(const void *context, const char *path, fcsl_expression_operand_t *operand,
                fcsl_expression_error_t *error)
{
    const fcsl_run_t *run = context;
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    return fcsl_expression_find_field(machine->fields, machine->field_count, machine, fcsl_run_data(run), path, operand,
                                      error);
}

static int compile(const fcsl_service_input_t *input, const char *text, fcsl_expression_t *expression,
                   fcsl_error_t *error)
{
    fcsl_expression_error_t why;
    if (fcsl_expression_compile(text, find, input->run, expression, &why) != 0) {
        return fcsl_fail(error, "service '%s': '%s': %s at character %zu", input->service->name, text, why.text,
                         why.at + 1u);
    }
    return expression->kind == FCSL_EXPRESSION_BOOL
               ? 0
               : fcsl_fail(error, "service '%s': '%s' is not a bool", input->service->name, text);
}

fcsl_service_input_t *fcsl_service_input_new(fcsl_run_t *run, uint32_t service, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    if (service >= machine->service_count) {
        (void)fcsl_fail(error, "no service number %" PRIu32, service);
        return NULL;
    }
    fcsl_service_input_t *input = calloc(1, sizeof *input);
    if (input == NULL) {
        (void)fcsl_fail(error, "out of memory for a service");
        return NULL;
    }
    input->run = run;
    input->service = &machine->services[service];
    const char *refused = input->service->refused;
    if (compile(input, input->service->accepted, &input->accepted, error) != 0 ||
        (*refused != '\0' && compile(input, refused, &input->refused, error) != 0)) {
        free(input);
        return NULL;
    }
    return input;
}

void fcsl_service_input_free(fcsl_service_input_t *input)
{
    free(input);
}

static uint8_t channel_value(const fcsl_service_input_t *input)
{
    const fcsl_machine_t *machine = fcsl_run_machine(input->run);
    const fcsl_field_t *field = &machine->fields[machine->channels[input->service->channel].field];
    return ((const uint8_t *)fcsl_run_data(input->run))[field->offset] != 0;
}

static void write_channel(fcsl_service_input_t *input, uint8_t value, int64_t now_ns)
{
    /* The descriptor was checked: a bool of a sensor channel takes 0 and 1. */
    (void)fcsl_run_write_channel(input->run, input->service->channel, &value, sizeof value, 0, now_ns, NULL);
}

void fcsl_service_input_begin(fcsl_service_input_t *input, int64_t now_ns)
{
    const uint8_t kept = input->returns ? input->before : channel_value(input);
    input->waits = 0;
    input->restored = 0;
    input->returns = 0;
    input->returned = 0;
    write_channel(input, input->service->kind == FCSL_SET_BOOL && kept, now_ns);
}

int fcsl_service_input_prepare(fcsl_service_input_t *input, int64_t now_ns)
{
    const uint64_t tick = fcsl_run_tick(input->run);
    input->restored = input->waits && tick != input->seen_tick;
    if (input->returns) {
        input->returns = 0;
        input->returned = 1;
        input->returned_tick = tick;
        write_channel(input, input->before, now_ns);
    }
    input->returned = input->returned && tick == input->returned_tick;
    return !input->returned;
}

int fcsl_service_input_call(fcsl_service_input_t *input, int value, int64_t now_ns, fcsl_service_answer_t *answer)
{
    if (input->waits) {
        *answer = (fcsl_service_answer_t){0};
        (void)snprintf(answer->message, sizeof answer->message, "busy: another call waits for its answer");
        return -1;
    }
    const int is_level = input->service->kind == FCSL_SET_BOOL;
    input->waits = 1;
    input->before = is_level && channel_value(input);
    input->value = !is_level || value != 0;
    input->called_tick = fcsl_run_tick(input->run);
    input->seen_tick = input->called_tick;
    write_channel(input, input->value, now_ns);
    return 0;
}

static int holds(const fcsl_expression_t *expression)
{
    fcsl_expression_value_t value;
    fcsl_expression_error_t error;
    return expression->count > 0 && fcsl_expression_run(expression, &value, &error) == 0 && value.integer != 0;
}

/* "accepted in FLY at tick 812": where the machine was in its last tick. */
static void say_where(const fcsl_service_input_t *input, const char *what, const char *condition,
                      fcsl_service_answer_t *answer)
{
    const fcsl_machine_t *machine = fcsl_run_machine(input->run);
    const int32_t state = *(const int32_t *)((const uint8_t *)fcsl_run_data(input->run) + machine->state_offset);
    const char *name = state >= 0 && (uint32_t)state < machine->state_count ? machine->states[state].name : "?";
    const uint64_t tick = fcsl_run_tick(input->run);
    (void)snprintf(answer->message, sizeof answer->message, "%s%.120s in %s at tick %" PRIu64, what, condition, name,
                   tick > 0 ? tick - 1u : 0);
}

/* A SetBool that was accepted stays; everything else goes back, so that nothing acts after the caller was told that it does not. */
static int ended(fcsl_service_input_t *input, const fcsl_service_answer_t *answer)
{
    const int stays = answer->success && input->service->kind == FCSL_SET_BOOL;
    input->waits = 0;
    input->returns = !stays && input->before != input->value;
    return 1;
}

int fcsl_service_input_poll(fcsl_service_input_t *input, fcsl_service_answer_t *answer)
{
    const uint64_t tick = fcsl_run_tick(input->run);
    if (!input->waits || tick == input->seen_tick) {
        return 0;
    }
    input->seen_tick = tick;
    *answer = (fcsl_service_answer_t){0};
    if (input->restored) { /* the channel has what the checkpoint had */
        (void)snprintf(answer->message, sizeof answer->message, "a checkpoint was restored before it was answered");
        input->before = input->value;
    } else if (holds(&input->refused)) {
        say_where(input, "refused: ", input->service->refused, answer);
    } else if (holds(&input->accepted)) {
        answer->success = 1;
        say_where(input, "accepted", "", answer);
    } else if (tick - input->called_tick >= input->service->within_ticks) {
        say_where(input, "timed out: not ", input->service->accepted, answer);
    } else {
        return 0;
    }
    return ended(input, answer);
}

int fcsl_service_input_end(fcsl_service_input_t *input, fcsl_service_answer_t *answer)
{
    if (!input->waits) {
        return 0;
    }
    *answer = (fcsl_service_answer_t){0};
    (void)snprintf(answer->message, sizeof answer->message, "the machine stopped before it answered");
    return ended(input, answer);
}
