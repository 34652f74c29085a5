/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars, lists and white space, for the reader of mappings.
 */
#ifndef FCSL_YAML_ITEMS_H
#define FCSL_YAML_ITEMS_H

#include "yaml.h"

/* The byte at the cursor, or -1 at the end. */
int yaml_peek(const yaml_cursor_t *cursor);
int yaml_is_blank(int byte);
/* Whether a line ends with this byte, or the text. */
int yaml_is_break(int byte);
/* To the end of the line. */
void yaml_skip_comment(yaml_cursor_t *cursor);
/* Blanks, ends of lines and comments. */
void yaml_skip_space(yaml_cursor_t *cursor);
/* Reads a scalar; in a flow mapping or list it ends at `,[]{}`, too. Of a word the end is not passed. 0, or -1 with `error`. */
int yaml_scalar(yaml_cursor_t *cursor, int in_flow, yaml_item_t *item, fcsl_error_t *error);
/* From `[` to behind its `]`; `depth`: of what it lies in. 0, or -1 with `error`. */
int yaml_skip_list(yaml_cursor_t *cursor, uint32_t depth, fcsl_error_t *error);

#endif /* FCSL_YAML_ITEMS_H */
