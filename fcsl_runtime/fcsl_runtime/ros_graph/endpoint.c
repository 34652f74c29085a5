/* SPDX-License-Identifier: Apache-2.0
 *
 * Keys and liveliness tokens as zenoh-plugin-ros2dds and rmw_zenoh read them.
 */
#define _POSIX_C_SOURCE 200809L
#include "endpoint.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"

enum { ROUTER_MS = 5000, DOMAIN_MAX = 232, DOMAIN_DIGITS = 3, WORD_BYTES = 2 * FCSL_BUS_KEY_MAX };

/* ---- a place in a graph --------------------------------------------------------------------------------------------- */

/* ROS_DOMAIN_ID: 0 where nothing says it. */
static int read_domain(unsigned *domain, fcsl_error_t *error)
{
    const char *text = getenv("ROS_DOMAIN_ID");
    if (text == NULL || text[0] == '\0') {
        *domain = 0;
        return 0;
    }
    const size_t length = strnlen(text, DOMAIN_DIGITS + 1u);
    if (length > DOMAIN_DIGITS || strspn(text, "0123456789") != length || strtoul(text, NULL, 10) > DOMAIN_MAX) {
        return fcsl_fail(error, "ROS_DOMAIN_ID is '%.40s'; it is a number from 0 to %d", text, DOMAIN_MAX);
    }
    *domain = (unsigned)strtoul(text, NULL, 10);
    return 0;
}

int ros_place_read(ros_place_t *place, const char *address, const char *name_space, const char *node,
                   fcsl_error_t *error)
{
    static const char RMW_ZENOH[] = "rmw_zenoh:";
    const size_t prefix = sizeof RMW_ZENOH - 1u;
    *place = (ros_place_t){.middleware = ROS_BY_BRIDGE,
                           .role = FCSL_BUS_LISTEN,
                           .address = address,
                           .name_space = name_space,
                           .node = node};
    if (strncmp(address, RMW_ZENOH, prefix) != 0) {
        return 0;
    }
    place->middleware = ROS_BY_RMW_ZENOH;
    place->role = FCSL_BUS_CLIENT;
    place->address = address + prefix;
    return read_domain(&place->domain, error);
}

/* ---- names ---------------------------------------------------------------------------------------------------------- */

/* The namespace without slashes around it, in `length` bytes from the result on. */
static const char *bare(const char *name_space, size_t *length)
{
    name_space += strspn(name_space, "/");
    *length = strlen(name_space);
    while (*length > 0 && name_space[*length - 1] == '/') {
        (*length)--;
    }
    return name_space;
}

/* The topic's full name without its leading slash. */
static int write_name(char name[FCSL_BUS_KEY_MAX + 1], const ros_place_t *place, const char *machine, const char *topic,
                      fcsl_error_t *error)
{
    const int is_absolute = topic[0] == '/';
    size_t length = 0;
    const char *name_space = bare(place->name_space, &length);
    length = is_absolute ? 0u : length;
    const int size =
        snprintf(name, FCSL_BUS_KEY_MAX + 1u, "%.*s%s%s%s%s", (int)length, name_space, length > 0 ? "/" : "",
                 machine != NULL ? machine : "", machine != NULL ? "/" : "", topic + is_absolute);
    return size <= (int)FCSL_BUS_KEY_MAX ? 0
                                         : fcsl_fail(error, "topic '%.100s' in namespace '%.100s': more than %u bytes",
                                                     topic, name_space, FCSL_BUS_KEY_MAX);
}

/* A name as one word of a key: `slash` stands for each slash. */
static void write_word(const char *name, size_t length, const char *slash, char word[WORD_BYTES])
{
    const size_t width = strlen(slash);
    size_t at = 0;
    for (size_t i = 0; i < length && at + width < WORD_BYTES; i++) {
        if (name[i] == '/') {
            memcpy(word + at, slash, width);
            at += width;
        } else {
            word[at++] = name[i];
        }
    }
    word[at] = '\0';
}

/* "pkg::msg::dds_::Name_", as DDS calls a type "pkg/msg/Name". */
static int write_dds_type(const char *type, char word[WORD_BYTES], fcsl_error_t *error)
{
    const char *name = strrchr(type, '/');
    char folders[WORD_BYTES];
    if (name == NULL) {
        return fcsl_fail(error, "'%.100s' is no type of a message", type);
    }
    write_word(type, (size_t)(name - type), "::", folders);
    const int size = snprintf(word, WORD_BYTES, "%s::dds_::%s_", folders, name + 1);
    return size < WORD_BYTES ? 0 : fcsl_fail(error, "type '%.100s' has too long a name", type);
}

/* ---- zenoh-plugin-ros2dds ------------------------------------------------------------------------------------------- */

/* The key is the name. In the token: reliable (1) or best effort (0), volatile (0) or transient local (1), keep last (0) with a
 * depth, and what DDS has as the data of the user: the type's hash. */
static int write_for_bridge(ros_endpoint_t *endpoint, const char *name, const ros_quality_t *quality)
{
    static const char SLASH[] = "\xc2\xa7";
    char topic[WORD_BYTES];
    char type[WORD_BYTES];
    write_word(name, strlen(name), SLASH, topic);
    write_word(quality->type, strlen(quality->type), SLASH, type);
    (void)snprintf(endpoint->key, sizeof endpoint->key, "%s", name);
    if (quality->kind == ROS_SERVICE) {
        return snprintf(endpoint->token, sizeof endpoint->token, "@/{zid}/@ros2_lv/SS/%s/%s", topic, type);
    }
    return snprintf(endpoint->token, sizeof endpoint->token, "@/{zid}/@ros2_lv/%s/%s/%s/:%d:%d:0,%u:typehash=%s;",
                    quality->kind == ROS_PUBLISHER ? "MP" : "MS", topic, type, quality->reliable, quality->latched,
                    quality->depth, quality->hash);
}

/* ---- rmw_zenoh ------------------------------------------------------------------------------------------------------ */

/* What all tokens of a node have: domain, session, node 0, number, kind, no enclave, namespace, name. */
static int write_head(ros_token_t token, const ros_place_t *place, uint32_t number, const char *kind)
{
    char name_space[WORD_BYTES];
    size_t length = 0;
    const char *inside = bare(place->name_space, &length);
    write_word(inside, length, "%", name_space);
    return snprintf(token, FCSL_BUS_TOKEN_MAX + 1u, "@ros2_lv/%u/{zid}/0/%u/%s/%%/%%%s/%s", place->domain, number, kind,
                    name_space, place->node);
}

/* The quality of service: reliable (nothing: the default) or best effort (2), transient local (1) or volatile (2; the default differed
 * between versions), keep last with a depth, and no deadline, lifespan or lease. */
static int write_for_rmw_zenoh(ros_endpoint_t *endpoint, const ros_place_t *place, const char *name,
                               const ros_quality_t *quality, uint32_t number, fcsl_error_t *error)
{
    char topic[WORD_BYTES];
    char type[WORD_BYTES];
    if (write_dds_type(quality->type, type, error) != 0) {
        return -1;
    }
    write_word(name, strlen(name), "%", topic);
    const int size =
        snprintf(endpoint->key, sizeof endpoint->key, "%u/%s/%s/%s", place->domain, name, type, quality->hash);
    if (size >= (int)sizeof endpoint->key) {
        return fcsl_fail(error, "topic '%.100s' of type %.100s: its key has more than %u bytes", name, quality->type,
                         FCSL_BUS_KEY_MAX);
    }
    static const char *const KINDS[] = {[ROS_PUBLISHER] = "MP", [ROS_SUBSCRIPTION] = "MS", [ROS_SERVICE] = "SS"};
    const int head = write_head(endpoint->token, place, number + 1u, KINDS[quality->kind]);
    if (head < 0 || head >= (int)sizeof endpoint->token) {
        return head;
    }
    return head + snprintf(endpoint->token + head, sizeof endpoint->token - (size_t)head,
                           "/%%%s/%s/%s/%s:%s:,%u:,:,:,,", topic, type, quality->hash, quality->reliable ? "" : "2",
                           quality->latched ? "1" : "2", quality->depth);
}

/* --------------------------------------------------------------------------------------------------------------------- */

int ros_endpoint_write(ros_endpoint_t *endpoint, const ros_place_t *place, const char *machine, const char *name,
                       const ros_quality_t *quality, uint32_t number, fcsl_error_t *error)
{
    char full[FCSL_BUS_KEY_MAX + 1];
    if (write_name(full, place, machine, name, error) != 0) {
        return -1;
    }
    const int size = place->middleware == ROS_BY_BRIDGE
                         ? write_for_bridge(endpoint, full, quality)
                         : write_for_rmw_zenoh(endpoint, place, full, quality, number, error);
    if (size >= (int)sizeof endpoint->token) {
        return fcsl_fail(error, "topic %.200s of type %.200s has too long names", full, quality->type);
    }
    return size < 0 ? -1 : 0;
}

int ros_session_open(const ros_place_t *place, const fcsl_bus_options_t *options, const char **tokens,
                     uint32_t token_count, fcsl_bus_t **bus, fcsl_error_t *error)
{
    fcsl_error_t reason;
    ros_token_t node;
    fcsl_bus_options_t placed = *options;
    placed.role = place->role;
    placed.endpoint = place->address;
    placed.tokens = tokens;
    placed.token_count = token_count;
    if (place->middleware == ROS_BY_BRIDGE) {
        return fcsl_bus_open(&placed, bus, error);
    }
    const int size = write_head(node, place, 0, "NN");
    if (size < 0 || size > (int)FCSL_BUS_TOKEN_MAX) {
        return fcsl_fail(error, "node %.200s has too long a name", place->node);
    }
    tokens[token_count] = node;
    placed.token_count = token_count + 1u;
    placed.timeout_ms = ROUTER_MS;
    placed.attaches = 1;
    return fcsl_bus_open(&placed, bus, &reason) == 0
               ? 0
               : fcsl_fail(error, "%s; `ros2 run rmw_zenoh_cpp rmw_zenohd` starts the router", reason.text);
}
