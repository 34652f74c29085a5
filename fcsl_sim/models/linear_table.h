/* SPDX-License-Identifier: Apache-2.0
 *
 * Tables that models interpolate linearly: columns over x, which increases. Outside of the table its ends hold. One
 * search serves all columns.
 */
#ifndef FCSL_SIM_MODELS_LINEAR_TABLE_H
#define FCSL_SIM_MODELS_LINEAR_TABLE_H

#include <stdbool.h>
#include <stdint.h>

/* Between `row` and the next one; at `row` if the fraction is 0. */
typedef struct {
    uint32_t row;
    double fraction;
} table_place_t;

/* Whether x increases up to its last value, which fills the rest. */
static inline bool table_increases(const double *x, uint32_t capacity)
{
    for (uint32_t i = 1; i < capacity; i++) {
        const bool fills = x[i] == x[i - 1] && x[i] == x[capacity - 1];
        if (!(x[i] > x[i - 1] || fills)) {
            return false;
        }
    }
    return x[0] == x[0];
}

static inline table_place_t table_find(const double *x, uint32_t capacity, double at)
{
    table_place_t place = {0, 0.0};
    bool is_last = true;
    for (uint32_t i = 1; i < capacity; i++) {
        is_last = at >= x[i];
        if (!is_last) {
            break;
        }
        place.row = i;
    }
    if (!is_last && !(at <= x[place.row])) { /* NaN gives NaN */
        place.fraction = (at - x[place.row]) / (x[place.row + 1] - x[place.row]);
    }
    return place;
}

static inline double table_value(const double *column, table_place_t place)
{
    if (place.fraction == 0.0) {
        return column[place.row];
    }
    return column[place.row] + place.fraction * (column[place.row + 1] - column[place.row]);
}

#endif /* FCSL_SIM_MODELS_LINEAR_TABLE_H */
