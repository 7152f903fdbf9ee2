#include "gap/fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STEP_SHARE 0.02          /* of a parameter's scale, for differences */
#define NOMINAL_NUDGE 0.01
#define STIFFNESS_PRIOR 0.5      /* standard deviation of its logarithm: only where nothing else tells */
#define SUPPLY_PRIOR 0.2
#define DAMPING_FIRST 1e-3
#define ATTEMPTS 5
#define REBASES 4
#define MOVED_LITTLE 1e-3         /* of the nominal scales: a base tells of that exactly enough */
#define AGED_LITTLE_S 2e-4        /* .. and so long is nothing beside a valve's pulse, by which it errs */
#define ENOUGH 2e-4              /* relative change of the sum of squares that is worth no further step */

static bool acts_on_gas(const struct effect_kind *kind) {
    return effect_has(kind, EFFECT_HOOK_COMMAND) || effect_has(kind, EFFECT_HOOK_GAS);
}

static bool same_effect(const struct effect *a, const struct effect *b) {
    bool same = a->kind == b->kind && a->chamber == b->chamber && a->form == b->form && a->onset_s == b->onset_s &&
                a->latent == b->latent;
    for (size_t i = 0; same && i < a->kind->parameter_count; i++) {
        same = a->parameter[i] == b->parameter[i];
    }
    return same;
}

/* The next effect from `from` on that acts on the gas; `count`: none. */
static size_t next_on_gas(const struct gap_model *model, size_t from) {
    while (from < model->count && !acts_on_gas(model->effect[from].kind)) {
        from++;
    }
    return from;
}

/* Are the true pressures of both the same, but for the nominal parameters? */
static bool same_gas(const struct gap_model *a, const struct gap_model *b) {
    size_t i = next_on_gas(a, 0), j = next_on_gas(b, 0);
    while (i < a->count && j < b->count && same_effect(&a->effect[i], &b->effect[j])) {
        i = next_on_gas(a, i + 1);
        j = next_on_gas(b, j + 1);
    }
    return i == a->count && j == b->count;
}

static bool has_sensor_effects(const struct gap_model *model) {
    for (size_t e = 0; e < model->count; e++) {
        if (effect_has(model->effect[e].kind, EFFECT_HOOK_READING)) {
            return true;
        }
    }
    return false;
}

static bool all_have_duties(const struct replay *replay) {
    for (size_t i = 0; i < replay->runs; i++) {
        if (!replay->run[i].run->has_duty) {
            return false;
        }
    }
    return true;
}

/* --- base --- */

static void difference_of(const struct replay *replay, const struct replay_state *base, double step,
                          struct replay_state *moved) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t k = 0; k < 3 * (run->steps + 1); k++) {
            moved->pressure_pa[i][k] = (moved->pressure_pa[i][k] - base->pressure_pa[i][k]) / step;
        }
        for (size_t k = 0; k < 3 * run->blocks; k++) {
            moved->difference[i][k] = (moved->difference[i][k] - base->difference[i][k]) / step;
        }
        for (size_t k = 0; k < run->blocks; k++) {
            moved->supply[i][k] = (moved->supply[i][k] - base->supply[i][k]) / step;
        }
    }
}

/* Residuals of the base's own model, from its pressures in `state`. */
static void base_residual(const struct replay *replay, const struct gap_model *model, const struct replay_state *state,
                          double *residual) {
    replay_take_pressures(replay, state, residual);
    replay_tip(replay, model, state, false, residual);
}

/* offset = fine less coarse. */
static bool find_offsets(struct fit_base *base, const struct replay *fine) {
    const size_t all = base->replay->residuals;
    struct replay_state state;
    struct replay samples = *base->replay; /* coarse in time, with every tip sample */
    samples.coarse = false;
    base->offset[0] = malloc(2 * all * sizeof(double));
    bool sound = replay_state_open(&state, fine) && base->offset[0] != NULL;
    double *coarse = malloc(all * sizeof *coarse);
    if (sound && coarse != NULL) {
        base->offset[1] = base->offset[0] + all;
        replay_pressures(fine, &base->model, &state);
        base_residual(fine, &base->model, &state, base->offset[0]);
        memcpy(base->offset[1], base->offset[0], all * sizeof(double));
        for (size_t i = 0; i < 2; i++) {
            base_residual(i == 0 ? &samples : base->replay, &base->model, &base->state, coarse);
            for (size_t k = 0; k < all; k++) {
                base->offset[i][k] -= coarse[k];
            }
        }
    }
    sound = sound && coarse != NULL;
    free(coarse);
    replay_state_close(&state, fine);
    return sound;
}

bool fit_base_open(struct fit_base *base, const struct replay *fine, const struct replay *coarse,
                   const struct gap_model *model) {
    const struct replay *replay = coarse != NULL ? coarse : fine;
    memset(base, 0, sizeof *base);
    base->model = *model;
    base->replay = replay;
    if (!replay_state_open(&base->state, replay) || !replay_state_open(&base->moved[0], replay) ||
        !replay_state_open(&base->moved[1], replay)) {
        fit_base_close(base);
        return false;
    }
    replay_pressures(replay, model, &base->state);
    for (size_t k = 0; k < 2; k++) {
        struct gap_model moved = *model;
        *(k == 0 ? &moved.stiffness_scale : &moved.supply_scale) += NOMINAL_NUDGE;
        replay_pressures(replay, &moved, &base->moved[k]);
        difference_of(replay, &base->state, NOMINAL_NUDGE, &base->moved[k]);
    }
    if (coarse != NULL && !find_offsets(base, fine)) {
        fit_base_close(base);
        return false;
    }
    return true;
}

void fit_base_close(struct fit_base *base) {
    if (base->replay != NULL) {
        replay_state_close(&base->state, base->replay);
        replay_state_close(&base->moved[0], base->replay);
        replay_state_close(&base->moved[1], base->replay);
        free(base->offset[0]);
        memset(base, 0, sizeof *base);
    }
}

/* state = from + the base's derivatives times the changes of the nominal parameters. */
static void shift_state(const struct replay *replay, const struct fit_base *base, const struct replay_state *from,
                        const double change[2], struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t k = 0; k < 3 * (run->steps + 1); k++) {
            state->pressure_pa[i][k] = from->pressure_pa[i][k] + change[0] * base->moved[0].pressure_pa[i][k] +
                                       change[1] * base->moved[1].pressure_pa[i][k];
        }
        for (size_t k = 0; k < 3 * run->blocks; k++) {
            state->difference[i][k] = from->difference[i][k] + change[0] * base->moved[0].difference[i][k] +
                                      change[1] * base->moved[1].difference[i][k];
        }
        for (size_t k = 0; k < run->blocks; k++) {
            state->supply[i][k] = from->supply[i][k] + change[0] * base->moved[0].supply[i][k] +
                                  change[1] * base->moved[1].supply[i][k];
        }
    }
    replay_correct(replay, state);
}

static void copy_state(const struct replay *replay, const struct replay_state *from, struct replay_state *to) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        memcpy(to->pressure_pa[i], from->pressure_pa[i], 3 * (run->steps + 1) * sizeof(double));
        memcpy(to->supply[i], from->supply[i], run->blocks * sizeof(double));
    }
}

/* --- fitter --- */

bool fitter_open(struct fitter *fitter, const struct fit_base *base) {
    const struct replay *replay = base->replay;
    memset(fitter, 0, sizeof *fitter);
    fitter->replay = replay;
    fitter->base = base;
    fitter->residual = malloc(replay->residuals * sizeof(double));
    fitter->moved = malloc(replay->residuals * sizeof(double));
    fitter->jacobian = malloc(GAP_PARAMETERS_MAX * replay->residuals * sizeof(double));
    const bool sound = replay_state_open(&fitter->state, replay) && replay_state_open(&fitter->trial, replay) &&
                       fitter->residual != NULL && fitter->moved != NULL && fitter->jacobian != NULL;
    if (!sound) {
        fitter_close(fitter);
    }
    return sound;
}

void fitter_close(struct fitter *fitter) {
    if (fitter->replay != NULL) {
        replay_state_close(&fitter->state, fitter->replay);
        replay_state_close(&fitter->trial, fitter->replay);
    }
    free(fitter->residual);
    free(fitter->moved);
    free(fitter->jacobian);
    memset(fitter, 0, sizeof *fitter);
}

/* Residuals of the state; a coarse replay with what it is known to be off by. */
static void take_residuals(const struct fitter *fitter, const struct gap_model *model, const struct replay_state *state,
                           double *residual) {
    replay_take_pressures(fitter->replay, state, residual);
    replay_tip(fitter->replay, model, state, false, residual);
    const double *offset = fitter->base->offset[replay_needs_samples(fitter->replay, model) ? 0 : 1];
    for (size_t k = 0; offset != NULL && k < fitter->replay->residuals; k++) {
        residual[k] += offset[k];
    }
}

static void evaluate_into(struct fitter *fitter, const struct gap_model *model, struct replay_state *state,
                          double *residual) {
    const struct fit_base *base = fitter->base;
    const bool sensors = (has_sensor_effects(model) || has_sensor_effects(&base->model));
    if (same_gas(model, &base->model) && (!sensors || all_have_duties(fitter->replay))) {
        const double change[2] = {model->stiffness_scale - base->model.stiffness_scale,
                                  model->supply_scale - base->model.supply_scale};
        shift_state(fitter->replay, base, &base->state, change, state);
        if (sensors) {
            replay_readings(fitter->replay, model, state);
        }
    } else {
        replay_pressures(fitter->replay, model, state);
    }
    take_residuals(fitter, model, state, residual);
}

void fitter_evaluate(struct fitter *fitter, const struct gap_model *model) {
    evaluate_into(fitter, model, &fitter->state, fitter->residual);
}

static bool counts(const struct fitter *fitter, size_t k) {
    return fitter->replay->weight[k] > 0.0 && (fitter->use_all || !fitter->replay->held_out[k]);
}

static void sum_up(const struct fitter *fitter, const double *residual, struct fit_sums *sums) {
    const struct replay *replay = fitter->replay;
    memset(sums, 0, sizeof *sums);
    for (int k = 0; k < 2 * FIT_GROUPS; k++) {
        sums->part[k / FIT_GROUPS][k % FIT_GROUPS].noise_most = replay->noise_most[k % FIT_GROUPS];
    }
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        const size_t end = run->tip_at + REPLAY_TIP_CHANNELS * run->tip_blocks;
        for (size_t k = run->pressure_at; k < end; k++) {
            if (replay->weight[k] > 0.0) {
                const int out = replay->held_out[k];
                struct fit_part *part = &sums->part[out][k < run->tip_at ? FIT_PRESSURE : FIT_TIP];
                part->square += residual[k] * residual[k];
                part->count += 1.0;
                const size_t stride = k < run->supply_at ? 3 : k < run->tip_at ? 1 : REPLAY_TIP_CHANNELS;
                const size_t start = k < run->supply_at ? run->pressure_at : k < run->tip_at ? run->supply_at : run->tip_at;
                if (k >= start + stride && replay->weight[k - stride] > 0.0 && replay->held_out[k - stride] == out && !replay->apart[k]) {
                    const double step = residual[k] - residual[k - stride];
                    part->noise += 0.5 * step * step + replay->lasting[k];
                    part->noise_count += 1.0;
                }
            }
        }
    }
}

double fit_squares(const struct fit_sums *sums, int held_out) {
    return sums->part[held_out][FIT_PRESSURE].square + sums->part[held_out][FIT_TIP].square;
}

double fit_count(const struct fit_sums *sums, int held_out) {
    return sums->part[held_out][FIT_PRESSURE].count + sums->part[held_out][FIT_TIP].count;
}

double fit_mean_square(const struct fit_sums *sums, int held_out) {
    const double count = fit_count(sums, held_out);
    return count > 0.0 ? fit_squares(sums, held_out) / count : 0.0;
}

double fit_noise_of(const struct fit_sums *sums, int held_out, enum fit_group group) {
    const struct fit_part *part = &sums->part[held_out][group];
    return part->noise_count > 0.0 ? fmin(part->noise / part->noise_count, part->noise_most) : 0.0;
}

double fit_structure_of(const struct fit_sums *sums, int held_out, enum fit_group group) {
    const struct fit_part *part = &sums->part[held_out][group];
    return part->count > 0.0 ? fmax(part->square / part->count - fit_noise_of(sums, held_out, group), 0.0) : 0.0;
}

double fit_structure(const struct fit_sums *sums, int held_out) {
    double sum = 0.0;
    for (int group = 0; group < FIT_GROUPS; group++) {
        sum += fit_structure_of(sums, held_out, (enum fit_group)group) * sums->part[held_out][group].count;
    }
    const double count = fit_count(sums, held_out);
    return count > 0.0 ? sum / count : 0.0;
}

static double cost_of(const struct fitter *fitter, const struct gap_model *model, const double *residual) {
    double sum = pow(log(model->stiffness_scale) / STIFFNESS_PRIOR, 2.0) +
                 pow((model->supply_scale - 1.0) / SUPPLY_PRIOR, 2.0);
    for (size_t k = 0; k < fitter->replay->residuals; k++) {
        sum += counts(fitter, k) ? residual[k] * residual[k] : 0.0;
    }
    return sum;
}

/* Column of the Jacobian: the nominal parameters move the state by the base's derivatives. */
static void fill_column(struct fitter *fitter, struct gap_model *model, const struct gap_parameter *parameter,
                        size_t index, double *column) {
    const double kept = *parameter->value;
    double step = index < 2 ? NOMINAL_NUDGE : STEP_SHARE * parameter->scale;
    step = kept + step > parameter->most ? -step : step;
    const bool nominal = index < 2;
    const bool upstream = index >= 2 && gap_effect_upstream(model->effect[parameter->effect].kind);
    *parameter->value = kept + step;
    if (nominal) {
        const double change[2] = {index == 0 ? step : 0.0, index == 1 ? step : 0.0};
        shift_state(fitter->replay, fitter->base, &fitter->state, change, &fitter->trial);
    } else if (upstream && !acts_on_gas(model->effect[parameter->effect].kind) && all_have_duties(fitter->replay)) {
        copy_state(fitter->replay, &fitter->state, &fitter->trial);
        replay_readings(fitter->replay, model, &fitter->trial);
    } else if (upstream) {
        replay_pressures(fitter->replay, model, &fitter->trial);
    }
    const struct replay_state *state = nominal || upstream ? &fitter->trial : &fitter->state;
    take_residuals(fitter, model, state, fitter->moved);
    *parameter->value = kept;
    for (size_t k = 0; k < fitter->replay->residuals; k++) {
        column[k] = (fitter->moved[k] - fitter->residual[k]) / step;
    }
}

struct normal {
    size_t size;
    double matrix[GAP_PARAMETERS_MAX][GAP_PARAMETERS_MAX];
    double gradient[GAP_PARAMETERS_MAX];
};

static void set_normal(const struct fitter *fitter, const struct gap_model *model, size_t size, struct normal *normal) {
    const size_t all = fitter->replay->residuals;
    memset(normal, 0, sizeof *normal);
    normal->size = size;
    for (size_t k = 0; k < all; k++) {
        if (!counts(fitter, k)) {
            continue;
        }
        for (size_t i = 0; i < size; i++) {
            const double slope = fitter->jacobian[i * all + k];
            normal->gradient[i] += slope * fitter->residual[k];
            for (size_t j = 0; j <= i; j++) {
                normal->matrix[i][j] += slope * fitter->jacobian[j * all + k];
            }
        }
    }
    const double log_slope = 1.0 / (model->stiffness_scale * STIFFNESS_PRIOR);
    normal->matrix[0][0] += log_slope * log_slope;
    normal->gradient[0] += log_slope * log(model->stiffness_scale) / STIFFNESS_PRIOR;
    normal->matrix[1][1] += 1.0 / (SUPPLY_PRIOR * SUPPLY_PRIOR);
    normal->gradient[1] += (model->supply_scale - 1.0) / (SUPPLY_PRIOR * SUPPLY_PRIOR);
    for (size_t i = 0; i < size; i++) {
        for (size_t j = i + 1; j < size; j++) {
            normal->matrix[i][j] = normal->matrix[j][i];
        }
    }
}

/* Cholesky's method on the free parameters; the others do not move. False: not positive definite. */
static bool solve(const struct normal *normal, const bool *is_free, double damping, double *step) {
    double l[GAP_PARAMETERS_MAX][GAP_PARAMETERS_MAX];
    const size_t n = normal->size;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = is_free[i] && is_free[j] ? normal->matrix[i][j] : (i == j ? 1.0 : 0.0);
            sum += i == j && is_free[i] ? damping * normal->matrix[i][i] + 1e-12 : 0.0;
            for (size_t k = 0; k < j; k++) {
                sum -= l[i][k] * l[j][k];
            }
            if (i == j && !(sum > 0.0)) {
                return false;
            }
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        double sum = is_free[i] ? -normal->gradient[i] : 0.0;
        for (size_t k = 0; k < i; k++) {
            sum -= l[i][k] * step[k];
        }
        step[i] = sum / l[i][i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) {
            step[i] -= l[k][i] * step[k];
        }
        step[i] /= l[i][i];
    }
    return true;
}

static void set_covariance(const struct normal *normal, const bool *is_free, struct fit *fit) {
    for (size_t i = 0; i < normal->size; i++) {
        struct normal unit = *normal;
        double column[GAP_PARAMETERS_MAX];
        for (size_t j = 0; j < normal->size; j++) {
            unit.gradient[j] = i == j ? -1.0 : 0.0;
        }
        const bool solved = is_free[i] && solve(&unit, is_free, 0.0, column);
        for (size_t j = 0; j < normal->size; j++) {
            fit->covariance[j][i] = solved ? column[j] : 0.0;
        }
    }
}

/* At a bound and pushed outward, or not to be fitted: fixed. */
static void find_free(const struct gap_parameter *parameter, const struct normal *normal, bool fit_nominal, bool *is_free) {
    for (size_t i = 0; i < normal->size; i++) {
        const double value = *parameter[i].value;
        const bool low = !parameter[i].turns && value <= parameter[i].least && normal->gradient[i] > 0.0;
        const bool high = !parameter[i].turns && value >= parameter[i].most && normal->gradient[i] < 0.0;
        is_free[i] = !low && !high && (i >= 2 || fit_nominal) && normal->matrix[i][i] > 0.0;
    }
}

static void take_step(const struct gap_parameter *parameter, size_t count, const double *step) {
    for (size_t i = 0; i < count; i++) {
        const double value = *parameter[i].value + step[i], turn = parameter[i].most - parameter[i].least;
        *parameter[i].value = parameter[i].turns ? value - turn * floor((value - parameter[i].least) / turn)
                                                 : fmin(fmax(value, parameter[i].least), parameter[i].most);
    }
}

void fitter_linear(struct fitter *fitter, const struct fit_base *base, const double *base_residual,
                   const struct effect *effect, double gain[4]) {
    struct gap_model model = base->model;
    const struct replay *replay = fitter->replay;
    double product[4] = {0.0}, square[4] = {0.0};
    model.effect[model.count++] = *effect;
    evaluate_into(fitter, &model, &fitter->trial, fitter->moved);
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t k = run->pressure_at; k < run->supply_at; k++) {
            if (counts(fitter, k)) {
                const double change = fitter->moved[k] - base_residual[k];
                const size_t c = 1 + (k - run->pressure_at) % 3;
                product[c] -= change * base_residual[k];
                square[c] += change * change;
            }
        }
    }
    product[0] = product[1] + product[2] + product[3];
    square[0] = square[1] + square[2] + square[3];
    for (size_t c = 0; c < 4; c++) {
        gain[c] = square[c] > 0.0 ? product[c] * fabs(product[c]) / square[c] : 0.0;
    }
}

double fitter_gain(struct fitter *fitter, const struct gap_model *model, double *share) {
    double product = 0.0, square = 0.0;
    evaluate_into(fitter, model, &fitter->trial, fitter->moved);
    for (size_t k = 0; k < fitter->replay->residuals; k++) {
        const double change = counts(fitter, k) ? fitter->moved[k] - fitter->residual[k] : 0.0;
        product -= change * fitter->residual[k];
        square += change * change;
    }
    *share = square > 0.0 ? product / square : 0.0;
    return *share * fabs(product);
}

void fitter_run(struct fitter *fitter, struct fit *fit, int rounds, bool fit_nominal) {
    struct gap_parameter parameter[GAP_PARAMETERS_MAX];
    struct gap_model *model = &fit->model;
    const size_t count = gap_model_parameters(model, parameter), all = fitter->replay->residuals;
    double damping = DAMPING_FIRST;
    struct normal normal = {0};
    bool is_free[GAP_PARAMETERS_MAX];
    fit->parameters = count;
    fitter_evaluate(fitter, model);
    fit->evaluations++;
    double cost = cost_of(fitter, model, fitter->residual);
    for (int round = 0; round <= rounds && (round < rounds || fitter->wants_covariance); round++) {
        for (size_t i = fit_nominal ? 0 : 2; i < count; i++) {
            fill_column(fitter, model, &parameter[i], i, fitter->jacobian + i * all);
            fit->evaluations++;
        }
        if (!fit_nominal) {
            memset(fitter->jacobian, 0, 2 * all * sizeof(double));
        }
        set_normal(fitter, model, count, &normal);
        find_free(parameter, &normal, fit_nominal, is_free);
        if (round == rounds) {
            break;
        }
        bool better = false;
        double gain = 0.0;
        for (int attempt = 0; attempt < ATTEMPTS && !better; attempt++) {
            double step[GAP_PARAMETERS_MAX];
            const struct gap_model kept = *model;
            if (solve(&normal, is_free, damping, step)) {
                take_step(parameter, count, step);
                evaluate_into(fitter, model, &fitter->trial, fitter->moved);
                fit->evaluations++;
                const double trial = cost_of(fitter, model, fitter->moved);
                better = trial < cost;
                gain = better ? (cost - trial) / fmax(cost, 1e-12) : 0.0;
                cost = better ? trial : cost;
            }
            damping *= better ? 0.2 : 8.0;
            if (!better) {
                *model = kept;
            } else {
                const struct replay_state swap = fitter->state;
                double *const residual = fitter->residual;
                fitter->state = fitter->trial;
                fitter->trial = swap;
                fitter->residual = fitter->moved;
                fitter->moved = residual;
            }
        }
        if (!better || gain < ENOUGH) {
            rounds = round + 1; /* once more, for the Jacobian where it ended */
        }
    }
    if (fitter->wants_covariance) {
        set_covariance(&normal, is_free, fit);
    }
    sum_up(fitter, fitter->residual, &fit->sums);
    fit->sound = isfinite(cost);
}

static double age_of(const struct gap_model *model) {
    return effects_age_s(model->effect, model->count, INFINITY);
}

bool fit_rebased(const struct replay *fine, const struct replay *coarse, struct fit *fit, int rounds) {
    bool sound = true, moved = true;
    for (int i = 0; i < REBASES && sound && moved; i++) {
        struct fit_base base;
        struct fitter fitter;
        sound = fit_base_open(&base, fine, coarse, &fit->model);
        if (!sound) {
            break;
        }
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter_run(&fitter, fit, rounds, true);
            fitter_close(&fitter);
        }
        moved = fabs(fit->model.stiffness_scale - base.model.stiffness_scale) > MOVED_LITTLE ||
                fabs(fit->model.supply_scale - base.model.supply_scale) > MOVED_LITTLE ||
                fabs(age_of(&fit->model) - age_of(&base.model)) > AGED_LITTLE_S;
        fit_base_close(&base);
    }
    return sound;
}
