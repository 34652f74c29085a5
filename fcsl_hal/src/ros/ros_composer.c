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
    const fcsl_ros_composer_plan_t *plan;
};

static int plan_valid(const fcsl_ros_composer_plan_t *plan)
{
    if (plan->size == 0 || plan->size > FCSL_ROS_MESSAGE_MAX ||
        !fcsl_ros_rows_valid(plan->rows, plan->row_count, plan->term_count, plan->size)) {
        return 0;
    }
    for (uint32_t i = 0; i < plan->term_count; i++) {
        if (plan->terms[i].anchor >= plan->memory_count || fcsl_ros_scalar_size(plan->terms[i].type) == 0) {
            return 0;
        }
    }
    return plan->stamp_offset == FCSL_ROS_NONE || (plan->size >= 8u && plan->stamp_offset <= plan->size - 8u);
}

fcsl_ros_composer_t *fcsl_ros_composer_new(const fcsl_ros_composer_plan_t *plan, fcsl_error_t *error)
{
    if (!plan_valid(plan)) {
        (void)fcsl_fail(error, "this plan of a message does not hold together");
        return NULL;
    }
    fcsl_ros_composer_t *composer = malloc(sizeof *composer);
    if (composer == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan of a message");
        return NULL;
    }
    composer->plan = plan;
    return composer;
}

void fcsl_ros_composer_free(fcsl_ros_composer_t *composer)
{
    free(composer);
}

fcsl_ros_status_t fcsl_ros_compose(const fcsl_ros_composer_t *composer, const uint8_t *const *memories, int64_t time_ns,
                                   uint8_t *cdr)
{
    const fcsl_ros_composer_plan_t *plan = composer->plan;
    memcpy(cdr, plan->text, plan->size);
    if (plan->stamp_offset != FCSL_ROS_NONE) {
        if (time_ns < 0 || time_ns / 1000000000 > INT32_MAX) {
            return FCSL_ROS_STAMP;
        }
        fcsl_put_u32(cdr + plan->stamp_offset, (uint32_t)(time_ns / 1000000000));
        fcsl_put_u32(cdr + plan->stamp_offset + 4u, (uint32_t)(time_ns % 1000000000));
    }
    for (uint32_t i = 0; i < plan->row_count; i++) {
        const fcsl_ros_status_t status = fcsl_ros_row_apply(&plan->rows[i], plan->terms, memories, 1, cdr);
        if (status != FCSL_ROS_TAKEN) {
            return status;
        }
    }
    return FCSL_ROS_TAKEN;
}
