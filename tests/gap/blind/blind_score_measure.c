#include "blind_score_measure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CLEAR_GAP 3.0   /* of the noise floor */
#define CONFIDENT 0.7   /* a wrong name with no more than this is a guess, stated as one */
#define WILSON_Z 1.959964

static bool is_corpus(const struct score_case *scored, const char *name) {
    return strcmp(scored->corpus, name) == 0;
}

static bool says(const struct score_case *scored, const char *verdict) {
    return scored->answered && strcmp(scored->said_verdict, verdict) == 0;
}

/* --- which cases --- */

static bool is_clear(const struct score_case *scored) {
    return scored->gap_ratio >= CLEAR_GAP;
}

static bool clear_single(const struct score_case *scored) {
    return is_corpus(scored, "single") && is_clear(scored);
}

static bool faint_single(const struct score_case *scored) {
    return is_corpus(scored, "single") && !is_clear(scored);
}

static bool clear_local(const struct score_case *scored) {
    return is_corpus(scored, "local") && is_clear(scored);
}

static bool clear_geometry(const struct score_case *scored) {
    return is_corpus(scored, "geometry") && is_clear(scored);
}

static bool clear_one_effect(const struct score_case *scored) {
    return clear_single(scored) || clear_local(scored) || clear_geometry(scored);
}

static bool clear_one_chamber(const struct score_case *scored) {
    return clear_one_effect(scored) && scored->effect[0].chamber > 0;
}

static bool is_pair(const struct score_case *scored) {
    return is_corpus(scored, "pair");
}

static bool is_unknown(const struct score_case *scored) {
    return is_corpus(scored, "unknown");
}

static bool is_nogap(const struct score_case *scored) {
    return is_corpus(scored, "nogap");
}

static bool is_recalibrate(const struct score_case *scored) {
    return is_corpus(scored, "recalibrate");
}

static bool is_ablation(const struct score_case *scored) {
    return is_corpus(scored, "ablation");
}

static bool is_confounded(const struct score_case *scored) {
    return is_corpus(scored, "confounded");
}

/* --- what is right --- */

static bool names_truth_first(const struct score_case *scored) {
    const struct score_effect *top = score_top(scored);
    return top != NULL && score_is_true(scored, top->name);
}

static bool names_wrongly(const struct score_case *scored) {
    return score_names_effects(scored) && !names_truth_first(scored);
}

static bool right_stage(const struct score_case *scored) {
    return scored->answered && strcmp(scored->said_stage, scored->effect[0].stage) == 0;
}

static bool right_chamber(const struct score_case *scored) {
    bool right = scored->answered;
    for (int c = 0; c < 3; c++) {
        right = right && scored->said_chamber[c] == (scored->effect[0].chamber == c + 1);
    }
    return right;
}

static size_t named_right(const struct score_case *scored) {
    size_t right = 0;
    for (size_t i = 0; i < scored->said_effects && score_names_effects(scored); i++) {
        right += score_is_true(scored, scored->said[i].name) ? 1 : 0;
    }
    return right;
}

static bool both_right(const struct score_case *scored) {
    return named_right(scored) == scored->effects && scored->said_effects == scored->effects;
}

static bool some_right_none_false(const struct score_case *scored) {
    return named_right(scored) > 0 && named_right(scored) == scored->said_effects;
}

static bool detects_unknown(const struct score_case *scored) {
    return says(scored, "unknown");
}

static bool says_nogap(const struct score_case *scored) {
    return says(scored, "no-gap");
}

static bool says_recalibrate(const struct score_case *scored) {
    return says(scored, "recalibrate");
}

/* With the true entry gone: unknown, a group, a relative of the same stage, or a name that is offered as a guess. */
static bool admits_ignorance(const struct score_case *scored) {
    const struct score_effect *top = score_top(scored);
    if (top == NULL) {
        return says(scored, "unknown") || says(scored, "group");
    }
    return strcmp(top->stage, scored->effect[0].stage) == 0 || top->probability <= CONFIDENT;
}

static bool says_right_group(const struct score_case *scored) {
    return says(scored, "group") && score_in_group(scored);
}

const struct score_measure score_measures[] = {
    {"top-1 effect, single, gap at least 3 x floor", 0.90, false, clear_single, names_truth_first},
    {"  right group", 0.97, false, clear_single, score_in_group},
    {"top-1 effect, single, gap 1 to 3 x floor", 0.70, false, faint_single, names_truth_first},
    {"  a wrong name there", 0.00, true, faint_single, names_wrongly},
    {"top-1 effect, local", 0.90, false, clear_local, names_truth_first},
    {"  right group", 0.97, false, clear_local, score_in_group},
    {"top-1 effect, another geometry", 0.90, false, clear_geometry, names_truth_first},
    {"  right group", 0.97, false, clear_geometry, score_in_group},
    {"locus, stage", 0.95, false, clear_one_effect, right_stage},
    {"locus, chamber, where there is one", 0.96, false, clear_one_chamber, right_chamber},
    {"pairs: both right", 0.75, false, is_pair, both_right},
    {"pairs: at least one and none false", 0.90, false, is_pair, some_right_none_false},
    {"a named effect on unknown-effect data", 0.10, true, is_unknown, score_names_effects},
    {"a named effect on no-gap data", 0.03, true, is_nogap, score_names_effects},
    {"a named effect on data to recalibrate", 0.03, true, is_recalibrate, score_names_effects},
    {"unknown detected", 0.90, false, is_unknown, detects_unknown},
    {"no gap said where there is none", 0.90, false, is_nogap, says_nogap},
    {"recalibration said where it is enough", 0.90, false, is_recalibrate, says_recalibrate},
    {"true entry removed: unknown, group or near family", 0.90, false, is_ablation, admits_ignorance},
    {"confounded: a group with the truth in it", 0.90, false, is_confounded, says_right_group},
};
const size_t score_measure_count = sizeof score_measures / sizeof score_measures[0];

/* --- numbers --- */

void score_wilson(size_t hits, size_t count, double *low, double *high) {
    const double n = (double)count, p = (double)hits / n, z2 = WILSON_Z * WILSON_Z;
    const double middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    const double half = WILSON_Z * sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n)) / (1.0 + z2 / n);
    *low = fmax(middle - half, 0.0);
    *high = fmin(middle + half, 1.0);
}

static int rising(const void *a, const void *b) {
    const double one = *(const double *)a, two = *(const double *)b;
    return (one > two) - (one < two);
}

double score_median(double *value, size_t count) {
    if (count == 0) {
        return NAN;
    }
    qsort(value, count, sizeof *value, rising);
    return 0.5 * (value[(count - 1) / 2] + value[count / 2]);
}

/* --- parameters --- */

static const struct score_parameter *parameter_of(const struct score_effect *effect, const char *name) {
    for (size_t i = 0; i < effect->parameters; i++) {
        if (strcmp(effect->parameter[i].name, name) == 0) {
            return &effect->parameter[i];
        }
    }
    return NULL;
}

/* Ratios do nothing at one: their error is relative to how far from it they are. */
static bool is_ratio(const char *name) {
    static const char *const ratios[] = {"gain", "flow_scale", "conductance_scale"};
    for (size_t i = 0; i < sizeof ratios / sizeof ratios[0]; i++) {
        if (strcmp(name, ratios[i]) == 0) {
            return true;
        }
    }
    return false;
}

static bool is_angle(const char *name) {
    return strcmp(name, "direction") == 0 || strcmp(name, "angle") == 0;
}

static double relative_error(const struct score_effect *effect, const struct score_parameter *true_one,
                             const struct score_parameter *said) {
    const bool ratio =
        is_ratio(true_one->name) || (strcmp(effect->name, "end_restraint") == 0 && strcmp(true_one->name, "fraction") == 0);
    if (is_angle(true_one->name)) { /* a direction has no size: the error in radians */
        return fabs(remainder(said->value - true_one->value, 2.0 * M_PI));
    }
    return fabs(said->value - true_one->value) / fmax(fabs(true_one->value - (ratio ? 1.0 : 0.0)), 1e-12);
}

/* A vector's error is relative to its length. */
static bool vector_error(const struct score_effect *effect, const struct score_effect *said, double *error) {
    static const char *const axes[3] = {"x", "y", "z"};
    double square = 0.0, apart = 0.0;
    for (int d = 0; d < 3; d++) {
        const struct score_parameter *true_one = parameter_of(effect, axes[d]), *one = parameter_of(said, axes[d]);
        if (true_one == NULL || one == NULL) {
            return false;
        }
        square += true_one->value * true_one->value;
        apart += (one->value - true_one->value) * (one->value - true_one->value);
    }
    *error = sqrt(apart / square);
    return true;
}

static void add_pair(const struct score_effect *effect, const struct score_effect *said, struct score_parameters *sum) {
    double length_error = 0.0;
    const bool vector = vector_error(effect, said, &length_error);
    if (vector) {
        sum->error[sum->errors++] = length_error;
    }
    for (size_t i = 0; i < effect->parameters; i++) {
        const struct score_parameter *true_one = &effect->parameter[i];
        const struct score_parameter *one = parameter_of(said, true_one->name);
        if (one == NULL || isnan(one->value)) {
            continue;
        }
        if (!vector) {
            sum->error[sum->errors++] = relative_error(effect, true_one, one);
        }
        if (!isnan(one->low) && !isnan(one->high)) {
            sum->intervals++;
            sum->covered += one->low <= true_one->value && true_one->value <= one->high ? 1 : 0;
        }
    }
}

void score_add_parameters(const struct score_case *scored, struct score_parameters *sum) {
    for (size_t i = 0; i < scored->effects && score_names_effects(scored) && is_clear(scored); i++) {
        for (size_t k = 0; k < scored->said_effects; k++) {
            if (strcmp(scored->effect[i].name, scored->said[k].name) == 0) {
                add_pair(&scored->effect[i], &scored->said[k], sum);
            }
        }
    }
}

/* --- probabilities --- */

struct claim {
    double probability;
    bool right;
};

static int surer(const void *a, const void *b) {
    return rising(&((const struct claim *)a)->probability, &((const struct claim *)b)->probability);
}

double score_calibration(const struct score_case *cases, size_t count, size_t bins, size_t *used) {
    struct claim *claim = calloc(count + 1, sizeof *claim);
    double error = 0.0;
    *used = 0;
    for (size_t i = 0; i < count && claim != NULL; i++) {
        const struct score_case *scored = &cases[i];
        if (scored->answered && scored->said_effects > 0 && !isnan(scored->said[0].probability)) {
            const bool removed = scored->removed[0] != '\0'; /* it cannot be named then */
            claim[(*used)++] =
                (struct claim){scored->said[0].probability, !removed && score_is_true(scored, scored->said[0].name)};
        }
    }
    if (claim != NULL) {
        qsort(claim, *used, sizeof *claim, surer);
    }
    for (size_t b = 0; b < bins && *used > 0; b++) {
        double apart = 0.0;
        for (size_t i = b * *used / bins; i < (b + 1) * *used / bins; i++) {
            apart += claim[i].probability - (claim[i].right ? 1.0 : 0.0);
        }
        error += fabs(apart) / (double)*used;
    }
    free(claim);
    return *used > 0 ? error : NAN;
}

bool score_failed(const struct score_case *scored) {
    bool failed = !scored->answered;
    for (size_t m = 0; m < score_measure_count; m++) {
        const struct score_measure *measure = &score_measures[m];
        const bool abstains = faint_single(scored) && !score_names_effects(scored); /* as it may */
        failed = failed || (measure->counts(scored) && measure->hit(scored) == measure->at_most && !abstains);
    }
    return failed;
}
