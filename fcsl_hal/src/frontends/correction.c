/* SPDX-License-Identifier: Apache-2.0
 *
 * Corrections of readings.
 */
#include "frontends/correction.h"

#include <math.h>

void correct(const fcsl_correction_t *correction, double celsius, uint32_t count, double *values)
{
    const double warmer = isnan(celsius) ? 0.0 : celsius - correction->celsius;
    double raw[3] = {0.0};
    for (uint32_t i = 0; i < count && i < 3u; i++) {
        raw[i] = values[i] - correction->offset[i] - correction->per_kelvin[i] * warmer;
    }
    if (count == 1u) {
        values[0] = correction->matrix[0] * raw[0];
        return;
    }
    for (uint32_t i = 0; i < count && i < 3u; i++) {
        const double *row = &correction->matrix[3u * i];
        values[i] = row[0] * raw[0] + row[1] * raw[1] + row[2] * raw[2];
    }
}

double stick_of(const fcsl_stick_t *stick, double pulse_us)
{
    const double end_us =
        (pulse_us > stick->middle) == (stick->maximum > stick->middle) ? stick->maximum : stick->minimum;
    const double distance = fabs(pulse_us - stick->middle) - stick->deadband;
    const double whole = fabs(end_us - stick->middle) - stick->deadband;
    if (isnan(pulse_us)) {
        return pulse_us;
    }
    if (!(distance > 0.0) || !(whole > 0.0)) {
        return 0.0;
    }
    const double size = distance < whole ? distance / whole : 1.0;
    return end_us == stick->maximum ? size : -size;
}
