#include "gap/diagnosis_parts.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* A gap whose structure is below this share of the noise floor's square is none. */
#define STRUCTURE_NONE 0.3
/* Recalibration is the answer where it leaves no more than that, or this share of what was there: a thirtieth of the gap's size,
 * which the table's own errors reach. */
#define RECALIBRATED_SHARE 0.001
#define RECALIBRATED_SHARE_STRANGE 0.05 /* of another simulator, whose tip goes its own ways */
/* Catalogue effects must close this share of the structured gap, or the gap is of an unknown kind. */
#define CLOSED_LEAST 0.97
/* By several, or by one of many forms: they can bend to much that they are not. */
#define CLOSED_LEAST_BY_MANY 0.98
#define CLOSED_LEAST_IN_DOUBT 0.95 /* by one whose law is in doubt, at least */
#define FEW_PARTS 3
#define AT_BOUND 1e-4        /* share of a parameter's range */
#define SURE_ON_STRANGE 0.80 /* the same where another simulator errs in ways of its own */
/* A rival that leaves so much more of the pressures' gap is e times less believed. */
#define PRESSURE_SHARE 0.02
/* Share of its movement by which our table model may miss another simulator's tip. */
#define DOUBTFUL_CHANGE 0.1

const char *gap_verdict_name(enum gap_verdict verdict) {
    static const char *const names[GAP_VERDICT_COUNT] = {
        "no-gap", "recalibrate", "effect", "effects", "group", "unknown", "insufficient-data"};
    return names[verdict];
}

void diagnosis_warn(struct diagnosis *diagnosis, const char *format, ...) {
    va_list arguments;
    if (diagnosis->warnings < DIAGNOSIS_WARNINGS_MAX) {
        va_start(arguments, format);
        (void)vsnprintf(diagnosis->warning[diagnosis->warnings++], DIAGNOSIS_TEXT_BYTES, format, arguments);
        va_end(arguments);
    }
}

/* --- where --- */

static void locate(struct diagnosis *diagnosis) {
    diagnosis->stage = "";
    (void)snprintf(diagnosis->regime, sizeof diagnosis->regime, "whole run");
    if (diagnosis->effects == 0) {
        return;
    }
    const struct diagnosis_effect *first = &diagnosis->effect[0];
    diagnosis->stage = effect_stage_name(first->kind->stage);
    for (size_t e = 0; e < diagnosis->effects; e++) {
        const struct diagnosis_effect *effect = &diagnosis->effect[e];
        for (size_t c = 0; c < 3; c++) {
            diagnosis->chamber[c] = diagnosis->chamber[c] || effect->chamber == 0 || effect->chamber == c + 1;
        }
    }
    if (first->onset_s > 0.0) {
        (void)snprintf(diagnosis->regime, sizeof diagnosis->regime, "from %.1f s on", first->onset_s);
    }
}

/* --- verdict --- */

/* Held pressures that never move tell stiffness from nothing. Where no pressure is known, nothing is said of
 * them. */
static bool says_nothing(struct diagnosis *diagnosis, const struct search *search) {
    double most_pa = 0.0;
    for (size_t i = 0; i < search->data->runs; i++) {
        const struct gap_run *run = &search->data->run[i];
        if (!run->has_reading && !run->has_command && run->sim_pa == NULL) {
            return false;
        }
    }
    for (size_t c = 0; c < 3; c++) {
        most_pa = fmax(most_pa, diagnosis_moves_pa(search->data, c));
    }
    if (most_pa > MOVES_LEAST_PA) {
        return false;
    }
    diagnosis_warn(
        diagnosis,
        "the pressures never move by more than %.0f Pa: record steps, ramps and holds of all three chambers",
        most_pa);
    return true;
}

/* Does another simulator move in a way that our table model cannot follow? It is then likely to err smoothly,
 * as bent fields and the like do, too. */
bool diagnosis_is_strange(const struct search *search) {
    const struct replay_elsewhere *elsewhere = &search->replay.elsewhere;
    return search->data->from_simulator && elsewhere->apart_m > DOUBTFUL_CHANGE * elsewhere->moves_m;
}

/* Share of the structure that the effects must close. What a simulator errs by looks like effects of body and
 * tip, which can bend to it nearly as well as several of them together can to anything; it does not look like
 * a pressure sensor's. */
static double least_closed(const struct diagnosis *diagnosis, const struct search *search) {
    bool bends = diagnosis->effects > 1 || search->best.model.count > FEW_PARTS;
    for (size_t e = 0; e < diagnosis->effects && diagnosis_is_strange(search); e++) {
        bends = bends || diagnosis->effect[e].kind->stage != EFFECT_STAGE_PRESSURE_SENSOR;
    }
    /* one whose law real causes need not follow leaves what that makes */
    const double doubt = diagnosis->effects == 1 ? effect_doubt(diagnosis->effect[0].kind) : 0.0;
    return bends ? CLOSED_LEAST_BY_MANY : fmax(fmin(CLOSED_LEAST, 1.0 - doubt * doubt), CLOSED_LEAST_IN_DOUBT);
}

static double pressure_squares(const struct fit *fit) {
    return fit->sums.part[1][FIT_PRESSURE].square;
}

/* Belief in a kind among its rivals by what each leaves of the pressures alone. */
static double belief_by_pressures(const struct search *search, const struct diagnosis_effect *effect) {
    for (size_t r = 0; r < search->rivals_count; r++) {
        const struct rivals *rivals = &search->rivals[r];
        double least = pressure_squares(&search->best), own = 0.0, sum = 0.0;
        if (rivals->place != effect->place) {
            continue;
        }
        for (size_t i = 0; i < rivals->count; i++) {
            least = fmin(least, pressure_squares(&rivals->rival[i].fit));
        }
        const bool seen = search->best.sums.part[1][FIT_PRESSURE].noise_count > 0.0;
        const double noise = seen ? fit_noise_of(&search->best.sums, 1, FIT_PRESSURE) : 1.0;
        const double scale =
            PRESSURE_SHARE * fmax(pressure_squares(&search->recalibrated) - least, 0.0) + 4.0 * noise;
        for (size_t i = 0; i < rivals->count; i++) {
            const double belief = exp(-(pressure_squares(&rivals->rival[i].fit) - least) / scale);
            sum += belief;
            own += rivals->rival[i].kind == effect->kind ? belief : 0.0;
        }
        return sum > 0.0 ? own / sum : 0.0;
    }
    return 0.0;
}

/* Another simulator may err at the tip and yet have the right pressures: what explains these then stands, and
 * the rest is said to be unexplained. */
static bool keep_sensor_effects(struct diagnosis *diagnosis, const struct search *search) {
    const double before = fit_structure_of(&search->recalibrated.sums, 1, FIT_PRESSURE);
    const double after = fit_structure_of(&search->best.sums, 1, FIT_PRESSURE);
    size_t kept = 0;
    if (!diagnosis_is_strange(search) || before <= STRUCTURE_NONE ||
        after > fmax(STRUCTURE_NONE, (1.0 - CLOSED_LEAST) * before)) {
        return false;
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].kind->stage == EFFECT_STAGE_PRESSURE_SENSOR) {
            diagnosis->effect[kept] = diagnosis->effect[e];
            diagnosis->effect[kept].probability = belief_by_pressures(search, &diagnosis->effect[kept]);
            kept++;
        }
    }
    if (kept == 0) {
        return false;
    }
    for (size_t e = 0; e < kept; e++) {
        if (diagnosis->effect[e].probability < SURE_ON_STRANGE) { /* nothing that one could name */
            return false;
        }
    }
    diagnosis->effects = kept;
    diagnosis->group = 0;
    memset(diagnosis->chamber, 0, sizeof diagnosis->chamber);
    locate(diagnosis);
    diagnosis_warn(diagnosis,
                   "what is named explains the pressures; the tip is left with %.2g mm rms that nothing "
                   "explains, or an error of "
                   "the other simulator",
                   diagnosis->gap[1].after_effect);
    return true;
}

/* Does a size press against the end of what its effect may be? The fit then makes of it what it is not. */
static bool presses_on_bound(const struct diagnosis *diagnosis) {
    bool any = false;
    for (size_t e = 0; e < diagnosis->effects; e++) {
        const struct effect_kind *kind = diagnosis->effect[e].kind;
        for (size_t i = 0; i < kind->parameter_count; i++) {
            const struct effect_parameter *parameter = &kind->parameter[i];
            const double near = AT_BOUND * (parameter->most - parameter->least),
                         value = diagnosis->effect[e].parameter[i].value;
            const bool low = value < parameter->least + near && parameter->least < parameter->none - near;
            const bool high = value > parameter->most - near && parameter->most > parameter->none + near;
            any = any || low || high; /* with a NaN for none: neither */
        }
    }
    return any;
}

static void decide(struct diagnosis *diagnosis, const struct search *search) {
    const double before = diagnosis->structure[0], recalibrated = diagnosis->structure[1],
                 best = diagnosis->structure[2];
    if (says_nothing(diagnosis, search)) {
        diagnosis->verdict = GAP_INSUFFICIENT_DATA;
        diagnosis->effects = 0;
        diagnosis->group = 0;
        diagnosis->stage = "";
        memset(diagnosis->chamber, 0, sizeof diagnosis->chamber);
        return;
    }
    if (search->data->from_simulator && fmax(before, recalibrated) <= STRUCTURE_NONE) {
        diagnosis->verdict = GAP_NONE; /* what the search made of so little is nothing */
        diagnosis->effects = 0;
        diagnosis->group = 0;
        diagnosis->stage = "";
        memset(diagnosis->chamber, 0, sizeof diagnosis->chamber);
        return;
    }
    if (search->best.model.count == 0) {
        const double share = diagnosis_is_strange(search) ? RECALIBRATED_SHARE_STRANGE : RECALIBRATED_SHARE;
        if (fmin(before, recalibrated) > STRUCTURE_NONE && recalibrated > share * before) {
            diagnosis->verdict = GAP_UNKNOWN;
        } else {
            diagnosis->verdict =
                before > fmax(STRUCTURE_NONE, 2.0 * recalibrated) ? GAP_RECALIBRATE : GAP_NONE;
        }
        return;
    }
    const double least = least_closed(diagnosis, search);
    const bool unexplained =
        best > STRUCTURE_NONE + (1.0 - least) * recalibrated || presses_on_bound(diagnosis);
    if (unexplained && !keep_sensor_effects(diagnosis, search)) {
        diagnosis->verdict = GAP_UNKNOWN;
        return;
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].probability < (diagnosis_is_strange(search) ? SURE_ON_STRANGE : SURE)) {
            diagnosis->verdict = GAP_GROUP;
            return;
        }
    }
    diagnosis->verdict = diagnosis->effects > 1 ? GAP_EFFECTS : GAP_EFFECT;
}

bool diagnosis_conclude(struct diagnosis *diagnosis, struct search *search) {
    memset(diagnosis, 0, sizeof *diagnosis);
    if (!diagnosis_measure(diagnosis, search)) {
        return false;
    }
    diagnosis_describe_data(diagnosis, search);
    diagnosis_take_effects(diagnosis, search);
    diagnosis_believe(diagnosis, search);
    locate(diagnosis);
    decide(diagnosis, search);
    if (diagnosis->verdict == GAP_UNKNOWN) {
        diagnosis->stage = diagnosis->rest_stage;
        memcpy(diagnosis->chamber, diagnosis->rest_chamber, sizeof diagnosis->chamber);
        (void)snprintf(diagnosis->regime, sizeof diagnosis->regime, "whole run");
    } else {
        *diagnosis->description = '\0';
    }
    if (diagnosis->verdict == GAP_UNKNOWN) {
        diagnosis_find_closest(diagnosis, search);
    }
    diagnosis_doubt_floor(diagnosis, search);
    diagnosis_suggest(diagnosis);
    diagnosis_temper(diagnosis, search);
    return dependence_find(&diagnosis->dependences, search,
                           diagnosis->verdict == GAP_UNKNOWN && search->best.model.count > 0);
}
