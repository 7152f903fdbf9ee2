/* Byte layout of a .tbt image, shared by the reader (bend_table.c) and the writer (model/). Little-endian throughout.
 *
 *   offset  bytes  what
 *        0      4  magic "TBND"
 *        4      2  version, 2
 *        6      2  header bytes, 288
 *        8      4  image bytes, header included
 *       12      4  CRC-32 of every byte from offset 16 to the end
 *       16     32  module name, NUL padded
 *       48      8  hash of the inputs (FNV-1a 64 of module, material and solver settings)
 *       56     12  nodes on each of the three pressure axes, uint32
 *       68      4  number of channels, uint32, BEND_TABLE_CHANNEL_COUNT
 *       72     32  float32: outer_diameter_m, chamber_length_m, active_length_m, cap_proximal_m, cap_distal_m,
 *                  working_pressure_pa, burst_pressure_pa, bend_limit_rad
 *      104    152  channel names and units, text: "curvature_x 1/m\n..." NUL padded
 *      256     12  nodes of the ballooned grid on its three axes, uint32; zeros: there is none
 *      268      8  float32: jump_up_pa, jump_down_pa
 *      276     12  zeros
 *      288         the grid: axis 1, axis 2, axis 3 (float32, Pa), channels in the order of enum bend_table_channel
 *                  (float32, chamber 3 fastest), then a tag byte a node, then zeros to a multiple of four
 *                  the ballooned grid, the same way: chamber 1's volume (m2) takes the place of its pressure as axis 1,
 *                  and its pressure (Pa) that of its volume as channel */
#ifndef TRIBEND_BEND_TABLE_FORMAT_H
#define TRIBEND_BEND_TABLE_FORMAT_H

#define BEND_TABLE_MAGIC "TBND"
#define BEND_TABLE_VERSION 2u
#define BEND_TABLE_HEADER_BYTES 288u
#define BEND_TABLE_OFFSET_VERSION 4u
#define BEND_TABLE_OFFSET_HEADER_BYTES 6u
#define BEND_TABLE_OFFSET_IMAGE_BYTES 8u
#define BEND_TABLE_OFFSET_CRC 12u
#define BEND_TABLE_OFFSET_NAME 16u
#define BEND_TABLE_OFFSET_HASH 48u
#define BEND_TABLE_OFFSET_NODES 56u
#define BEND_TABLE_OFFSET_CHANNELS 68u
#define BEND_TABLE_OFFSET_GEOMETRY 72u
#define BEND_TABLE_OFFSET_CHANNEL_TEXT 104u
#define BEND_TABLE_CHANNEL_TEXT_BYTES 152u
#define BEND_TABLE_OFFSET_BALLOONED 256u
#define BEND_TABLE_OFFSET_JUMPS 268u
/* What BEND_TABLE_OFFSET_CHANNEL_TEXT holds: one line a channel, in the order of enum bend_table_channel. */
#define BEND_TABLE_CHANNEL_TEXT                                                                                    \
    "curvature_x 1/m\ncurvature_y 1/m\nstretch 1\nvolume_1 m2\nvolume_2 m2\nvolume_3 m2\n"                          \
    "von_mises_apex Pa\nstretch_max 1\nwidth_max m\n"

#endif
