/* Equilibria of many modules at once: the founding paper's parametric studies (Elsayed et al. 2014, figure 6) and the
 * points that its other figures need. Solved as a sweep. SI units. */
#ifndef TRIBEND_STUDY_H
#define TRIBEND_STUDY_H

#include "section/section_solver.h"
#include "sweep/sweep.h"

#define STUDY_POINTS_MAX 64
#define STUDY_SHAPES 4

/* The paper's standard geometry: 25 mm across, 65 mm long, chambers of 55 mm and radius 3.7 mm behind 1.5 mm of wall. */
#define PAPER_RADIUS_M 0.0125
#define PAPER_LENGTH_M 0.065
#define PAPER_CHAMBER_LENGTH_M 0.055
#define PAPER_CAVITY_RADIUS_M 0.0037
#define PAPER_WALL_M 0.0015

struct study_point {
    struct module_description module;
    enum section_goal goal; /* chamber 1 alone, from rest to this */
    double value;
    double x;               /* what the study varies */
    double chamber_length_m;
};

struct study_answer {
    bool found;
    struct section_state state; /* at the goal, or the greatest pressure on the way where it was not found */
    char why[256];              /* not found: why */
};

enum study_kind { STUDY_WALL, STUDY_LENGTH, STUDY_AREA, STUDY_SHAPE, STUDY_KINDS };

struct study {
    const char *name;
    const char *x_label;      /* what is varied, over the module's measure */
    const char *paper_says;   /* on pressure */
    const char *paper_adds;   /* on ballooning */
};
extern const struct study study_of[STUDY_KINDS];
extern const char *const cavity_shape_name[STUDY_SHAPES];

/* The paper's module with cavities of a shape and area (m2) behind a wall. Sectors and ring sectors open 60 degrees: the
 * paper prints neither angle. */
void study_module(enum cavity_shape shape, double area_m2, double wall_m, const struct material *material,
                  struct module_description *module);
/* The points of a study, at most STUDY_POINTS_MAX; returns how many. */
size_t study_points(enum study_kind kind, const struct material *material, double bend_rad, struct study_point *points);

struct study_options {
    void (*progress)(void *context, size_t done, size_t total); /* may be NULL */
    void *context;
    const volatile sig_atomic_t *stop;
    const char *keep_path;
};
/* Answers to all points. A point that has no equilibrium at its goal is an answer; `error` is for the sweep itself. */
enum sweep_outcome study_solve(const struct study_point *points, size_t count, const struct study_options *options,
                               struct study_answer *answers, struct description_error *error);

double study_bend_rad(const struct study_point *point, const struct study_answer *answer);
/* Projected area of the balloon seen from the side, m2: what the section grows in the bending plane, along the chamber. */
double study_balloon_area_m2(const struct study_point *point, const struct study_answer *answer);
/* Slope's sign and straightness: Pearson's correlation of y with x. */
double study_correlation(const double *x, const double *y, size_t count);

#endif
