/* SPDX-License-Identifier: Apache-2.0
 *
 * A damaged frame may hide the beginning of a good one: only its first byte is dropped.
 *
 * `//@ split` and `//@ loop unroll`, here and in the protocols, are for scripts/verify/receivers: the first analyses each value
 * by itself until `//@ merge`, the second follows each turn of a loop.
 */
#include "byte_stream.h"

#include <string.h>

static void drop(byte_stream_t *stream, uint32_t count)
{
    if (count >= stream->size) {
        stream->size = 0;
        return;
    }
    stream->size -= count;
    memmove(stream->bytes, stream->bytes + count, stream->size);
}

uint32_t byte_stream_take(byte_stream_t *stream, uint8_t byte, byte_stream_judge_t judge)
{
    //@ split stream->taken;
    drop(stream, stream->taken);
    stream->taken = 0;
    //@ merge stream->taken;
    if (stream->size == BYTE_STREAM_MAX) { /* a judge that waits for more than there is room for */
        byte_stream_break(stream);
    }
    stream->bytes[stream->size++] = byte;
    //@ loop unroll BYTE_STREAM_MAX;
    while (stream->size > 0u) { /* every turn drops a byte, or ends */
        const int32_t length = judge(stream->bytes, stream->size);
        //@ split length > 0;
        if (length > 0 && (uint32_t)length <= stream->size) {
            stream->taken = (uint32_t)length;
            stream->frames++;
            return stream->taken;
        }
        if (length >= 0) {
            return 0;
        }
        byte_stream_note(stream, (uint32_t)-(int64_t)length);
        drop(stream, 1);
        stream->garbage++;
    }
    return 0;
}

void byte_stream_break(byte_stream_t *stream)
{
    stream->garbage += stream->size - stream->taken;
    stream->size = 0;
    stream->taken = 0;
}

void byte_stream_note(byte_stream_t *stream, uint32_t why)
{
    stream->why = why > stream->why ? why : stream->why;
}

void byte_stream_report(byte_stream_t *stream, fcsl_driver_input_t *input)
{
    input->frames += (uint32_t)stream->frames;
    input->rejected += (uint32_t)stream->garbage;
    input->why = stream->why > input->why ? stream->why : input->why;
    stream->frames = 0;
    stream->garbage = 0;
    stream->why = FCSL_DRIVER_NOT_TOLD;
}
