/* SPDX-License-Identifier: Apache-2.0
 *
 * Indices and slices of array fields, as NumPy has them.
 */
#include "view.h"

#include <string.h>

#include "fcsl/fcsl_scalar.h"

/* Larger than any extent; digits beyond it change nothing for a slice and are out of range for an index. */
static const int64_t NUMBER_MAX = INT64_C(1) << 40;

view_t fcsl_view_whole(const fcsl_field_t *field)
{
    view_t view = {.rank = field->rank <= RANK_MAX ? field->rank : RANK_MAX};
    int64_t stride = fcsl_scalar_size(field->type);
    for (uint32_t level = view.rank; level > 0; level--) {
        view.axes[level - 1].stride = stride;
        view.axes[level - 1].count = field->shape[level - 1];
        stride *= field->shape[level - 1];
    }
    return view;
}

/* An optional integer: 1 when there is one, 0 when there is none, -1 for a sign without digits. */
static int read_number(const char **text, int64_t *number)
{
    const char *at = *text;
    const int negative = *at == '-';
    at += negative;
    if (*at < '0' || *at > '9') {
        return negative ? -1 : 0;
    }
    int64_t value = 0;
    for (; *at >= '0' && *at <= '9'; at++) {
        value = value < NUMBER_MAX ? value * 10 + (*at - '0') : NUMBER_MAX;
    }
    *number = negative ? -value : value;
    *text = at;
    return 1;
}

static int64_t clamp(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
}

/* One `start:stop:step` whose text begins at its first colon; Python's slice.indices. */
static int read_slice(const char **text, int has_start, int64_t start, int64_t count, int64_t *first, int64_t *step,
                      uint32_t *taken)
{
    int64_t stop = 0;
    int has_step = 0;
    *step = 1;
    (*text)++;
    const int has_stop = read_number(text, &stop);
    if (has_stop >= 0 && **text == ':') {
        (*text)++;
        has_step = read_number(text, step);
    }
    if (has_stop < 0 || has_step < 0 || *step == 0) {
        return -1;
    }
    const int down = *step < 0;
    const int64_t low = down ? -1 : 0;
    const int64_t high = down ? count - 1 : count;
    start = has_start ? clamp(start < 0 ? start + count : start, low, high) : down ? high : low;
    stop = has_stop ? clamp(stop < 0 ? stop + count : stop, low, high) : down ? low : high;
    const int64_t span = down ? start - stop : stop - start;
    const int64_t pace = down ? -*step : *step;
    *first = start;
    *taken = span > 0 ? (uint32_t)((span + pace - 1) / pace) : 0u;
    return 0;
}

/* One item of a bracket, for the axis at `level` of the view; 1 when the axis stays (a slice), 0 when it is gone. */
static int read_item(view_t *view, uint32_t level, const char **text)
{
    const int64_t count = view->axes[level].count;
    const int64_t stride = view->axes[level].stride;
    const int64_t fields = view->axes[level].fields;
    int64_t number = 0;
    const int has_number = read_number(text, &number);
    if (has_number < 0) {
        return -1;
    }
    if (**text == ':') {
        int64_t first = 0;
        int64_t step = 1;
        uint32_t taken = 0;
        if (read_slice(text, has_number, number, count, &first, &step, &taken) != 0) {
            return -1;
        }
        /* The offset of an empty slice is never used; it stays inside the field all the same. */
        view->offset += taken > 0 ? first * stride : 0;
        view->fields += taken > 0 ? first * fields : 0;
        /* With two or more the step is within the axis; a larger one goes nowhere, and would overflow. */
        view->axes[level].stride = taken > 1 ? stride * step : 0;
        view->axes[level].fields = taken > 1 ? fields * step : 0;
        view->axes[level].count = taken;
        return 1;
    }
    number += number < 0 ? count : 0;
    if (has_number == 0 || number < 0 || number >= count) {
        return -1;
    }
    view->offset += number * stride;
    view->fields += number * fields;
    memmove(&view->axes[level], &view->axes[level + 1], (view->rank - level - 1u) * sizeof view->axes[0]);
    view->rank--;
    return 0;
}

int fcsl_view_index(view_t *view, const char *text)
{
    while (*text != '\0') {
        uint32_t level = 0;
        if (*text != '[') {
            return -1;
        }
        do {
            text++; /* the bracket, or the comma */
            const int stays = level < view->rank ? read_item(view, level, &text) : -1;
            if (stays < 0) {
                return -1;
            }
            level += (uint32_t)stays;
        } while (*text == ',');
        if (*text != ']') {
            return -1;
        }
        text++;
    }
    return 0;
}

uint32_t fcsl_view_count(const view_t *view)
{
    uint32_t count = 1;
    for (uint32_t level = 0; level < view->rank; level++) {
        count *= view->axes[level].count;
    }
    return count;
}

int64_t fcsl_view_byte(const view_t *view, uint32_t i)
{
    int64_t at = view->offset;
    for (uint32_t level = view->rank; level > 0; level--) {
        at += (int64_t)(i % view->axes[level - 1].count) * view->axes[level - 1].stride;
        i /= view->axes[level - 1].count;
    }
    return at;
}

int64_t fcsl_view_field(const view_t *view, uint32_t i)
{
    int64_t field = view->fields;
    for (uint32_t level = view->rank; level > 0; level--) {
        field += (int64_t)(i % view->axes[level - 1].count) * view->axes[level - 1].fields;
        i /= view->axes[level - 1].count;
    }
    return field;
}

int fcsl_view_append(view_t *view, const view_t *last)
{
    if (view->rank + last->rank > RANK_MAX) {
        return -1;
    }
    view->offset += last->offset;
    view->fields += last->fields;
    memcpy(&view->axes[view->rank], last->axes, last->rank * sizeof last->axes[0]);
    view->rank += last->rank;
    return 0;
}
