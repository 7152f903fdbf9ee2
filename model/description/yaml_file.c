#include "description/yaml_file.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

#define LINE_BYTES 1024

/* libcyaml says what is wrong first, then where, innermost first. */
struct capture {
    char what[256];
    char where[128];
    int line;
};

static void capture_log(cyaml_log_t level, void *context, const char *format, va_list arguments) {
    struct capture *capture = context;
    char text[256];
    (void)level;
    if (capture == NULL) {
        return;
    }
    (void)vsnprintf(text, sizeof text, format, arguments);
    text[strcspn(text, "\n")] = '\0';
    const char *message = strncmp(text, "Load: ", 6) == 0 ? text + 6 : text;
    const char *line = strstr(message, "(line: ");
    if (capture->what[0] == '\0') {
        (void)snprintf(capture->what, sizeof capture->what, "%s", message);
    }
    if (line != NULL && capture->line == 0) {
        capture->line = (int)strtol(line + strlen("(line: "), NULL, 10);
        message += strspn(message, " ");
        (void)snprintf(capture->where, sizeof capture->where, "%.*s", (int)(line > message ? line - message - 1 : 0),
                       message);
    }
}

const cyaml_config_t yaml_config = {
    .log_fn = capture_log, .mem_fn = cyaml_mem, .log_level = CYAML_LOG_ERROR, .flags = CYAML_CFG_DEFAULT};

#define UNEXPECTED "Unexpected key: "

/* libcyaml names the line before an unexpected key. */
static int line_of(const struct capture *capture, const char *path) {
    char key[sizeof capture->what];
    if (strncmp(capture->what, UNEXPECTED, strlen(UNEXPECTED)) != 0) {
        return capture->line;
    }
    (void)snprintf(key, sizeof key, "%s", capture->what + strlen(UNEXPECTED));
    const int line = yaml_file_line(path, key, 1);
    return line > 0 ? line : capture->line;
}

/* --- numbers: libcyaml takes the digits that a scalar starts with and lets pass what follows --- */

struct numbers {
    const char *path;
    yaml_document_t document;
    struct description_error *error;
};

static bool is_number(enum cyaml_type type, const char *text) {
    char *end = NULL;
    errno = 0;
    if (type == CYAML_FLOAT) {
        (void)strtod(text, &end); /* an overflow gives infinity, which the checks of each file refuse */
        return end != text && *end == '\0';
    }
    if (type == CYAML_INT) {
        (void)strtoll(text, &end, 0);
    } else {
        (void)strtoull(text, &end, 0);
    }
    return end != text && *end == '\0' && errno == 0;
}

static bool check_scalar(const struct numbers *numbers, const yaml_node_t *node, enum cyaml_type type, const char *key) {
    const char *text = (const char *)node->data.scalar.value;
    if (is_number(type, text)) {
        return true;
    }
    (void)snprintf(numbers->error->text, sizeof numbers->error->text,
                   "%s:%zu: %s: '%.40s' is not a %snumber; write it alone, in SI units and without a unit", numbers->path,
                   node->start_mark.line + 1, key, text, type == CYAML_FLOAT ? "" : "whole ");
    return false;
}

static const cyaml_schema_field_t *find_field(const cyaml_schema_field_t *field, const char *key) {
    while (field->key != NULL && strcmp(field->key, key) != 0) {
        field++;
    }
    return field->key == NULL ? NULL : field;
}

/* Every scalar that the schema takes for a number; `key` is the innermost one above it. Goes as deep as the schema, which
 * does not contain itself. */
static bool check_node(struct numbers *numbers, const yaml_node_t *node, const cyaml_schema_value_t *schema, // NOLINT(misc-no-recursion)
                       const char *key) {
    const bool is_sequence = schema->type == CYAML_SEQUENCE || schema->type == CYAML_SEQUENCE_FIXED;
    bool sound = true;
    if (node == NULL) {
        return true;
    }
    if (node->type == YAML_SCALAR_NODE &&
        (schema->type == CYAML_FLOAT || schema->type == CYAML_INT || schema->type == CYAML_UINT)) {
        return check_scalar(numbers, node, schema->type, key);
    }
    if (node->type == YAML_SEQUENCE_NODE && is_sequence) {
        for (const yaml_node_item_t *item = node->data.sequence.items.start; item < node->data.sequence.items.top && sound;
             item++) {
            sound = check_node(numbers, yaml_document_get_node(&numbers->document, *item), schema->sequence.entry, key);
        }
    }
    if (node->type == YAML_MAPPING_NODE && schema->type == CYAML_MAPPING) {
        for (const yaml_node_pair_t *pair = node->data.mapping.pairs.start; pair < node->data.mapping.pairs.top && sound;
             pair++) {
            const yaml_node_t *name = yaml_document_get_node(&numbers->document, pair->key);
            const bool named = name != NULL && name->type == YAML_SCALAR_NODE;
            const char *text = named ? (const char *)name->data.scalar.value : "";
            const cyaml_schema_field_t *field = find_field(schema->mapping.fields, text);
            sound = field == NULL ||
                    check_node(numbers, yaml_document_get_node(&numbers->document, pair->value), &field->value, text);
        }
    }
    return sound;
}

/* Of a file that libcyaml has taken. */
static bool check_numbers(const char *path, const cyaml_schema_value_t *schema, struct description_error *error) {
    struct numbers numbers = {.path = path, .error = error};
    yaml_parser_t parser;
    FILE *file = fopen(path, "r");
    if (file == NULL || yaml_parser_initialize(&parser) == 0) {
        (void)snprintf(error->text, sizeof error->text, "%s: %s", path, file == NULL ? strerror(errno) : "out of memory");
        if (file != NULL) {
            (void)fclose(file);
        }
        return false;
    }
    yaml_parser_set_input_file(&parser, file);
    bool sound = yaml_parser_load(&parser, &numbers.document) != 0;
    if (sound) {
        sound = check_node(&numbers, yaml_document_get_root_node(&numbers.document), schema, "the file");
        yaml_document_delete(&numbers.document);
    } else {
        (void)snprintf(error->text, sizeof error->text, "%s:%zu: %s", path, parser.problem_mark.line + 1,
                       parser.problem != NULL ? parser.problem : "out of memory");
    }
    yaml_parser_delete(&parser);
    (void)fclose(file);
    return sound;
}

bool yaml_file_load(const char *path, const cyaml_schema_value_t *schema, void **data, struct description_error *error) {
    struct capture capture = {.what = "", .where = "", .line = 0};
    cyaml_config_t config = yaml_config;
    config.log_ctx = &capture;
    *data = NULL;
    FILE *probe = fopen(path, "r");
    if (probe == NULL) {
        (void)snprintf(error->text, sizeof error->text, "%s: %s; give the path of a YAML file or a name from tables/",
                       path, strerror(errno));
        return false;
    }
    (void)fclose(probe);
    const cyaml_err_t result = cyaml_load_file(path, &config, schema, (cyaml_data_t **)data, NULL);
    if (result == CYAML_OK && check_numbers(path, schema, error)) {
        return true;
    }
    if (result == CYAML_OK) {
        (void)cyaml_free(&yaml_config, schema, *data, 0);
        *data = NULL;
        return false;
    }
    (void)snprintf(error->text, sizeof error->text, "%s:%d: %s%s%s (%s); see tables/README.md for the keys", path,
                   line_of(&capture, path), capture.what[0] == '\0' ? cyaml_strerror(result) : capture.what,
                   capture.where[0] == '\0' ? "" : ", ", capture.where, cyaml_strerror(result));
    return false;
}

int yaml_file_line(const char *path, const char *key, int occurrence) {
    FILE *file = fopen(path, "r");
    char text[LINE_BYTES];
    int line = 0, seen = 0, found = 0;
    if (file == NULL) {
        return 0;
    }
    while (found == 0 && fgets(text, sizeof text, file) != NULL) {
        line++;
        const char *word = text + strspn(text, " -{");
        const size_t length = strlen(key);
        seen += strncmp(word, key, length) == 0 && word[length] == ':';
        found = seen == occurrence ? line : 0;
    }
    (void)fclose(file);
    return found;
}

bool yaml_file_reject(struct description_error *error, const char *path, const char *key, int occurrence,
                      const char *format, ...) {
    const int length = snprintf(error->text, sizeof error->text, "%s:%d: %s: ", path, yaml_file_line(path, key, occurrence),
                                key);
    const size_t used = length < 0 ? 0 : (size_t)length;
    va_list arguments;
    va_start(arguments, format);
    if (used < sizeof error->text) {
        (void)vsnprintf(error->text + used, sizeof error->text - used, format, arguments);
    }
    va_end(arguments);
    return false;
}
