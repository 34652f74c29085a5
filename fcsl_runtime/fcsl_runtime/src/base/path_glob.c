/* SPDX-License-Identifier: Apache-2.0
 *
 * Chooses paths by globs.
 */
#include "path_glob.h"

#include <string.h>

#include "fcsl/fcsl_error.h"

/* Whether all of `text` matches the glob of `length` characters. */
static int matches(const char *glob, size_t length, const char *text)
{
    const char *end = glob + length;
    const char *star = NULL; /* the last one seen, and where the text behind it was last assumed to begin */
    const char *retry = NULL;
    while (*text != '\0') {
        if (glob < end && *glob == '*') {
            star = ++glob;
            retry = text;
        } else if (glob < end && (*glob == '?' || *glob == *text)) {
            glob++;
            text++;
        } else if (star != NULL) {
            glob = star;
            text = ++retry;
        } else {
            return 0;
        }
    }
    while (glob < end && *glob == '*') {
        glob++;
    }
    return glob == end;
}

int fcsl_match_paths(const char *globs, int lenient, const fcsl_paths_t *paths, uint8_t *chosen, fcsl_error_t *error)
{
    for (const char *glob = globs; *glob != '\0';) {
        const size_t length = strcspn(glob, ",");
        int found = 0;
        for (uint32_t i = 0; i < paths->count; i++) {
            if (matches(glob, length, paths->path(paths->table, i))) {
                chosen[i] = 1;
                found = 1;
            }
        }
        if (!found && !lenient) {
            return fcsl_fail(error, "no field matches '%.*s'; a path is like '%s'", (int)(length < 128 ? length : 128),
                             glob, paths->count > 0 ? paths->path(paths->table, paths->count - 1) : "a.outputs.b");
        }
        glob += length + (glob[length] == ',' ? 1u : 0u);
    }
    return 0;
}
