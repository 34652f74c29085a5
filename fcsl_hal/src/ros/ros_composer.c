/* SPDX-License-Identifier: Apache-2.0
 *
 * Composers: a message in which every constant is in place already, and what each tick puts into it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_scalar.h"
#include "ros_number.h"

struct fcsl_ros_composer {
    const fcsl_ros_composer_plan_t *conversion;
};

static int conversion_valid(const fcsl_ros_composer_plan_t *conversion)
{
    if (conversion->size == 0 || conversion->size > FCSL_ROS_MESSAGE_MAX ||
        !fcsl_ros_rows_valid(conversion->rows, conversion->row_count, conversion->term_count, conversion->size)) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->term_count; i++) {
        if (conversion->terms[i].anchor >= conversion->memory_count ||
            fcsl_ros_scalar_size(conversion->terms[i].type) == 0) {
            return 0;
        }
    }
    return conversion->stamp_offset == FCSL_ROS_NONE ||
           (conversion->size >= 8u && conversion->stamp_offset <= conversion->size - 8u);
}

fcsl_ros_composer_t *fcsl_ros_composer_new(const fcsl_ros_composer_plan_t *conversion, fcsl_error_t *error)
{
    if (!conversion_valid(conversion)) {
        (void)fcsl_fail(error, "this plan of a message does not hold together");
        return NULL;
    }
    fcsl_ros_composer_t *composer = malloc(sizeof *composer);
    if (composer == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan of a message");
        return NULL;
    }
    composer->conversion = conversion;
    return composer;
}

void fcsl_ros_composer_free(fcsl_ros_composer_t *composer)
{
    free(composer);
}

fcsl_ros_status_t fcsl_ros_compose(const fcsl_ros_composer_t *composer, const uint8_t *const *memories, int64_t time_ns,
                                   uint8_t *cdr)
{
    const fcsl_ros_composer_plan_t *conversion = composer->conversion;
    memcpy(cdr, conversion->text, conversion->size);
    if (conversion->stamp_offset != FCSL_ROS_NONE) {
        if (time_ns < 0 || time_ns / 1000000000 > INT32_MAX) {
            return FCSL_ROS_STAMP;
        }
        fcsl_put_u32(cdr + conversion->stamp_offset, (uint32_t)(time_ns / 1000000000));
        fcsl_put_u32(cdr + conversion->stamp_offset + 4u, (uint32_t)(time_ns % 1000000000));
    }
    for (uint32_t i = 0; i < conversion->row_count; i++) {
        const fcsl_ros_status_t status = fcsl_ros_row_apply(&conversion->rows[i], conversion->terms, memories, 1, cdr);
        if (status != FCSL_ROS_TAKEN) {
            return status;
        }
    }
    return FCSL_ROS_TAKEN;
}
