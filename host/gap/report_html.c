#include "gap/report_html.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/report_candidates.h"
#include "gap/report_markup.h"
#include "gap/report_residuals.h"
#include "gap/report_runs.h"
#include "gap/report_style.h"
#include "gap/report_verdict.h"
#include "program/output_file.h"

#define BAR_LEFT 190.0
#define BAR_WIDTH 440.0
#define BAR_PITCH 36.0
#define BAR_HEIGHT 20.0
#define NOTE_LEFT 704.0
#define FIGURE_WIDTH 1064.0

/* --- candidates --- */

static double bar_x(double share) {
    return BAR_LEFT + BAR_WIDTH * fmin(fmax(share, 0.0), 1.0);
}

static bool is_named(const struct diagnosis *diagnosis, const struct effect_kind *kind) {
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].kind == kind && diagnosis->verdict != GAP_UNKNOWN) {
            return true;
        }
    }
    for (size_t i = 0; i < diagnosis->group && diagnosis->verdict == GAP_GROUP; i++) {
        if (strcmp(diagnosis->group_name[i], kind->name) == 0) {
            return true;
        }
    }
    return false;
}

static double belief_in(const struct diagnosis *diagnosis, const struct effect_kind *kind) {
    for (size_t i = 0; i < diagnosis->group; i++) {
        if (strcmp(diagnosis->group_name[i], kind->name) == 0) {
            return diagnosis->group_probability[i];
        }
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].kind == kind) {
            return diagnosis->effect[e].probability;
        }
    }
    return NAN;
}

static void draw_candidate(FILE *out, const struct diagnosis *diagnosis,
                           const struct report_candidate *candidate, double top) {
    const struct effect *effect = candidate->effect;
    const double first = diagnosis->closed_recalibration.value, belief = belief_in(diagnosis, effect->kind);
    const double middle = top + 0.5 * BAR_HEIGHT + 4.5;
    fprintf(out, "<text class=\"%s\" x=\"0\" y=\"%.1f\">",
            is_named(diagnosis, effect->kind) ? "striking" : "", middle);
    markup_text(out, effect->kind->name);
    fputs("</text>\n", out);
    fprintf(out, "<rect class=\"fill recalibrated\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
            bar_x(0.0), top, bar_x(fmin(first, candidate->closed)) - bar_x(0.0), BAR_HEIGHT);
    fprintf(out, "<rect class=\"fill %s\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
            is_named(diagnosis, effect->kind) ? "after" : "faint", bar_x(fmin(first, candidate->closed)), top,
            bar_x(candidate->closed) - bar_x(fmin(first, candidate->closed)), BAR_HEIGHT);
    fprintf(out, "<text class=\"end\" x=\"%.1f\" y=\"%.1f\">", NOTE_LEFT - 16.0, middle);
    markup_percent(out, candidate->closed);
    fprintf(out, "</text><text class=\"tick\" x=\"%.1f\" y=\"%.1f\">", NOTE_LEFT,
            middle - (isnan(belief) ? 0.0 : 7.0));
    if (effect->form > 0) {
        fprintf(out, "form %zu, ", effect->form);
    }
    markup_parameters(out, effect);
    fputs("</text>\n", out);
    if (!isnan(belief)) {
        fprintf(out, "<text class=\"tick striking\" x=\"%.1f\" y=\"%.1f\">probability ", NOTE_LEFT,
                middle + 8.0);
        markup_number(out, belief, 0.05);
        fputs("</text>\n", out);
    }
}

static void draw_candidates(FILE *out, const struct diagnosis *diagnosis,
                            const struct report_candidates *candidates) {
    const double bottom = BAR_PITCH * (double)candidates->count, height = bottom + 24.0;
    fprintf(
        out,
        "<div class=\"scroll\"><svg width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" "
        "aria-label=\"share of the gap that each candidate closes\">\n",
        FIGURE_WIDTH, height, FIGURE_WIDTH, height);
    for (int percent = 0; percent <= 100; percent += 20) {
        fprintf(out,
                "<path class=\"grid\" d=\"M%.1f 0V%.1f\"/><text class=\"tick middle\" x=\"%.1f\" "
                "y=\"%.1f\">%d %%</text>\n",
                bar_x(0.01 * percent), bottom, bar_x(0.01 * percent), bottom + 16.0, percent);
    }
    for (size_t i = 0; i < candidates->count; i++) {
        draw_candidate(out, diagnosis, &candidates->list[i],
                       BAR_PITCH * (double)i + 0.5 * (BAR_PITCH - BAR_HEIGHT));
    }
    fprintf(out, "<path class=\"rule\" stroke-dasharray=\"4 3\" d=\"M%.1f 0V%.1f\"/>\n</svg></div>\n",
            bar_x(diagnosis->closed.value), bottom);
}

static bool is_listed(const struct report_candidates *candidates, const struct effect_kind *kind) {
    for (size_t i = 0; i < candidates->count; i++) {
        if (candidates->list[i].effect->kind == kind) {
            return true;
        }
    }
    return false;
}

static void write_left_behind(FILE *out, const struct search *search,
                              const struct report_candidates *candidates) {
    size_t count = 0;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        if (!is_listed(candidates, kind) && report_why_untried(search, kind) == NULL) {
            fputs(count++ == 0 ? "<p>Tried coarsely and left behind: " : ", ", out);
            markup_text(out, kind->name);
        }
    }
    fputs(count > 0 ? ".</p>\n" : "", out);
}

static bool write_candidates(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    struct report_candidates *candidates = calloc(1, sizeof *candidates);
    const bool sound = candidates != NULL && report_candidates_find(candidates, diagnosis, search);
    fputs("<section id=\"candidates\"><h2>Candidates tried</h2>\n", out);
    if (sound && candidates->count > 0) {
        fputs("<p class=\"legend\">Share of the held-out gap that the model closes with each effect alone, "
              "nominal parameters "
              "refitted: <span class=\"swatch recalibrated\"></span>what recalibration alone closes "
              "<span class=\"swatch after\"></span>what the effect adds. Dashed: the best model; less green "
              "than the others: worse than "
              "recalibration alone.</p>\n",
              out);
        draw_candidates(out, diagnosis, candidates);
    } else {
        fputs("<p>No effect took anything off the gap, so there is nothing to compare.</p>\n", out);
    }
    if (sound && candidates->count > 0) {
        write_left_behind(out, search, candidates);
    }
    fputs("</section>\n", out);
    free(candidates);
    return sound;
}

/* --- open questions --- */

static void write_group(FILE *out, const struct diagnosis *diagnosis) {
    const bool named = diagnosis->verdict == GAP_EFFECT || diagnosis->verdict == GAP_EFFECTS;
    if (diagnosis->group < 2) {
        fputs(named ? "<p>This data tells what is named above from every other candidate.</p>\n" : "", out);
        return;
    }
    fputs("<table>\n<tr><th>cannot be told apart on this data</th><th "
          "class=\"number\">probability</th><th>what it leaves in a "
          "recording</th></tr>\n",
          out);
    for (size_t i = 0; i < diagnosis->group; i++) {
        const struct effect_kind *kind = effect_kind_find(diagnosis->group_name[i]);
        fputs("<tr><td><b>", out);
        markup_text(out, diagnosis->group_name[i]);
        fputs("</b></td><td class=\"number\">", out);
        markup_number(out, diagnosis->group_probability[i], 0.05);
        fputs("</td><td>", out);
        markup_text(out, kind != NULL && kind->signature != NULL ? kind->signature : "");
        fputs("</td></tr>\n", out);
    }
    fputs("</table>\n", out);
}

static void write_warnings(FILE *out, const struct diagnosis *diagnosis) {
    fputs(diagnosis->warnings > 0 ? "<h3>Notes on the data</h3>\n<ul>\n" : "", out);
    for (size_t i = 0; i < diagnosis->warnings; i++) {
        fputs("<li>", out);
        markup_text(out, diagnosis->warning[i]);
        fputs("</li>\n", out);
    }
    fputs(diagnosis->warnings > 0 ? "</ul>\n" : "", out);
}

/* Effects with the same reason stand together. */
static void write_untried(FILE *out, const struct search *search) {
    const size_t kinds = effect_kind_count();
    size_t reasons = 0;
    for (size_t i = 0; i < kinds; i++) {
        const char *reason = report_why_untried(search, effect_kind_at(i));
        bool said = reason == NULL;
        for (size_t j = 0; j < i && !said; j++) {
            const char *other = report_why_untried(search, effect_kind_at(j));
            said = other != NULL && strcmp(other, reason) == 0;
        }
        if (said) {
            continue;
        }
        fputs(reasons++ == 0 ? "<h3>Effects that were not tried</h3>\n<ul>\n" : "", out);
        fprintf(out, "<li>%s: ", reason);
        size_t named = 0;
        for (size_t j = i; j < kinds; j++) {
            const char *other = report_why_untried(search, effect_kind_at(j));
            if (other != NULL && strcmp(other, reason) == 0) {
                fputs(named++ > 0 ? ", " : "", out);
                markup_text(out, effect_kind_at(j)->name);
            }
        }
        fputs("</li>\n", out);
    }
    fputs(reasons > 0 ? "</ul>\n" : "", out);
}

static void write_open(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    fputs("<section id=\"open\"><h2>Open questions</h2>\n", out);
    write_group(out, diagnosis);
    if (*diagnosis->next_experiment != '\0') {
        fputs("<p><b>Next experiment:</b> ", out);
        markup_text(out, diagnosis->next_experiment);
        fputs("</p>\n", out);
    }
    if (search->interrupted) {
        fputs("<p><b>The search was interrupted:</b> what it had found by then is shown.</p>\n", out);
    }
    write_warnings(out, diagnosis);
    write_untried(out, search);
    fputs("</section>\n", out);
}

/* --- provenance --- */

static void write_fact(FILE *out, const char *name, double value, const char *si_unit) {
    fprintf(out, "<li>%s ", name);
    markup_quantity(out, value, si_unit);
    fputs("</li>\n", out);
}

static void write_columns(FILE *out, const struct gap_run *run) {
    const struct {
        bool present;
        const char *name;
    } columns[] = {{run->has_duty && run->sim_pa == NULL, "duties"},
                   {run->sim_pa != NULL, "pressures of another simulator"},
                   {run->sim_tip != NULL, "its tip"},
                   {run->has_reading, "pressures"},
                   {run->has_supply, "supply"},
                   {run->tips > 0, "tip position"},
                   {run->has_orientation, "tip orientation"},
                   {run->has_temperature, "temperature"}};
    size_t count = 0;
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) {
        if (columns[i].present) {
            fprintf(out, "%s%s", count++ > 0 ? ", " : "", columns[i].name);
        }
    }
}

static void write_log(FILE *out, const struct replay_run *run) {
    const struct gap_run *data = run->run;
    fputs("<tr><td class=\"path\"><code>", out);
    markup_text(out, data->path);
    fprintf(out, "</code></td><td class=\"number\">%zu</td><td class=\"number\">%zu", data->rows, data->tips);
    if (data->tips_skipped > 0) {
        fprintf(out, " (%zu skipped)", data->tips_skipped);
    }
    fputs("</td><td>", out);
    write_columns(out, data);
    fputs("</td><td class=\"number\">", out);
    markup_quantity(out, data->has_reading ? run->reading_noise_pa : NAN, "Pa");
    fputs("</td><td class=\"number\">", out);
    markup_quantity(out, data->tips > 0 ? run->tip_noise[0] : NAN, "m");
    fputs("</td><td class=\"number\">", out);
    markup_quantity(out, data->has_orientation ? run->tip_noise[1] : NAN, "rad");
    fputs("</td></tr>\n", out);
}

static void write_provenance(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    const struct replay *replay = &search->replay;
    fputs("<section id=\"provenance\"><h2>Provenance</h2>\n<ul><li>module ", out);
    markup_text(out, search->data->module);
    fprintf(out, ", table <code>%016" PRIx64 "</code></li>\n", replay->table->module.inputs_hash);
    write_fact(out, "nominal supply", replay->nominal.supply_pa, "Pa");
    fputs("<li>nominal scales found: stiffness \xc3\x97 ", out);
    markup_interval(out, &diagnosis->stiffness_scale, "1");
    fputs(", supply \xc3\x97 ", out);
    markup_interval(out, &diagnosis->supply_scale, "1");
    fputs("; by recalibration alone \xc3\x97 ", out);
    markup_number(out, search->recalibrated.model.stiffness_scale, 0.0);
    fputs(" and \xc3\x97 ", out);
    markup_number(out, search->recalibrated.model.supply_scale, 0.0);
    fputs("</li>\n", out);
    if (replay->run[0].duty_from_next_period) {
        fputs("<li>a duty logged at a period\xe2\x80\x99s start counts from the next period on</li>\n", out);
    }
    fputs("</ul>\n<div class=\"scroll\"><table>\n<tr><th>log</th><th class=\"number\">rows</th><th "
          "class=\"number\">tip samples"
          "</th><th>recorded</th><th class=\"number\">pressure noise</th><th class=\"number\">position "
          "noise</th>"
          "<th class=\"number\">angle noise</th></tr>\n",
          out);
    for (size_t i = 0; i < replay->runs; i++) {
        write_log(out, &replay->run[i]);
    }
    fputs("</table></div></section>\n", out);
}

/* --- the page --- */

static bool write_series(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    struct report_series series;
    if (!report_series_open(&series, search)) {
        return false;
    }
    fputs("<section id=\"runs\"><h2>Measured and simulated</h2>\n<p class=\"muted\">", out);
    fputs(search->data->from_simulator
              ? "Simulated is what another simulator wrote into the log, moved by what the difference between its pressures "
                "and the measured ones changes in the table model.</p>\n"
              : "The tip is simulated from the measured pressures, so that little of what supply and valves do wrong reaches "
                "it.</p>\n",
          out);
    report_runs(out, &series, search->data);
    fputs("</section>\n<section id=\"residuals\"><h2>What is left, against what it might depend on</h2>\n",
          out);
    dependence_html(&diagnosis->dependences, out);
    const bool sound = report_residuals(out, &series, search->data);
    fputs("</section>\n", out);
    report_series_close(&series);
    return sound;
}

static bool write_page(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
          "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>",
          out);
    report_headline(out, diagnosis);
    fputs("</title>\n", out);
    report_style(out);
    fputs("</head>\n<body><main>\n", out);
    report_verdict(out, diagnosis, search);
    const bool sound = write_series(out, diagnosis, search) && write_candidates(out, diagnosis, search);
    write_open(out, diagnosis, search);
    write_provenance(out, diagnosis, search);
    fputs("</main></body>\n</html>\n", out);
    return sound;
}

bool gap_report_html(const struct diagnosis *diagnosis, const struct search *search, const char *path,
                     char *error, size_t error_bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, error_bytes)) {
        return false;
    }
    if (!write_page(file.stream, diagnosis, search)) {
        output_file_discard(&file);
        (void)snprintf(error, error_bytes, "%s: out of memory for the report", path);
        return false;
    }
    return output_file_commit(&file, error, error_bytes);
}
