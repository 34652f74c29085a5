/* SPDX-License-Identifier: Apache-2.0
 *
 * model.c: descriptors of models, which come out of libraries. Input: number of patches (1), patches of a good descriptor's
 * tables, then bits that say what the plan makes of it. Names end and pointers can be read, since a loader cannot know; all else
 * may be wrong. What is accepted is opened and flown: its functions read and write by the table alone.
 */
#include <dlfcn.h>

#include "fuzz.h"
#define fcsl_model_load load_library
#include "model.c"
#undef fcsl_model_load

#include "fcsl/fcsl_sim.h"

enum { FIELDS = 8, EVENTS = 4, TICKS = 3, TEXT_BYTES = 4096, CDR_BYTES = 1 << 16, VALUES = 16 };

int LLVMFuzzerInitialize(int *argc, char ***argv);

typedef struct {
    struct {
        double u[2];
        bool on;
    } inputs;
    struct {
        double gain;
        int32_t count;
    } parameters;
    struct {
        double x[4];
        int64_t n;
    } state;
    struct {
        double y;
        float z[2];
        uint8_t sampled;
    } outputs;
} plant_t;

typedef struct {
    fcsl_model_t model;
    fcsl_field_t fields[FIELDS];
    fcsl_model_event_t events[EVENTS];
} tables_t;

static const fcsl_field_t good_fields[] = {
    FCSL_MODEL_VECTOR(plant_t, FCSL_ROLE_INPUT, inputs.u, "m", ""),
    FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_INPUT, inputs.on, "", ""),
    FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_PARAMETER, parameters.gain, "", ""),
    FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_PARAMETER, parameters.count, "", ""),
    FCSL_MODEL_VECTOR(plant_t, FCSL_ROLE_STATE, state.x, "", ""),
    FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_STATE, state.n, "", ""),
    FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_FEEDTHROUGH, outputs.y, "m", ""),
    FCSL_MODEL_VECTOR(plant_t, FCSL_ROLE_OUTPUT, outputs.z, "", ""),
};
static const fcsl_model_event_t good_events[] = {
    {"low", FCSL_FALLING, ""}, {"high", FCSL_RISING, ""}, {"zero", FCSL_EITHER, ""}, {"never", FCSL_RISING, ""}};

static tables_t *tables; /* of the present input */

/* ---- functions that do what the table says -------------------------------------------------------------------------------- */

static const char *initialise(void *self, const fcsl_model_context_t *context)
{
    (void)context;
    ((uint8_t *)self)[0] ^= 1u;
    ((uint8_t *)self)[tables->model.size - 1u] ^= 1u;
    return NULL;
}

/* Positions get velocities where the model is of second order. */
static void derivative(const void *self, double t, const double *x, double *dx)
{
    const uint32_t count = tables->model.continuous_count;
    const uint32_t half = count / 2u;
    (void)self;
    for (uint32_t i = 0; i < count; i++) {
        dx[i] = tables->model.is_second_order && i < half ? x[half + i] : 1.0 - t;
    }
}

static void output(void *self, double t, const double *x)
{
    FUZZ_CHECK((x == NULL) == (tables->model.continuous_count == 0));
    for (uint32_t i = 0; i < tables->model.field_count; i++) {
        const fcsl_field_t *field = &tables->fields[i];
        if (field->role == FCSL_ROLE_OUTPUT) {
            memset((uint8_t *)self + field->offset, t > 0.015, field->size);
        }
    }
}

static void update(void *self, const fcsl_model_context_t *context)
{
    output(self, (double)context->time_ns * 1e-9 + context->uniform(context->noise, 0) * 0.0,
           tables->model.continuous_count > 0 ? (const double *)self : NULL);
}

static void event(const void *self, double t, const double *x, double *value)
{
    (void)self;
    for (uint32_t i = 0; i < tables->model.event_count; i++) {
        value[i] = (x == NULL ? 0.0125 : 0.0125 + 1e-6 * (double)i) - t;
    }
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    (void)context;
    FUZZ_CHECK(number < tables->model.event_count);
    ((uint8_t *)self)[tables->model.size - 1u] ^= 1u;
}

/* ---- the loader's checks, without a library -------------------------------------------------------------------------------- */

const fcsl_model_t *fcsl_model_load(const char *library, const char *name, void **handle, fcsl_error_t *error)
{
    const fcsl_model_t *const models[] = {&tables->model, NULL};
    const fcsl_model_t *model = find_model(models, library, name, error);
    *handle = NULL;
    return model != NULL && fcsl_model_check(model, library, error) == 0 ? model : NULL;
}

/* ---- the input ------------------------------------------------------------------------------------------------------------ */

static void begin(tables_t *t)
{
    memcpy(t->fields, good_fields, sizeof good_fields);
    memcpy(t->events, good_events, sizeof good_events);
    t->model = (fcsl_model_t){
        .abi_version = FCSL_MODEL_ABI_VERSION,
        .name = "plant",
        .doc = "",
        .fields = t->fields,
        .field_count = FIELDS,
        .size = sizeof(plant_t),
        .align = _Alignof(plant_t),
        .continuous_offset = offsetof(plant_t, state.x),
        .continuous_count = 4,
        .sampled_offset = FCSL_NO_OFFSET,
        .events = t->events,
        .event_count = EVENTS,
        .init = initialise,
        .derivative = derivative,
        .output = output,
        .event = event,
        .reset = reset,
    };
}

static void patch_field(bytes_t *bytes, fcsl_field_t *field)
{
    static const uint32_t shapes[][4] = {
        {2, 2, 2, 2}, {4, 1, 1, 1}, {65536, 65536, 65536, 65536}, {0, 1, 1, 1}, {3, 3, 1, 1}};
    static const char *const paths[] = {
        "inputs.u",  "outputs.y", "state.x", "parameters.gain", "outputs.header", "outputs.", "inputs.a.b",
        "outputs.A", "x",         NULL};
    uint32_t *const words[] = {&field->offset, &field->size, &field->count};
    const uint64_t which = take_number(bytes, 1) % 9u;
    if (which < 3) {
        patch_words(bytes, words[which], sizeof *words[which], 1);
    } else if (which == 3) {
        field->role = (uint8_t)take_number(bytes, 1);
    } else if (which == 4) {
        field->type = (uint8_t)take_number(bytes, 1);
    } else if (which == 5) { /* with as many extents as it may have */
        field->rank = (uint8_t)(take_number(bytes, 1) % 5u);
        field->shape = take_number(bytes, 1) == 255u ? NULL : shapes[take_number(bytes, 1) % 5u];
    } else if (which == 6) {
        field->flags = (uint8_t)take_number(bytes, 1);
    } else if (which == 7) {
        field->path = paths[take_number(bytes, 1) % (sizeof paths / sizeof *paths)];
    } else {
        field->unit = take_number(bytes, 1) == 255u ? NULL : "kg";
        field->doc = take_number(bytes, 1) == 255u ? NULL : "";
    }
}

/* A function that is there or not. */
static void patch_function(bytes_t *bytes, fcsl_model_t *model)
{
    const unsigned which = (unsigned)take_number(bytes, 1) % 6u;
    model->init = which == 0 ? NULL : model->init;
    model->derivative = which == 1 ? NULL : model->derivative;
    model->output = which == 2 ? NULL : model->output;
    model->event = which == 3 ? NULL : model->event;
    model->reset = which == 4 ? NULL : model->reset;
    model->update = which == 5 ? update : model->update;
}

static void patch_model(bytes_t *bytes, fcsl_model_t *model)
{
    uint32_t *const words[] = {
        &model->size,           &model->align,      &model->continuous_offset, &model->continuous_count,
        &model->sampled_offset, &model->abi_version};
    const uint64_t which = take_number(bytes, 1) % 12u;
    if (which < 6) {
        patch_words(bytes, words[which], sizeof *words[which], 1);
    } else if (which == 6) { /* the tables are as long as they are, and longer ones are refused */
        model->field_count = (uint32_t)take_number(bytes, 1) % (FIELDS + 2u);
        model->field_count = model->field_count <= FIELDS ? model->field_count : FCSL_MODEL_MAX_FIELDS + 1u;
    } else if (which == 7) {
        model->event_count = (uint32_t)take_number(bytes, 1) % (EVENTS + 2u);
        model->event_count = model->event_count <= EVENTS ? model->event_count : FCSL_MODEL_MAX_EVENTS + 1u;
    } else if (which == 8) {
        model->is_second_order = (uint8_t)take_number(bytes, 1);
    } else if (which == 9) { /* without states and events */
        model->continuous_count = 0;
        model->event_count = 0;
        model->derivative = NULL;
        model->event = NULL;
        model->reset = NULL;
    } else if (which == 10) {
        const uint64_t null = take_number(bytes, 1);
        model->fields = null == 1 ? NULL : model->fields;
        model->events = null == 2 ? NULL : model->events;
        model->doc = null == 3 ? NULL : model->doc;
        model->name = null == 4 ? NULL : null == 5 ? "Plant" : model->name;
    } else {
        patch_function(bytes, model);
    }
}

static void patch(bytes_t *bytes, tables_t *t)
{
    const uint64_t which = take_number(bytes, 1) % 8u;
    const uint64_t row = take_number(bytes, 1);
    if (which < 3) {
        patch_model(bytes, &t->model);
    } else if (which == 3) {
        fcsl_model_event_t *patched = &t->events[row % EVENTS];
        patched->crossing = (uint8_t)take_number(bytes, 1);
        patched->name = take_number(bytes, 1) == 255u ? NULL : patched->name;
        patched->doc = take_number(bytes, 1) == 255u ? NULL : patched->doc;
    } else {
        patch_field(bytes, &t->fields[row % FIELDS]);
    }
}

/* ---- what a simulation does with it --------------------------------------------------------------------------------------- */

static size_t write_plan(bytes_t *bytes, const fcsl_model_t *model, char *text)
{
    static const char *const groups[] = {
        "group rk4 1000 0000000000000000 0000000000000000 0000000000000000 0000000000000000",
        "group verlet 100 0000000000000000 0000000000000000 0000000000000000 0000000000000000",
        "group rk45 0 3eb0c6f7a0b5ed8d 3eb0c6f7a0b5ed8d 3f1a36e2eb1c432d 3fb999999999999a",
        "group ab4 300 0000000000000000 0000000000000000 0000000000000000 0000000000000000",
    };
    const int updates = model->update != NULL;
    int used = snprintf(text, TEXT_BYTES,
                        "fcsl-sim-plan 3\nmachine hopper ./hopper.so\nseed 1\nticks 9\nmodel %s plant\n%s\n"
                        "instance a %s 0 %d %d 0\ninstance b %s 0 %d %d 0\n",
                        "plant", groups[take_number(bytes, 1) % 4u], "plant", updates ? 100 : 0, updates, "plant",
                        updates ? 100 : 0, updates);
    if (model->output != NULL) {
        used += snprintf(text + used, TEXT_BYTES - (size_t)used, "call a stage\ncall b output\n");
    }
    if (updates) {
        used += snprintf(text + used, TEXT_BYTES - (size_t)used, "call a update\ncall b update\n");
    }
    if ((take_number(bytes, 1) & 1u) == 0) {
        used += snprintf(text + used, TEXT_BYTES - (size_t)used, "link a outputs.y b inputs.u\n");
    }
    if ((take_number(bytes, 1) & 1u) != 0) {
        used += snprintf(text + used, TEXT_BYTES - (size_t)used, "set a parameters.count 0 00000000ffffffff\n");
    }
    return (size_t)used + (size_t)snprintf(text + used, TEXT_BYTES - (size_t)used, "end\n");
}

static void fly(fcsl_sim_t *sim)
{
    static uint8_t cdr[CDR_BYTES];
    double values[VALUES];
    fcsl_error_t error = {{0}};
    for (int i = 0; i < TICKS && fcsl_sim_run(sim, 1, &error) == 1; i++) {
        (void)fcsl_sim_truth_values(sim, values, VALUES);
        (void)fcsl_sim_model_message(sim, 0, cdr, sizeof cdr);
        FUZZ_CHECK(fcsl_sim_model_message_schema(sim, 1)[0] != '\0');
    }
    const size_t capacity = fcsl_sim_checkpoint_capacity(sim);
    void *checkpoint = malloc(capacity);
    FUZZ_CHECK(checkpoint != NULL && fcsl_sim_checkpoint(sim, checkpoint) <= capacity);
    free(checkpoint);
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
    FUZZ_CHECK(dlopen("./hopper.so", RTLD_NOW) != NULL); /* never closed, so that an input does not load it anew */
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char text[TEXT_BYTES];
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    tables_t *t = malloc(sizeof *t);
    FUZZ_CHECK(t != NULL);
    begin(t);
    const uint64_t patches = take_number(&bytes, 1) % 8u;
    for (uint64_t i = 0; i < patches; i++) {
        patch(&bytes, t);
    }
    tables = t;
    const size_t length = write_plan(&bytes, &t->model, text);
    fcsl_sim_t *sim = fcsl_sim_open(text, length, NULL, &error);
    FUZZ_CHECK((sim == NULL) == (error.text[0] != '\0'));
    if (getenv("FUZZ_SHOW") != NULL) {
        (void)fprintf(stderr, "%s\n", error.text);
    }
    if (sim != NULL) {
        fly(sim);
        FUZZ_CHECK(fcsl_sim_close(sim, &error) == 0);
    }
    free(t);
    return 0;
}
