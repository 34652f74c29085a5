/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_sim.h: checkpoints of whole simulations. Input: which plan (1), ticks before it was saved (1), number of patches (1),
 * patches as fuzz.h says; then its CRCs are made right. What is refused changes nothing; from what is taken the simulation goes on,
 * and what it saves then is taken again, the same.
 */
#include <dlfcn.h>

#include "fcsl/fcsl_mcap_writer.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_sim.h"
#include "fuzz.h"

enum { CRC_BYTES = 4, AT_MACHINE = 24, HEAD_BYTES = 48, TICKS = 4, PATCHES_MAX = 8 };

int LLVMFuzzerInitialize(int *argc, char ***argv);

#define ZEROS "0000000000000000"
#define NONE  ZEROS " " ZEROS " " ZEROS " " ZEROS "\n"
#define BEGIN "fcsl-sim-plan 3\nmachine hopper ./hopper.so\nseed 1\nticks 20\n"
#define BALL                                                                                                           \
    "set ball parameters.gravity 0 40239eb851eb851f\nset ball parameters.restitution 0 3fe0000000000000\n"             \
    "set ball parameters.rest_speed 0 3fb999999999999a\nset ball parameters.height 0 3f847ae147ae147b\n"               \
    "event 35000000 ball inputs.push 0 3ff0000000000000\n"

static const char *const plans[] = {
    BEGIN "model ball ./ball.so\nmodel noisy_sensor ./noisy_sensor.so\n"
          "group rk45 0 3eb0c6f7a0b5ed8d 3eb0c6f7a0b5ed8d 3ee4f8b588e368f1 3fb999999999999a\n"
          "instance ball ball 0 0 0 0\ninstance sensor noisy_sensor - 1000 20 5\n"
          "set sensor parameters.sigma 0 3fb999999999999a\n" BALL "call ball output\ncall sensor update\n"
          "link ball outputs.z sensor inputs.truth\nsensor sensor outputs.value altitude\n"
          "until 3 ball.outputs.bounces == 255\nend\n",
    BEGIN "delay 2\ncompanion second 1 hopper ./hopper.so\nmodel ball ./ball.so\nmodel problem ./problem.so\nmodel "
          "ramp ./ramp.so\n"
          "group ab4 300 " NONE "group verlet 100 " NONE "group rk4 1000 " NONE
          "instance ramp ramp 0 0 0 0\ninstance orbit problem 1 0 0 0\ninstance ball ball 2 0 0 0\n"
          "set orbit parameters.p 0 3ff0000000000000\nset orbit parameters.x 1 3ff0000000000000\n" BALL
          "call ramp output\ncall orbit output\ncall ball output\n"
          "sensor ball outputs.z altitude\nactuator throttle ramp inputs.rate\n"
          "companion_sensor ramp outputs.x second altitude\ncompanion_actuator second throttle ball inputs.push\nend\n",
    BEGIN "machine_model hopper ./hopper.so\nmodel ramp ./ramp.so\ngroup rk2 50 " NONE
          "instance pilot hopper - 50 1 0\ninstance ramp ramp 0 0 0 0\ncall pilot update\ncall ramp output\n"
          "link pilot outputs.throttle ramp inputs.rate\nsensor pilot outputs.pos_z altitude\n"
          "write ramp outputs.x pilot.outputs.pos_z\nend\n",
};

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
    /* Never closed, so that an input does not load them anew. */
    FUZZ_CHECK(dlopen("./hopper.so", RTLD_NOW) != NULL && dlopen("./ball.so", RTLD_NOW) != NULL &&
               dlopen("./ramp.so", RTLD_NOW) != NULL && dlopen("./problem.so", RTLD_NOW) != NULL &&
               dlopen("./noisy_sensor.so", RTLD_NOW) != NULL);
    return 0;
}

/* The checkpoint of a simulation in memory of exactly its size. */
static uint8_t *saved(const fcsl_sim_t *sim, size_t *size)
{
    uint8_t *room = malloc(fcsl_sim_checkpoint_capacity(sim));
    FUZZ_CHECK(room != NULL);
    *size = fcsl_sim_checkpoint(sim, room);
    uint8_t *exact = realloc(room, *size);
    FUZZ_CHECK(exact != NULL);
    return exact;
}

static void expect_same(const fcsl_sim_t *sim, const uint8_t *before, size_t size)
{
    size_t still_size = 0;
    uint8_t *still = saved(sim, &still_size);
    FUZZ_CHECK(still_size == size && memcmp(still, before, size) == 0);
    free(still);
}

/* Of the machine's part, and of the whole. */
static void repair(uint8_t *image, size_t size)
{
    const uint64_t machine = fcsl_get_u64(image + AT_MACHINE);
    if (machine >= CRC_BYTES && machine <= size - HEAD_BYTES - CRC_BYTES) {
        uint8_t *part = image + HEAD_BYTES;
        fcsl_put_u32(part + machine - CRC_BYTES, fcsl_mcap_crc32(part, (size_t)machine - CRC_BYTES));
    }
    fcsl_put_u32(image + size - CRC_BYTES, fcsl_mcap_crc32(image, size - CRC_BYTES));
}

static void go_on(fcsl_sim_t *sim)
{
    fcsl_error_t error = {{0}};
    size_t size = 0;
    FUZZ_CHECK(fcsl_sim_tick(sim) <= fcsl_sim_ticks(sim));
    for (int i = 0; i < TICKS && fcsl_sim_status(sim) == FCSL_SIM_RUNNING; i++) {
        const uint64_t tick = fcsl_sim_tick(sim);
        if (fcsl_sim_run(sim, 1, &error) < 0) {
            FUZZ_CHECK(error.text[0] != '\0'); /* states may be such that the plant cannot go on */
            return;
        }
        FUZZ_CHECK(fcsl_sim_tick(sim) == tick + 1u);
    }
    uint8_t *after = saved(sim, &size);
    if (fcsl_sim_restore_checkpoint(sim, after, size, &error) != 0) {
        (void)fprintf(stderr, "%s\n", error.text);
        FUZZ_CHECK(!"what was saved is restored");
    }
    expect_same(sim, after, size);
    free(after);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    const char *plan = plans[take_number(&bytes, 1) % (sizeof plans / sizeof *plans)];
    const uint64_t before = take_number(&bytes, 1) % 6u;
    fcsl_sim_t *sim = fcsl_sim_open(plan, strlen(plan), NULL, &error);
    if (sim == NULL) {
        (void)fprintf(stderr, "%s\n", error.text);
        FUZZ_CHECK(!"the plans are good");
    }
    for (uint64_t i = 0; i < before; i++) {
        FUZZ_CHECK(fcsl_sim_run(sim, 1, &error) == 1);
    }
    size_t image_size = 0;
    uint8_t *image = saved(sim, &image_size);
    uint8_t *original = saved(sim, &image_size);
    patch_words(&bytes, image, image_size, (uint32_t)take_number(&bytes, 1) % PATCHES_MAX);
    if (bytes.left > 0) { /* cut short */
        image_size -= (size_t)take_number(&bytes, 2) % image_size;
        image = realloc(image, image_size);
        FUZZ_CHECK(image != NULL);
    }
    if (image_size >= HEAD_BYTES + CRC_BYTES) {
        repair(image, image_size);
    }
    if (fcsl_sim_restore_checkpoint(sim, image, image_size, &error) == 0) {
        go_on(sim);
    } else {
        size_t whole = 0;
        free(saved(sim, &whole));
        FUZZ_CHECK(error.text[0] != '\0');
        expect_same(sim, original, whole);
    }
    free(original);
    free(image);
    FUZZ_CHECK(fcsl_sim_close(sim, &error) == 0);
    return 0;
}
