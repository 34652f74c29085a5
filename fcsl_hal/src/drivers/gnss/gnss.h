/* SPDX-License-Identifier: Apache-2.0
 *
 * What receivers of satellite navigation send: u-blox's UBX and NMEA 0183.
 */
#ifndef FCSL_HAL_GNSS_H
#define FCSL_HAL_GNSS_H

#include "serial/byte_stream.h"

typedef enum {
    GNSS_NO_FIX = 0,
    GNSS_2D = 2, /* the altitude is assumed */
    GNSS_3D = 3
} gnss_fix_kind_t;

/* One solution. What a receiver does not tell is NaN, or 0 of a count. */
typedef struct {
    gnss_fix_kind_t kind; /* without a fix the rest counts for nothing */
    uint32_t satellites; /* used */
    int has_utc;
    int64_t utc_ns; /* since 1970, without leap seconds */
    double latitude_deg;
    double longitude_deg;
    double altitude_m; /* above mean sea level */
    double height_m; /* above the ellipsoid */
    float velocity_ned_mps[3];
    float ground_speed_mps;
    float course_deg; /* of the motion, from true north */
    float horizontal_m; /* standard deviations, as the receiver estimates them */
    float vertical_m;
    float speed_mps;
    float dilution; /* of precision: of the position (UBX), or horizontal (NMEA) */
} gnss_fix_t;

/* Nothing is known. */
gnss_fix_t gnss_no_fix(void);

/* Nanoseconds since 1970 of a date in the Gregorian calendar. */
int64_t gnss_utc_ns(int year, int month, int day, int64_t ns_of_day);

/* UBX, of which NAV-PVT is read. */
typedef struct {
    byte_stream_t stream;
} gnss_ubx_t;

/* Takes a byte. Returns 1 with *fix when it completes a NAV-PVT, else 0. */
int gnss_ubx_take(gnss_ubx_t *ubx, uint8_t byte, gnss_fix_t *fix);

/* NMEA 0183, of which GGA and RMC of any talker are read. A solution has both, of the same time. */
typedef struct {
    gnss_fix_t fix; /* of what came of it so far */
    int64_t ns_of_day;
    uint32_t seen;
    int has_fix; /* as its RMC says */
    byte_stream_t stream;
} gnss_nmea_t;

/* Takes a byte. Returns 1 with *fix when a solution is complete, else 0. */
int gnss_nmea_take(gnss_nmea_t *nmea, uint8_t byte, gnss_fix_t *fix);

#endif /* FCSL_HAL_GNSS_H */
