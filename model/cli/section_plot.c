#include "cli/section_plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/gnuplot.h"
#include "section/section_mesh.h"

#define DEGREES (180.0 / M_PI)

static const size_t contour[6] = {0, 3, 1, 4, 2, 5}; /* corners and mid-sides in turn */

static void draw_triangles(FILE *script, const struct section_mesh *mesh, const double *position_m,
                           const double *stretch) {
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        fprintf(script, "set object %zu polygon", t + 1);
        for (size_t k = 0; k <= 6; k++) {
            const double *at = &position_m[2 * mesh->triangle[t][contour[k % 6]]];
            fprintf(script, "%s %.4f,%.4f", k == 0 ? " from" : " to", 1e3 * at[0], 1e3 * at[1]);
        }
        fprintf(script, " fillcolor palette cb %.4f fillstyle solid 1.0 border lc rgb '#404040' lw 0.4\n",
                stretch[t]);
    }
}

static void draw_rest(FILE *script, const struct section_mesh *mesh) {
    for (size_t e = 0; e < mesh->edge_count; e++) {
        const size_t order[3] = {mesh->edge[e].node[0], mesh->edge[e].node[2], mesh->edge[e].node[1]};
        for (size_t k = 0; k < 3; k++) {
            fprintf(script, "%.4f %.4f\n", 1e3 * mesh->position_m[2 * order[k]],
                    1e3 * mesh->position_m[2 * order[k] + 1]);
        }
        fputs("\n", script);
    }
    fputs("e\n", script);
}

static double extent_mm(const struct section_mesh *mesh, const double *position_m) {
    double most = 0.0;
    for (size_t i = 0; i < 2 * mesh->node_count; i++) {
        most = fmax(most, fabs(1e3 * position_m[i]));
    }
    return 1.08 * most;
}

bool section_plot(const char *png_path, const struct module_description *module, const struct section_mesh *mesh,
                  struct section_solver *solver, char *error, size_t error_bytes) {
    struct section_state state;
    struct gnuplot plot = {.script = NULL};
    memset(&state, 0, sizeof state);
    double *position_m = calloc(2 * mesh->node_count, sizeof(double));
    double *stretch = calloc(mesh->triangle_count, sizeof(double));
    bool drawn = position_m != NULL && stretch != NULL;
    if (!drawn) {
        (void)snprintf(error, error_bytes, "out of memory for the picture");
    } else {
        section_solver_state(solver, &state);
        section_solver_field(solver, position_m, stretch);
        drawn = gnuplot_open(&plot, png_path, 1000, 900, error, error_bytes);
    }
    if (drawn) {
        const double limit = extent_mm(mesh, position_m);
        const double bend = hypot(state.curvature_x_1pm, state.curvature_y_1pm) *
                            module->chamber_length_m * DEGREES;
        fprintf(plot.script,
                "set title \"Deformed section of %s, %s\\n%.2f, %.2f, %.2f kPa in chambers 1, 2, 3: bend %.1f deg\"\n"
                "set size ratio -1\nset grid\nset xrange [%.3f:%.3f]\nset yrange [%.3f:%.3f]\n"
                "set xlabel 'x / mm (through chamber 1)'\nset ylabel 'y / mm'\n"
                "set cblabel 'greatest principal stretch of the element / 1'\nset cbrange [1:%.4f]\n"
                "set palette defined (0 '#f7fbff', 0.35 '#9ecae1', 0.7 '#fdae6b', 1 '#cb181d')\n",
                module->name, module->material.name, 1e-3 * state.pressure_pa[0], 1e-3 * state.pressure_pa[1],
                1e-3 * state.pressure_pa[2], bend, -limit, limit, -limit, limit, state.stretch_max);
        draw_triangles(plot.script, mesh, position_m, stretch);
        /* the palette's colour box needs one plot element with a palette colour */
        fputs("plot '-' with lines dashtype 2 lw 1.5 lc rgb '#202020' title 'undeformed walls', "
              "'-' using 1:2:3 with points pt 7 ps 0 palette notitle\n",
              plot.script);
        draw_rest(plot.script, mesh);
        fputs("0 0 1\ne\n", plot.script);
        drawn = gnuplot_close(&plot, error, error_bytes);
    }
    free(position_m);
    free(stretch);
    return drawn;
}
