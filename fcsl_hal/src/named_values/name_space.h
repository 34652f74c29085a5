/* SPDX-License-Identifier: Apache-2.0
 *
 * A namespace as keys have it, from one as ROS 2 users write it.
 */
#ifndef FCSL_NAME_SPACE_H
#define FCSL_NAME_SPACE_H

#include <string.h>

/* Sets *name_space behind the slashes that it begins with; returns its length without those at its end. */
static inline int name_space_trim(const char **name_space)
{
    const char *begin = *name_space + strspn(*name_space, "/");
    size_t length = strlen(begin);
    while (length > 0u && begin[length - 1u] == '/') {
        length--;
    }
    *name_space = begin;
    return (int)length;
}

#endif /* FCSL_NAME_SPACE_H */
