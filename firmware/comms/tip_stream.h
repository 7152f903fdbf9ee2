/* The tip sensor's serial line: bytes in, poses out; and the reverse, for simulators.
 *
 * This is the one place that knows the wire format. A record is 9 words of 14 bits, two bytes a word, seven
 * bits a byte, low bits first, 115200 8N1; the first byte of a record alone has bit 7 set (phasing):
 *
 *     word      0 to 2        3 to 5                    6        7         8
 *     what      x, y, z       azimuth, elevation, roll  time     quality   status
 *     scale     914.4/8192 mm 180/8192 deg              1/8 ms   as it is  bits, 0: good
 *
 * Positions and angles are signed (two's complement): a step is 0.11 mm and 0.022 deg. Azimuth turns about z,
 * then elevation about the turned y, then roll about the turned x (z-y-x, as the makers of such sensors write
 * it). `time` is the sensor's clock when the pose was true, modulo 2.048 s: it takes out how unevenly records
 * arrive. The earliest of them are taken to be `age_us` old.
 *
 * A byte out of phase is skipped and counted, so that after garbage the second whole record at the latest is
 * understood. There is no checksum: whether a pose is plausible is the controller's to judge. */
#ifndef TRIBEND_TIP_STREAM_H
#define TRIBEND_TIP_STREAM_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

#define TIP_STREAM_RECORD_BYTES 18u
#define TIP_STREAM_QUEUE 4u
#define TIP_STREAM_AGE_US 10000 /* of the design page's sensor */

struct tip_stream_counters {
    uint32_t records;       /* understood */
    uint32_t bad_phasing;   /* bytes outside of a record */
    uint32_t short_records; /* that another one, or a pause, cut off */
    uint32_t out_of_range;  /* an elevation over 90 degrees, or a good pose of zeros: no sensor sends it */
    uint32_t overflow;      /* samples that nobody read in time: the oldest goes */
};

struct tip_stream {
    int64_t age_us;
    struct tip_stream_counters counters;
    uint8_t record[TIP_STREAM_RECORD_BYTES];
    uint32_t count; /* bytes of it; 0: waits for a first byte */
    int64_t started_us;
    bool clock_known;
    uint32_t clock;    /* of the last record */
    int64_t clock_us;  /* the same without wrapping */
    int64_t offset_us; /* from there to arrival, of the earliest */
    struct hal_tip_sample queue[TIP_STREAM_QUEUE];
    uint32_t first;
    uint32_t queued;
};

/* `age_us`: how old a pose is when the first byte of its record arrives, at the least. */
void tip_stream_init(struct tip_stream *stream, int64_t age_us);
void tip_stream_byte(struct tip_stream *stream, uint8_t byte, int64_t arrived_us);
/* The oldest sample that waits; false: none. What hal.h's read_tip wants. */
bool tip_stream_read(struct tip_stream *stream, struct hal_tip_sample *sample);
/* The record of a sample, saturated at 0.9144 m; quality and status are cut to 14 bits, time to steps of 1/8
 * ms. */
void tip_stream_encode(const struct hal_tip_sample *sample, uint8_t record[TIP_STREAM_RECORD_BYTES]);

#endif
