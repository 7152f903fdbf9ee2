#include "control/bend_table.h"

#include <string.h>

#include "control/bend_table_format.h"
#include "control/crc32.h"

#define AXIS_NODES_LEAST 4u
#define STENCIL 4u

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the image is read in place, in little-endian byte order");

/* --- opening --- */

static uint32_t read_u32(const uint8_t *image, size_t offset) {
    uint32_t value = 0;
    (void)memcpy(&value, image + offset, sizeof value);
    return value;
}

static uint16_t read_u16(const uint8_t *image, size_t offset) {
    uint16_t value = 0;
    (void)memcpy(&value, image + offset, sizeof value);
    return value;
}

static bool is_finite(float value) {
    return value - value == 0.0f;
}

/* All of the header but the CRC. */
static enum bend_table_status check_frame(const uint8_t *image, size_t size) {
    if (size < BEND_TABLE_HEADER_BYTES) {
        return BEND_TABLE_TOO_SHORT;
    }
    if (memcmp(image, BEND_TABLE_MAGIC, 4) != 0) {
        return BEND_TABLE_BAD_MAGIC;
    }
    if (read_u16(image, BEND_TABLE_OFFSET_VERSION) != BEND_TABLE_VERSION) {
        return BEND_TABLE_BAD_VERSION;
    }
    const uint32_t image_bytes = read_u32(image, BEND_TABLE_OFFSET_IMAGE_BYTES);
    if (size < image_bytes) {
        return BEND_TABLE_TOO_SHORT;
    }
    if (size > image_bytes || read_u16(image, BEND_TABLE_OFFSET_HEADER_BYTES) != BEND_TABLE_HEADER_BYTES) {
        return BEND_TABLE_BAD_SIZE;
    }
    return BEND_TABLE_OK;
}

static bool crc_holds(const uint8_t *image, size_t size) {
    const size_t covered = BEND_TABLE_OFFSET_CRC + 4u;
    return crc32_update(0u, image + covered, size - covered) == read_u32(image, BEND_TABLE_OFFSET_CRC);
}

/* Nodes and bytes of the grid whose node counts stand at `offset`. */
static enum bend_table_status measure_grid(struct bend_table *table, const uint8_t *image, size_t offset) {
    size_t nodes = 1, axis_nodes = 0;
    for (size_t a = 0; a < 3; a++) {
        table->nodes[a] = read_u32(image, offset + 4u * a);
        if (table->nodes[a] < AXIS_NODES_LEAST || table->nodes[a] > BEND_TABLE_AXIS_NODES_MAX) {
            return BEND_TABLE_BAD_AXIS;
        }
        nodes *= table->nodes[a];
        axis_nodes += table->nodes[a];
    }
    const size_t used = sizeof(float) * (axis_nodes + BEND_TABLE_CHANNEL_COUNT * nodes) + nodes;
    table->grid_bytes = (uint32_t)((used + 3u) / 4u * 4u);
    return BEND_TABLE_OK;
}

static void bind_grid(struct bend_table *table, const uint8_t *grid) {
    const size_t nodes = (size_t)table->nodes[0] * table->nodes[1] * table->nodes[2];
    const float *next = (const float *)(const void *)grid;
    for (size_t a = 0; a < 3; a++) {
        table->axis_pa[a] = next;
        next += table->nodes[a];
    }
    for (size_t c = 0; c < BEND_TABLE_CHANNEL_COUNT; c++) {
        table->channel[c] = next;
        next += nodes;
    }
    table->tag = (const uint8_t *)(const void *)next;
}

static enum bend_table_status read_module(struct bend_table *table, const uint8_t *image) {
    struct bend_table_module *module = &table->module;
    float geometry[8], jumps[2];
    (void)memcpy(module->name, image + BEND_TABLE_OFFSET_NAME, BEND_TABLE_NAME_BYTES);
    (void)memcpy(&module->inputs_hash, image + BEND_TABLE_OFFSET_HASH, sizeof module->inputs_hash);
    (void)memcpy(geometry, image + BEND_TABLE_OFFSET_GEOMETRY, sizeof geometry);
    (void)memcpy(jumps, image + BEND_TABLE_OFFSET_JUMPS, sizeof jumps);
    module->outer_diameter_m = geometry[0];
    module->chamber_length_m = geometry[1];
    module->active_length_m = geometry[2];
    module->cap_proximal_m = geometry[3];
    module->cap_distal_m = geometry[4];
    module->working_pressure_pa = geometry[5];
    module->burst_pressure_pa = geometry[6];
    module->bend_limit_rad = geometry[7];
    module->jump_up_pa = jumps[0];
    module->jump_down_pa = jumps[1];
    bool sound = is_finite(jumps[0]) && jumps[1] >= 0.0f && jumps[1] <= jumps[0] &&
                 module->name[BEND_TABLE_NAME_BYTES - 1u] == '\0';
    for (size_t i = 0; i < 8; i++) {
        const bool may_be_zero = i == 3 || i == 4;
        sound = sound && is_finite(geometry[i]) && (geometry[i] > 0.0f || (may_be_zero && geometry[i] == 0.0f));
    }
    sound = sound && module->burst_pressure_pa > module->working_pressure_pa;
    return sound ? BEND_TABLE_OK : BEND_TABLE_BAD_VALUE;
}

/* Three-point difference weights on an uneven axis (Fornberg 1988), the nearest three nodes at the ends. */
static enum bend_table_status weigh_slopes(struct bend_table *table, size_t a) {
    const float *x = table->axis_pa[a];
    const size_t n = table->nodes[a];
    if (!is_finite(x[0])) {
        return BEND_TABLE_BAD_AXIS;
    }
    for (size_t i = 0; i + 1 < n; i++) {
        if (!is_finite(x[i + 1]) || !(x[i + 1] > x[i])) {
            return BEND_TABLE_BAD_AXIS;
        }
    }
    for (size_t i = 0; i < n; i++) {
        const size_t j = i == 0 ? 0 : (i - 1 > n - 3 ? n - 3 : i - 1);
        for (size_t k = 0; k < 3; k++) {
            const float own = x[j + k], one = x[j + (k + 1) % 3], two = x[j + (k + 2) % 3];
            table->slope[a][i][k] = ((x[i] - one) + (x[i] - two)) / ((own - one) * (own - two));
        }
    }
    return BEND_TABLE_OK;
}

static enum bend_table_status bind_axes(struct bend_table *table, bool volume_first) {
    enum bend_table_status status = BEND_TABLE_OK;
    for (size_t a = 0; a < 3 && status == BEND_TABLE_OK; a++) {
        const bool is_volume = volume_first && a == 0;
        if (is_volume ? !(table->axis_pa[a][0] > 0.0f) : table->axis_pa[a][0] != 0.0f) {
            return BEND_TABLE_BAD_AXIS;
        }
        status = weigh_slopes(table, a);
    }
    table->axes_alike = true;
    for (size_t a = 1; a < 3; a++) {
        table->axes_alike = table->axes_alike && table->nodes[a] == table->nodes[0];
        for (size_t i = 0; i < table->nodes[a] && table->axes_alike; i++) {
            table->axes_alike = table->axis_pa[a][i] - table->axis_pa[0][i] == 0.0f;
        }
    }
    return status;
}

/* The grid at `start` of the image, whose node counts stand at `offset`; it must lie inside the image. */
static enum bend_table_status read_grid(struct bend_table *table, const uint8_t *image, size_t size, size_t offset,
                                        size_t start) {
    enum bend_table_status status = measure_grid(table, image, offset);
    if (status == BEND_TABLE_OK && (start > size || table->grid_bytes > size - start)) {
        status = BEND_TABLE_BAD_SIZE;
    }
    if (status == BEND_TABLE_OK) {
        bind_grid(table, image + start);
        status = bind_axes(table, offset == BEND_TABLE_OFFSET_BALLOONED);
    }
    return status;
}

static bool has_ballooned(const uint8_t *image) {
    return read_u32(image, BEND_TABLE_OFFSET_BALLOONED) != 0u;
}

/* Every byte of the image belongs to the header or to a grid. */
static enum bend_table_status check_sizes(struct bend_table *table, const uint8_t *image, size_t size) {
    size_t used = BEND_TABLE_HEADER_BYTES;
    if (read_u32(image, BEND_TABLE_OFFSET_CHANNELS) != BEND_TABLE_CHANNEL_COUNT) {
        return BEND_TABLE_BAD_SIZE;
    }
    enum bend_table_status status = measure_grid(table, image, BEND_TABLE_OFFSET_NODES);
    used += table->grid_bytes;
    if (status == BEND_TABLE_OK && has_ballooned(image)) {
        status = measure_grid(table, image, BEND_TABLE_OFFSET_BALLOONED);
        used += table->grid_bytes;
    }
    return status == BEND_TABLE_OK && used != size ? BEND_TABLE_BAD_SIZE : status;
}

static enum bend_table_status read_grids(struct bend_table *table, const uint8_t *image, size_t size) {
    enum bend_table_status status = check_sizes(table, image, size);
    if (status == BEND_TABLE_OK) {
        status = read_grid(table, image, size, BEND_TABLE_OFFSET_NODES, BEND_TABLE_HEADER_BYTES);
    }
    if (status == BEND_TABLE_OK && has_ballooned(image)) {
        /* checked in the same view, which is then bound to its own grid again */
        status = read_grid(table, image, size, BEND_TABLE_OFFSET_BALLOONED,
                           BEND_TABLE_HEADER_BYTES + (size_t)table->grid_bytes);
        if (status == BEND_TABLE_OK) {
            status = read_grid(table, image, size, BEND_TABLE_OFFSET_NODES, BEND_TABLE_HEADER_BYTES);
        }
        if (status == BEND_TABLE_OK && !(table->module.jump_up_pa > 0.0f)) {
            status = BEND_TABLE_BAD_VALUE;
        }
    }
    table->image = image;
    table->image_bytes = (uint32_t)size;
    table->image_crc = read_u32(image, BEND_TABLE_OFFSET_CRC);
    return status;
}

static enum bend_table_status check_name(const struct bend_table *table, const char *module_name) {
    const bool other =
        module_name != NULL && strncmp(module_name, table->module.name, BEND_TABLE_NAME_BYTES) != 0;
    return other ? BEND_TABLE_WRONG_MODULE : BEND_TABLE_OK;
}

static enum bend_table_status check_image(const void *image, size_t size) {
    if (image == NULL) {
        return BEND_TABLE_TOO_SHORT;
    }
    if ((uintptr_t)image % sizeof(float) != 0u) {
        return BEND_TABLE_MISALIGNED;
    }
    return check_frame(image, size);
}

enum bend_table_status bend_table_bind(struct bend_table *table, const void *image, size_t size,
                                       const char *module_name) {
    (void)memset(table, 0, sizeof *table);
    enum bend_table_status status = check_image(image, size);
    if (status == BEND_TABLE_OK) {
        status = read_module(table, image);
    }
    if (status == BEND_TABLE_OK) {
        status = read_grids(table, image, size);
    }
    return status == BEND_TABLE_OK ? check_name(table, module_name) : status;
}

/* Where the axes and channels of the grid that starts at `start` end, its node counts standing at `offset`. */
static size_t end_of_values(const uint8_t *image, size_t offset, size_t start) {
    const size_t n1 = read_u32(image, offset), n2 = read_u32(image, offset + 4u), n3 = read_u32(image, offset + 8u);
    return start + sizeof(float) * (n1 + n2 + n3 + BEND_TABLE_CHANNEL_COUNT * n1 * n2 * n3);
}

bool bend_table_is_finite(const struct bend_table *table, uint32_t from, uint32_t to) {
    const uint8_t *image = table->image;
    const size_t second = BEND_TABLE_HEADER_BYTES + (size_t)table->grid_bytes;
    const size_t first_end = end_of_values(image, BEND_TABLE_OFFSET_NODES, BEND_TABLE_HEADER_BYTES);
    const size_t second_end = has_ballooned(image) ? end_of_values(image, BEND_TABLE_OFFSET_BALLOONED, second) : second;
    bool finite = true;
    for (size_t at = from; at < to; at += sizeof(float)) {
        const bool is_value = (at >= BEND_TABLE_HEADER_BYTES && at < first_end) || (at >= second && at < second_end);
        float value = 0.0f;
        (void)memcpy(&value, image + at, sizeof value);
        finite = finite && (!is_value || is_finite(value));
    }
    return finite;
}

enum bend_table_status bend_table_open(struct bend_table *table, const void *image, size_t size,
                                       const char *module_name) {
    enum bend_table_status status = check_image(image, size);
    if (status == BEND_TABLE_OK && !crc_holds(image, size)) {
        status = BEND_TABLE_BAD_CRC;
    }
    if (status == BEND_TABLE_OK) {
        status = bend_table_bind(table, image, size, module_name);
    }
    if (status == BEND_TABLE_OK && !bend_table_is_finite(table, 0u, table->image_bytes)) {
        status = BEND_TABLE_BAD_VALUE;
    }
    return status;
}

bool bend_table_ballooned(const struct bend_table *table, struct bend_table *ballooned) {
    *ballooned = *table;
    return has_ballooned(table->image) &&
           read_grid(ballooned, table->image, table->image_bytes, BEND_TABLE_OFFSET_BALLOONED,
                     BEND_TABLE_HEADER_BYTES + (size_t)table->grid_bytes) == BEND_TABLE_OK;
}

const char *bend_table_status_text(enum bend_table_status status) {
    switch (status) {
    case BEND_TABLE_OK:
        return "the table is sound";
    case BEND_TABLE_TOO_SHORT:
        return "the table is cut short; copy or build it again";
    case BEND_TABLE_BAD_MAGIC:
        return "this is not a bend table (it does not start with TBND)";
    case BEND_TABLE_BAD_VERSION:
        return "the table is of another version of the format; build it again";
    case BEND_TABLE_BAD_SIZE:
        return "the table's size does not fit its header; copy or build it again";
    case BEND_TABLE_BAD_CRC:
        return "the table was changed after it was built (CRC-32 differs); copy or build it again";
    case BEND_TABLE_BAD_AXIS:
        return "a pressure axis of the table does not rise from zero over 4 to 32 nodes";
    case BEND_TABLE_BAD_VALUE:
        return "the table holds a number that is not finite or a geometry that makes no sense";
    case BEND_TABLE_WRONG_MODULE:
        return "the table is of another module";
    case BEND_TABLE_MISALIGNED:
        return "the table does not start at a multiple of four bytes";
    default:
        return "unknown table status";
    }
}

/* --- interpolation --- */

uint32_t bend_table_cell(const struct bend_table *table, size_t a, float pressure_pa) {
    const float *axis = table->axis_pa[a];
    uint32_t low = 0u, high = table->nodes[a] - 1u;
    while (high - low > 1u) { /* at most five rounds: axes have up to 32 nodes */
        const uint32_t middle = (low + high) / 2u;
        if (axis[middle] <= pressure_pa) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* Weights of the stencil's four nodes from those of value and slope at either end of the cell, and from the weights of
 * those slopes: of a node inside the axis its neighbours' and its own, of an end the nearest three. */
static inline void weigh_nodes(size_t cell, size_t n, const float basis[4], const float low[3], const float high[3],
                               float weight[STENCIL]) {
    if (cell == 0) {
        weight[0] = basis[0] + basis[1] * low[0] + basis[3] * high[0];
        weight[1] = basis[1] * low[1] + basis[2] + basis[3] * high[1];
        weight[2] = basis[1] * low[2] + basis[3] * high[2];
        weight[3] = 0.0f;
    } else if (cell == n - 2) {
        weight[0] = 0.0f;
        weight[1] = basis[1] * low[0] + basis[3] * high[0];
        weight[2] = basis[0] + basis[1] * low[1] + basis[3] * high[1];
        weight[3] = basis[1] * low[2] + basis[2] + basis[3] * high[2];
    } else {
        weight[0] = basis[1] * low[0];
        weight[1] = basis[0] + basis[1] * low[1] + basis[3] * high[0];
        weight[2] = basis[1] * low[2] + basis[2] + basis[3] * high[1];
        weight[3] = basis[3] * high[2];
    }
}

void bend_table_locate_in_cell(const struct bend_table *table, size_t a, uint32_t cell, float pressure_pa,
                               struct bend_table_stencil *stencil) {
    const float *axis = table->axis_pa[a];
    const uint32_t n = table->nodes[a];
    const uint32_t first = cell == 0u ? 0u : (cell - 1u > n - STENCIL ? n - STENCIL : cell - 1u);
    const float h = axis[cell + 1u] - axis[cell], t = (pressure_pa - axis[cell]) / h, left = 1.0f - t;
    /* cubic Hermite basis: value and slope at either end, and its derivative by p */
    const float basis[4] = {(1.0f + 2.0f * t) * left * left, t * left * left * h, t * t * (3.0f - 2.0f * t),
                            t * t * (t - 1.0f) * h};
    const float rate[4] = {6.0f * t * (t - 1.0f) / h, left * (1.0f - 3.0f * t), 6.0f * t * left / h,
                           t * (3.0f * t - 2.0f)};
    const float *low = table->slope[a][cell], *high = table->slope[a][cell + 1];
    stencil->first[a] = first;
    stencil->cell[a] = cell;
    weigh_nodes(cell, n, basis, low, high, stencil->weight[a]);
    weigh_nodes(cell, n, rate, low, high, stencil->derivative[a]);
}

void bend_table_locate(const struct bend_table *table, const float pressure_pa[3], struct bend_table_stencil *stencil) {
    stencil->clamped = false;
    for (size_t a = 0; a < 3; a++) {
        const float *axis = table->axis_pa[a], end_pa = axis[table->nodes[a] - 1u];
        float p = pressure_pa[a] >= axis[0] ? pressure_pa[a] : axis[0]; /* NaN goes to the start */
        p = p <= end_pa ? p : end_pa;
        bend_table_locate_in_cell(table, a, bend_table_cell(table, a, p), p, stencil);
        if (!(p == pressure_pa[a])) {
            stencil->clamped = true;
            (void)memset(stencil->derivative[a], 0, sizeof stencil->derivative[a]);
        }
    }
}

static const float *stencil_start(const struct bend_table *table, const struct bend_table_stencil *stencil,
                                  enum bend_table_channel channel) {
    return table->channel[channel] + stencil->first[2] +
           table->nodes[2] * (stencil->first[1] + table->nodes[1] * (size_t)stencil->first[0]);
}

static inline float along(const float weight[STENCIL], const float row[STENCIL]) {
    return weight[0] * row[0] + weight[1] * row[1] + weight[2] * row[2] + weight[3] * row[3];
}

float bend_table_value(const struct bend_table *table, const struct bend_table_stencil *stencil,
                       enum bend_table_channel channel) {
    const float *row = stencil_start(table, stencil, channel);
    const size_t next_row = table->nodes[2], next_plane = next_row * (table->nodes[1] - STENCIL);
    const float *w2 = stencil->weight[1], *w3 = stencil->weight[2];
    float sum = 0.0f;
    for (size_t i = 0; i < STENCIL; i++, row += next_plane) {
        float plane = 0.0f;
        for (size_t j = 0; j < STENCIL; j += 2u, row += 2u * next_row) { /* by twos: a loop's turn costs as much as a row */
            plane += w2[j] * along(w3, row);
            plane += w2[j + 1u] * along(w3, row + next_row);
        }
        sum += stencil->weight[0][i] * plane;
    }
    return sum;
}

float bend_table_gradient(const struct bend_table *table, const struct bend_table_stencil *stencil,
                          enum bend_table_channel channel, float gradient[3]) {
    const float *row = stencil_start(table, stencil, channel);
    const size_t next_row = table->nodes[2], next_plane = next_row * (table->nodes[1] - STENCIL);
    const float *w2 = stencil->weight[1], *d2 = stencil->derivative[1];
    const float *w3 = stencil->weight[2], *d3 = stencil->derivative[2];
    float value = 0.0f, slope1 = 0.0f, slope2 = 0.0f, slope3 = 0.0f;
    for (size_t i = 0; i < STENCIL; i++, row += next_plane) {
        float plane = 0.0f, plane2 = 0.0f, plane3 = 0.0f;
        for (size_t j = 0; j < STENCIL; j += 2u, row += 2u * next_row) {
            const float line = along(w3, row), next_line = along(w3, row + next_row);
            plane += w2[j] * line;
            plane2 += d2[j] * line;
            plane3 += w2[j] * along(d3, row);
            plane += w2[j + 1u] * next_line;
            plane2 += d2[j + 1u] * next_line;
            plane3 += w2[j + 1u] * along(d3, row + next_row);
        }
        value += stencil->weight[0][i] * plane;
        slope1 += stencil->derivative[0][i] * plane;
        slope2 += stencil->weight[0][i] * plane2;
        slope3 += stencil->weight[0][i] * plane3;
    }
    gradient[0] = slope1;
    gradient[1] = slope2;
    gradient[2] = slope3;
    return value;
}

bool bend_table_cell_is_valid(const struct bend_table *table, const uint32_t cell[3]) {
    const size_t next_row = table->nodes[2], next_plane = next_row * table->nodes[1];
    const uint8_t *tag = table->tag + cell[2] + next_row * cell[1] + next_plane * cell[0];
    const unsigned all = (unsigned)tag[0] & tag[1] & tag[next_row] & tag[next_row + 1u] & tag[next_plane] &
                         tag[next_plane + 1u] & tag[next_plane + next_row] & tag[next_plane + next_row + 1u];
    return (all & (unsigned)BEND_TABLE_TAG_VALID) != 0u;
}

bool bend_table_is_valid(const struct bend_table *table, const struct bend_table_stencil *stencil) {
    return !stencil->clamped && bend_table_cell_is_valid(table, stencil->cell);
}

static bool holds_at(const struct bend_table *table, const float pressure_pa[3], float share) {
    uint32_t cell[3];
    for (size_t a = 0; a < 3; a++) {
        const float scaled_pa = share * pressure_pa[a];
        if (!(scaled_pa >= table->axis_pa[a][0] && scaled_pa <= table->axis_pa[a][table->nodes[a] - 1u])) {
            return false;
        }
        cell[a] = bend_table_cell(table, a, scaled_pa);
    }
    return bend_table_cell_is_valid(table, cell);
}

bool bend_table_keep_valid(const struct bend_table *table, float pressure_pa[3]) {
    if (holds_at(table, pressure_pa, 1.0f)) {
        return true;
    }
    float low = 0.0f, step = 0.5f;
    for (uint32_t i = 0; i < 10u; i++) {
        if (holds_at(table, pressure_pa, low + step)) {
            low += step;
        }
        step *= 0.5f;
    }
    for (uint32_t c = 0; c < 3u; c++) {
        pressure_pa[c] *= low;
    }
    return false;
}
