/* SPDX-License-Identifier: Apache-2.0
 *
 * Words of plans: the flat, checked texts that front ends in Python hand to native programs. One statement per line, words separated
 * by one space.
 */
#ifndef FCSL_PLAN_TEXT_H
#define FCSL_PLAN_TEXT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Turns line feeds into zeros; the last line may lack one. Returns null with the number of lines, or what is wrong with line *lines: a
 * control character, or more than `line_max` bytes. */
const char *fcsl_plan_cut_lines(char *text, size_t size, size_t line_max, uint32_t *lines);

/* Cuts a line into exactly `count` words. With `rest` the last one is the rest of the line. Returns null, or what is wrong. */
const char *fcsl_plan_split(char *line, char **words, uint32_t count, int rest);

/* Decimal without sign and leading zeros, at most `limit`: 0, or -1. */
int fcsl_plan_number(const char *word, uint64_t limit, uint64_t *value);
/* 16 hexadecimal digits in lower case: 0, or -1. */
int fcsl_plan_bits(const char *word, uint64_t *bits);
/* Letters, digits and underscores, no digit first, 64 at most. */
int fcsl_plan_is_name(const char *word);
/* Names joined by dots, 200 characters at most. */
int fcsl_plan_is_path(const char *word);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_PLAN_TEXT_H */
