/* A parameter set in a file, by names, and as the image that a board takes.
 *
 *     {"tribend-parameters": 1, "module": "paper-semicircle", "parameters": {"node_id": 1, "tip_gain": 0.2,
 * ...}}
 *
 * SI units, as firmware/comms/parameters.def has them. Not here: asking a board (link/can_board.h). */
#ifndef TRIBEND_PARAMETER_FILE_H
#define TRIBEND_PARAMETER_FILE_H

#include "comms/parameters.h"

struct parameter_values {
    bool given[PARAMETER_COUNT];
    uint32_t value[PARAMETER_COUNT]; /* an integer, or the bits of a float */
};

struct parameter_words {
    const char *name;
    const char *unit; /* with a space before it */
    const char *comment;
    bool holds_from_start; /* from the board's next start on, if it is saved */
};

const struct parameter_words *parameter_words(enum parameter_index parameter);
/* " kPa"; "" where it has none. */
const char *parameter_unit(enum parameter_index parameter);
/* False: there is none of this name. */
bool parameter_by_name(const char *name, enum parameter_index *parameter);
/* Of a real one the shortest decimal that is the same float. */
double parameter_number(enum parameter_index parameter, uint32_t value);
/* False: no value of this parameter's type within its bounds; `error` says which there are. */
bool parameter_from_number(enum parameter_index parameter, double number, uint32_t *value, char *error,
                           size_t error_bytes);
/* False: `error` names the file, the key and what is wrong. */
bool parameter_file_read(const char *path, struct parameter_values *values, char *error, size_t error_bytes);
/* Appears whole or not at all. */
bool parameter_file_write(const char *path, const char *module, const struct parameter_values *values,
                          char *error, size_t error_bytes);
/* The image of those that are given; returns its bytes. */
uint32_t parameter_values_image(const struct parameter_values *values, uint8_t image[PARAMETERS_IMAGE_BYTES]);

#endif
