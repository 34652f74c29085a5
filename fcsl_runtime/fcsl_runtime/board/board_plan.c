/* SPDX-License-Identifier: Apache-2.0
 *
 * Reads the plan of a board.
 */
#define _POSIX_C_SOURCE 200809L
#include "board_plan.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_plan_text.h"

enum { WORDS_MAX = 18, LINE_MAX_BYTES = 4096, HZ_MAX = 1000000 };
static const uint64_t PERIOD_NS_MAX = 3600000000000u;
static const char FIRST_LINE[] = "fcsl-board-plan 1";

typedef struct {
    board_plan_t *plan;
    board_sensor_t *sensor; /* the last one; null: none yet */
    fcsl_backend_config_t *backend; /* its last one */
    board_output_t *output; /* the last one */
    char *word[WORDS_MAX];
} parser_t;

/* Each statement returns null, or what is wrong. word[0] is the keyword. */
typedef const char *(*take_t)(parser_t *parser);

static const char NOT_BITS[] = "a value is not 16 hexadecimal digits";

static int find_quantity(const board_sensor_t *sensor, const char *name, uint32_t *quantity)
{
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[sensor->config.kind];
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        if (strcmp(kind->quantities[q].name, name) == 0) {
            *quantity = q;
            return 0;
        }
    }
    return -1;
}

/* `count` doubles from word `first` on. */
static int take_doubles(const parser_t *parser, uint32_t first, uint32_t count, double *values)
{
    for (uint32_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        if (fcsl_plan_bits(parser->word[first + i], &bits) != 0) {
            return -1;
        }
        memcpy(&values[i], &bits, sizeof bits);
    }
    return 0;
}

static const char *on_machine(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    if (plan->machine != NULL) {
        return "a second `machine`";
    }
    plan->machine = parser->word[1];
    return fcsl_plan_is_name(plan->machine) && fcsl_plan_number(parser->word[2], HZ_MAX, &plan->tick_hz) == 0
               ? NULL
               : "not a name and a rate";
}

static const char *on_device(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    if (plan->device_count == BOARD_DEVICES_MAX) {
        return "too many devices";
    }
    board_device_t *device = &plan->devices[plan->device_count];
    *device = (board_device_t){.name = parser->word[1], .driver = parser->word[3], .address = parser->word[4]};
    for (uint32_t i = 0; i < plan->device_count; i++) {
        if (strcmp(plan->devices[i].name, device->name) == 0) {
            return "a second device of this name";
        }
    }
    plan->device_count++;
    return fcsl_plan_is_name(device->name) && fcsl_plan_number(parser->word[2], PERIOD_NS_MAX, &device->period_ns) == 0
               ? NULL
               : "not a name and a period";
}

static int find_device(const board_plan_t *plan, const char *name, uint32_t *device)
{
    for (uint32_t d = 0; d < plan->device_count; d++) {
        if (strcmp(plan->devices[d].name, name) == 0) {
            *device = d;
            return 0;
        }
    }
    return -1;
}

static const char *on_pace(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    if (plan->pacing != BOARD_NO_DEVICE) {
        return "a second `pace`";
    }
    return find_device(plan, parser->word[1], &plan->pacing) == 0 &&
                   fcsl_plan_number(parser->word[2], PERIOD_NS_MAX, &plan->pace_timeout_ns) == 0
               ? NULL
               : "not a device and a time";
}

static void set_no_limits(fcsl_frontend_config_t *config)
{
    for (uint32_t q = 0; q < FCSL_QUANTITIES_MAX; q++) {
        config->low[q] = -INFINITY;
        config->high[q] = INFINITY;
        config->tolerance[q] = INFINITY;
    }
}

static const char *on_sensor(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    if (plan->sensor_count == BOARD_SENSORS_MAX) {
        return "too many sensors";
    }
    board_sensor_t *sensor = &plan->sensors[plan->sensor_count];
    for (uint32_t i = 0; i < plan->sensor_count; i++) {
        if (strcmp(plan->sensors[i].name, parser->word[1]) == 0) {
            return "a second sensor of this name";
        }
    }
    plan->sensor_count++;
    parser->sensor = sensor;
    parser->backend = NULL;
    sensor->name = parser->word[1];
    set_no_limits(&sensor->config);
    for (uint32_t k = 0; k < FCSL_SENSOR_KINDS; k++) {
        if (strcmp(fcsl_sensor_kinds[k].name, parser->word[2]) == 0) {
            sensor->config.kind = (fcsl_sensor_kind_t)k;
            return fcsl_plan_is_name(sensor->name) ? NULL : "not a name";
        }
    }
    return "not a kind of sensor";
}

static const char *on_health(parser_t *parser)
{
    fcsl_frontend_config_t *config = &parser->sensor->config;
    return fcsl_plan_number(parser->word[1], PERIOD_NS_MAX, &config->max_age_ns) == 0 &&
                   fcsl_plan_number(parser->word[2], PERIOD_NS_MAX, &config->stuck_ns) == 0 &&
                   fcsl_plan_number(parser->word[3], PERIOD_NS_MAX, &config->recover_ns) == 0
               ? NULL
               : "not three times in nanoseconds";
}

static const char *on_limits(parser_t *parser)
{
    uint32_t q = 0;
    double limits[2];
    if (find_quantity(parser->sensor, parser->word[1], &q) != 0) {
        return "not a quantity of this sensor";
    }
    if (take_doubles(parser, 2, 2, limits) != 0) {
        return NOT_BITS;
    }
    parser->sensor->config.low[q] = limits[0];
    parser->sensor->config.high[q] = limits[1];
    return NULL;
}

static const char *on_tolerance(parser_t *parser)
{
    uint32_t q = 0;
    if (find_quantity(parser->sensor, parser->word[1], &q) != 0) {
        return "not a quantity of this sensor";
    }
    return take_doubles(parser, 2, 1, &parser->sensor->config.tolerance[q]) == 0 ? NULL : NOT_BITS;
}

static const char *on_bind(parser_t *parser)
{
    board_sensor_t *sensor = parser->sensor;
    uint32_t q = 0;
    if (find_quantity(sensor, parser->word[1], &q) != 0 || !fcsl_plan_is_path(parser->word[2])) {
        return "not a quantity of this sensor and a channel";
    }
    if (sensor->binding_count == FCSL_QUANTITIES_MAX) {
        return "too many channels";
    }
    sensor->bindings[sensor->binding_count++] = (board_binding_t){.quantity = q, .channel = parser->word[2]};
    return NULL;
}

static void set_no_corrections(fcsl_backend_config_t *backend)
{
    for (uint32_t q = 0; q < FCSL_QUANTITIES_MAX; q++) {
        backend->corrections[q] = (fcsl_correction_t){.matrix = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}};
    }
    for (uint32_t i = 0; i < FCSL_STICKS_MAX; i++) {
        backend->sticks[i] = (fcsl_stick_t){.minimum = 1000.0, .middle = 1500.0, .maximum = 2000.0};
    }
}

static const char *on_backend(parser_t *parser)
{
    board_sensor_t *sensor = parser->sensor;
    fcsl_frontend_config_t *config = &sensor->config;
    if (config->backend_count == FCSL_BACKENDS_MAX) {
        return "too many backends";
    }
    uint32_t d = 0;
    if (find_device(parser->plan, parser->word[1], &d) != 0) {
        return "not a device";
    }
    sensor->devices[config->backend_count] = d;
    parser->backend = &config->backends[config->backend_count++];
    parser->backend->period_ns = parser->plan->devices[d].period_ns;
    set_no_corrections(parser->backend);
    return NULL;
}

static const char *on_signal(parser_t *parser)
{
    board_sensor_t *sensor = parser->sensor;
    uint32_t q = 0;
    if (find_quantity(sensor, parser->word[1], &q) != 0) {
        return "not a quantity of this sensor";
    }
    sensor->signals[sensor->config.backend_count - 1u][q] = parser->word[2];
    return NULL;
}

static const char *on_correct(parser_t *parser)
{
    enum { MATRIX = 2, OFFSET = 11, PER_KELVIN = 14, CELSIUS = 17 };
    uint32_t q = 0;
    if (find_quantity(parser->sensor, parser->word[1], &q) != 0) {
        return "not a quantity of this sensor";
    }
    fcsl_correction_t *correction = &parser->backend->corrections[q];
    return take_doubles(parser, MATRIX, 9, correction->matrix) == 0 &&
                   take_doubles(parser, OFFSET, 3, correction->offset) == 0 &&
                   take_doubles(parser, PER_KELVIN, 3, correction->per_kelvin) == 0 &&
                   take_doubles(parser, CELSIUS, 1, &correction->celsius) == 0
               ? NULL
               : NOT_BITS;
}

static const char *on_stick(parser_t *parser)
{
    uint64_t i = 0;
    double values[4];
    if (fcsl_plan_number(parser->word[1], FCSL_STICKS_MAX - 1u, &i) != 0) {
        return "not a channel of a remote control";
    }
    if (take_doubles(parser, 2, 4, values) != 0) {
        return NOT_BITS;
    }
    parser->backend->sticks[i] =
        (fcsl_stick_t){.minimum = values[0], .middle = values[1], .maximum = values[2], .deadband = values[3]};
    return NULL;
}

static const char *on_section(parser_t *parser)
{
    fcsl_backend_config_t *backend = parser->backend;
    uint32_t q = 0;
    if (find_quantity(parser->sensor, parser->word[1], &q) != 0) {
        return "not a quantity of this sensor";
    }
    if (backend->section_count == FCSL_SECTIONS_MAX) {
        return "too many sections";
    }
    fcsl_section_t *section = &backend->sections[backend->section_count++];
    section->quantity = q;
    return take_doubles(parser, 2, 3, section->b) == 0 && take_doubles(parser, 5, 2, section->a) == 0 ? NULL : NOT_BITS;
}

static const char *on_output(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    if (plan->output_count == BOARD_OUTPUTS_MAX) {
        return "too many outputs";
    }
    parser->output = &plan->outputs[plan->output_count++];
    parser->output->channel = parser->word[1];
    return fcsl_plan_is_path(parser->word[1]) && find_device(plan, parser->word[2], &parser->output->device) == 0
               ? NULL
               : "not a channel and a device";
}

static const char *on_pulse(parser_t *parser)
{
    enum { VALUES = 7 };
    board_output_t *output = parser->output;
    uint64_t index = 0;
    double v[VALUES];
    if (output->pulse_count == BOARD_PULSES_MAX || fcsl_plan_number(parser->word[1], UINT16_MAX, &index) != 0) {
        return "not an element of the channel, or too many";
    }
    if (take_doubles(parser, 3, VALUES, v) != 0) {
        return NOT_BITS;
    }
    output->pulses[output->pulse_count++] = (board_pulse_t){.signal = parser->word[2],
                                                            .index = (uint32_t)index,
                                                            .low = v[0],
                                                            .high = v[1],
                                                            .minimum = v[2],
                                                            .middle = v[3],
                                                            .maximum = v[4],
                                                            .slew = v[5],
                                                            .safe = v[6]};
    return NULL;
}

static const char *on_undriven(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    if (plan->undriven_count == BOARD_OUTPUTS_MAX) {
        return "too many";
    }
    plan->undriven[plan->undriven_count++] = parser->word[1];
    return fcsl_plan_is_path(parser->word[1]) ? NULL : "not a channel";
}

/* Of a pin, a converter or a register. */
static int take_number(const char *word, uint32_t *number)
{
    uint64_t value = 0;
    const int status = fcsl_plan_number(word, UINT32_MAX, &value);
    *number = (uint32_t)value;
    return status;
}

static const char *take_pin(parser_t *parser, int is_output, int safe)
{
    board_plan_t *plan = parser->plan;
    board_pin_t pin = {.signal = parser->word[3], .is_output = is_output, .safe = safe};
    if (plan->pin_count == BOARD_PINS_MAX) {
        return "too many pins";
    }
    if (take_number(parser->word[1], &pin.number) != 0 || find_device(plan, parser->word[2], &pin.device) != 0) {
        return "not a pin and a device";
    }
    plan->pins[plan->pin_count++] = pin;
    return NULL;
}

static const char *on_gpio_in(parser_t *parser)
{
    return take_pin(parser, 0, 0);
}

static const char *on_gpio_out(parser_t *parser)
{
    uint64_t safe = 0;
    return fcsl_plan_number(parser->word[4], 1, &safe) == 0 ? take_pin(parser, 1, (int)safe) : "safe is not 0 or 1";
}

static const char *on_adc(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    board_converter_t converter = {.signal = parser->word[3]};
    if (plan->converter_count == BOARD_CONVERTERS_MAX) {
        return "too many inputs of converters";
    }
    if (take_number(parser->word[1], &converter.number) != 0 ||
        find_device(plan, parser->word[2], &converter.device) != 0) {
        return "not an input and a device";
    }
    plan->converters[plan->converter_count++] = converter;
    return NULL;
}

static const char *on_registers(parser_t *parser)
{
    board_plan_t *plan = parser->plan;
    const char *access = parser->word[4];
    board_registers_t window = {.is_written = strcmp(access, "read_write") == 0, .file = parser->word[5]};
    if (plan->registers_count == BOARD_REGISTERS_MAX) {
        return "too many registers";
    }
    if (take_number(parser->word[1], &window.address) != 0 || take_number(parser->word[2], &window.bytes) != 0 ||
        fcsl_plan_number(parser->word[3], INT64_MAX, &window.offset) != 0 ||
        (!window.is_written && strcmp(access, "read") != 0)) {
        return "not an address, bytes, an offset, and read or read_write";
    }
    if (window.bytes == 0u || (window.address | window.bytes | window.offset) % sizeof(uint32_t) != 0u ||
        window.bytes - 1u > UINT32_MAX - window.address || window.offset > (uint64_t)INT64_MAX - window.bytes) {
        return "registers are whole words of 4 bytes, and their addresses have 32 bits";
    }
    plan->registers[plan->registers_count++] = window;
    return NULL;
}

typedef enum { BELONGS_TO_BOARD, BELONGS_TO_SENSOR, BELONGS_TO_BACKEND, BELONGS_TO_OUTPUT } owner_t;

static const struct {
    const char *keyword;
    uint32_t words;
    int rest; /* the last word extends to the end of the line */
    owner_t owner;
    take_t take;
} STATEMENTS[] = {
    {"machine", 3, 0, BELONGS_TO_BOARD, on_machine},
    {"device", 5, 1, BELONGS_TO_BOARD, on_device},
    {"pace", 3, 0, BELONGS_TO_BOARD, on_pace},
    {"sensor", 3, 0, BELONGS_TO_BOARD, on_sensor},
    {"health", 4, 0, BELONGS_TO_SENSOR, on_health},
    {"limits", 4, 0, BELONGS_TO_SENSOR, on_limits},
    {"tolerance", 3, 0, BELONGS_TO_SENSOR, on_tolerance},
    {"bind", 3, 0, BELONGS_TO_SENSOR, on_bind},
    {"backend", 2, 0, BELONGS_TO_SENSOR, on_backend},
    {"signal", 3, 0, BELONGS_TO_BACKEND, on_signal},
    {"correct", 18, 0, BELONGS_TO_BACKEND, on_correct},
    {"stick", 6, 0, BELONGS_TO_BACKEND, on_stick},
    {"section", 7, 0, BELONGS_TO_BACKEND, on_section},
    {"output", 3, 0, BELONGS_TO_BOARD, on_output},
    {"undriven", 2, 0, BELONGS_TO_BOARD, on_undriven},
    {"pulse", 10, 0, BELONGS_TO_OUTPUT, on_pulse},
    {"gpio_in", 4, 0, BELONGS_TO_BOARD, on_gpio_in},
    {"gpio_out", 5, 0, BELONGS_TO_BOARD, on_gpio_out},
    {"adc", 4, 0, BELONGS_TO_BOARD, on_adc},
    {"registers", 6, 1, BELONGS_TO_BOARD, on_registers},
};

static const char *take_line(parser_t *parser, char *line)
{
    const size_t length = strcspn(line, " ");
    for (size_t i = 0; i < sizeof STATEMENTS / sizeof STATEMENTS[0]; i++) {
        if (strlen(STATEMENTS[i].keyword) != length || strncmp(STATEMENTS[i].keyword, line, length) != 0) {
            continue;
        }
        if ((STATEMENTS[i].owner == BELONGS_TO_SENSOR || STATEMENTS[i].owner == BELONGS_TO_BACKEND) &&
            parser->sensor == NULL) {
            return "there is no `sensor` before it";
        }
        if (STATEMENTS[i].owner == BELONGS_TO_OUTPUT && parser->output == NULL) {
            return "there is no `output` before it";
        }
        if (STATEMENTS[i].owner == BELONGS_TO_BACKEND && parser->backend == NULL) {
            return "there is no `backend` before it";
        }
        const char *wrong = fcsl_plan_split(line, parser->word, STATEMENTS[i].words, STATEMENTS[i].rest);
        return wrong != NULL ? wrong : STATEMENTS[i].take(parser);
    }
    return "unknown statement";
}

/* Whether a line is the last one of a plan. */
static int is_last(const char *line)
{
    return strcmp(line, "end") == 0 || strncmp(line, "end ", 4) == 0;
}

/* The checksum behind `end`, if there is one. */
static const char *check_sum(const char *text, size_t size)
{
    size_t begin = size > 0 ? size - 1u : 0;
    while (begin > 0 && text[begin - 1u] != '\n') {
        begin--;
    }
    char wanted[16];
    (void)snprintf(wanted, sizeof wanted, "end %08" PRIx32 "\n", fcsl_crc32(0, text, begin));
    const size_t length = size - begin;
    if (length < 4u || memcmp(text + begin, "end ", 4) != 0) {
        return NULL;
    }
    return length == strlen(wanted) && memcmp(text + begin, wanted, length) == 0
               ? NULL
               : "the plan is damaged, or edited: write it with `fcsl board board.json`";
}

static int parse(board_plan_t *plan, const char *file, size_t size, fcsl_error_t *error)
{
    parser_t parser = {.plan = plan};
    uint32_t lines = 0;
    const char *damaged = check_sum(plan->text, size);
    if (damaged != NULL) {
        return fcsl_fail(error, "%.300s: %s", file, damaged);
    }
    const char *wrong = fcsl_plan_cut_lines(plan->text, size, LINE_MAX_BYTES, &lines);
    if (wrong != NULL) {
        return fcsl_fail(error, "%.300s:%u: %s", file, lines, wrong);
    }
    char *at = plan->text;
    for (uint32_t line = 1; line <= lines; line++) {
        char *next = at + strlen(at) + 1;
        const int is_end = is_last(at);
        if (line == 1u ? strcmp(at, FIRST_LINE) != 0 : is_end != (line == lines)) {
            wrong = line == 1u ? "not a plan, or of another version: `fcsl board board.json` writes it"
                    : is_end   ? "text after `end`"
                               : "the plan has no `end`: it was cut off";
        } else if (line > 1u && !is_end) {
            wrong = take_line(&parser, at);
        }
        if (wrong != NULL) {
            return fcsl_fail(error, "%.300s:%u: %s", file, line, wrong);
        }
        at = next;
    }
    return plan->machine != NULL ? 0 : fcsl_fail(error, "%.300s: the plan has no `machine`", file);
}

/* Returns the size, or -1. */
static long read_text(const char *file, char *text, fcsl_error_t *error)
{
    struct stat status;
    if (stat(file, &status) != 0) {
        return fcsl_fail(error, "cannot read '%.300s': %s", file, strerror(errno));
    }
    if (!S_ISREG(status.st_mode) || status.st_size > BOARD_BYTES_MAX) {
        return fcsl_fail(error, "'%.300s' is not a plan: no regular file of at most 1 MiB", file);
    }
    FILE *stream = fopen(file, "rbe");
    if (stream == NULL) {
        return fcsl_fail(error, "cannot read '%.300s': %s", file, strerror(errno));
    }
    const size_t size = fread(text, 1, BOARD_BYTES_MAX, stream);
    const int failed = ferror(stream);
    (void)fclose(stream);
    return failed ? fcsl_fail(error, "cannot read '%.300s'", file) : (long)size;
}

board_plan_t *board_plan_parse(const char *name, const char *text, size_t size, fcsl_error_t *error)
{
    board_plan_t *plan = size <= BOARD_BYTES_MAX ? calloc(1, sizeof *plan) : NULL;
    char *copy = plan != NULL ? calloc(1, size + 1u) : NULL;
    if (copy == NULL) {
        free(plan);
        (void)fcsl_fail(error, "out of memory for the plan");
        return NULL;
    }
    memcpy(copy, text, size);
    plan->text = copy;
    plan->pacing = BOARD_NO_DEVICE;
    if (parse(plan, name, size, error) != 0) {
        board_plan_free(plan);
        return NULL;
    }
    return plan;
}

board_plan_t *board_plan_read(const char *file, fcsl_error_t *error)
{
    char *text = malloc(BOARD_BYTES_MAX);
    if (text == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan");
        return NULL;
    }
    const long size = read_text(file, text, error);
    board_plan_t *plan = size >= 0 ? board_plan_parse(file, text, (size_t)size, error) : NULL;
    free(text);
    return plan;
}

/* Integrals of rates need these; those of accelerations both, because the body turns meanwhile. */
static int is_integral_of(const board_sensor_t *sensor, uint32_t integral, uint32_t quantity)
{
    const fcsl_quantity_t *quantities = fcsl_sensor_kinds[sensor->config.kind].quantities;
    const int is_rate = strcmp(quantities[quantity].name, "gyro") == 0;
    const int is_accel = strcmp(quantities[quantity].name, "accel") == 0;
    return (strcmp(quantities[integral].name, "delta_angle") == 0 && is_rate) ||
           (strcmp(quantities[integral].name, "delta_velocity") == 0 && (is_rate || is_accel));
}

int board_sensor_needs(const board_sensor_t *sensor, uint32_t quantity)
{
    for (uint32_t i = 0; i < sensor->binding_count; i++) {
        const uint32_t bound = sensor->bindings[i].quantity;
        if (bound == quantity || is_integral_of(sensor, bound, quantity)) {
            return 1;
        }
    }
    return 0;
}

void board_plan_free(board_plan_t *plan)
{
    if (plan != NULL) {
        free(plan->text);
        free(plan);
    }
}

int board_plan_has_hardware(const board_plan_t *plan)
{
    return plan->pin_count + plan->converter_count + plan->registers_count > 0u;
}

int board_plan_flies(const board_plan_t *plan, uint32_t device)
{
    for (uint32_t i = 0; i < plan->output_count; i++) {
        if (plan->outputs[i].device == device) {
            return 0;
        }
    }
    return 1;
}

int board_plan_check_machine(const board_plan_t *plan, const char *file, const fcsl_machine_t *machine,
                             fcsl_error_t *error)
{
    if (strcmp(plan->machine, machine->name) == 0 && plan->tick_hz == machine->tick_hz) {
        return 0;
    }
    return fcsl_fail(error, "'%.300s' is for machine '%.60s' at %" PRIu64 " Hz, and this is '%.60s' at %" PRIu64 " Hz",
                     file, plan->machine, plan->tick_hz, machine->name, machine->tick_hz);
}
