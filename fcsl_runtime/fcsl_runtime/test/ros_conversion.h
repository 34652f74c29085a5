/* SPDX-License-Identifier: Apache-2.0
 *
 * A message of everything that a walk meets, and the conversion that reads it; for the test and for the fuzzer.
 */
#ifndef ROS_CONVERSION_H
#define ROS_CONVERSION_H

#include <string.h>

#include "fcsl/fcsl_cdr.h"
#include "fcsl/fcsl_ros.h"

enum { MESSAGE_MAX = 600, VALUES = 3 };

/* The message:
 *   Header header; string[] name; float64[] position; Pair[] pairs; bool armed; uint16 mode; float64[3] v
 *   Pair: string label; Item[] items      Item: uint8 kind; float64 value
 * Its picks: position[<left>] (value 0), v (1), armed and mode (2). The first pair is spelled out. */
static const fcsl_ros_part_t PARTS[] = {
    {FCSL_ROS_BLOCK, 8, 8, 0, 0},
    {FCSL_ROS_STRING, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_NAMES, 0, 0, 0, 1},
    {FCSL_ROS_SEQUENCE, 8, 8, 0, 1},
    {FCSL_ROS_COUNT, 0, 0, FCSL_ROS_NONE, 1},
    {FCSL_ROS_STRING, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_COUNT, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_REPEAT, 0, 0, 10, 0}, /* 7 */
    {FCSL_ROS_BLOCK, 1, 1, FCSL_ROS_NONE, 0},
    {FCSL_ROS_BLOCK, 8, 8, FCSL_ROS_NONE, 0},
    {FCSL_ROS_END, 0, 0, 7, 0},
    {FCSL_ROS_REPEAT, 0, 0, 18, 0}, /* 11 */
    {FCSL_ROS_STRING, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_COUNT, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_REPEAT, 0, 0, 17, 0}, /* 14 */
    {FCSL_ROS_BLOCK, 1, 1, FCSL_ROS_NONE, 0},
    {FCSL_ROS_BLOCK, 8, 8, FCSL_ROS_NONE, 0},
    {FCSL_ROS_END, 0, 0, 14, 0},
    {FCSL_ROS_END, 0, 0, 11, 0},
    {FCSL_ROS_BLOCK, 2, 4, 2, 0},
    {FCSL_ROS_BLOCK, 8, 24, 3, 0},
};
static const fcsl_ros_pick_t PICKS[] = {{1, 0, 0, 0}};
static const char *const NAMES[] = {"left"};
static const fcsl_ros_term_t TERMS[] = {
    {1.0, 1, 0, FCSL_ROS_F64},  {1.0, 3, 0, FCSL_ROS_F64}, {-1.0, 3, 8, FCSL_ROS_F64},
    {1.0, 2, 0, FCSL_ROS_BOOL}, {1.0, 2, 2, FCSL_ROS_U16},
};
static const fcsl_ros_row_t ROWS[] = {
    {0, 1, 0, FCSL_ROS_F64, 0, 0.0, 0.0, 0},  {1, 1, 8, FCSL_ROS_F64, 0, 0.0, 0.0, 0},
    {2, 1, 16, FCSL_ROS_F64, 0, 0.0, 0.0, 1}, {3, 1, 32, FCSL_ROS_BOOL, 0, 0.0, 0.0, 0},
    {4, 1, 36, FCSL_ROS_I32, 1, 0.5, 1.0, 0},
};
static const fcsl_ros_value_t ROW_VALUES[VALUES] = {
    {0, 8, 0, 1, 0, 0, 0, 0, 0, 0}, {8, 24, 1, 2, 0, 0, 0, 0, 0, 0}, {32, 8, 3, 2, 0, 0, 0, 0, 0, 0}};

#define COUNT_OF(table) ((uint32_t)(sizeof(table) / sizeof(table)[0]))
static const fcsl_ros_reader_plan_t CONVERSION = {
    .parts = PARTS,
    .picks = PICKS,
    .names = NAMES,
    .values = ROW_VALUES,
    .rows = ROWS,
    .terms = TERMS,
    .part_count = COUNT_OF(PARTS),
    .pick_count = COUNT_OF(PICKS),
    .name_count = COUNT_OF(NAMES),
    .value_count = VALUES,
    .row_count = COUNT_OF(ROWS),
    .term_count = COUNT_OF(TERMS),
    .anchor_count = 4,
    .size = 40,
    .stamp_anchor = 0,
};

/* Of the same message by what else there is: the frame among two (value 3), position of up to four (0) and its length (1), the
 * number of items of pairs[label=abcd] (2), the mode among two numbers (4). */
enum { SEARCH_VALUES = 5 };
static const fcsl_ros_part_t SEARCH_PARTS[] = {
    {FCSL_ROS_BLOCK, 8, 8, 0, 0},
    {FCSL_ROS_CHOICE, 0, 1, 0, 2},
    {FCSL_ROS_NAMES, 0, 0, 0, 0},
    {FCSL_ROS_SEQUENCE, 8, 8, 0, 2},
    {FCSL_ROS_FIND, 0, 4, 11, 1}, /* 4 */
    {FCSL_ROS_KEY, 0, 0, 2, 0},
    {FCSL_ROS_COUNT, 0, 0, 4, 0},
    {FCSL_ROS_REPEAT, 0, 0, 10, 0}, /* 7 */
    {FCSL_ROS_BLOCK, 1, 1, FCSL_ROS_NONE, 0},
    {FCSL_ROS_BLOCK, 8, 8, FCSL_ROS_NONE, 0},
    {FCSL_ROS_END, 0, 0, 7, 0},
    {FCSL_ROS_FOUND, 0, 0, 4, 0},
    {FCSL_ROS_COUNT, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_REPEAT, 0, 0, 20, 0}, /* 13 */
    {FCSL_ROS_STRING, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_COUNT, 0, 0, FCSL_ROS_NONE, 0},
    {FCSL_ROS_REPEAT, 0, 0, 19, 0}, /* 16 */
    {FCSL_ROS_BLOCK, 1, 1, FCSL_ROS_NONE, 0},
    {FCSL_ROS_BLOCK, 8, 8, FCSL_ROS_NONE, 0},
    {FCSL_ROS_END, 0, 0, 16, 0},
    {FCSL_ROS_END, 0, 0, 13, 0},
    {FCSL_ROS_BLOCK, 2, 4, 5, 0},
    {FCSL_ROS_BLOCK, 8, 24, FCSL_ROS_NONE, 0},
};
static const fcsl_ros_pick_t SEARCH_PICKS[] = {{2, 4, 1, FCSL_ROS_NONE}, {3, 0, FCSL_ROS_NONE, FCSL_ROS_NONE}};
static const char *const SEARCH_NAMES[] = {"map", "base", "abcd"};
static const int64_t SEARCH_CHOICES[] = {9, 6};
static const fcsl_ros_term_t SEARCH_TERMS[] = {
    {1.0, 2, 0, FCSL_ROS_F64}, {1.0, 3, 0, FCSL_ROS_U32}, {1.0, 4, 0, FCSL_ROS_U32},
    {1.0, 1, 0, FCSL_ROS_U32}, {1.0, 5, 2, FCSL_ROS_U16},
};
static const fcsl_ros_row_t SEARCH_ROWS[] = {
    {0, 1, 0, FCSL_ROS_F64, 0, 0.0, 0.0, 3},  {1, 1, 32, FCSL_ROS_U32, 0, 0.0, 0.0, 0},
    {2, 1, 36, FCSL_ROS_U32, 0, 0.0, 0.0, 0}, {3, 1, 40, FCSL_ROS_U32, 0, 0.0, 0.0, 0},
    {4, 1, 44, FCSL_ROS_I32, 0, 0.0, 0.0, 0},
};
static const fcsl_ros_value_t SEARCH_ROW_VALUES[SEARCH_VALUES] = {{0, 32, 0, 1, 0, 0, 0, 1, 0, 0},
                                                                  {32, 4, 1, 1, 0, 0, 0, 0, 0, 0},
                                                                  {36, 4, 2, 1, 0, 0, 0, 0, 0, 0},
                                                                  {40, 4, 3, 1, 0, 0, 0, 0, FCSL_ROS_NONE, 2},
                                                                  {44, 4, 4, 1, 0, 0, 0, 0, 0, 2}};
static const fcsl_ros_reader_plan_t SEARCH = {
    .parts = SEARCH_PARTS,
    .picks = SEARCH_PICKS,
    .names = SEARCH_NAMES,
    .values = SEARCH_ROW_VALUES,
    .rows = SEARCH_ROWS,
    .terms = SEARCH_TERMS,
    .choices = SEARCH_CHOICES,
    .part_count = COUNT_OF(SEARCH_PARTS),
    .pick_count = COUNT_OF(SEARCH_PICKS),
    .name_count = COUNT_OF(SEARCH_NAMES),
    .value_count = SEARCH_VALUES,
    .row_count = COUNT_OF(SEARCH_ROWS),
    .term_count = COUNT_OF(SEARCH_TERMS),
    .choice_count = COUNT_OF(SEARCH_CHOICES),
    .anchor_count = 6,
    .size = 48,
    .stamp_anchor = 0,
};

static void put_double(fcsl_cdr_t *cdr, double value)
{
    uint64_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    fcsl_cdr_u64(cdr, bits);
}

static void put_pair(fcsl_cdr_t *cdr, const char *label, uint32_t items)
{
    fcsl_cdr_string(cdr, label);
    fcsl_cdr_u32(cdr, items);
    for (uint32_t i = 0; i < items; i++) {
        fcsl_cdr_u8(cdr, (uint8_t)i);
        put_double(cdr, 0.25 * i);
    }
}

static size_t armed_at; /* in the message; its mode is two bytes further */

static size_t make_message(uint8_t *bytes)
{
    fcsl_cdr_t cdr;
    fcsl_cdr_begin(&cdr, bytes, MESSAGE_MAX);
    fcsl_cdr_u32(&cdr, 12);
    fcsl_cdr_u32(&cdr, 34);
    fcsl_cdr_string(&cdr, "base");
    fcsl_cdr_u32(&cdr, 3);
    fcsl_cdr_string(&cdr, "right");
    fcsl_cdr_string(&cdr, "left");
    fcsl_cdr_string(&cdr, "left");
    fcsl_cdr_u32(&cdr, 3);
    for (uint32_t i = 0; i < 3; i++) {
        put_double(&cdr, 10.0 + i);
    }
    fcsl_cdr_u32(&cdr, 3);
    put_pair(&cdr, "", 1);
    put_pair(&cdr, "abc", 0);
    put_pair(&cdr, "abcd", 2);
    fcsl_cdr_align(&cdr, 2);
    armed_at = cdr.at;
    fcsl_cdr_u8(&cdr, 1);
    fcsl_cdr_align(&cdr, 2);
    fcsl_cdr_u8(&cdr, 6);
    fcsl_cdr_u8(&cdr, 0);
    put_double(&cdr, 1.5);
    put_double(&cdr, 2.5);
    put_double(&cdr, -0.0);
    return fcsl_cdr_end(&cdr);
}

#endif /* ROS_CONVERSION_H */
