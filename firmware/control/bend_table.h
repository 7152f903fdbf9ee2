/* The bend table: what the cross-section solver computed, as the firmware reads it.
 *
 * A .tbt image is a fixed little-endian header and float32 blocks (layout in bend_table_format.h). bend_table_open()
 * checks it once; afterwards a struct bend_table is a read-only view: it owns nothing, the image must outlive it.
 * Between nodes the table is a tensor-product cubic Hermite with three-point slopes: C1 in all three pressures.
 * Not here: solving for a bend (bend_inverse.h), writing tables (model/).
 *
 * Shapes: every float[3] is indexed by chamber, 0..2 for chambers 1..3. Units: Pa gauge, rad, m, 1/m. */
#ifndef TRIBEND_BEND_TABLE_H
#define TRIBEND_BEND_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BEND_TABLE_AXIS_NODES_MAX 32u
#define BEND_TABLE_NAME_BYTES 32u

enum bend_table_channel {
    BEND_TABLE_CURVATURE_X = 0, /* 1/m per reference length; bend = hypot(x, y) * active_length_m */
    BEND_TABLE_CURVATURE_Y,     /* 1/m; the vector (x, y) points where the tip moves (chamber 1 alone: -x) */
    BEND_TABLE_STRETCH,         /* of the line through the section's centre, 1 */
    BEND_TABLE_VOLUME_1,        /* deformed chamber volume per reference length, m2 */
    BEND_TABLE_VOLUME_2,
    BEND_TABLE_VOLUME_3,
    BEND_TABLE_VON_MISES,   /* mean through the wall at the apex of the most loaded chamber, Pa */
    BEND_TABLE_STRETCH_MAX, /* greatest principal stretch in the section, 1 */
    BEND_TABLE_WIDTH_MAX,   /* greatest outer width of the deformed section, m */
    BEND_TABLE_CHANNEL_COUNT
};

#define BEND_TABLE_PRESSURE_1 BEND_TABLE_VOLUME_1 /* in the ballooned table, Pa */

/* Tag of a node, bits. A cell is usable where all eight corners are valid. */
enum bend_table_tag {
    BEND_TABLE_TAG_VALID = 1u << 0,          /* equilibrium found, stable, inside the module's limits' margin */
    BEND_TABLE_TAG_STABLE = 1u << 1,         /* second variation positive at fixed pressures */
    BEND_TABLE_TAG_MIRRORED = 1u << 2,       /* copied by symmetry from a solved node */
    BEND_TABLE_TAG_EXTRAPOLATED = 1u << 3,   /* no equilibrium: filled so that slopes nearby stay defined */
    BEND_TABLE_TAG_BEYOND_STRAIN = 1u << 4,  /* stretch over the material's fitted range */
    BEND_TABLE_TAG_CONTACT = 1u << 5         /* chamber walls touch: the model does not hold */
};

enum bend_table_status {
    BEND_TABLE_OK = 0,
    BEND_TABLE_TOO_SHORT,
    BEND_TABLE_BAD_MAGIC,
    BEND_TABLE_BAD_VERSION,
    BEND_TABLE_BAD_SIZE,
    BEND_TABLE_BAD_CRC,
    BEND_TABLE_BAD_AXIS,
    BEND_TABLE_BAD_VALUE, /* a NaN or an infinity, or a geometry that makes no sense */
    BEND_TABLE_WRONG_MODULE,
    BEND_TABLE_MISALIGNED
};

/* Geometry and limits that the table carries for controller and plant.
 *
 * jump_up_pa: a module whose rubber softens has a greatest pressure of one chamber alone; there the chamber balloons at
 * once, and it falls back at jump_down_pa. The table's axes end before jump_up_pa; what lies beyond is in the ballooned
 * grid (bend_table_ballooned()). Control never goes there. */
struct bend_table_module {
    char name[BEND_TABLE_NAME_BYTES];
    uint64_t inputs_hash;
    float outer_diameter_m;
    float chamber_length_m;       /* undeformed */
    float active_length_m;        /* bend = curvature * active length: chamber length and its end correction */
    float cap_proximal_m;         /* straight rigid end caps */
    float cap_distal_m;
    float working_pressure_pa;    /* greatest commanded pressure of one chamber */
    float burst_pressure_pa;
    float bend_limit_rad;         /* greatest commanded bend */
    float jump_up_pa;             /* 0: no snap up to the end of the axes */
    float jump_down_pa;           /* 0: no second stable branch was found */
};

struct bend_table {
    struct bend_table_module module;
    uint32_t nodes[3];
    const float *axis_pa[3];  /* strictly rising, first 0 */
    bool axes_alike;          /* all three hold the same pressures, so that a cell found on one is found on all */
    const float *channel[BEND_TABLE_CHANNEL_COUNT]; /* [i3 + nodes[2] * (i2 + nodes[1] * i1)] */
    const uint8_t *tag;
    uint32_t grid_bytes;  /* axes, channels, tags and padding */
    const uint8_t *image; /* as a whole, to be checked again while running */
    uint32_t image_bytes;
    uint32_t image_crc;
    /* slope at node i of axis a = sum_k slope[a][i][k] * f[j + k], j = i - 1 kept within [0, nodes - 3] */
    float slope[3][BEND_TABLE_AXIS_NODES_MAX][3];
};

/* Weights of the four nodes round a point on each axis, for value and derivative. */
struct bend_table_stencil {
    uint32_t first[3];     /* index of the lowest of the four nodes used (clamped to the axis) */
    uint32_t cell[3];
    float weight[3][4];
    float derivative[3][4]; /* 1/Pa; zero where the pressure was clamped */
    bool clamped;           /* some pressure lay outside its axis */
};

/* Check `size` bytes at `image` (4-byte aligned) and bind `table` to them. `module_name` NULL accepts any module.
 * Anything but BEND_TABLE_OK leaves `table` unusable. */
enum bend_table_status bend_table_open(struct bend_table *table, const void *image, size_t size,
                                       const char *module_name);
/* The same but for what takes a look at every byte: neither the CRC nor single numbers are checked. For an image that is
 * checked a slice at a time. */
enum bend_table_status bend_table_bind(struct bend_table *table, const void *image, size_t size,
                                       const char *module_name);
/* Every number of a bound table's image within bytes [from, to), multiples of four, is finite. */
bool bend_table_is_finite(const struct bend_table *table, uint32_t from, uint32_t to);
/* The states of one chamber that has ballooned, both the unstable ones and those of the second stable branch, as a table
 * of its own: axis 1 is that chamber's volume (m2, first above 0) in place of its pressure, and BEND_TABLE_PRESSURE_1 its
 * pressure in place of its volume. For chamber 2 or 3, turn by one or two thirds and shift the pressures alike.
 * `table` is one that bend_table_open() accepted; false: it has no such states. */
bool bend_table_ballooned(const struct bend_table *table, struct bend_table *ballooned);
/* A sentence for people, never NULL. */
const char *bend_table_status_text(enum bend_table_status status);

/* Index of the node of axis `a` (0..2) at or below `pressure_pa`, kept so that there is a node above it. */
uint32_t bend_table_cell(const struct bend_table *table, size_t a, float pressure_pa);
/* All eight corners of the cell are valid. */
bool bend_table_cell_is_valid(const struct bend_table *table, const uint32_t cell[3]);
/* Axis `a` of the stencil alone, for a pressure within the axis that lies in `cell`. */
void bend_table_locate_in_cell(const struct bend_table *table, size_t a, uint32_t cell, float pressure_pa,
                               struct bend_table_stencil *stencil);
/* Where `pressure_pa` lies; a pressure outside its axis is clamped to it, NaN to the axis' start. */
void bend_table_locate(const struct bend_table *table, const float pressure_pa[3], struct bend_table_stencil *stencil);
float bend_table_value(const struct bend_table *table, const struct bend_table_stencil *stencil,
                       enum bend_table_channel channel);
/* Value, and its derivatives by the three pressures into `gradient` (channel unit per Pa). */
float bend_table_gradient(const struct bend_table *table, const struct bend_table_stencil *stencil,
                          enum bend_table_channel channel, float gradient[3]);
/* All eight corners of the cell are valid and no pressure was clamped. */
bool bend_table_is_valid(const struct bend_table *table, const struct bend_table_stencil *stencil);
/* Scales the pressures towards none until the table holds there (a fold or touching walls end its domain), to 1/1024 of
 * them; the table holds at no pressure. True: they were left as they are. */
bool bend_table_keep_valid(const struct bend_table *table, float pressure_pa[3]);

#endif
