/* SPDX-License-Identifier: Apache-2.0
 *
 * Cuts packets into datagrams.
 */
#include "datagram.h"

#include <string.h>

#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_scalar.h"

enum {
    VERSION = 2,
    AT_VERSION = 4,
    AT_KIND = 5,
    AT_STRIDE = 6,
    AT_CRC = 8,
    AT_TOTAL = 12,
    AT_OFFSET = 16,
    AT_CONFIGURATION = 20,
    AT_SESSION = 24,
    AT_SEQUENCE = 32
};

size_t fcsl_datagram_write(const packet_t *packet, uint32_t offset, uint8_t datagram[DATAGRAM_BYTES])
{
    const uint32_t left = packet->total - offset;
    const size_t bytes = left < STRIDE_BYTES ? left : STRIDE_BYTES;
    memcpy(datagram, "FCST", 4);
    datagram[AT_VERSION] = VERSION;
    datagram[AT_KIND] = (uint8_t)packet->kind;
    fcsl_put_u16(datagram + AT_STRIDE, STRIDE_BYTES);
    fcsl_put_u32(datagram + AT_CRC, 0);
    fcsl_put_u32(datagram + AT_TOTAL, packet->total);
    fcsl_put_u32(datagram + AT_OFFSET, offset);
    fcsl_put_u32(datagram + AT_CONFIGURATION, packet->configuration);
    fcsl_put_u64(datagram + AT_SESSION, packet->session);
    fcsl_put_u64(datagram + AT_SEQUENCE, packet->sequence);
    memcpy(datagram + HEADER_BYTES, packet->body + offset, bytes);
    fcsl_put_u32(datagram + AT_CRC, fcsl_crc32(0, datagram, HEADER_BYTES + bytes));
    return HEADER_BYTES + bytes;
}
