/* SPDX-License-Identifier: Apache-2.0
 *
 * Keys and liveliness tokens as zenoh-plugin-ros2dds reads them.
 */
#include "endpoint.h"

#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_error.h"

int ros_key_write(char key[FCSL_BUS_KEY_MAX + 1], const char *name_space, const char *machine, const char *name,
                  fcsl_error_t *error)
{
    const int is_absolute = name[0] == '/';
    name_space += strspn(name_space, "/");
    size_t length = is_absolute ? 0u : strlen(name_space);
    while (length > 0 && name_space[length - 1] == '/') {
        length--;
    }
    const int size =
        snprintf(key, FCSL_BUS_KEY_MAX + 1u, "%.*s%s%s%s%s", (int)length, name_space, length > 0 ? "/" : "",
                 machine != NULL ? machine : "", machine != NULL ? "/" : "", name + is_absolute);
    return size <= (int)FCSL_BUS_KEY_MAX ? 0
                                         : fcsl_fail(error, "topic '%.100s' in namespace '%.100s': more than %u bytes",
                                                     name, name_space, FCSL_BUS_KEY_MAX);
}

/* A name as one word of a key: the plugin writes a paragraph sign for each slash. */
static void write_word(const char *name, char *word, size_t size)
{
    static const char SLASH[] = "\xc2\xa7";
    size_t at = 0;
    for (; *name != '\0' && at + sizeof SLASH < size; name++) {
        if (*name == '/') {
            memcpy(word + at, SLASH, sizeof SLASH - 1u);
            at += sizeof SLASH - 1u;
        } else {
            word[at++] = *name;
        }
    }
    word[at] = '\0';
}

/* Reliable (1) or best effort (0), volatile (0) or transient local (1), keep last (0) with a depth, and what DDS has as the data of
 * the user: the type's hash. */
int ros_token_write(char token[FCSL_BUS_TOKEN_MAX + 1], const char *key, const ros_quality_t *quality,
                    fcsl_error_t *error)
{
    char name[2u * FCSL_BUS_KEY_MAX];
    char type[2u * FCSL_BUS_KEY_MAX];
    write_word(key, name, sizeof name);
    write_word(quality->type, type, sizeof type);
    const int size = snprintf(token, FCSL_BUS_TOKEN_MAX + 1u, "@/{zid}/@ros2_lv/%s/%s/%s/:%d:%d:0,%u:typehash=%s;",
                              quality->kind == ROS_PUBLISHER ? "MP" : "MS", name, type, quality->reliable,
                              quality->latched, quality->depth, quality->hash);
    return size <= (int)FCSL_BUS_TOKEN_MAX
               ? 0
               : fcsl_fail(error, "topic %.200s of type %.200s has too long names", key, quality->type);
}
