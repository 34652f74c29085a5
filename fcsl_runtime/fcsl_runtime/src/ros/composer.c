/* SPDX-License-Identifier: Apache-2.0
 *
 * Composers: a message in which every constant is in place already, and what each tick puts into it.
 */
#include <stdlib.h>
#include <string.h>

#include "base/error.h"
#include "fcsl/fcsl_scalar.h"
#include "messages/message.h"
#include "number.h"

struct fcsl_ros_composer {
    fcsl_ros_composer_plan_t plan; /* its tables lie behind the struct: rows, terms, text */
};

static int plan_valid(const fcsl_ros_composer_plan_t *plan)
{
    if (plan->size == 0 || plan->size > FCSL_MESSAGE_BYTES_MAX ||
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

/* A table of a plan, copied behind those before it. A plan without rows may come without the table. */
static const void *put_table(uint8_t **at, const void *table, size_t size)
{
    uint8_t *copy = *at;
    if (size > 0) {
        memcpy(copy, table, size);
    }
    *at += size;
    return copy;
}

fcsl_ros_composer_t *fcsl_ros_composer_new(const fcsl_ros_composer_plan_t *plan, fcsl_error_t *error)
{
    if (!plan_valid(plan)) {
        (void)fcsl_fail(error, "this plan of a message does not hold together");
        return NULL;
    }
    const size_t rows = plan->row_count * sizeof *plan->rows;
    const size_t terms = plan->term_count * sizeof *plan->terms;
    fcsl_ros_composer_t *composer = malloc(sizeof *composer + rows + terms + plan->size);
    if (composer == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan of a message");
        return NULL;
    }
    uint8_t *at = (uint8_t *)(composer + 1); /* every table before the text consists of doubles and what they align */
    composer->plan = *plan;
    composer->plan.rows = put_table(&at, plan->rows, rows);
    composer->plan.terms = put_table(&at, plan->terms, terms);
    composer->plan.text = put_table(&at, plan->text, plan->size);
    return composer;
}

void fcsl_ros_composer_free(fcsl_ros_composer_t *composer)
{
    free(composer);
}

fcsl_ros_status_t fcsl_ros_compose(const fcsl_ros_composer_t *composer, const uint8_t *const *memories, int64_t time_ns,
                                   uint8_t *cdr)
{
    const fcsl_ros_composer_plan_t *plan = &composer->plan;
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
