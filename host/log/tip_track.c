#include "log/tip_track.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "log/rotation.h"
#include "log/run_columns.h"

#define MARKERS_MAX 16
#define MARKERS_FOR_A_POSE 3
#define QUATERNION_LENGTH_WITHIN 0.05
#define FLATTEST_TRIANGLE 0.02 /* area over the square of its longest side */

struct track {
    const struct mapping *mapping;
    const struct source_table *table;
    const struct rest_rows *rest;
    const char *path;
    struct tip_pose *pose;
    double factor; /* of the tip's unit, to m */
    double marker_at_rest[MARKERS_MAX][3];
    char *error;
    size_t error_bytes;
};

/* --- reading --- */

static bool want_all(struct source_table *table, char *const *names, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (source_table_want(table, names[i]) < 0) {
            return false;
        }
    }
    return true;
}

static bool want_points(struct source_table *table, const struct mapping_point *points, unsigned count) {
    for (unsigned p = 0; p < count; p++) {
        if (!want_all(table, points[p].column, 3)) {
            return false;
        }
    }
    return true;
}

bool tip_track_want(const struct mapping *mapping, struct source_table *table) {
    const struct mapping_tip *tip = mapping->tip;
    const struct mapping_frame *frame = mapping->frame;
    return (tip == NULL || ((tip->position == NULL || want_all(table, tip->position, 3)) &&
                            (tip->quaternion == NULL || want_all(table, tip->quaternion, 4)) &&
                            want_points(table, tip->markers, tip->markers_count))) &&
           (frame == NULL || want_points(table, frame->subtract_base, frame->subtract_base_count));
}

/* True: all of them were measured in that row. */
static bool read_values(const struct track *track, size_t row, char *const *names, size_t count,
                        double factor, double *value) {
    bool measured = true;
    for (size_t i = 0; i < count; i++) {
        value[i] = NAN;
        for (size_t w = 0; w < track->table->wanted_count; w++) {
            if (strcmp(track->table->wanted[w], names[i]) == 0) {
                value[i] = factor * track->table->value[row * track->table->wanted_count + w];
            }
        }
        measured = measured && !isnan(value[i]);
    }
    return measured;
}

static bool read_points(const struct track *track, size_t row, const struct mapping_point *points,
                        unsigned count, double (*value)[3]) {
    bool measured = true;
    for (unsigned p = 0; p < count; p++) {
        measured = read_values(track, row, points[p].column, 3, track->factor, value[p]) && measured;
    }
    return measured;
}

static void centre_of(const double (*points)[3], size_t count, double centre[3]) {
    memset(centre, 0, 3 * sizeof *centre);
    for (size_t p = 0; p < count; p++) {
        for (size_t k = 0; k < 3; k++) {
            centre[k] += points[p][k] / (double)count;
        }
    }
}

static bool read_position(const struct track *track, size_t row, double position[3]) {
    const struct mapping_tip *tip = track->mapping->tip;
    double markers[MARKERS_MAX][3];
    if (tip->position != NULL) {
        return read_values(track, row, tip->position, 3, track->factor, position);
    }
    const bool measured = read_points(track, row, tip->markers, tip->markers_count, markers);
    centre_of((const double(*)[3])markers, tip->markers_count, position);
    return measured;
}

static bool read_base(const struct track *track, size_t row, double base[3]) {
    const struct mapping_frame *frame = track->mapping->frame;
    double points[MARKERS_MAX][3];
    memset(base, 0, 3 * sizeof *base);
    if (frame == NULL || frame->subtract_base_count == 0) {
        return true;
    }
    const bool measured = read_points(track, row, frame->subtract_base, frame->subtract_base_count, points);
    centre_of((const double(*)[3])points, frame->subtract_base_count, base);
    return measured;
}

static bool read_quaternion(struct track *track, size_t row, double rotation[4], bool *sound) {
    const struct mapping_tip *tip = track->mapping->tip;
    double terms[4];
    *sound = true;
    if (!read_values(track, row, tip->quaternion, 4, 1.0, terms)) {
        return false;
    }
    const size_t w = tip->order == MAPPING_XYZW ? 3 : 0, x = tip->order == MAPPING_XYZW ? 0 : 1;
    const double ordered[4] = {terms[w], terms[x], terms[x + 1], terms[x + 2]};
    memcpy(rotation, ordered, sizeof ordered);
    const double length = rotation_normalise(rotation);
    if (!(fabs(length - 1.0) <= QUATERNION_LENGTH_WITHIN)) {
        (void)snprintf(
            track->error, track->error_bytes,
            "%s:%d: the tip's quaternion (columns %s, %s, %s, %s) has the length %.4g, not 1: are these the "
            "right columns?",
            track->path, track->table->line[row], tip->quaternion[0], tip->quaternion[1], tip->quaternion[2],
            tip->quaternion[3], length);
        *sound = false;
    }
    if (tip->inverse) {
        rotation_inverse(rotation, rotation);
    }
    return true;
}

/* --- orientation from markers --- */

static double largest_flatness(const double (*points)[3], size_t count) {
    double best = 0.0;
    for (size_t a = 0; a < count; a++) {
        for (size_t b = a + 1; b < count; b++) {
            for (size_t c = b + 1; c < count; c++) {
                double u[3], v[3];
                for (size_t k = 0; k < 3; k++) {
                    u[k] = points[b][k] - points[a][k];
                    v[k] = points[c][k] - points[a][k];
                }
                const double area =
                    0.5 * sqrt(pow(u[1] * v[2] - u[2] * v[1], 2.0) + pow(u[2] * v[0] - u[0] * v[2], 2.0) +
                               pow(u[0] * v[1] - u[1] * v[0], 2.0));
                const double side =
                    fmax(u[0] * u[0] + u[1] * u[1] + u[2] * u[2], v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
                best = fmax(best, side > 0.0 ? area / side : 0.0);
            }
        }
    }
    return best;
}

static bool learn_markers(struct track *track) {
    const struct mapping_tip *tip = track->mapping->tip;
    double sum[MARKERS_MAX][3] = {{0.0}}, markers[MARKERS_MAX][3];
    size_t count = 0;
    for (size_t row = track->rest->first; row < track->rest->end; row++) {
        if (!read_points(track, row, tip->markers, tip->markers_count, markers)) {
            continue;
        }
        count++;
        for (size_t m = 0; m < tip->markers_count; m++) {
            for (size_t k = 0; k < 3; k++) {
                sum[m][k] += markers[m][k];
            }
        }
    }
    for (size_t m = 0; m < tip->markers_count; m++) {
        for (size_t k = 0; k < 3; k++) {
            track->marker_at_rest[m][k] = sum[m][k] / (double)count;
        }
    }
    if (count == 0 ||
        largest_flatness((const double(*)[3])track->marker_at_rest, tip->markers_count) < FLATTEST_TRIANGLE) {
        (void)snprintf(track->error, track->error_bytes, "%s: the tip's markers give no orientation: %s",
                       track->path, count == 0 ? "no row at rest has all of them" : "they stand on one line");
        return false;
    }
    return true;
}

static bool rotation_of_markers(const struct track *track, size_t row, double rotation[4]) {
    const struct mapping_tip *tip = track->mapping->tip;
    double markers[MARKERS_MAX][3];
    if (!read_points(track, row, tip->markers, tip->markers_count, markers)) {
        return false;
    }
    rotation_between((const double(*)[3])track->marker_at_rest, (const double(*)[3])markers,
                     tip->markers_count, rotation);
    return true;
}

/* --- into the base frame --- */

static bool fill_row(struct track *track, size_t row, const double to_base[4]) {
    const struct mapping_frame *frame = track->mapping->frame;
    const struct mapping_tip *tip = track->mapping->tip;
    struct tip_pose *pose = &track->pose[row];
    double base[3], back[4];
    bool sound = true;
    pose->has_position = read_position(track, row, pose->position_m) && read_base(track, row, base);
    for (size_t k = 0; pose->has_position && k < 3; k++) {
        pose->position_m[k] -=
            base[k] + (frame != NULL && frame->origin_m != NULL ? frame->origin_m[k] : 0.0);
    }
    rotation_apply(to_base, pose->position_m, pose->position_m);
    if (tip->quaternion != NULL) {
        pose->has_rotation = read_quaternion(track, row, pose->rotation, &sound);
        rotation_multiply(to_base, pose->rotation, pose->rotation);
        if (tip->mount_quaternion != NULL) {
            rotation_multiply(pose->rotation, tip->mount_quaternion, pose->rotation);
        }
    } else if (tip->markers_count >= MARKERS_FOR_A_POSE) { /* their frame at rest is the base's */
        pose->has_rotation = rotation_of_markers(track, row, pose->rotation);
        rotation_inverse(to_base, back);
        rotation_multiply(to_base, pose->rotation, pose->rotation);
        rotation_multiply(pose->rotation, back, pose->rotation);
    }
    return sound;
}

/* So that orientation at rest is none. */
static bool turn_to_rest(struct track *track) {
    double mean[4] = {0.0}, back[4];
    for (size_t row = track->rest->first; row < track->rest->end; row++) {
        const double *rotation = track->pose[row].rotation;
        double dot = 0.0;
        for (size_t k = 0; track->pose[row].has_rotation && k < 4; k++) {
            dot += mean[k] * rotation[k];
        }
        for (size_t k = 0; track->pose[row].has_rotation && k < 4; k++) {
            mean[k] += copysign(1.0, dot) * rotation[k];
        }
    }
    if (!(rotation_normalise(mean) > 0.0)) {
        (void)snprintf(track->error, track->error_bytes, "%s: no row at rest has the tip's orientation",
                       track->path);
        return false;
    }
    rotation_inverse(mean, back);
    for (size_t row = 0; row < track->table->rows; row++) {
        rotation_multiply(track->pose[row].rotation, back, track->pose[row].rotation);
    }
    return true;
}

static void take_lever_arm_off(struct track *track, const double lever_arm_m[3]) {
    for (size_t row = 0; row < track->table->rows; row++) {
        struct tip_pose *pose = &track->pose[row];
        double arm_m[3];
        rotation_apply(pose->rotation, lever_arm_m, arm_m);
        pose->has_position = pose->has_position && pose->has_rotation;
        for (size_t k = 0; k < 3; k++) {
            pose->position_m[k] -= arm_m[k];
        }
    }
}

static bool move_to_rest(struct track *track, const double rest_tip_m[3]) {
    double mean_m[3];
    if (!tip_track_rest_position(track->pose, track->rest, mean_m)) {
        (void)snprintf(track->error, track->error_bytes, "%s: no row at rest has the tip's position",
                       track->path);
        return false;
    }
    for (size_t row = 0; row < track->table->rows; row++) {
        for (size_t k = 0; k < 3; k++) {
            track->pose[row].position_m[k] += rest_tip_m[k] - mean_m[k];
        }
    }
    return true;
}

/* Of the two quaternions of a rotation, the one near that of the row before. */
static void smooth_signs(struct track *track) {
    double before[4] = {1.0, 0.0, 0.0, 0.0};
    for (size_t row = 0; row < track->table->rows; row++) {
        double *rotation = track->pose[row].rotation;
        double dot = 0.0;
        if (!track->pose[row].has_rotation) {
            continue;
        }
        for (size_t k = 0; k < 4; k++) {
            dot += before[k] * rotation[k];
        }
        for (size_t k = 0; k < 4; k++) {
            rotation[k] = dot < 0.0 ? -rotation[k] : rotation[k];
            before[k] = rotation[k];
        }
    }
}

bool tip_track_has_rotation(const struct mapping *mapping) {
    return mapping->tip != NULL &&
           (mapping->tip->quaternion != NULL || mapping->tip->markers_count >= MARKERS_FOR_A_POSE);
}

bool tip_track_build(const struct mapping *mapping, const struct source_table *table,
                     const struct rest_rows *rest, const char *path, struct tip_pose *pose, char *error,
                     size_t error_bytes) {
    struct track track = {.mapping = mapping,
                          .table = table,
                          .rest = rest,
                          .path = path,
                          .pose = pose,
                          .error = error,
                          .error_bytes = error_bytes};
    const struct mapping_frame *frame = mapping->frame;
    const struct mapping_tip *tip = mapping->tip;
    double to_base[4];
    memset(pose, 0, table->rows * sizeof *pose);
    track.factor = run_unit_find(tip->unit)->factor;
    mapping_rotation(mapping, to_base);
    if (tip->markers_count >= MARKERS_FOR_A_POSE && !learn_markers(&track)) {
        return false;
    }
    for (size_t row = 0; row < table->rows; row++) {
        if (!fill_row(&track, row, to_base)) {
            return false;
        }
    }
    if (frame != NULL && frame->rest_is_straight && !turn_to_rest(&track)) {
        return false;
    }
    if (tip->lever_arm_m != NULL) {
        take_lever_arm_off(&track, tip->lever_arm_m);
    }
    if (frame != NULL && frame->rest_tip_m != NULL && !move_to_rest(&track, frame->rest_tip_m)) {
        return false;
    }
    smooth_signs(&track);
    return true;
}

bool tip_track_rest_position(const struct tip_pose *pose, const struct rest_rows *rest,
                             double position_m[3]) {
    size_t count = 0;
    memset(position_m, 0, 3 * sizeof *position_m);
    for (size_t row = rest->first; row < rest->end; row++) {
        if (!pose[row].has_position) {
            continue;
        }
        count++;
        for (size_t k = 0; k < 3; k++) {
            position_m[k] += pose[row].position_m[k];
        }
    }
    for (size_t k = 0; count > 0 && k < 3; k++) {
        position_m[k] /= (double)count;
    }
    return count > 0;
}
