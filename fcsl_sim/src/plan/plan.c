/* SPDX-License-Identifier: Apache-2.0
 *
 * Parses the plan of a simulation.
 */
#include "plan.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_plan_text.h"
#include "fcsl/fcsl_error.h"

#define MAX_WORDS 7

typedef struct {
    fcsl_plan_t *plan;
    fcsl_error_t *error;
    uint32_t line;
    char *word[MAX_WORDS];
} parser_t;

static int bad(const parser_t *parser, const char *what)
{
    return fcsl_fail(parser->error, "plan line %u: %s", parser->line, what);
}

/* Cuts the line into `count` words; with `rest` the last takes the rest of the line (library paths may have spaces). */
static int split(parser_t *parser, char *line, uint32_t count, int rest)
{
    const char *wrong = fcsl_plan_split(line, parser->word, count, rest);
    return wrong == NULL ? 0 : bad(parser, wrong);
}

/* ---- statements: each gets its words, word[0] is the keyword ---------------------------------------------------------- */

static int take_library(parser_t *parser, fcsl_plan_library_t *library)
{
    if (!fcsl_plan_is_name(parser->word[1])) {
        return bad(parser, "not a name");
    }
    *library = (fcsl_plan_library_t){parser->line, parser->word[1], parser->word[2], 0};
    return 0;
}

static int on_machine(parser_t *parser)
{
    if (parser->plan->machine.line) {
        return bad(parser, "a second `machine`");
    }
    return take_library(parser, &parser->plan->machine);
}

/* A double from its bits. */
static int take_double(const parser_t *parser, const char *word, double *value)
{
    uint64_t bits = 0;
    if (fcsl_plan_bits(word, &bits)) {
        return bad(parser, "the value is not 16 hexadecimal digits");
    }
    memcpy(value, &bits, sizeof bits);
    return isfinite(*value) && *value >= 0.0 ? 0 : bad(parser, "not a number from 0 on");
}

static int on_group(parser_t *parser)
{
    static const char *const names[FCSL_METHODS] = {"euler", "rk2", "rk4", "ab4", "verlet", "rk45"};
    fcsl_plan_group_t *group = &parser->plan->groups[parser->plan->group_count++];
    *group = (fcsl_plan_group_t){.line = parser->line, .method = FCSL_METHODS};
    for (uint32_t i = 0; i < FCSL_METHODS; i++) {
        if (strcmp(parser->word[1], names[i]) == 0) {
            group->method = (fcsl_method_t)i;
        }
    }
    if (group->method == FCSL_METHODS) {
        return bad(parser, "there is no such integrator");
    }
    if (fcsl_plan_number(parser->word[2], FCSL_PLAN_MAX_HZ, &group->hz) ||
        (group->hz == 0) != (group->method == FCSL_RK45)) {
        return bad(parser, "the integrator's rate is not in 1..1000000 Hz, or 0 for rk45");
    }
    if (take_double(parser, parser->word[3], &group->rtol) || take_double(parser, parser->word[4], &group->atol) ||
        take_double(parser, parser->word[5], &group->min_step_s) ||
        take_double(parser, parser->word[6], &group->max_step_s)) {
        return -1;
    }
    if (group->hz == 0 && !(group->max_step_s > 0.0 && group->atol > 0.0)) {
        return bad(parser, "the largest step and the absolute tolerance are not above 0");
    }
    if (group->hz == 0 && group->min_step_s > group->max_step_s) {
        return bad(parser, "the smallest step is above the largest");
    }
    return 0;
}

static int on_seed(parser_t *parser)
{
    if (parser->plan->seed_line) {
        return bad(parser, "a second `seed`");
    }
    if (fcsl_plan_number(parser->word[1], UINT64_MAX, &parser->plan->seed)) {
        return bad(parser, "the seed is not an unsigned 64-bit number");
    }
    parser->plan->seed_line = parser->line;
    return 0;
}

static int on_ticks(parser_t *parser)
{
    if (parser->plan->ticks_line) {
        return bad(parser, "a second `ticks`");
    }
    if (fcsl_plan_number(parser->word[1], FCSL_PLAN_MAX_TICKS, &parser->plan->ticks) || parser->plan->ticks == 0) {
        return bad(parser, "ticks is not in 1..1000000000000");
    }
    parser->plan->ticks_line = parser->line;
    return 0;
}

static int on_model(parser_t *parser)
{
    return take_library(parser, &parser->plan->models[parser->plan->model_count++]);
}

static int on_machine_model(parser_t *parser)
{
    fcsl_plan_library_t *model = &parser->plan->models[parser->plan->model_count++];
    if (take_library(parser, model)) {
        return -1;
    }
    model->is_machine = 1;
    return 0;
}

static int on_instance(parser_t *parser)
{
    fcsl_plan_t *plan = parser->plan;
    fcsl_plan_instance_t *instance = &plan->instances[plan->instance_count++];
    uint64_t group = FCSL_PLAN_NO_GROUP;
    *instance = (fcsl_plan_instance_t){.line = parser->line, .name = parser->word[1], .model = parser->word[2]};
    if (!fcsl_plan_is_name(instance->name) || !fcsl_plan_is_name(instance->model)) {
        return bad(parser, "not a name");
    }
    if (strcmp(parser->word[3], "-") != 0 &&
        (fcsl_plan_number(parser->word[3], FCSL_PLAN_MAX_GROUPS, &group) || group >= plan->group_count)) {
        return bad(parser, "there is no such group");
    }
    instance->group = (uint32_t)group;
    if (fcsl_plan_number(parser->word[4], FCSL_PLAN_MAX_GRID_HZ, &instance->hz) ||
        fcsl_plan_number(parser->word[5], FCSL_PLAN_MAX_TICKS, &instance->every) ||
        fcsl_plan_number(parser->word[6], FCSL_PLAN_MAX_TICKS, &instance->phase) ||
        (instance->hz > 0) != (instance->every > 0) ||
        (instance->hz > 0 && (instance->every / instance->hz > FCSL_PLAN_MAX_SECONDS ||
                              instance->phase / instance->hz > FCSL_PLAN_MAX_SECONDS))) {
        return bad(parser, "not a rate with its phase");
    }
    return 0;
}

static int on_tolerance(parser_t *parser)
{
    fcsl_plan_tolerance_t *tolerance = &parser->plan->tolerances[parser->plan->tolerance_count++];
    *tolerance = (fcsl_plan_tolerance_t){.line = parser->line, .instance = parser->word[1]};
    if (!fcsl_plan_is_name(tolerance->instance) || fcsl_plan_number(parser->word[2], UINT32_MAX, &tolerance->state)) {
        return bad(parser, "not an instance and the number of a state");
    }
    if (take_double(parser, parser->word[3], &tolerance->atol)) {
        return -1;
    }
    return tolerance->atol > 0.0 ? 0 : bad(parser, "the tolerance is not above 0");
}

static int on_call(parser_t *parser)
{
    static const char *const kinds[] = {"output", "stage", "update"};
    fcsl_plan_call_t *call = &parser->plan->calls[parser->plan->call_count++];
    *call = (fcsl_plan_call_t){.line = parser->line, .instance = parser->word[1]};
    for (uint32_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        if (strcmp(parser->word[2], kinds[i]) == 0) {
            call->kind = (fcsl_call_kind_t)i;
            return fcsl_plan_is_name(call->instance) ? 0 : bad(parser, "not a name");
        }
    }
    return bad(parser, "the call is not `output`, `stage` or `update`");
}

/* INSTANCE FIELD ELEMENT BITS from word `first` on. */
static int take_set(parser_t *parser, uint32_t first, fcsl_plan_set_t *set)
{
    *set = (fcsl_plan_set_t){.line = parser->line, .instance = parser->word[first], .field = parser->word[first + 1]};
    if (!fcsl_plan_is_name(set->instance) || !fcsl_plan_is_path(set->field)) {
        return bad(parser, "not a name or field");
    }
    if (fcsl_plan_number(parser->word[first + 2], UINT32_MAX, &set->element)) {
        return bad(parser, "the element is not a number");
    }
    if (fcsl_plan_bits(parser->word[first + 3], &set->bits)) {
        return bad(parser, "the value is not 16 hexadecimal digits");
    }
    return 0;
}

static int on_set(parser_t *parser)
{
    return take_set(parser, 1, &parser->plan->sets[parser->plan->set_count++]);
}

static int on_event(parser_t *parser)
{
    fcsl_plan_set_t *event = &parser->plan->events[parser->plan->event_count++];
    if (take_set(parser, 2, event)) {
        return -1;
    }
    if (fcsl_plan_number(parser->word[1], INT64_MAX, &event->time_ns)) {
        return bad(parser, "the time is not a number of nanoseconds");
    }
    return 0;
}

static int on_link(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->links[parser->plan->link_count++] =
        (fcsl_plan_link_t){parser->line, NULL, word[1], word[2], word[3], word[4]};
    if (!fcsl_plan_is_name(word[1]) || !fcsl_plan_is_path(word[2]) || !fcsl_plan_is_name(word[3]) ||
        !fcsl_plan_is_path(word[4])) {
        return bad(parser, "not a name or field");
    }
    return 0;
}

static int on_sensor(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->sensors[parser->plan->sensor_count++] =
        (fcsl_plan_link_t){parser->line, NULL, word[1], word[2], NULL, word[3]};
    if (!fcsl_plan_is_name(word[1]) || !fcsl_plan_is_path(word[2]) || !fcsl_plan_is_path(word[3])) {
        return bad(parser, "not a name, field or channel");
    }
    return 0;
}

static int on_actuator(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->actuators[parser->plan->actuator_count++] =
        (fcsl_plan_link_t){parser->line, NULL, NULL, word[1], word[2], word[3]};
    if (!fcsl_plan_is_path(word[1]) || !fcsl_plan_is_name(word[2]) || !fcsl_plan_is_path(word[3])) {
        return bad(parser, "not a name, field or channel");
    }
    return 0;
}

static int take_delay(const parser_t *parser, const char *word, uint32_t *ticks)
{
    uint64_t value = 0;
    if (fcsl_plan_number(word, FCSL_PLAN_MAX_DELAY_TICKS, &value)) {
        return bad(parser, "the delay is not in 0..1000 ticks");
    }
    *ticks = (uint32_t)value;
    return 0;
}

static int on_delay(parser_t *parser)
{
    return take_delay(parser, parser->word[1], &parser->plan->delay_ticks);
}

static int on_companion(parser_t *parser)
{
    char *const *word = parser->word;
    fcsl_plan_companion_t *companion = &parser->plan->companions[parser->plan->companion_count++];
    *companion = (fcsl_plan_companion_t){parser->line, word[1], word[3], word[4], 0};
    if (!fcsl_plan_is_name(word[1]) || !fcsl_plan_is_name(word[3])) {
        return bad(parser, "not a name");
    }
    return take_delay(parser, word[2], &companion->delay_ticks);
}

static int on_companion_sensor(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->sensors[parser->plan->sensor_count++] =
        (fcsl_plan_link_t){parser->line, word[3], word[1], word[2], NULL, word[4]};
    if (!fcsl_plan_is_name(word[1]) || !fcsl_plan_is_path(word[2]) || !fcsl_plan_is_name(word[3]) ||
        !fcsl_plan_is_path(word[4])) {
        return bad(parser, "not a name, field or channel");
    }
    return 0;
}

/* Of the controller `-`, the first one, or of a companion. */
static int on_first_sample(parser_t *parser)
{
    char *const *word = parser->word;
    fcsl_plan_first_sample_t *first = &parser->plan->first_samples[parser->plan->first_sample_count++];
    const int is_lead = strcmp(word[1], "-") == 0;
    *first = (fcsl_plan_first_sample_t){parser->line, is_lead ? NULL : word[1], word[2], 0};
    if ((!is_lead && !fcsl_plan_is_name(word[1])) || !fcsl_plan_is_path(word[2])) {
        return bad(parser, "not a name or channel");
    }
    return fcsl_plan_number(word[3], INT64_MAX, &first->time_ns)
               ? bad(parser, "the time is not a number of nanoseconds")
               : 0;
}

static int on_companion_actuator(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->actuators[parser->plan->actuator_count++] =
        (fcsl_plan_link_t){parser->line, word[1], NULL, word[2], word[3], word[4]};
    if (!fcsl_plan_is_name(word[1]) || !fcsl_plan_is_path(word[2]) || !fcsl_plan_is_name(word[3]) ||
        !fcsl_plan_is_path(word[4])) {
        return bad(parser, "not a name, field or channel");
    }
    return 0;
}

static int on_read(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->reads[parser->plan->read_count++] =
        (fcsl_plan_link_t){parser->line, NULL, NULL, word[1], word[2], word[3]};
    return fcsl_plan_is_path(word[1]) && fcsl_plan_is_name(word[2]) && fcsl_plan_is_path(word[3])
               ? 0
               : bad(parser, "not a name or field");
}

static int on_write(parser_t *parser)
{
    char *const *word = parser->word;
    parser->plan->writes[parser->plan->write_count++] =
        (fcsl_plan_link_t){parser->line, NULL, word[1], word[2], NULL, word[3]};
    return fcsl_plan_is_name(word[1]) && fcsl_plan_is_path(word[2]) && fcsl_plan_is_path(word[3])
               ? 0
               : bad(parser, "not a name or field");
}

static int on_until(parser_t *parser)
{
    fcsl_plan_t *plan = parser->plan;
    if (plan->until != NULL) {
        return bad(parser, "a second `until`");
    }
    plan->until_line = parser->line;
    plan->until = parser->word[2];
    return fcsl_plan_number(parser->word[1], FCSL_PLAN_MAX_TICKS, &plan->until_ticks) || plan->until_ticks == 0
               ? bad(parser, "the number of ticks is not in 1..1000000000000")
               : 0;
}

static int on_serial_link(parser_t *parser)
{
    parser->plan->serial_link = (fcsl_plan_library_t){.line = parser->line, .name = parser->word[1]};
    return fcsl_plan_is_name(parser->word[1]) ? 0 : bad(parser, "not a name");
}

static int on_views(parser_t *parser)
{
    parser->plan->views = parser->word[1];
    return 0;
}

typedef struct {
    const char *keyword;
    uint32_t words;
    int rest; /* the last word extends to the end of the line */
    int (*take)(parser_t *parser);
    uint32_t limit;
} statement_t;

enum {
    MACHINE,
    SEED,
    TICKS,
    DELAY,
    COMPANION,
    MODEL,
    MACHINE_MODEL,
    GROUP,
    INSTANCE,
    TOLERANCE,
    CALL,
    SET,
    LINK,
    SENSOR,
    ACTUATOR,
    COMPANION_SENSOR,
    FIRST_SAMPLE,
    COMPANION_ACTUATOR,
    READ,
    WRITE,
    EVENT,
    SERIAL_LINK,
    UNTIL,
    VIEWS,
    STATEMENTS
};

static const statement_t statements[STATEMENTS] = {
    [MACHINE] = {"machine", 3, 1, on_machine, 1},
    [SEED] = {"seed", 2, 0, on_seed, 1},
    [TICKS] = {"ticks", 2, 0, on_ticks, 1},
    [DELAY] = {"delay", 2, 0, on_delay, 1},
    [COMPANION] = {"companion", 5, 1, on_companion, FCSL_PLAN_MAX_COMPANIONS},
    [MODEL] = {"model", 3, 1, on_model, FCSL_PLAN_MAX_MODELS},
    [MACHINE_MODEL] = {"machine_model", 3, 1, on_machine_model, FCSL_PLAN_MAX_MODELS},
    [GROUP] = {"group", 7, 0, on_group, FCSL_PLAN_MAX_GROUPS},
    [INSTANCE] = {"instance", 7, 0, on_instance, FCSL_PLAN_MAX_INSTANCES},
    [TOLERANCE] = {"tolerance", 4, 0, on_tolerance, FCSL_PLAN_MAX_SETS},
    [CALL] = {"call", 3, 0, on_call, FCSL_PLAN_MAX_CALLS},
    [SET] = {"set", 5, 0, on_set, FCSL_PLAN_MAX_SETS},
    [LINK] = {"link", 5, 0, on_link, FCSL_PLAN_MAX_LINKS},
    [SENSOR] = {"sensor", 4, 0, on_sensor, FCSL_PLAN_MAX_LINKS},
    [ACTUATOR] = {"actuator", 4, 0, on_actuator, FCSL_PLAN_MAX_LINKS},
    [COMPANION_SENSOR] = {"companion_sensor", 5, 0, on_companion_sensor, FCSL_PLAN_MAX_LINKS},
    [FIRST_SAMPLE] = {"first_sample", 4, 0, on_first_sample, FCSL_PLAN_MAX_LINKS},
    [COMPANION_ACTUATOR] = {"companion_actuator", 5, 0, on_companion_actuator, FCSL_PLAN_MAX_LINKS},
    [READ] = {"read", 4, 0, on_read, FCSL_PLAN_MAX_LINKS},
    [WRITE] = {"write", 4, 0, on_write, FCSL_PLAN_MAX_LINKS},
    [EVENT] = {"event", 6, 0, on_event, FCSL_PLAN_MAX_SETS},
    [SERIAL_LINK] = {"serial_link", 2, 0, on_serial_link, 1},
    [UNTIL] = {"until", 3, 1, on_until, 1},
    [VIEWS] = {"views", 2, 1, on_views, 1},
};

static const statement_t *find_statement(const char *line)
{
    const size_t length = strcspn(line, " ");
    for (uint32_t i = 0; i < STATEMENTS; i++) {
        if (strlen(statements[i].keyword) == length && strncmp(statements[i].keyword, line, length) == 0) {
            return &statements[i];
        }
    }
    return NULL;
}

/* ---- the whole --------------------------------------------------------------------------------------------------------- */

/* First pass: counts each kind of statement, so that every table is allocated once with the right size. */
static int count_statements(const char *text, uint32_t lines, uint32_t counts[STATEMENTS], fcsl_error_t *error)
{
    const char *at = text;
    for (uint32_t i = 1; i <= lines; i++, at += strlen(at) + 1) {
        if (i == 1) {
            if (strcmp(at, "fcsl-sim-plan 3") != 0) {
                return fcsl_fail(error, "plan line 1: not `fcsl-sim-plan 3`");
            }
            continue;
        }
        if (strcmp(at, "end") == 0) {
            if (i != lines) {
                return fcsl_fail(error, "plan line %u: text after `end`", i + 1);
            }
            return 0;
        }
        const statement_t *statement = find_statement(at);
        if (!statement) {
            return fcsl_fail(error, "plan line %u: unknown statement", i);
        }
        const uint32_t kind = (uint32_t)(statement - statements);
        if (++counts[kind] > statement->limit) {
            return fcsl_fail(error, "plan line %u: more than %u `%s`", i, statement->limit, statement->keyword);
        }
    }
    return fcsl_fail(error, "plan line %u: the plan has no `end`: it is truncated", lines);
}

static int allocate(fcsl_plan_t *plan, const uint32_t counts[STATEMENTS], fcsl_error_t *error)
{
    plan->models = calloc(counts[MODEL] + counts[MACHINE_MODEL] + 1u, sizeof *plan->models);
    plan->groups = calloc(counts[GROUP] + 1u, sizeof *plan->groups);
    plan->instances = calloc(counts[INSTANCE] + 1u, sizeof *plan->instances);
    plan->tolerances = calloc(counts[TOLERANCE] + 1u, sizeof *plan->tolerances);
    plan->calls = calloc(counts[CALL] + 1u, sizeof *plan->calls);
    plan->sets = calloc(counts[SET] + 1u, sizeof *plan->sets);
    plan->links = calloc(counts[LINK] + 1u, sizeof *plan->links);
    plan->sensors = calloc(counts[SENSOR] + counts[COMPANION_SENSOR] + 1u, sizeof *plan->sensors);
    plan->first_samples = calloc(counts[FIRST_SAMPLE] + 1u, sizeof *plan->first_samples);
    plan->actuators = calloc(counts[ACTUATOR] + counts[COMPANION_ACTUATOR] + 1u, sizeof *plan->actuators);
    plan->companions = calloc(counts[COMPANION] + 1u, sizeof *plan->companions);
    plan->reads = calloc(counts[READ] + 1u, sizeof *plan->reads);
    plan->writes = calloc(counts[WRITE] + 1u, sizeof *plan->writes);
    plan->events = calloc(counts[EVENT] + 1u, sizeof *plan->events);
    if (!plan->companions || !plan->reads || !plan->writes || !plan->models || !plan->groups || !plan->instances ||
        !plan->tolerances || !plan->calls || !plan->sets || !plan->links || !plan->sensors || !plan->first_samples ||
        !plan->actuators || !plan->events) {
        return fcsl_fail(error, "no memory for the plan");
    }
    return 0;
}

static int check_complete(const fcsl_plan_t *plan, fcsl_error_t *error)
{
    const char *missing = !plan->machine.line ? "machine"
                          : !plan->seed_line  ? "seed"
                          : !plan->ticks_line ? "ticks"
                                              : NULL;
    if (missing) {
        return fcsl_fail(error, "the plan has no `%s`", missing);
    }
    for (uint32_t i = 0; i < plan->companion_count; i++) {
        for (uint32_t j = 0; j < i; j++) {
            if (strcmp(plan->companions[i].name, plan->companions[j].name) == 0) {
                return fcsl_fail(error, "plan line %u: a second controller `%s`", plan->companions[i].line,
                                 plan->companions[i].name);
            }
        }
    }
    for (uint32_t i = 0; i < plan->model_count; i++) {
        for (uint32_t j = 0; j < i; j++) {
            if (strcmp(plan->models[i].name, plan->models[j].name) == 0) {
                return fcsl_fail(error, "plan line %u: a second model `%s`", plan->models[i].line,
                                 plan->models[i].name);
            }
        }
    }
    for (uint32_t i = 0; i < plan->instance_count; i++) {
        for (uint32_t j = 0; j < i; j++) {
            if (strcmp(plan->instances[i].name, plan->instances[j].name) == 0) {
                return fcsl_fail(error, "plan line %u: a second instance `%s`", plan->instances[i].line,
                                 plan->instances[i].name);
            }
        }
    }
    return 0;
}

int fcsl_plan_parse(fcsl_plan_t *plan, const char *text, size_t size, fcsl_error_t *error)
{
    *plan = (fcsl_plan_t){0};
    if (size == 0 || size > FCSL_PLAN_MAX_BYTES) {
        return fcsl_fail(error, "the plan is empty or above 4 MiB");
    }
    plan->text = malloc(size + 1);
    if (!plan->text) {
        return fcsl_fail(error, "no memory for the plan");
    }
    memcpy(plan->text, text, size);
    plan->text[size] = '\0';

    uint32_t lines = 0;
    uint32_t counts[STATEMENTS] = {0};
    const char *wrong = fcsl_plan_cut_lines(plan->text, size, FCSL_PLAN_MAX_LINE, &lines);
    if (wrong != NULL) {
        return fcsl_fail(error, "plan line %u: %s", lines, wrong);
    }
    if (count_statements(plan->text, lines, counts, error)) {
        return -1;
    }
    if (allocate(plan, counts, error)) {
        return -1;
    }

    parser_t parser = {.plan = plan, .error = error};
    char *at = plan->text;
    for (uint32_t i = 1; i < lines; i++) { /* the first line is the header, the last is `end` */
        char *next = at + strlen(at) + 1;
        const statement_t *statement = i > 1 ? find_statement(at) : NULL;
        parser.line = i;
        if (statement && (split(&parser, at, statement->words, statement->rest) || statement->take(&parser))) {
            return -1;
        }
        at = next;
    }
    return check_complete(plan, error);
}

void fcsl_plan_free(fcsl_plan_t *plan)
{
    free(plan->models);
    free(plan->groups);
    free(plan->instances);
    free(plan->tolerances);
    free(plan->calls);
    free(plan->sets);
    free(plan->links);
    free(plan->companions);
    free(plan->reads);
    free(plan->writes);
    free(plan->sensors);
    free(plan->first_samples);
    free(plan->actuators);
    free(plan->events);
    free(plan->text);
    *plan = (fcsl_plan_t){0};
}
