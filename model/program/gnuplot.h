/* Pictures through the gnuplot program: a script is written to its standard input. */
#ifndef TRIBEND_GNUPLOT_H
#define TRIBEND_GNUPLOT_H

#include "program/output_file.h"

struct gnuplot {
    FILE *script;
    char path[OUTPUT_PATH_BYTES];
    char aside[OUTPUT_PATH_BYTES];
};

/* Start gnuplot with a PNG terminal of the given size in pixels; the caller writes plot commands to `script`. */
bool gnuplot_open(struct gnuplot *plot, const char *png_path, int width, int height, char *error, size_t error_bytes);
/* Wait for gnuplot, rename the picture to its place. False: no picture was left. */
bool gnuplot_close(struct gnuplot *plot, char *error, size_t error_bytes);

#endif
