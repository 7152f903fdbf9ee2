#include "cli/parameter_file.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "control/crc32.h"
#include "messages/message_words.h"
#include "program/output_file.h"

#define FORMAT_KEY "tribend-parameters"

enum moment { VENTED, ANY_TIME, START };
static const struct parameter_words words[PARAMETER_COUNT] = {
#define PARAMETER(id, name, type, member, unit, least, most, when, comment)                                  \
    {#name, " " unit, comment, (when) == START},
#include "comms/parameters.def"
};

const struct parameter_words *parameter_words(enum parameter_index parameter) {
    return &words[parameter];
}

const char *parameter_unit(enum parameter_index parameter) {
    return strcmp(words[parameter].unit, " 1") == 0 ? "" : words[parameter].unit;
}

bool parameter_by_name(const char *name, enum parameter_index *parameter) {
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT; p++) {
        if (strcmp(words[p].name, name) == 0) {
            *parameter = (enum parameter_index)p;
            return true;
        }
    }
    return false;
}

double parameter_number(enum parameter_index parameter, uint32_t value) {
    float real = 0.0f;
    memcpy(&real, &value, sizeof real);
    return parameter_row(parameter)->type == PARAMETER_TYPE_REAL ? message_decimal(real) : (double)value;
}

bool parameter_from_number(enum parameter_index parameter, double number, uint32_t *value, char *error,
                           size_t error_bytes) {
    const struct parameter_row *row = parameter_row(parameter);
    const bool is_real = row->type == PARAMETER_TYPE_REAL;
    const double least = is_real ? (double)row->least : (double)row->least_whole;
    const double most = is_real ? (double)row->most : (double)row->most_whole;
    const float real = (float)number;
    if (!((is_real ? (double)real : number) >= least && (is_real ? (double)real : number) <= most) ||
        (!is_real && number != floor(number))) {
        (void)snprintf(error, error_bytes, "%s: %.9g is no %snumber from %.9g to %.9g%s",
                       words[parameter].name, number, is_real ? "" : "whole ", least, most,
                       parameter_unit(parameter));
        return false;
    }
    if (is_real) {
        memcpy(value, &real, sizeof real);
    } else {
        *value = (uint32_t)number;
    }
    return true;
}

/* --- files */

static bool take_values(const char *path, json_t *parameters, struct parameter_values *values, char *error,
                        size_t error_bytes) {
    const char *name = NULL;
    json_t *number = NULL;
    char what[256];
    json_object_foreach(parameters, name, number) {
        enum parameter_index p;
        if (!parameter_by_name(name, &p)) {
            (void)snprintf(error, error_bytes, "%s: parameters: there is no '%s' (tribend params list)", path,
                           name);
            return false;
        }
        if (!json_is_number(number)) {
            (void)snprintf(error, error_bytes, "%s: parameters: %s is no number", path, name);
            return false;
        }
        if (!parameter_from_number(p, json_number_value(number), &values->value[p], what, sizeof what)) {
            (void)snprintf(error, error_bytes, "%s: parameters: %s", path, what);
            return false;
        }
        values->given[p] = true;
    }
    return true;
}

bool parameter_file_read(const char *path, struct parameter_values *values, char *error, size_t error_bytes) {
    json_error_t wrong;
    memset(values, 0, sizeof *values);
    json_t *root = json_load_file(path, JSON_REJECT_DUPLICATES, &wrong);
    if (root == NULL) {
        (void)snprintf(error, error_bytes, "%s:%d: %s", path, wrong.line, wrong.text);
        return false;
    }
    json_t *parameters = json_object_get(root, "parameters");
    const json_t *version = json_object_get(root, FORMAT_KEY);
    bool sound = json_is_integer(version) && json_integer_value(version) == (json_int_t)PARAMETERS_VERSION;
    if (!sound || !json_is_object(parameters)) {
        (void)snprintf(error, error_bytes,
                       "%s: no parameters of this version: it wants \"" FORMAT_KEY
                       "\": %u and an object \"parameters\" "
                       "(tribend params backup writes one)",
                       path, PARAMETERS_VERSION);
        sound = false;
    }
    sound = sound && take_values(path, parameters, values, error, error_bytes);
    json_decref(root);
    return sound;
}

bool parameter_file_write(const char *path, const char *module, const struct parameter_values *values,
                          char *error, size_t error_bytes) {
    struct output_file file;
    const char *separator = "";
    if (!output_file_open(&file, path, error, error_bytes)) {
        return false;
    }
    fprintf(file.stream, "{\"" FORMAT_KEY "\": %u,\n \"module\": \"%s\",\n \"parameters\": {",
            PARAMETERS_VERSION, module);
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT; p++) {
        if (values->given[p]) {
            fprintf(file.stream, "%s\n    \"%s\": %.9g", separator, words[p].name,
                    parameter_number((enum parameter_index)p, values->value[p]));
            separator = ",";
        }
    }
    fputs("\n }}\n", file.stream);
    return output_file_commit(&file, error, error_bytes);
}

/* --- images */

static void put_record(uint8_t *record, uint32_t id, uint32_t value) {
    memset(record, 0, PARAMETERS_RECORD_BYTES);
    record[0] = (uint8_t)(id & 0xffu);
    record[1] = (uint8_t)(id >> 8);
    for (uint32_t i = 0; i < 4u; i++) {
        record[4u + i] = (uint8_t)(value >> (8u * i));
    }
}

uint32_t parameter_values_image(const struct parameter_values *values,
                                uint8_t image[PARAMETERS_IMAGE_BYTES]) {
    uint8_t *records = image + PARAMETERS_IMAGE_HEADER_BYTES;
    uint32_t count = 0;
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT; p++) {
        if (values->given[p]) {
            put_record(records + count++ * PARAMETERS_RECORD_BYTES,
                       parameter_row((enum parameter_index)p)->id, values->value[p]);
        }
    }
    parameters_seal(image, count, 0u, crc32_update(0u, records, count * PARAMETERS_RECORD_BYTES));
    return PARAMETERS_IMAGE_HEADER_BYTES + count * PARAMETERS_RECORD_BYTES;
}
