/* SPDX-License-Identifier: Apache-2.0
 *
 * What the protocols of receivers have in common.
 */
#include "gnss.h"

#include <math.h>

gnss_fix_t gnss_no_fix(void)
{
    return (gnss_fix_t){.kind = GNSS_NO_FIX,
                        .latitude_deg = (double)NAN,
                        .longitude_deg = (double)NAN,
                        .altitude_m = (double)NAN,
                        .height_m = (double)NAN,
                        .velocity_ned_mps = {NAN, NAN, NAN},
                        .ground_speed_mps = NAN,
                        .course_deg = NAN,
                        .horizontal_m = NAN,
                        .vertical_m = NAN,
                        .speed_mps = NAN,
                        .dilution = NAN};
}

/* A year begins in March, so that the leap day ends it: 153 days have the five months from March on. */
int64_t gnss_utc_ns(int year, int month, int day, int64_t ns_of_day)
{
    const int64_t shifted = month > 2 ? year : (int64_t)year - 1;
    const int64_t since_march = month > 2 ? month - 3 : month + 9;
    const int64_t days =
        365 * shifted + shifted / 4 - shifted / 100 + shifted / 400 + (153 * since_march + 2) / 5 + day;
    static const int64_t DAYS_TO_1970 = 719469;
    return (days - DAYS_TO_1970) * INT64_C(86400000000000) + ns_of_day;
}
