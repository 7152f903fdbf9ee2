/* Fitting a model's parameters to the residuals that are not held out: Levenberg and Marquardt's method within bounds.
 *
 * Replaying the gas is what costs. So a base keeps the replayed pressures of one model with how they move with its two
 * nominal parameters; models whose effects all lie downstream of the pressures are evaluated from it alone, and others
 * take the nominal columns of their Jacobian from it. */
#ifndef TRIBEND_GAP_FIT_H
#define TRIBEND_GAP_FIT_H

#include "gap/replay.h"

struct fit_base {
    struct gap_model model; /* its downstream effects do not matter here */
    const struct replay *replay;
    double *offset[2];      /* [residuals] fine less coarse, of the base: with every tip sample, with one a block; NULL: fine */
    struct replay_state state;
    struct replay_state moved[2]; /* derivatives by stiffness and supply scale */
};

/* Sums over whitened residuals of one group. */
struct fit_part {
    double square;
    double count;
    double noise; /* half the squares of differences of neighbouring blocks, and how many */
    double noise_count;
    double noise_most; /* that these may make of a mean square, see replay.h */
};

/* [0] fitted, [1] held out. */
struct fit_sums {
    struct fit_part part[2][FIT_GROUPS];
};

struct fit {
    struct gap_model model;
    struct fit_sums sums;
    double covariance[GAP_PARAMETERS_MAX][GAP_PARAMETERS_MAX]; /* of the parameters, residuals taken as independent */
    size_t parameters;
    size_t evaluations;
    bool sound;
};

/* A thread's room to work in. */
struct fitter {
    const struct replay *replay;
    const struct fit_base *base;
    struct replay_state state;
    struct replay_state trial;
    double *residual;
    double *moved;
    double *jacobian; /* [GAP_PARAMETERS_MAX][residuals] */
    bool use_all;          /* fit to the held-out residuals too */
    bool wants_covariance; /* else fit->covariance stays zero, which saves a Jacobian */
};

/* `coarse` NULL: fits replay finely. Otherwise they replay coarsely, and the base says by how much that errs. */
bool fit_base_open(struct fit_base *base, const struct replay *fine, const struct replay *coarse,
                   const struct gap_model *model);
void fit_base_close(struct fit_base *base);
bool fitter_open(struct fitter *fitter, const struct fit_base *base);
void fitter_close(struct fitter *fitter);

/* Residuals of a model into fitter->residual (and its pressures into fitter->state). */
void fitter_evaluate(struct fitter *fitter, const struct gap_model *model);
/* At most `rounds` steps from fit->model. `fit_nominal`: stiffness and supply move too. */
void fitter_run(struct fitter *fitter, struct fit *fit, int rounds, bool fit_nominal);
/* The same from bases of its own, as often as the nominal parameters or the tip's age move so far that a base no longer tells of
 * them. False: out of memory. */
bool fit_rebased(const struct replay *fine, const struct replay *coarse, struct fit *fit, int rounds);
/* By how much pressure residuals would shrink, to first order, were the effect added to the base on all chambers [0] or on
 * one [1..3] at some size; negative where only the opposite effect would help. */
void fitter_linear(struct fitter *fitter, const struct fit_base *base, const double *base_residual,
                   const struct effect *effect, double gain[4]);
/* By how much the squares that are fitted would shrink from the model last evaluated, to first order, were its change to `model`
 * taken `share` times, which is set to what does best. */
double fitter_gain(struct fitter *fitter, const struct gap_model *model, double *share);
/* Squares over pressure and tip, fitted or held out; how many; and their mean. */
double fit_squares(const struct fit_sums *sums, int held_out);
double fit_count(const struct fit_sums *sums, int held_out);
double fit_mean_square(const struct fit_sums *sums, int held_out);
/* Of one group: what noise alone makes of its mean square (von Neumann 1941), at most noise_most. */
double fit_noise_of(const struct fit_sums *sums, int held_out, enum fit_group group);
/* .. and its mean square less that, not below zero: what is left to explain. */
double fit_structure_of(const struct fit_sums *sums, int held_out, enum fit_group group);
/* The same of both, by their counts. */
double fit_structure(const struct fit_sums *sums, int held_out);

#endif
