/* SPDX-License-Identifier: Apache-2.0
 *
 * NMEA 0183: `$`, talker, sentence, fields behind commas, `*`, and in hex the sum (^) of all between. Numbers are read as whole
 * numbers and divided once, so that the nearest double comes out, in every locale.
 */
#include <math.h>
#include <string.h>

#include "gnss.h"

enum {
    SENTENCE_MAX = 120, /* bytes; the standard has 82, and receivers more */
    TAIL = 5, /* bytes of `*hh\r\n` */
    KIND = 3, /* its place, behind `$` and the talker */
    FIELDS_MAX = 32,
    DIGITS_MAX = 15,
    GGA = 1,
    RMC = 2,
    BOTH = 3
};
static const double KNOT_MPS = 1852.0 / 3600.0;
static const int64_t NS_PER_S = 1000000000;

/* ---- a sentence --------------------------------------------------------------------------------------------------------- */

static int hex_of(uint8_t digit)
{
    if (digit >= '0' && digit <= '9') {
        return digit - '0';
    }
    const int letter = (digit | 0x20) - 'a';
    return letter >= 0 && letter < 6 ? letter + 10 : -1;
}

/* The place of the line feed that ends it; `size` where it is not among the first SENTENCE_MAX bytes, and minus the reason where
 * something is no text. */
static int32_t end_of(const uint8_t *bytes, uint32_t size)
{
    //@ loop unroll SENTENCE_MAX;
    for (uint32_t i = 1; i < size && i < SENTENCE_MAX; i++) {
        if (bytes[i] == '\n') {
            return (int32_t)i;
        }
        if (bytes[i] == '$') { /* behind a carriage return alone, or a sentence that was cut */
            return bytes[i - 1u] == '\r' ? -FCSL_DRIVER_LINE_ENDS : -FCSL_DRIVER_NO_FRAMES;
        }
        if (bytes[i] != '\r' && (bytes[i] < 0x20u || bytes[i] > 0x7Eu)) {
            return -FCSL_DRIVER_NO_FRAMES;
        }
    }
    return (int32_t)size;
}

static int32_t judge(const uint8_t *bytes, uint32_t size)
{
    const int32_t end = bytes[0] == '$' ? end_of(bytes, size) : -FCSL_DRIVER_NO_FRAMES;
    if (end < 0 || end >= SENTENCE_MAX) {
        return end < 0 ? end : -FCSL_DRIVER_NO_FRAMES;
    }
    if ((uint32_t)end == size) {
        return 0;
    }
    const uint32_t length = (uint32_t)end + 1u;
    if (length < TAIL + 1u || bytes[length - 2u] != '\r') {
        return -FCSL_DRIVER_LINE_ENDS;
    }
    if (bytes[length - TAIL] != '*') {
        return -FCSL_DRIVER_NO_CHECKSUMS;
    }
    int sum = 0;
    //@ loop unroll SENTENCE_MAX;
    for (uint32_t i = 1; i + TAIL < length; i++) {
        sum ^= bytes[i];
    }
    const int high = hex_of(bytes[length - 4u]);
    const int low = hex_of(bytes[length - 3u]);
    return high >= 0 && low >= 0 && sum == high * 16 + low ? (int32_t)length : -FCSL_DRIVER_NO_FRAMES;
}

/* ---- fields ------------------------------------------------------------------------------------------------------------- */

typedef struct {
    const char *text;
    uint32_t size;
} field_t;

typedef struct {
    field_t fields[FIELDS_MAX]; /* the first one is the sentence's name */
    uint32_t count;
} sentence_t;

static sentence_t split(const uint8_t *bytes, uint32_t size)
{
    sentence_t sentence = {.count = 1};
    for (uint32_t i = 0; i < FIELDS_MAX; i++) { /* a field that does not come is empty */
        sentence.fields[i].text = (const char *)bytes + 1;
    }
    //@ loop unroll SENTENCE_MAX;
    for (uint32_t i = 1; i + TAIL < size; i++) {
        if (bytes[i] != ',') {
            sentence.fields[sentence.count - 1u].size++;
        } else if (sentence.count < FIELDS_MAX) {
            sentence.fields[sentence.count++].text = (const char *)bytes + i + 1;
        } else {
            break;
        }
    }
    return sentence;
}

/* A decimal: `whole` / `scale`. */
typedef struct {
    int64_t whole;
    int64_t scale;
} decimal_t;

/* Returns 1, 0 for an empty field, -1 for one that is no number, or has too many digits. */
static int read_decimal(field_t field, decimal_t *decimal)
{
    *decimal = (decimal_t){.whole = 0, .scale = 1};
    const int negative = field.size > 0u && field.text[0] == '-';
    uint32_t digits = 0;
    int point = 0;
    //@ loop unroll SENTENCE_MAX;
    for (uint32_t i = negative ? 1u : 0u; i < field.size; i++) {
        const char c = field.text[i];
        if (c == '.' && !point) {
            point = 1;
        } else if (c >= '0' && c <= '9' && digits < DIGITS_MAX) {
            decimal->whole = decimal->whole * 10 + (c - '0');
            decimal->scale *= point ? 10 : 1;
            digits++;
        } else {
            return -1;
        }
    }
    decimal->whole = negative ? -decimal->whole : decimal->whole;
    return field.size == 0u ? 0 : digits > 0u ? 1 : -1;
}

/* The whole part of a number; 0 for one that is negative or above 255, and for an empty field. Returns 0, or -1. */
static int read_count(field_t field, uint32_t *count)
{
    decimal_t decimal;
    const int found = read_decimal(field, &decimal);
    const int64_t whole = decimal.whole / decimal.scale;
    *count = whole >= 0 && whole <= 255 ? (uint32_t)whole : 0u;
    return found < 0 ? -1 : 0;
}

/* Returns 0 with the number, NaN for an empty field, or -1. */
static int read_number(field_t field, double *number)
{
    decimal_t decimal;
    const int found = read_decimal(field, &decimal);
    *number = found > 0 ? (double)decimal.whole / (double)decimal.scale : (double)NAN;
    return found < 0 ? -1 : 0;
}

/* `dddmm.mmmm` and one of `marks`, the second of which is negative. Returns 0, or -1. */
static int read_angle(field_t field, field_t side, const char *marks, int64_t degrees_max, double *degrees)
{
    decimal_t decimal;
    const int found = read_decimal(field, &decimal);
    if (found == 0 && side.size == 0u) {
        *degrees = (double)NAN;
        return 0;
    }
    if (found <= 0 || decimal.whole < 0 || decimal.scale > NS_PER_S || side.size != 1u ||
        (side.text[0] != marks[0] && side.text[0] != marks[1])) {
        return -1;
    }
    const int64_t whole_degrees = decimal.whole / (100 * decimal.scale);
    const int64_t minutes = decimal.whole % (100 * decimal.scale); /* times the scale */
    const int64_t sum = whole_degrees * 60 * decimal.scale + minutes;
    if (minutes >= 60 * decimal.scale || sum > degrees_max * 60 * decimal.scale) {
        return -1;
    }
    *degrees = (double)(side.text[0] == marks[1] ? -sum : sum) / (double)(60 * decimal.scale);
    return 0;
}

/* Three numbers of two digits. Returns 0, or -1. */
static int read_triple(field_t field, int triple[3])
{
    for (uint32_t i = 0; i < 6u; i++) {
        const int digit = i < field.size ? field.text[i] - '0' : -1;
        if (digit < 0 || digit > 9) {
            return -1;
        }
        triple[i / 2u] = i % 2u == 0u ? digit * 10 : triple[i / 2u] + digit;
    }
    return 0;
}

/* `hhmmss.ss`. Returns 0, or -1: a sentence without time belongs to no solution. */
static int read_time(field_t field, int64_t *ns_of_day)
{
    int time[3];
    decimal_t all;
    if (read_triple(field, time) != 0 || read_decimal(field, &all) <= 0 || all.scale > NS_PER_S || time[0] > 23 ||
        time[1] > 59 || time[2] > 60 || all.whole < 0) {
        return -1;
    }
    const int64_t part = all.whole % all.scale; /* of the second, times the scale */
    *ns_of_day = (time[0] * INT64_C(3600) + time[1] * 60 + time[2]) * NS_PER_S + part * (NS_PER_S / all.scale);
    return 0;
}

/* ---- sentences ----------------------------------------------------------------------------------------------------------- */

/* Whether a field of one letter is among these. */
static int is_one_of(field_t field, const char *letters)
{
    int found = 0;
    //@ loop unroll FIELDS_MAX;
    for (uint32_t i = 0; letters[i] != '\0'; i++) {
        found = found || (field.size == 1u && field.text[0] == letters[i]);
    }
    return found;
}

/* `--GGA,time,latitude,N,longitude,E,quality,satellites,hdop,altitude,M,separation,M,…`. Of the qualities these are measured: 1
 * autonomous, 2 differential, 3 precise, 4 RTK, 5 RTK with floating ambiguities, 9 SBAS (NovAtel). The others are not: 0 none, 6 dead
 * reckoning, 7 entered by hand, 8 simulated. */
static int read_gga(const sentence_t *s, gnss_fix_t *fix)
{
    double dilution = 0.0;
    double separation = 0.0;
    if (s->count < 12u || read_angle(s->fields[2], s->fields[3], "NS", 90, &fix->latitude_deg) != 0 ||
        read_angle(s->fields[4], s->fields[5], "EW", 180, &fix->longitude_deg) != 0 ||
        read_count(s->fields[7], &fix->satellites) != 0 || read_number(s->fields[8], &dilution) != 0 ||
        read_number(s->fields[9], &fix->altitude_m) != 0 || read_number(s->fields[11], &separation) != 0) {
        return -1;
    }
    fix->dilution = (float)dilution;
    fix->height_m = fix->altitude_m + separation;
    const int is_there =
        is_one_of(s->fields[6], "123459") && isfinite(fix->latitude_deg) && isfinite(fix->longitude_deg);
    fix->kind = !is_there ? GNSS_NO_FIX : isfinite(fix->altitude_m) ? GNSS_3D : GNSS_2D;
    return 0;
}

/* Whether an RMC tells of a fix. Its status is A. Its mode, which came with NMEA 2.3, is autonomous, differential, float RTK, precise or
 * RTK; not estimated (E), by hand (M), simulated (S) or none (N). Its integrity (NMEA 4.1) is not U, unsafe; u-blox always sends V
 * there, which is that it tells none. */
static int has_fix(const sentence_t *s)
{
    return is_one_of(s->fields[2], "A") && (s->fields[12].size == 0u || is_one_of(s->fields[12], "ADFPR")) &&
           !is_one_of(s->fields[13], "U");
}

/* `--RMC,time,status,latitude,N,longitude,E,knots,course,ddmmyy,variation,E,mode,integrity` */
static int read_rmc(const sentence_t *s, int64_t ns_of_day, gnss_fix_t *fix)
{
    double knots = 0.0;
    double course = 0.0;
    int date[3];
    if (s->count < 10u || read_number(s->fields[7], &knots) != 0 || read_number(s->fields[8], &course) != 0) {
        return -1;
    }
    fix->ground_speed_mps = (float)(knots * KNOT_MPS);
    fix->course_deg = (float)course;
    if (s->fields[9].size == 0u) {
        return 0;
    }
    if (read_triple(s->fields[9], date) != 0 || s->fields[9].size != 6u || date[0] < 1 || date[0] > 31 || date[1] < 1 ||
        date[1] > 12) {
        return -1;
    }
    const int year = date[2] + (date[2] < 80 ? 2000 : 1900); /* GPS began in 1980 */
    fix->utc_ns = gnss_utc_ns(year, date[1], date[0], ns_of_day);
    fix->has_utc = 1;
    return 0;
}

/* GGA, RMC, or 0 for others. */
static uint32_t kind_of(const sentence_t *s)
{
    if (s->fields[0].size != 5u) {
        return 0;
    }
    const char *kind = s->fields[0].text + KIND - 1;
    return memcmp(kind, "GGA", 3) == 0 ? GGA : memcmp(kind, "RMC", 3) == 0 ? RMC : 0u;
}

int gnss_nmea_take(gnss_nmea_t *nmea, uint8_t byte, gnss_fix_t *fix)
{
    int64_t ns_of_day = 0;
    const uint32_t size = byte_stream_take(&nmea->stream, byte, judge);
    if (size == 0u) {
        return 0;
    }
    const sentence_t sentence = split(nmea->stream.bytes, size);
    const uint32_t kind = kind_of(&sentence);
    if (kind == 0u) {
        byte_stream_note(&nmea->stream, FCSL_DRIVER_OTHER_FRAMES);
        return 0;
    }
    if (sentence.count < 2u || read_time(sentence.fields[1], &ns_of_day) != 0) {
        byte_stream_note(&nmea->stream, sentence.fields[1].size == 0u ? FCSL_DRIVER_NO_TIME : FCSL_DRIVER_REFUSED);
        return 0;
    }
    if (nmea->seen == 0u || ns_of_day != nmea->ns_of_day) { /* a new solution */
        nmea->fix = gnss_no_fix();
        nmea->ns_of_day = ns_of_day;
        nmea->seen = 0;
    }
    if (kind == RMC) {
        nmea->has_fix = has_fix(&sentence);
    }
    if ((kind == GGA ? read_gga(&sentence, &nmea->fix) : read_rmc(&sentence, ns_of_day, &nmea->fix)) != 0) {
        byte_stream_note(&nmea->stream, FCSL_DRIVER_REFUSED);
        nmea->seen = 0;
        return 0;
    }
    nmea->seen |= kind;
    if (nmea->seen != BOTH) {
        byte_stream_note(&nmea->stream, kind == GGA ? FCSL_DRIVER_GGA_ALONE : FCSL_DRIVER_RMC_ALONE);
        return 0;
    }
    nmea->seen = 0;
    *fix = nmea->fix;
    fix->kind = nmea->has_fix ? fix->kind : GNSS_NO_FIX; /* what one of the two doubts is no fix */
    return 1;
}
