/* SPDX-License-Identifier: Apache-2.0
 *
 * Expressions over what is served.
 */
#ifndef FCSL_VARS_EVALUATE_H
#define FCSL_VARS_EVALUATE_H

#include "catalog.h"
#include "fcsl/fcsl_expression.h"
#include "json.h"

typedef struct {
    fcsl_expression_value_t value;
    uint8_t type;                  /* of a name */
    const fcsl_machine_t *machine; /* of a name */
} evaluated_t;

/* The value of `text` over one publication; 0, or -1 with `error`. */
int fcsl_evaluate(const char *text, const catalog_t *catalog, const uint8_t *snapshot, evaluated_t *evaluated,
                  fcsl_expression_error_t *error);
void fcsl_evaluated_write(const evaluated_t *evaluated, json_out_t *out);

#endif /* FCSL_VARS_EVALUATE_H */
