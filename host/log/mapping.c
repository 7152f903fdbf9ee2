#include "log/mapping.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "description/yaml_file.h"
#include "log/rotation.h"
#include "log/run_columns.h"
#include "log/run_log.h"

#define NAME_MOST 63
#define LINE_BYTES 1024
#define TEXT_MOST 1023
#define POINTS_MOST 16
#define STEPS_MOST 256
#define MARKERS_FOR_A_POSE 3
#define UNIT_LENGTH_WITHIN 1e-3

#define OPTIONAL CYAML_FLAG_OPTIONAL
#define OPTIONAL_POINTER (CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL)

static const cyaml_strval_t orders[] = {{"wxyz", MAPPING_WXYZ}, {"xyzw", MAPPING_XYZW}};
static const cyaml_schema_value_t real_value = {CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_value_t name_value = {CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 1, NAME_MOST)};

static const cyaml_schema_field_t column_fields[] = {
    CYAML_FIELD_STRING_PTR("to", CYAML_FLAG_POINTER, struct mapping_column, to, 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("column", CYAML_FLAG_POINTER, struct mapping_column, column, 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("unit", CYAML_FLAG_POINTER, struct mapping_column, unit, 1, NAME_MOST),
    CYAML_FIELD_FLOAT_PTR("sign", OPTIONAL_POINTER, struct mapping_column, sign),
    CYAML_FIELD_FLOAT_PTR("scale", OPTIONAL_POINTER, struct mapping_column, scale),
    CYAML_FIELD_FLOAT("offset", OPTIONAL, struct mapping_column, offset),
    CYAML_FIELD_BOOL("subtract_rest", OPTIONAL, struct mapping_column, subtract_rest),
    CYAML_FIELD_END};
static const cyaml_schema_value_t column_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct mapping_column, column_fields)};

static const cyaml_schema_value_t step_schema = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &real_value, 2)};
static const cyaml_schema_field_t constant_fields[] = {
    CYAML_FIELD_STRING_PTR("to", CYAML_FLAG_POINTER, struct mapping_constant, to, 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("unit", OPTIONAL_POINTER, struct mapping_constant, unit, 1, NAME_MOST),
    CYAML_FIELD_FLOAT_PTR("value", OPTIONAL_POINTER, struct mapping_constant, value),
    CYAML_FIELD_SEQUENCE("steps", OPTIONAL_POINTER, struct mapping_constant, steps, &step_schema, 1,
                         STEPS_MOST),
    CYAML_FIELD_FLOAT("while_moved_m", OPTIONAL, struct mapping_constant, while_moved_m),
    CYAML_FIELD_END};
static const cyaml_schema_value_t constant_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct mapping_constant, constant_fields)};

/* A mapping, not a list: libcyaml 1.3 frees a list of fixed lists of texts wrongly. */
static const cyaml_schema_field_t point_fields[] = {
    CYAML_FIELD_STRING_PTR("x", CYAML_FLAG_POINTER, struct mapping_point, column[0], 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("y", CYAML_FLAG_POINTER, struct mapping_point, column[1], 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("z", CYAML_FLAG_POINTER, struct mapping_point, column[2], 1, NAME_MOST),
    CYAML_FIELD_END};
static const cyaml_schema_value_t point_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct mapping_point, point_fields)};
static const cyaml_schema_field_t tip_fields[] = {
    CYAML_FIELD_STRING_PTR("unit", CYAML_FLAG_POINTER, struct mapping_tip, unit, 1, NAME_MOST),
    CYAML_FIELD_SEQUENCE_FIXED("position", OPTIONAL_POINTER, struct mapping_tip, position, &name_value, 3),
    CYAML_FIELD_SEQUENCE_FIXED("quaternion", OPTIONAL_POINTER, struct mapping_tip, quaternion, &name_value,
                               4),
    CYAML_FIELD_ENUM("quaternion_order", CYAML_FLAG_STRICT | OPTIONAL, struct mapping_tip, order, orders, 2),
    CYAML_FIELD_BOOL("quaternion_inverse", OPTIONAL, struct mapping_tip, inverse),
    CYAML_FIELD_SEQUENCE("tip_from_markers", OPTIONAL_POINTER, struct mapping_tip, markers, &point_schema, 1,
                         POINTS_MOST),
    CYAML_FIELD_SEQUENCE_FIXED("lever_arm_m", OPTIONAL_POINTER, struct mapping_tip, lever_arm_m, &real_value,
                               3),
    CYAML_FIELD_SEQUENCE_FIXED("mount_quaternion", OPTIONAL_POINTER, struct mapping_tip, mount_quaternion,
                               &real_value, 4),
    CYAML_FIELD_END};

static const cyaml_schema_field_t axes_fields[] = {
    CYAML_FIELD_STRING_PTR("x", CYAML_FLAG_POINTER, struct mapping_axes, direction[0], 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("y", CYAML_FLAG_POINTER, struct mapping_axes, direction[1], 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("z", CYAML_FLAG_POINTER, struct mapping_axes, direction[2], 1, NAME_MOST),
    CYAML_FIELD_END};
static const cyaml_schema_field_t frame_fields[] = {
    CYAML_FIELD_SEQUENCE("subtract_base", OPTIONAL_POINTER, struct mapping_frame, subtract_base,
                         &point_schema, 1, POINTS_MOST),
    CYAML_FIELD_SEQUENCE_FIXED("origin_m", OPTIONAL_POINTER, struct mapping_frame, origin_m, &real_value, 3),
    CYAML_FIELD_MAPPING_PTR("axes", OPTIONAL_POINTER, struct mapping_frame, axes, axes_fields),
    CYAML_FIELD_SEQUENCE_FIXED("quaternion", OPTIONAL_POINTER, struct mapping_frame, quaternion, &real_value,
                               4),
    CYAML_FIELD_SEQUENCE_FIXED("rest_tip_m", OPTIONAL_POINTER, struct mapping_frame, rest_tip_m, &real_value,
                               3),
    CYAML_FIELD_BOOL("rest_is_straight", OPTIONAL, struct mapping_frame, rest_is_straight),
    CYAML_FIELD_END};

static const cyaml_schema_field_t rest_fields[] = {
    CYAML_FIELD_FLOAT("from_s", OPTIONAL, struct mapping_rest, from_s),
    CYAML_FIELD_FLOAT("until_s", CYAML_FLAG_DEFAULT, struct mapping_rest, until_s), CYAML_FIELD_END};
static const cyaml_schema_field_t gaps_fields[] = {
    CYAML_FIELD_FLOAT("cut_after_s", OPTIONAL, struct mapping_gaps, cut_after_s),
    CYAML_FIELD_FLOAT("pressure_jump_pa", OPTIONAL, struct mapping_gaps, pressure_jump_pa), CYAML_FIELD_END};

static const cyaml_schema_field_t mapping_fields[] = {
    CYAML_FIELD_STRING_PTR("name", CYAML_FLAG_POINTER, struct mapping, name, 1, NAME_MOST),
    CYAML_FIELD_STRING_PTR("source", CYAML_FLAG_POINTER, struct mapping, source, 1, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("module", OPTIONAL_POINTER, struct mapping, module, 1, MODULE_NAME_BYTES - 1),
    CYAML_FIELD_STRING_PTR("note", OPTIONAL_POINTER, struct mapping, note, 1, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("delimiter", OPTIONAL_POINTER, struct mapping, delimiter, 1, NAME_MOST),
    CYAML_FIELD_INT_PTR("header_lines", OPTIONAL_POINTER, struct mapping, header_lines),
    CYAML_FIELD_STRING_PTR("comment", OPTIONAL_POINTER, struct mapping, comment, 1, 1),
    CYAML_FIELD_SEQUENCE("columns", CYAML_FLAG_POINTER, struct mapping, columns, &column_schema, 1,
                         RUN_LOG_COLUMNS_MAX),
    CYAML_FIELD_SEQUENCE("constants", OPTIONAL_POINTER, struct mapping, constants, &constant_schema, 0,
                         RUN_LOG_COLUMNS_MAX),
    CYAML_FIELD_MAPPING_PTR("tip", OPTIONAL_POINTER, struct mapping, tip, tip_fields),
    CYAML_FIELD_MAPPING_PTR("frame", OPTIONAL_POINTER, struct mapping, frame, frame_fields),
    CYAML_FIELD_MAPPING_PTR("rest", OPTIONAL_POINTER, struct mapping, rest, rest_fields),
    CYAML_FIELD_MAPPING_PTR("gaps", OPTIONAL_POINTER, struct mapping, gaps, gaps_fields),
    CYAML_FIELD_END};
static const cyaml_schema_value_t schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct mapping, mapping_fields)};

/* --- checks of what the schema lets pass --- */

struct check {
    const char *path;
    const struct mapping *mapping;
    struct description_error *error;
};

static bool is_tip_column(const char *name) {
    return strcmp(name, "tip_quality") != 0 && strcmp(name, "tip_status") != 0 &&
           strncmp(name, "tip_", 4) == 0;
}

/* The line without blanks, quotes, braces and list dashes: `- {to: p1_pa, unit: bar}` becomes
 * `to:p1_pa,unit:bar`. */
static void squeeze(const char *line, char squeezed[LINE_BYTES]) {
    size_t used = 0;
    for (const char *at = line; *at != '\0' && *at != '#' && used + 1 < LINE_BYTES; at++) {
        if (strchr(" \t\r\n\"'{}", *at) == NULL && (*at != '-' || used > 0)) {
            squeezed[used++] = *at;
        }
    }
    squeezed[used] = '\0';
}

/* Does `word` stand in a squeezed line as a whole entry, or as its key? */
static bool has_word(const char *squeezed, const char *word) {
    const size_t length = strlen(word);
    for (const char *at = strstr(squeezed, word); at != NULL; at = strstr(at + 1, word)) {
        const bool starts = at == squeezed || at[-1] == ',';
        if (starts && (word[length - 1] == ':' || at[length] == '\0' || at[length] == ',')) {
            return true;
        }
    }
    return false;
}

/* Line of `key` in the entry that starts with `anchor`, else the anchor's; 0 when there is none. */
static int line_of(const char *path, const char *anchor, const char *key) {
    char line[LINE_BYTES], squeezed[LINE_BYTES], key_colon[NAME_MOST + 2];
    int number = 0, found = 0;
    bool at_key = false;
    FILE *file = fopen(path, "r");
    (void)snprintf(key_colon, sizeof key_colon, "%s:", key);
    while (file != NULL && !at_key && fgets(line, sizeof line, file) != NULL) {
        number++;
        squeeze(line, squeezed);
        if (found == 0 && has_word(squeezed, anchor)) {
            found = number;
        } else if (found != 0 && has_word(squeezed, "to:")) {
            break;
        }
        at_key = found != 0 && has_word(squeezed, key_colon);
        found = at_key ? number : found;
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return found;
}

/* "FILE:LINE: KEY: message" for a key of the entry for column `to`. Returns false. */
static bool reject(const struct check *check, const char *to, const char *key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
static bool reject(const struct check *check, const char *to, const char *key, const char *format, ...) {
    char anchor[NAME_MOST + 8];
    (void)snprintf(anchor, sizeof anchor, "to:%s", to);
    const int length = snprintf(check->error->text, sizeof check->error->text, "%s:%d: %s: ", check->path,
                                line_of(check->path, anchor, key), key);
    const size_t used = length < 0 ? 0 : (size_t)length;
    va_list arguments;
    va_start(arguments, format);
    if (used < sizeof check->error->text) {
        (void)vsnprintf(check->error->text + used, sizeof check->error->text - used, format, arguments);
    }
    va_end(arguments);
    return false;
}

static bool check_target(const struct check *check, const char *to, enum run_dimension *dimension) {
    const struct mapping *mapping = check->mapping;
    if (!run_column_find(to, dimension)) {
        char list[DESCRIPTION_ERROR_BYTES];
        run_column_list(list, sizeof list);
        return reject(check, to, "to", "a run log has no column '%s'; it has: %s", to, list);
    }
    if (mapping->tip != NULL && is_tip_column(to)) {
        return reject(check, to, "to", "%s comes out of 'tip:' already; take it from either", to);
    }
    int count = 0;
    for (unsigned c = 0; c < mapping->columns_count; c++) {
        count += strcmp(mapping->columns[c].to, to) == 0;
    }
    for (unsigned c = 0; c < mapping->constants_count; c++) {
        count += strcmp(mapping->constants[c].to, to) == 0;
    }
    return count == 1 || reject(check, to, "to", "%s is given %d times", to, count);
}

static bool check_unit(const struct check *check, const char *to, const char *unit,
                       enum run_dimension dimension) {
    const struct run_unit *found = run_unit_find(unit);
    const enum run_dimension wanted = dimension == RUN_STATE ? RUN_NUMBER : dimension;
    return (found != NULL && found->dimension == wanted) ||
           reject(check, to, "unit", "%s is %s, '%s' is no unit of that", to, run_dimension_words(dimension),
                  unit);
}

static bool check_column(const struct check *check, const struct mapping_column *column) {
    enum run_dimension dimension;
    if (!check_target(check, column->to, &dimension) ||
        !check_unit(check, column->to, column->unit, dimension)) {
        return false;
    }
    if (column->sign != NULL && fabs(fabs(*column->sign) - 1.0) > 0.0) {
        return reject(check, column->to, "sign", "must be 1 or -1, not %g", *column->sign);
    }
    if (column->scale != NULL && (!isfinite(*column->scale) || !(fabs(*column->scale) > 0.0))) {
        return reject(check, column->to, "scale", "must not be %g", *column->scale);
    }
    return isfinite(column->offset) || reject(check, column->to, "offset", "must not be %g", column->offset);
}

static bool check_columns(const struct check *check) {
    const struct mapping *mapping = check->mapping;
    bool has_time = false;
    for (unsigned c = 0; c < mapping->columns_count; c++) {
        if (!check_column(check, &mapping->columns[c])) {
            return false;
        }
        has_time = has_time || strcmp(mapping->columns[c].to, "time_s") == 0;
    }
    return has_time || yaml_file_reject(check->error, check->path, "columns", 1, "none of them is time_s");
}

static bool check_steps(const struct check *check, const struct mapping_constant *constant) {
    for (unsigned s = 0; s < constant->steps_count; s++) {
        const double *at = constant->steps[s].at;
        if (!isfinite(at[0]) || !isfinite(at[1]) || (s > 0 && !(at[0] > constant->steps[s - 1].at[0]))) {
            return reject(check, constant->to, "steps",
                          "number %u: steps are [time in s, value], each later than the one before", s + 1);
        }
    }
    return true;
}

static bool check_constant(const struct check *check, const struct mapping_constant *constant) {
    const char *to = constant->to;
    enum run_dimension dimension;
    if (!check_target(check, to, &dimension)) {
        return false;
    }
    if (dimension == RUN_TIME) {
        return reject(check, to, "to", "time_s cannot be a constant");
    }
    if (constant->value != NULL && constant->steps_count > 0) {
        return reject(check, to, "value", "%s has a value and steps; give one of them", to);
    }
    if (constant->unit == NULL && (constant->value != NULL || constant->steps_count > 0)) {
        return reject(check, to, "unit", "%s has a value without a unit; it is %s", to,
                      run_dimension_words(dimension));
    }
    if (constant->unit != NULL && !check_unit(check, to, constant->unit, dimension)) {
        return false;
    }
    if (constant->while_moved_m < 0.0 || (constant->while_moved_m > 0.0 && check->mapping->tip == NULL)) {
        return reject(check, to, "while_moved_m", "must be above 0 and needs the tip's position from 'tip:'");
    }
    return check_steps(check, constant);
}

static bool check_tip(const struct check *check) {
    const struct mapping_tip *tip = check->mapping->tip;
    if (tip == NULL) {
        return true;
    }
    const struct run_unit *unit = run_unit_find(tip->unit);
    if (unit == NULL || unit->dimension != RUN_LENGTH) {
        return yaml_file_reject(check->error, check->path, "tip", 1,
                                "unit: the tip's position is %s, '%s' is no unit of that",
                                run_dimension_words(RUN_LENGTH), tip->unit);
    }
    if ((tip->position == NULL) == (tip->markers_count == 0)) {
        return yaml_file_reject(check->error, check->path, "tip", 1,
                                "give either position or tip_from_markers");
    }
    const bool pose = tip->quaternion != NULL || tip->markers_count >= MARKERS_FOR_A_POSE;
    if (tip->quaternion != NULL && tip->markers_count > 0) {
        return yaml_file_reject(check->error, check->path, "quaternion", 1,
                                "the orientation comes from the markers already; take it from either");
    }
    if (tip->lever_arm_m != NULL && !pose) {
        return yaml_file_reject(check->error, check->path, "lever_arm_m", 1,
                                "needs the orientation: a quaternion or three markers");
    }
    return true;
}

static bool needs_rest(const struct mapping *mapping) {
    const struct mapping_frame *frame = mapping->frame;
    bool needed = frame != NULL && (frame->rest_is_straight || frame->rest_tip_m != NULL);
    needed = needed || (mapping->tip != NULL && mapping->tip->markers_count >= MARKERS_FOR_A_POSE);
    for (unsigned c = 0; c < mapping->columns_count; c++) {
        needed = needed || mapping->columns[c].subtract_rest;
    }
    for (unsigned c = 0; c < mapping->constants_count; c++) {
        needed = needed || mapping->constants[c].while_moved_m > 0.0;
    }
    return needed;
}

static bool check_rest(const struct check *check) {
    const struct mapping_rest *rest = check->mapping->rest;
    if (rest == NULL) {
        return !needs_rest(check->mapping) ||
               yaml_file_reject(
                   check->error, check->path, "name", 1,
                   "'rest: until_s:' is missing: subtract_rest, rest_tip_m, rest_is_straight, while_moved_m "
                   "and an orientation from markers go by the rows at rest");
    }
    return (rest->from_s >= 0.0 && rest->until_s > rest->from_s) ||
           yaml_file_reject(check->error, check->path, "until_s", 1,
                            "must lie after from_s = %g s, not at %g s", rest->from_s, rest->until_s);
}

/* The row of the rotation's matrix; false: no such axis. */
static bool parse_axis(const char *text, double row[3]) {
    const bool sound =
        strlen(text) == 2 && (text[0] == '+' || text[0] == '-') && text[1] >= 'x' && text[1] <= 'z';
    memset(row, 0, 3 * sizeof *row);
    if (sound) {
        row[text[1] - 'x'] = text[0] == '+' ? 1.0 : -1.0;
    }
    return sound;
}

static double determinant(const double m[3][3]) {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

static bool axes_matrix(const struct mapping_axes *axes, double matrix[3][3]) {
    bool sound = true;
    for (size_t k = 0; k < 3; k++) {
        sound = parse_axis(axes->direction[k], matrix[k]) && sound;
    }
    return sound && determinant((const double(*)[3])matrix) > 0.5;
}

static bool is_unit(const double quaternion[4]) {
    double copy[4];
    memcpy(copy, quaternion, sizeof copy);
    return fabs(rotation_normalise(copy) - 1.0) < UNIT_LENGTH_WITHIN;
}

static bool check_frame(const struct check *check) {
    const struct mapping_frame *frame = check->mapping->frame;
    double matrix[3][3];
    if (frame == NULL) {
        return true;
    }
    if (check->mapping->tip == NULL) {
        return yaml_file_reject(check->error, check->path, "frame", 1, "is of no use without 'tip:'");
    }
    if (frame->axes != NULL && frame->quaternion != NULL) {
        return yaml_file_reject(check->error, check->path, "frame", 1, "give either axes or quaternion");
    }
    if (frame->axes != NULL && !axes_matrix(frame->axes, matrix)) {
        return yaml_file_reject(
            check->error, check->path, "axes", 1,
            "[%s, %s, %s] is no right-handed frame: x, y and z each take one of +x -x +y -y +z -z",
            frame->axes->direction[0], frame->axes->direction[1], frame->axes->direction[2]);
    }
    if (frame->quaternion != NULL && !is_unit(frame->quaternion)) {
        return yaml_file_reject(check->error, check->path, "frame", 1, "the quaternion's length is not 1");
    }
    return true;
}

static bool check_format(const struct check *check) {
    const struct mapping *mapping = check->mapping;
    const char *delimiter = mapping->delimiter;
    if (delimiter != NULL && strcmp(delimiter, "tab") != 0 && strcmp(delimiter, "space") != 0 &&
        strlen(delimiter) != 1) {
        return yaml_file_reject(check->error, check->path, "delimiter", 1,
                                "'%s' is not one character, tab or space", delimiter);
    }
    if (mapping->header_lines != NULL && (*mapping->header_lines < 0 || *mapping->header_lines > 1000)) {
        return yaml_file_reject(check->error, check->path, "header_lines", 1,
                                "must be between 0 and 1000, not %d", *mapping->header_lines);
    }
    if (mapping->tip != NULL && mapping->tip->mount_quaternion != NULL &&
        !is_unit(mapping->tip->mount_quaternion)) {
        return yaml_file_reject(check->error, check->path, "mount_quaternion", 1, "its length is not 1");
    }
    return true;
}

static bool check_all(const struct check *check) {
    if (!check_columns(check)) {
        return false;
    }
    for (unsigned c = 0; c < check->mapping->constants_count; c++) {
        if (!check_constant(check, &check->mapping->constants[c])) {
            return false;
        }
    }
    return check_tip(check) && check_frame(check) && check_rest(check) && check_format(check);
}

struct mapping *mapping_read(const char *path, struct description_error *error) {
    struct mapping *mapping = NULL;
    if (!yaml_file_load(path, &schema, (void **)&mapping, error)) {
        return NULL;
    }
    const struct check check = {path, mapping, error};
    if (!check_all(&check)) {
        mapping_free(mapping);
        return NULL;
    }
    return mapping;
}

void mapping_free(struct mapping *mapping) {
    (void)cyaml_free(&yaml_config, &schema, mapping, 0);
}

struct source_format mapping_format(const struct mapping *mapping) {
    const char *delimiter = mapping->delimiter == NULL ? "," : mapping->delimiter;
    const bool tab = strcmp(delimiter, "tab") == 0, space = strcmp(delimiter, "space") == 0;
    return (struct source_format){.delimiter = tab     ? '\t'
                                               : space ? ' '
                                                       : delimiter[0],
                                  .header_lines = mapping->header_lines == NULL ? 1 : *mapping->header_lines,
                                  .comment = mapping->comment == NULL ? '#' : mapping->comment[0]};
}

void mapping_rotation(const struct mapping *mapping, double rotation[4]) {
    const struct mapping_frame *frame = mapping->frame;
    const double none[4] = {1.0, 0.0, 0.0, 0.0};
    double matrix[3][3];
    memcpy(rotation, none, sizeof none);
    if (frame != NULL && frame->axes != NULL && axes_matrix(frame->axes, matrix)) {
        rotation_from_rows((const double(*)[3])matrix, rotation);
    } else if (frame != NULL && frame->quaternion != NULL) {
        memcpy(rotation, frame->quaternion, sizeof none);
        (void)rotation_normalise(rotation);
    }
}
