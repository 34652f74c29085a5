/* SPDX-License-Identifier: Apache-2.0
 *
 * Splits the bag, and removes files of it. All of it is the writer thread's: the step thread never waits for it.
 *
 * A file begins with a keyframe, so that it replays alone; views, health, counters and verdicts are written anew in it. With
 * `around_ns`, a file stays that has something within this time of a trigger; the others go when they are older than this.
 */
#include <string.h>

#include "recorder_internal.h"

/* Files that make up the time before a trigger. */
enum { FILES_AROUND = 3 };

#define BILLION     UINT64_C(1000000000)
#define LARGEST     UINT64_C(1000000) /* seconds, megabytes */
#define SPLIT_USAGE "seconds=60,megabytes=100,files=10,around=30, or some of these"

/* A positive decimal number in billionths, up to LARGEST; 0: it is none. */
static uint64_t read_billionths(const char *text, size_t length)
{
    uint64_t value = 0;
    uint64_t unit = BILLION;
    int is_fraction = 0;
    for (size_t i = 0; i < length; i++) {
        if (text[i] == '.' && !is_fraction) {
            is_fraction = 1;
            continue;
        }
        if (text[i] < '0' || text[i] > '9' || value > LARGEST * BILLION) {
            return 0;
        }
        const uint64_t digit = (uint64_t)(text[i] - '0');
        unit = is_fraction ? unit / 10u : unit;
        value = is_fraction ? value + digit * unit : value * 10u + digit * BILLION;
    }
    return value <= LARGEST * BILLION ? value : 0;
}

static int read_entry(fcsl_recorder_t *recorder, const char *name, size_t length, uint64_t billionths)
{
    if (length == strlen("seconds") && memcmp(name, "seconds", length) == 0) {
        recorder->split_ns = billionths;
    } else if (length == strlen("megabytes") && memcmp(name, "megabytes", length) == 0) {
        recorder->split_bytes = billionths / 1000u;
    } else if (length == strlen("around") && memcmp(name, "around", length) == 0) {
        recorder->around_ns = billionths;
    } else if (length == strlen("files") && memcmp(name, "files", length) == 0 && billionths % BILLION == 0 &&
               billionths / BILLION <= FCSL_BAG_FILES_MAX) {
        recorder->keep_files = (uint32_t)(billionths / BILLION);
    } else {
        return -1;
    }
    return billionths == 0 ? -1 : 0;
}

int fcsl_recorder_read_split(fcsl_recorder_t *recorder, const char *split, fcsl_error_t *error)
{
    for (const char *at = split; *at != '\0';) {
        const size_t length = strcspn(at, ",");
        const char *equals = memchr(at, '=', length);
        const size_t name = equals != NULL ? (size_t)(equals - at) : 0u;
        if (equals == NULL || read_entry(recorder, at, name, read_billionths(equals + 1, length - name - 1u)) != 0) {
            return fcsl_fail(error, "a recording is split by " SPLIT_USAGE ", not by '%.100s'", split);
        }
        at += length;
        at += *at == ',' && at[1] != '\0';
        if (*at == ',') {
            return fcsl_fail(error, "a recording is split by " SPLIT_USAGE ", not by '%.100s'", split);
        }
    }
    if (recorder->keep_files != 0 && recorder->split_ns == 0 && recorder->split_bytes == 0 &&
        recorder->around_ns == 0) {
        return fcsl_fail(error, "files=%u of a recording needs seconds or megabytes: when does a file end?",
                         recorder->keep_files);
    }
    return 0;
}

static int is_due(const fcsl_recorder_t *recorder, uint64_t now_ns)
{
    const uint64_t split_ns = recorder->split_ns != 0 ? recorder->split_ns : recorder->around_ns / FILES_AROUND;
    return (split_ns != 0 && fcsl_bag_file_ns(recorder->bag, now_ns) >= split_ns) ||
           (recorder->split_bytes != 0 && fcsl_bag_file_bytes(recorder->bag) >= recorder->split_bytes);
}

int fcsl_recorder_split(fcsl_recorder_t *recorder, fcsl_stamp_t stamp)
{
    if (!is_due(recorder, stamp.time_ns)) {
        return 0;
    }
    if (fcsl_bag_split(recorder->bag, stamp.time_ns, &recorder->failure) != 0) {
        return -1;
    }
    recorder->status_written = 0;
    if (recorder->views_size > 0 && fcsl_bag_write(recorder->bag, FCSL_TOPIC_VIEWS, stamp.time_ns, recorder->views,
                                                   recorder->views_size, &recorder->failure) != 0) {
        return -1;
    }
    if (recorder->around_ns == 0 && recorder->keep_files == 0) {
        return 0;
    }
    if (stamp.time_ns <= recorder->keep_until_ns) {
        fcsl_bag_keep(recorder->bag, stamp.time_ns);
    }
    const uint64_t around_ns = recorder->around_ns;
    const uint64_t before_ns = around_ns != 0 && stamp.time_ns > around_ns ? stamp.time_ns - around_ns : 0u;
    return fcsl_bag_remove(recorder->bag, before_ns, recorder->keep_files, &recorder->failure);
}

void fcsl_recorder_trigger(fcsl_recorder_t *recorder, uint64_t time_ns)
{
    if (recorder->around_ns != 0) {
        fcsl_bag_keep(recorder->bag, time_ns > recorder->around_ns ? time_ns - recorder->around_ns : 0u);
        recorder->keep_until_ns = time_ns + recorder->around_ns;
    }
}
