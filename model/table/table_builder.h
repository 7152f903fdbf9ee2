/* Builds the bend table: an equilibrium at every node of a pressure grid, one sixth solved and the rest turned and
 * mirrored. The format is firmware/control/bend_table_format.h. */
#ifndef TRIBEND_TABLE_BUILDER_H
#define TRIBEND_TABLE_BUILDER_H

#include <signal.h>

#include "description/module_description.h"
#include "sweep/sweep.h"

#define TABLE_NODES_DEFAULT 17
#define TABLE_NODES_LEAST 4

struct table_build_options {
    size_t nodes;  /* on each axis, 0: the default */
    double size_m; /* of the mesh, 0: the default */
    void (*progress)(void *context, size_t done, size_t total); /* called by one thread at a time; may be NULL */
    void *context;
    const volatile sig_atomic_t *stop; /* set to give up; may be NULL */
    const char *keep_path;             /* keeps finished slabs there and goes on from them; NULL: no */
};

struct table_image {
    unsigned char *bytes;
    size_t size;
    size_t solved;         /* equilibria computed */
    size_t nodes;          /* in the whole table */
    size_t no_equilibrium; /* of the solved ones */
    size_t newton_iterations;
};

/* The image where the outcome is SWEEP_DONE (free with table_image_free()); `error` where it is SWEEP_FAILED (not symmetric,
 * no mesh, out of memory) or SWEEP_STOPPED. Under mpirun every rank calls it; rank 0 gets the image. */
enum sweep_outcome table_build(const struct module_description *module, const struct table_build_options *options,
                 struct table_image *image, struct description_error *error);
void table_image_free(struct table_image *image);
bool table_image_write(const struct table_image *image, const char *path, char *error, size_t error_bytes);

#endif
