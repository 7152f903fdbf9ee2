/* Drawing a section and meshing it with gmsh (OpenCASCADE kernel). Internal to model/section. Lengths in m. */
#ifndef TRIBEND_SECTION_SKETCH_H
#define TRIBEND_SECTION_SKETCH_H

#include "section/section_mesh.h"

#define SECTION_CAVITIES_MAX (MODULE_CHAMBERS * MODULE_CAVITIES_MAX)

/* The section's parts, flat. */
struct section_plan {
    double outer_radius_m;
    double bore_radius_m; /* 0: solid */
    size_t cavity_count;
    struct cavity cavity[SECTION_CAVITIES_MAX];
    int chamber[SECTION_CAVITIES_MAX]; /* of each cavity */
    size_t layer_count;
    double layer_inner_m[MODULE_LAYERS_MAX];
    double layer_outer_m[MODULE_LAYERS_MAX];
    double size_m; /* element edge at the cavities' walls */
    bool plain_corners; /* no finer elements at the cavities' corners */
};

/* A drawing in gmsh's OpenCASCADE kernel; `failed` collects the errors of every call. */
struct section_sketch {
    int failed;
    int threads; /* OpenMP's setting, which gmsh overwrites for the whole program */
};
void section_sketch_begin(struct section_sketch *sketch);
void section_sketch_end(const struct section_sketch *sketch);
/* The cavity as a plane surface; its tag. */
int section_sketch_cavity(struct section_sketch *sketch, const struct cavity *cavity);
/* Element size at a point, for gmsh's size callback; `plan` is a struct section_plan. */
double section_sketch_size(int dimension, int tag, double x, double y, double z, void *plan);

/* Triangles of the whole section, or of the half-wedge from 0 to 60 degrees: positions and triangles only, the rest of
 * the mesh is empty. NULL where gmsh fails or memory ends. */
struct section_mesh *section_sketch_mesh(const struct section_plan *plan, bool half_wedge);

#endif
