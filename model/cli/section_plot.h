/* A picture of the deformed section with its mesh, coloured by the greatest principal stretch. */
#ifndef TRIBEND_SECTION_PLOT_H
#define TRIBEND_SECTION_PLOT_H

#include "section/section_solver.h"

/* As the solver left it, into a PNG file. False: `error` says why there is none. */
bool section_plot(const char *png_path, const struct module_description *module, const struct section_mesh *mesh,
                  struct section_solver *solver, char *error, size_t error_bytes);

#endif
