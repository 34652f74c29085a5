/* SPDX-License-Identifier: Apache-2.0
 *
 * The topics of a record that show every tick, as messages of named fields. The outputs of an instance have a generated
 * interface. This file makes one for the other fields, and for a part of the outputs: topic and field name are the path.
 *
 *   nav.outputs.pos         topic nav             field pos
 *   nav.inputs.gyro         topic nav/inputs      field gyro
 *   nav.state.filter.p      topic nav/state       field filter.p
 *   channels.imu.gyro.valid topic record/channels field imu.gyro.valid
 */
#ifndef FCSL_RECORD_TOPICS_H
#define FCSL_RECORD_TOPICS_H

#include "messages/message.h"

typedef struct {
    char *topic; /* behind /<namespace>/<machine>/ */
    char *type;
    char *schema; /* complete ros2msg text */
    fcsl_layout_t layout;
    uint8_t *message; /* of the last tick that was written: the next one changes stamp and values */
} fcsl_record_topic_t;

/* Makes the messages of the fields that `globs` choose (see fcsl_record_options_t): *count of them at *shown. 0, or -1 when
 * a glob matches nothing, or only some elements of an array of structs are chosen. Freed by fcsl_record_topics_free in either case. */
int fcsl_record_topics_build(const fcsl_machine_t *machine, const char *globs, fcsl_record_topic_t **shown,
                             uint32_t *count, fcsl_error_t *error);
void fcsl_record_topics_free(fcsl_record_topic_t *shown, uint32_t count);

#endif /* FCSL_RECORD_TOPICS_H */
