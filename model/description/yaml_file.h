/* Loading a YAML file through libcyaml with an error that names file, line and key. Internal to model/description. */
#ifndef TRIBEND_YAML_FILE_H
#define TRIBEND_YAML_FILE_H

#include <cyaml/cyaml.h>

#include "description/module_description.h"

extern const cyaml_config_t yaml_config;

/* A number followed by anything else, such as its unit, is refused. False: `error` is filled. The caller frees `*data` with cyaml_free(&yaml_config, schema, *data, 0). */
bool yaml_file_load(const char *path, const cyaml_schema_value_t *schema, void **data, struct description_error *error);
/* Line of the `occurrence`-th line (from 1) whose first word is `key:`, 0 when there is none. */
int yaml_file_line(const char *path, const char *key, int occurrence);
/* "FILE:LINE: KEY: message" for a value that the schema lets pass but that makes no sense; the line is that of the
 * `occurrence`-th (from 1) mention of the key. Returns false, for `return yaml_file_reject(...)`. */
bool yaml_file_reject(struct description_error *error, const char *path, const char *key, int occurrence,
                      const char *format, ...) __attribute__((format(printf, 5, 6)));

#endif
