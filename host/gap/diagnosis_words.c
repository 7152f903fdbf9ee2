#include "gap/diagnosis_parts.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gap/baseline.h"

#define DEGREES (180.0 / M_PI)
#define FLOOR_DOUBTFUL 10.0 /* neighbours differ by that many times the sensor's noise */

/* Effects that cannot act on another simulator's outputs, those with the same reason in one note. */
static void describe_untried(struct diagnosis *diagnosis, const struct gap_data *data) {
    const size_t kinds = effect_kind_count();
    for (size_t i = 0; i < kinds; i++) {
        const char *reason = gap_baseline_why_not(data, effect_kind_at(i));
        char names[DIAGNOSIS_TEXT_BYTES] = "";
        bool first = reason != NULL;
        size_t used = 0;
        for (size_t j = 0; j < kinds && first; j++) {
            const char *other = gap_baseline_why_not(data, effect_kind_at(j));
            const bool same = other != NULL && strcmp(other, reason) == 0;
            first = !(same && j < i);
            if (same && used < sizeof names) {
                used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", used > 0 ? ", " : "",
                                         effect_kind_at(j)->name);
            }
        }
        if (first) {
            diagnosis_warn(diagnosis, "not tried: %s; %s", names, reason);
        }
    }
}

static void describe_baseline(struct diagnosis *diagnosis, const struct search *search) {
    const struct gap_data *data = search->data;
    const struct gap_run *run = &data->run[0];
    const struct replay_elsewhere *elsewhere = &search->replay.elsewhere;
    size_t rows = 0, tips = 0;
    for (size_t i = 0; i < data->runs; i++) {
        rows += data->run[i].rows_without_sim;
        tips += data->run[i].tips_without_sim;
    }
    diagnosis_warn(
        diagnosis,
        "the baseline is another simulator's output (%s), not our replay; --baseline table takes our replay",
        run->sim_pa == NULL    ? "sim_tip_x_m .."
        : run->sim_tip == NULL ? "sim_p1_pa .."
                               : "sim_tip_x_m .. and sim_p1_pa ..");
    if (run->sim_tip != NULL && elsewhere->stiffness_scale > 0.0 && elsewhere->moves_m > 0.0) {
        diagnosis_warn(diagnosis,
                       "effects on the body are tried as the change that they make in our table model, which "
                       "moves most like the other "
                       "simulator with stiffness x %.3g: their tips, %.2g mm rms about their means, then "
                       "differ by %.2g mm%s",
                       elsewhere->stiffness_scale, 1e3 * elsewhere->moves_m, 1e3 * elsewhere->apart_m,
                       diagnosis_is_strange(search) ? ", so that the sizes found for body effects are rough"
                                                    : "");
    }
    if (run->sim_is_copy) {
        diagnosis_warn(diagnosis,
                       "sim_p1_pa to sim_p3_pa repeat the measured pressures: they count as not simulated");
    } else if (run->sim_pa == NULL) {
        diagnosis_warn(
            diagnosis,
            "the other simulator gives no pressures: its tip is taken to be that of the measured ones");
    }
    if (run->sim_tip == NULL) {
        diagnosis_warn(diagnosis, "the other simulator gives no tip: only pressures are compared");
    } else if (!run->has_orientation && run->tips > 0) {
        diagnosis_warn(
            diagnosis,
            "the tip is compared by its position alone: body and tip sensor are hard to tell apart");
    }
    if (rows > 0 || tips > 2 * data->runs) { /* one or two at either end of a run are no loss */
        diagnosis_warn(diagnosis,
                       "%zu rows with pressures and %zu tip samples are left out: the other simulator says "
                       "nothing there",
                       rows, tips);
    }
    describe_untried(diagnosis, data);
}

void diagnosis_describe_data(struct diagnosis *diagnosis, const struct search *search) {
    const struct gap_run *run = &search->data->run[0];
    const uint64_t hash = search->replay.table->module.inputs_hash;
    if (run->table_hash != 0 && run->table_hash != hash) {
        diagnosis_warn(diagnosis,
                       "recorded with table %016" PRIx64 ", diagnosed with table %016" PRIx64
                       " of the same module: set-points came from "
                       "another model, and so may what the module is; --table takes another",
                       run->table_hash, hash);
    }
    if (search->data->from_simulator) {
        describe_baseline(diagnosis, search);
        return;
    }
    if (!run->has_duty) {
        diagnosis_warn(
            diagnosis,
            "no duties in the log: supply, valve and line effects cannot be told apart; record valve1..3");
    }
    if (!run->has_reading) {
        diagnosis_warn(diagnosis, "no measured pressures: what happens before and after the chambers cannot "
                                  "be separated; record p1_pa..p3_pa");
    }
    if (run->tips == 0) {
        diagnosis_warn(
            diagnosis,
            "no tip samples: nothing can be said of body and tip sensor; record tip_x_m.. and tip_qw..");
    } else if (!run->has_orientation) {
        diagnosis_warn(
            diagnosis,
            "no tip orientation: body and tip sensor cannot be told apart by comparing it with the position");
    }
    if (!run->has_supply) {
        diagnosis_warn(diagnosis, "the supply was not measured: its constant part is refitted, and its droop "
                                  "is seen by the chambers only");
    }
}

static bool in_group(const struct diagnosis *diagnosis, const char *name) {
    for (size_t i = 0; i < diagnosis->group; i++) {
        if (strcmp(diagnosis->group_name[i], name) == 0) {
            return true;
        }
    }
    return false;
}

/* Does an entry of the list name the same kinds? */
static bool names_the_same(const struct gap_model *a, const struct gap_model *b) {
    bool same = gap_model_kinds(a) == gap_model_kinds(b);
    for (size_t e = 0; e < a->count; e++) {
        bool named = false;
        for (size_t f = 0; f < b->count; f++) {
            named = named || b->effect[f].kind == a->effect[e].kind;
        }
        same = same && named;
    }
    return same;
}

/* Of an unknown gap: the models that come nearest, each set of kinds by its best, in the order of what they
 * leave. */
void diagnosis_find_closest(struct diagnosis *diagnosis, const struct search *search) {
    const double gap = fit_structure(&search->nominal.sums, 1);
    for (size_t t = 0; t < search->trials && gap > 0.0; t++) {
        const struct fit *fit = &search->trial[t].fit;
        const double closed = fit->sound ? 1.0 - fit_structure(&fit->sums, 1) / gap : -INFINITY;
        struct diagnosis_closest *list = diagnosis->closest_model;
        size_t at = 0;
        while (at < diagnosis->closest && !names_the_same(&list[at].model, &fit->model)) {
            at++;
        }
        if (at < diagnosis->closest) {
            if (list[at].closed >= closed) {
                continue;
            }
            memmove(&list[at], &list[at + 1], (--diagnosis->closest - at) * sizeof *list);
        }
        for (at = 0; at < diagnosis->closest && list[at].closed >= closed;) {
            at++;
        }
        if (at < DIAGNOSIS_CLOSEST_MAX && closed > diagnosis->closed_recalibration.value) {
            diagnosis->closest += diagnosis->closest < DIAGNOSIS_CLOSEST_MAX;
            memmove(&list[at + 1], &list[at], (diagnosis->closest - 1 - at) * sizeof *list);
            list[at] = (struct diagnosis_closest){fit->model, closed};
        }
    }
}

/* What to record next, in words. */
void diagnosis_suggest(struct diagnosis *diagnosis) {
    const char *what = "";
    if (diagnosis->verdict == GAP_UNKNOWN) {
        what = "hold, step and cycle one chamber at a time at three heights: what the rest depends on then "
               "shows in the HTML report";
    } else if (in_group(diagnosis, "gravity") || in_group(diagnosis, "tip_payload")) {
        what = "bend by the same angle in six directions, and again with the module mounted the other way up";
    } else if (in_group(diagnosis, "creep") || in_group(diagnosis, "hysteresis") ||
               in_group(diagnosis, "tip_latency")) {
        what = "the same cycle at three speeds, then hold for a minute: creep depends on time, hysteresis on "
               "the path, latency on speed";
    } else if (in_group(diagnosis, "line_volume") || in_group(diagnosis, "line_resistance") ||
               in_group(diagnosis, "valve_sluggish")) {
        what = "full steps from rest of one chamber at a time, up and down: small volumes tell a volume from "
               "a resistance";
    } else if (diagnosis->group > 1) {
        what = "all three chambers, one at a time and together, with steps, slow ramps and rests in between";
    }
    (void)snprintf(diagnosis->next_experiment, sizeof diagnosis->next_experiment, "%s", what);
}

/* Where neighbours differ by far more than the sensor errs, something moved between them that was not
 * recorded: what is called noise then hides a gap. */
void diagnosis_doubt_floor(struct diagnosis *diagnosis, const struct search *search) {
    const double noise_deg = search->replay.run[0].tip_noise[1] * DEGREES;
    const struct diagnosis_gap *angle = &diagnosis->gap[2];
    if (!angle->measured || !(angle->floor > FLOOR_DOUBTFUL * noise_deg)) {
        return;
    }
    diagnosis_warn(diagnosis,
                   "what no model can explain amounts to %.2g deg, the sensor errs by %.2g deg: pressures "
                   "were read too rarely, "
                   "transitions were sampled too slowly, or something moved the tip that no pressure shows, "
                   "and a smaller gap cannot "
                   "be seen; record valve1..3 at 50 Hz or more, with the module free",
                   angle->floor, noise_deg);
    if (diagnosis->verdict == GAP_NONE) {
        diagnosis->verdict = GAP_INSUFFICIENT_DATA;
    }
}
