/* SPDX-License-Identifier: Apache-2.0
 *
 * message.h: the .msg text of an instance, laid out along its outputs: a number, an array, a struct, an array of structs.
 * Input: that text. What is laid out lies in the machine's struct and in the message. The fields
 * are by hand: of a machine they are all that is read.
 */
#include "fuzz.h"
#include "messages/message.h"

typedef struct {
    double force;
    float gains[3];
    struct {
        double x;
        int32_t mode;
    } pose;
    struct {
        double range;
        uint8_t valid;
    } targets[2];
    int32_t health;
} outputs_t;

static const uint32_t THREE[] = {3};

#define LEAF(path_, type_, rank_, count_, member_)                                                                     \
    {.path = path_,                                                                                                    \
     .role = FCSL_ROLE_OUTPUT,                                                                                         \
     .type = type_,                                                                                                    \
     .rank = rank_,                                                                                                    \
     .shape = rank_ > 0 ? THREE : NULL,                                                                                \
     .count = count_,                                                                                                  \
     .offset = offsetof(outputs_t, member_),                                                                           \
     .size = sizeof(((outputs_t *)0)->member_)}

static const fcsl_field_t FIELDS[] = {
    LEAF("pilot.outputs.force", FCSL_F64, 0, 1, force),
    LEAF("pilot.outputs.gains", FCSL_F32, 1, 3, gains),
    LEAF("pilot.outputs.pose.x", FCSL_F64, 0, 1, pose.x),
    LEAF("pilot.outputs.pose.mode", FCSL_I32, 0, 1, pose.mode),
    LEAF("pilot.outputs.targets[0].range", FCSL_F64, 0, 1, targets[0].range),
    LEAF("pilot.outputs.targets[0].valid", FCSL_BOOL, 0, 1, targets[0].valid),
    LEAF("pilot.outputs.targets[1].range", FCSL_F64, 0, 1, targets[1].range),
    LEAF("pilot.outputs.targets[1].valid", FCSL_BOOL, 0, 1, targets[1].valid),
    LEAF("pilot.outputs.health", FCSL_HEALTH, 0, 1, health),
};
enum { FIELD_COUNT = sizeof FIELDS / sizeof FIELDS[0] };
static const fcsl_machine_t MACHINE = {
    .name = "pilot", .fields = FIELDS, .field_count = FIELD_COUNT, .size = sizeof(outputs_t)};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    fcsl_layout_t layout = {0};
    char *text = take_text(&bytes);
    const fcsl_instance_t instance = {
        .name = "pilot", .field_count = FIELD_COUNT, .message_type = "fuzz/msg/Pilot", .message_text = text};
    if (fcsl_layout_build(&MACHINE, &instance, &layout, &error) == 0) {
        outputs_t *outputs = calloc(1, sizeof *outputs);
        uint8_t *message = malloc(layout.size);
        FUZZ_CHECK(outputs != NULL && message != NULL && layout.size <= FCSL_MESSAGE_BYTES_MAX);
        fcsl_layout_write(&layout, outputs, 7, 8, message);
        free(message);
        free(outputs);
    } else {
        FUZZ_CHECK(error.text[0] != '\0');
    }
    fcsl_layout_free(&layout);
    free(text);
    return 0;
}
