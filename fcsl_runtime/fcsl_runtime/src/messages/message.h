/* SPDX-License-Identifier: Apache-2.0
 *
 * The generated message of an instance: its layout is worked out once from the message text (which is also the schema in
 * a bag, so the two cannot disagree), and written every tick by copying along that layout.
 */
#ifndef FCSL_MESSAGE_H
#define FCSL_MESSAGE_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"

/* No message may be larger. */
#define FCSL_MESSAGE_BYTES_MAX (1u << 20)

typedef struct {
    uint32_t source; /* offset in the machine struct */
    uint32_t target; /* offset in the message */
    uint32_t count;
    uint8_t type;    /* fcsl_type_t */
} fcsl_copy_t;

typedef struct {
    fcsl_copy_t *copies;
    uint32_t copy_count;
    uint32_t size; /* bytes of the message, encapsulation included */
} fcsl_layout_t;

/* Allocates the copies of `layout`; 0, or -1 when the text does not fit the instance's outputs. */
int fcsl_layout_build(const fcsl_machine_t *machine, const fcsl_instance_t *instance, fcsl_layout_t *layout,
                      fcsl_error_t *error);
/* An empty layout with room for `count` fields, and one field behind the others; 0, or -1 without memory, or room in a message. */
int fcsl_layout_open(fcsl_layout_t *layout, uint32_t count);
int fcsl_layout_append(fcsl_layout_t *layout, const fcsl_field_t *field);
/* The complete ros2msg text of an instance's interface; the caller frees it. Null without memory. */
char *fcsl_interface_schema(const fcsl_instance_t *instance);
/* Its topic below that of the machine: "att/rate" of instance "att.rate". The caller frees it. Null without memory. */
char *fcsl_interface_topic(const fcsl_instance_t *instance);

void fcsl_layout_free(fcsl_layout_t *layout);

/* The ROS 2 name of a field's type: "float64" or "float64[9]". */
void fcsl_ros_type(const fcsl_field_t *field, char *text, size_t size);

/* Puts into `cdr`, which has room for layout->size bytes, what all messages of a layout have in common. */
void fcsl_layout_begin(const fcsl_layout_t *layout, uint8_t *cdr);
/* Makes it the message of a tick; it may have been that of another one. */
void fcsl_layout_fill(const fcsl_layout_t *layout, const void *data, uint64_t tick, uint64_t time_ns, uint8_t *cdr);
/* Both. */
void fcsl_layout_write(const fcsl_layout_t *layout, const void *data, uint64_t tick, uint64_t time_ns, uint8_t *cdr);

#endif /* FCSL_MESSAGE_H */
