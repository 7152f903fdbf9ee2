#include "description/yaml_file.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
    if (result == CYAML_OK) {
        return true;
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
