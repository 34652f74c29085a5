/* SPDX-License-Identifier: Apache-2.0
 *
 * Parameter files: values of a machine's parameters in the form of a ROS 2 params.yaml (docs/reference/variables.md). Every host
 * reads and writes them through this file.
 */
#ifndef FCSL_PARAMETERS_H
#define FCSL_PARAMETERS_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of a parameter file. */
#define FCSL_PARAMETERS_BYTES_MAX (1u << 20)

/* The content of a parameter file. */
typedef struct {
    const char *text;
    size_t size;
    const char *name; /* what errors call it: its path; "" where a program has made it, and its lines mean nothing */
    const char *name_space; /* of the machine's node, "" for none: `/<name space>/<machine>` is what sections are for */
    int *used; /* null: a file without a section for this machine is refused; else set to 1 where it has one */
} fcsl_parameters_t;

/* Reads a file whole into memory that the caller frees; null with `error`. */
char *fcsl_parameters_read(const char *path, size_t *size, fcsl_error_t *error);

/* Takes the value of a parameter: a whole field, native. Returns 0, or -1 with `error`, which ends the reading. */
typedef int (*fcsl_parameter_take_t)(void *ctx, uint32_t field, const void *bytes, fcsl_error_t *error);

/* Calls `take` with each parameter of the machine that a section for it gives, checked, in the order of the text: of two values
 * the later one counts. Returns 0, or -1: an error begins with the file and the line. */
int fcsl_parameters_each(const fcsl_machine_t *machine, const fcsl_parameters_t *parameters, fcsl_parameter_take_t take,
                         void *ctx, fcsl_error_t *error);

/* Writes a parameter file: of every parameter of `data` (a struct of the machine) that differs from `compiled`, another one, its
 * value and unit. Returns its bytes, or -1 when `capacity` is too small. */
int64_t fcsl_parameters_write(const fcsl_machine_t *machine, const void *data, const void *compiled, char *text,
                              size_t capacity);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_PARAMETERS_H */
