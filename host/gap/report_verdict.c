#include "gap/report_verdict.h"

#include <math.h>
#include <string.h>

#include "gap/report_markup.h"

#define DEGREES (180.0 / M_PI)
#define BAR_LEFT 4.0
#define BAR_WIDTH 1054.0
#define BAR_TOP 18.0
#define BAR_HEIGHT 26.0
#define STRIP_WIDTH 190.0
#define CLOSED_SHOWN_LEAST (-9.99) /* below, a share says nothing */

static bool names_effects(const struct diagnosis *diagnosis) {
    return diagnosis->verdict == GAP_EFFECT || diagnosis->verdict == GAP_EFFECTS;
}

/* --- verdict --- */

/* "a", "a and b", "a, b or c" */
static void list_name(FILE *out, size_t index, size_t count, const char *last_word, const char *name) {
    const bool last = index + 1 == count;
    if (index > 0) {
        fprintf(out, last ? " %s " : ", ", last_word);
    }
    markup_text(out, name);
}

void report_headline(FILE *out, const struct diagnosis *diagnosis) {
    switch (diagnosis->verdict) {
    case GAP_NONE:
        fputs("No gap", out);
        return;
    case GAP_RECALIBRATE:
        fputs("Recalibrate: nothing is missing from the model", out);
        return;
    case GAP_EFFECT:
    case GAP_EFFECTS:
        fputs("The model leaves out ", out);
        for (size_t e = 0; e < diagnosis->effects; e++) {
            list_name(out, e, diagnosis->effects, "and", diagnosis->effect[e].kind->name);
        }
        return;
    case GAP_GROUP:
        fputs("The model leaves out one of ", out);
        for (size_t i = 0; i < diagnosis->group; i++) {
            list_name(out, i, diagnosis->group, "or", diagnosis->group_name[i]);
        }
        return;
    case GAP_UNKNOWN:
        fputs("An unknown effect", out);
        return;
    default:
        fputs("The data cannot say", out);
    }
}

static bool has_gap(const struct diagnosis *diagnosis) {
    for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
        if (diagnosis->gap[k].measured) {
            return true;
        }
    }
    return false;
}

static void write_percent_after(FILE *out, const struct diagnosis *diagnosis, const char *it) {
    if (!has_gap(diagnosis)) {
        return;
    }
    fprintf(out, " With %s in the model, ", it);
    markup_percent(out, diagnosis->closed.value);
    fputs(" of the gap on held-out data is gone.", out);
}

static void write_sentence(FILE *out, const struct diagnosis *diagnosis) {
    switch (diagnosis->verdict) {
    case GAP_NONE:
        fputs("The module does what the model says, within the noise.", out);
        return;
    case GAP_RECALIBRATE:
        fputs("Nominal parameters explain the gap: stiffness \xc3\x97 ", out);
        markup_interval(out, &diagnosis->stiffness_scale, "1");
        fputs(", supply \xc3\x97 ", out);
        markup_interval(out, &diagnosis->supply_scale, "1");
        fputs(".", out);
        return;
    case GAP_EFFECT:
        fputs("In the recordings ", out);
        markup_text(out, diagnosis->effect[0].kind->what);
        fputs(".", out);
        write_percent_after(out, diagnosis, "it");
        return;
    case GAP_EFFECTS:
        fputs("Several effects explain the gap together.", out);
        write_percent_after(out, diagnosis, "them");
        return;
    case GAP_GROUP:
        fputs("They explain the gap equally well; this data cannot tell them apart.", out);
        return;
    case GAP_UNKNOWN:
        fputs("There is a real gap that no effect of the catalogue explains. ", out);
        markup_text(out, diagnosis->description);
        return;
    default:
        fputs("What was recorded does not suffice; the notes below say what to record.", out);
    }
}

static void write_head(FILE *out, const struct diagnosis *diagnosis, const struct gap_data *data) {
    fprintf(out, "<header class=\"%s\">\n<p class=\"eyebrow\">Gap between model and module ",
            gap_verdict_name(diagnosis->verdict));
    markup_text(out, *data->module != '\0' ? data->module : "(unnamed)");
    fprintf(out, " \xc2\xb7 %zu run%s, ", data->runs, data->runs == 1 ? "" : "s");
    markup_number(out, gap_data_duration_s(data), 5.0);
    fprintf(out, " s \xc2\xb7 verdict: <b>%s</b></p>\n<h1>", gap_verdict_name(diagnosis->verdict));
    report_headline(out, diagnosis);
    fputs("</h1>\n<p class=\"lead\">", out);
    write_sentence(out, diagnosis);
    fputs("</p>\n<nav><a href=\"#runs\">measured and simulated</a><a href=\"#residuals\">what is left</a>"
          "<a href=\"#candidates\">candidates tried</a><a href=\"#open\">open questions</a>"
          "<a href=\"#provenance\">provenance</a></nav>\n</header>\n",
          out);
}

/* --- where --- */

static bool is_here(const struct diagnosis *diagnosis, const char *stage) {
    bool here = strcmp(diagnosis->stage, stage) == 0;
    for (size_t e = 0; e < diagnosis->effects && names_effects(diagnosis); e++) {
        here = here || strcmp(effect_stage_name(diagnosis->effect[e].kind->stage), stage) == 0;
    }
    for (size_t i = 0; i < diagnosis->group && diagnosis->verdict == GAP_GROUP; i++) {
        const struct effect_kind *kind = effect_kind_find(diagnosis->group_name[i]);
        here = here || (kind != NULL && strcmp(effect_stage_name(kind->stage), stage) == 0);
    }
    return here;
}

static void draw_stage(FILE *out, const struct diagnosis *diagnosis, enum effect_stage stage, double x,
                       double y, double width) {
    const char *name = effect_stage_name(stage), *here = is_here(diagnosis, name) ? " here" : "";
    fprintf(out,
            "<rect class=\"box%s\" x=\"%.0f\" y=\"%.0f\" width=\"%.0f\" height=\"34\" rx=\"6\"/>"
            "<text class=\"middle%s\" x=\"%.0f\" y=\"%.0f\">%s</text>\n",
            here, x, y, width, here, x + 0.5 * width, y + 21.5, name);
}

/* From duty to tip sample; the pressure sensor looks on at the chambers. */
static void draw_chain(FILE *out, const struct diagnosis *diagnosis) {
    fputs("<div class=\"scroll\"><svg width=\"356\" height=\"108\" viewBox=\"0 0 356 108\" role=\"img\" "
          "aria-label=\"the chain from supply to tip sensor\">\n"
          "<path class=\"arrow\" d=\"M71 19h16M82 14l5 5l-5 5M153 19h28M176 14l5 5l-5 5M247 19h16M258 14l5 "
          "5l-5 5"
          "M167 19v46M162 60l5 5l5 -5\"/>\n",
          out);
    draw_stage(out, diagnosis, EFFECT_STAGE_SUPPLY, 1.0, 2.0, 70.0);
    draw_stage(out, diagnosis, EFFECT_STAGE_VALVE, 88.0, 2.0, 65.0);
    draw_stage(out, diagnosis, EFFECT_STAGE_BODY, 182.0, 2.0, 65.0);
    draw_stage(out, diagnosis, EFFECT_STAGE_TIP_SENSOR, 264.0, 2.0, 90.0);
    draw_stage(out, diagnosis, EFFECT_STAGE_PRESSURE_SENSOR, 102.0, 67.0, 130.0);
    fputs("</svg></div>\n", out);
}

/* The section from the tip: chamber 1 on the x axis, 2 and 3 counter-clockwise. */
static void draw_section(FILE *out, const struct diagnosis *diagnosis) {
    fputs("<svg width=\"100\" height=\"100\" viewBox=\"0 0 100 100\" role=\"img\" aria-label=\"the chambers "
          "concerned\">"
          "<circle class=\"box\" cx=\"50\" cy=\"50\" r=\"47\"/>\n",
          out);
    for (size_t c = 0; c < 3; c++) {
        const double angle = 2.0 * M_PI / 3.0 * (double)c, x = 50.0 + 25.0 * cos(angle),
                     y = 50.0 - 25.0 * sin(angle);
        const char *here = diagnosis->chamber[c] ? " here" : "";
        fprintf(
            out,
            "<circle class=\"box%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"15\"/><text class=\"middle%s\" x=\"%.1f\" "
            "y=\"%.1f\">%zu</text>\n",
            here, x, y, here, x, y + 4.5, c + 1);
    }
    fputs("</svg>\n", out);
}

static size_t chambers_concerned(const struct diagnosis *diagnosis) {
    return (size_t)diagnosis->chamber[0] + diagnosis->chamber[1] + diagnosis->chamber[2];
}

static bool some_chambers(const struct diagnosis *diagnosis) {
    const size_t count = chambers_concerned(diagnosis);
    return count > 0 && count < 3;
}

static void write_chambers(FILE *out, const struct diagnosis *diagnosis) {
    if (chambers_concerned(diagnosis) == 3) {
        fputs(", no single chamber", out);
        return;
    }
    for (size_t c = 0; c < 3; c++) {
        if (diagnosis->chamber[c]) {
            fprintf(out, ", chamber %zu", c + 1);
        }
    }
}

static void write_where(FILE *out, const struct diagnosis *diagnosis) {
    fputs("<section><h3>Where</h3>\n<div class=\"where\"><div>\n", out);
    draw_chain(out, diagnosis);
    if (*diagnosis->stage != '\0') {
        fputs("<p><span class=\"name\">", out);
        markup_text(out, diagnosis->stage);
        fputs("</span>", out);
        write_chambers(out, diagnosis);
        fputs(", ", out);
        markup_text(out, diagnosis->regime);
        fputs("</p>\n", out);
    } else {
        fprintf(out, "<p class=\"muted\">%s</p>\n",
                diagnosis->verdict == GAP_NONE          ? "There is no gap to find a place for."
                : diagnosis->verdict == GAP_RECALIBRATE ? "In the nominal parameters of body and supply."
                                                        : "No single stage stands out.");
    }
    fputs("</div>\n", out);
    if (some_chambers(diagnosis)) {
        draw_section(out, diagnosis);
    }
    fputs("</div></section>\n", out);
}

/* --- which --- */

static void write_effect(FILE *out, const struct diagnosis_effect *effect) {
    fputs("<div class=\"effect\"><p><span class=\"name\">", out);
    markup_text(out, effect->kind->name);
    fputs("</span> <span class=\"muted\">", out);
    if (effect->chamber > 0) {
        fprintf(out, "chamber %zu, ", effect->chamber);
    }
    if (effect->onset_s > 0.0) {
        fputs("from ", out);
        markup_quantity(out, effect->onset_s, "s");
        fputs(effect->latent ? " on (it remembers what was before), " : " on, ", out);
    }
    fprintf(out, "probability ");
    markup_number(out, effect->probability, 0.05);
    fputs("</span><br/>", out);
    markup_text(out, effect->kind->what);
    if (effect->kind->forms > 1 && effect->kind->form_what[effect->form] != NULL) {
        fputs("; <i>here</i>: ", out);
        markup_text(out, effect->kind->form_what[effect->form]);
    }
    fputs("</p>\n<table>\n", out);
    for (size_t i = 0; i < effect->kind->parameter_count; i++) {
        fputs("<tr><td>", out);
        markup_words(out, effect->kind->parameter[i].name);
        fputs("</td><td class=\"number\">", out);
        markup_interval(out, &effect->parameter[i], effect->kind->parameter[i].unit);
        fputs("</td></tr>\n", out);
    }
    fputs("</table></div>\n", out);
}

static void write_scale(FILE *out, const char *name, const struct diagnosis_interval *interval) {
    fprintf(out, "<tr><td>%s</td><td class=\"number\">\xc3\x97 ", name);
    markup_interval(out, interval, "1");
    fputs("</td></tr>\n", out);
}

static bool is_named(const struct diagnosis *diagnosis, size_t place) {
    for (size_t e = 0; e < diagnosis->effects; e++) {
        if (diagnosis->effect[e].place == place) {
            return true;
        }
    }
    return false;
}

/* What the best model has beside the effects that are named: their other forms, and effects that are part of
 * them. */
static void write_parts(FILE *out, const struct diagnosis *diagnosis, const struct gap_model *model) {
    for (size_t e = 0; e < model->count; e++) {
        const struct effect *effect = &model->effect[e];
        if (is_named(diagnosis, e)) {
            continue;
        }
        fputs("<p class=\"muted\">completed by ", out);
        markup_text(out, effect->kind->name);
        if (effect->kind->forms > 1 && effect->kind->form_what[effect->form] != NULL) {
            fputs(", ", out);
            markup_text(out, effect->kind->form_what[effect->form]);
        }
        fputs(": ", out);
        markup_parameters(out, effect);
        fputs("</p>\n", out);
    }
}

static void write_closest(FILE *out, const struct diagnosis *diagnosis) {
    if (diagnosis->closest == 0) {
        return;
    }
    fputs("<p class=\"muted\">What comes nearest, and the share of the held-out gap that it closes:</p>\n<ul>\n", out);
    for (size_t i = 0; i < diagnosis->closest; i++) {
        const struct gap_model *model = &diagnosis->closest_model[i].model;
        fputs("<li>", out);
        markup_percent(out, diagnosis->closest_model[i].closed);
        fputs(": ", out);
        for (size_t e = 0; e < model->count; e++) {
            if (gap_model_is_part(model, e)) {
                continue;
            }
            fputs(e > 0 ? " and " : "", out);
            markup_text(out, model->effect[e].kind->name);
            fputs(" <span class=\"muted\">(", out);
            markup_parameters(out, &model->effect[e]);
            fputs(")</span>", out);
        }
        fputs("</li>\n", out);
    }
    fputs("</ul>\n", out);
}

static void write_which(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    const bool shown = names_effects(diagnosis) || diagnosis->verdict == GAP_GROUP;
    fputs("<section><h3>Which <span class=\"muted\">(90\xc2\xa0% intervals)</span></h3>\n", out);
    if (diagnosis->verdict == GAP_GROUP) {
        fputs("<p>One of ", out);
        for (size_t i = 0; i < diagnosis->group; i++) {
            list_name(out, i, diagnosis->group, "or", diagnosis->group_name[i]);
        }
        fputs(". What the search ended with:</p>\n", out);
    }
    for (size_t e = 0; e < diagnosis->effects && shown; e++) {
        write_effect(out, &diagnosis->effect[e]);
    }
    if (shown) {
        write_parts(out, diagnosis, &search->everything.model);
    } else {
        fputs("<p>No effect of the catalogue is named.</p>\n", out);
        write_closest(out, diagnosis);
    }
    fputs("<div class=\"effect\"><p class=\"muted\">nominal parameters, refitted</p><table>\n", out);
    write_scale(out, "stiffness", &diagnosis->stiffness_scale);
    write_scale(out, "supply", &diagnosis->supply_scale);
    fputs("</table></div></section>\n", out);
}

/* --- how far --- */

static double bar_x(double share) {
    return BAR_LEFT + BAR_WIDTH * fmin(fmax(share, 0.0), 1.0);
}

static void draw_part(FILE *out, const char *class, double from, double to) {
    if (bar_x(to) > bar_x(from)) {
        fprintf(out, "<rect class=\"%s\" x=\"%.1f\" y=\"%.0f\" width=\"%.1f\" height=\"%.0f\"/>\n", class,
                bar_x(from), BAR_TOP, bar_x(to) - bar_x(from), BAR_HEIGHT);
    }
}

static void draw_whisker(FILE *out, const struct diagnosis_interval *interval, double y) {
    fprintf(out, "<path class=\"rule\" d=\"M%.1f %.1fv8M%.1f %.1fH%.1fM%.1f %.1fv8\"/>\n",
            bar_x(interval->low), y - 4.0, bar_x(interval->low), y, bar_x(interval->high),
            bar_x(interval->high), y - 4.0);
}

static void draw_closed(FILE *out, const struct diagnosis *diagnosis) {
    const double first = diagnosis->closed_recalibration.value, all = diagnosis->closed.value;
    fputs("<div class=\"scroll\"><svg width=\"1064\" height=\"66\" viewBox=\"0 0 1064 66\" role=\"img\" "
          "aria-label=\"share of the gap closed\">\n",
          out);
    draw_part(out, "open", 0.0, 1.0);
    draw_part(out, "fill recalibrated", 0.0, fmin(first, all));
    draw_part(out, "fill after", fmax(fmin(first, all), 0.0), all);
    draw_whisker(out, &diagnosis->closed, 9.0);
    for (int percent = 0; percent <= 100; percent += 20) {
        fprintf(out, "<text class=\"tick %s\" x=\"%.1f\" y=\"60\">%d%s</text>\n",
                percent == 0     ? ""
                : percent == 100 ? "end"
                                 : "middle",
                bar_x(0.01 * percent), percent, percent == 100 ? " %" : "");
    }
    fputs("</svg></div>\n", out);
}

static void write_share(FILE *out, const struct diagnosis_interval *share) {
    markup_percent(out, share->value);
    fputs(" (", out);
    markup_number(out, 100.0 * share->low, 1.0);
    fputs(" to ", out);
    markup_percent(out, share->high);
    fputs(")", out);
}

static void write_closed(FILE *out, const struct diagnosis *diagnosis) {
    const double first = diagnosis->closed_recalibration.value, all = diagnosis->closed.value;
    if (diagnosis->verdict == GAP_NONE || !isfinite(all) || all < CLOSED_SHOWN_LEAST) {
        fputs("<p>There is no gap above the noise floor to close.</p>\n", out);
        return;
    }
    draw_closed(out, diagnosis);
    fputs("<p class=\"legend\"><span class=\"swatch recalibrated\"></span>recalibration alone ", out);
    write_share(out, &diagnosis->closed_recalibration);
    fprintf(out, " <span class=\"swatch after\"></span>%s ",
            !names_effects(diagnosis) ? "the model that fits best adds"
            : diagnosis->effects == 1 ? "the effect itself adds"
                                      : "the effects themselves add");
    markup_percent(out, all - first);
    fputs(" <span class=\"swatch left\"></span>left ", out);
    markup_percent(out, 1.0 - all);
    fputs(" \xe2\x80\x94 in all <b>", out);
    write_share(out, &diagnosis->closed);
    fputs("</b> of the mean square above the noise floor, on held-out data; the line over the bar is the "
          "90\xc2\xa0% "
          "interval.</p>\n",
          out);
}

struct residual_words {
    const char *name;
    const char *what;
};

static void write_residual_name(FILE *out, const char *name) {
    static const struct residual_words words[] = {
        {"r1_pressure", "chamber pressure, simulated from duties"},
        {"r2_position", "tip position, simulated from measured pressures"},
        {"r2_angle", "tip orientation, simulated from measured pressures"},
        {"r3_position", "tip position, simulated from duties"},
        {"r3_angle", "tip orientation, simulated from duties"}};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        if (strcmp(words[i].name, name) == 0) {
            fprintf(out, "%s <span class=\"muted\">(%.2s)</span>", words[i].what, name);
            return;
        }
    }
    markup_words(out, name);
}

/* The four figures on a line from nothing to the greatest of them. */
static void draw_strip(FILE *out, const struct diagnosis_gap *gap) {
    const double most =
        fmax(fmax(gap->before, gap->after_recalibration), fmax(gap->after_effect, gap->floor));
    const double scale = most > 0.0 ? (STRIP_WIDTH - 14.0) / most : 0.0;
    const double before = 7.0 + scale * gap->before, after = 7.0 + scale * gap->after_effect;
    const double recalibrated = 7.0 + scale * gap->after_recalibration, floor_of = 7.0 + scale * gap->floor;
    fprintf(out,
            "<svg width=\"%.0f\" height=\"20\" viewBox=\"0 0 %.0f 20\" role=\"img\" aria-label=\"the same, "
            "drawn\">"
            "<path class=\"grid\" d=\"M7 10h%.0f\"/>",
            STRIP_WIDTH, STRIP_WIDTH, STRIP_WIDTH - 14.0);
    fprintf(out,
            "<circle class=\"mark fill before\" cx=\"%.1f\" cy=\"10\" r=\"7\"/>"
            "<path class=\"mark fill recalibrated\" d=\"M%.1f 5l5 5l-5 5l-5 -5z\"/>"
            "<circle class=\"mark fill after\" cx=\"%.1f\" cy=\"10\" r=\"4\"/><path class=\"rule\" d=\"M%.1f "
            "3v14\"/></svg>",
            before, recalibrated, after, floor_of);
}

static void write_number_cell(FILE *out, double value) {
    fputs("<td class=\"number\">", out);
    markup_number(out, value, 0.0);
    fputs("</td>", out);
}

static void write_rms_cell(FILE *out, const struct diagnosis_gap *gap, size_t model, double value) {
    fputs("<td class=\"number\">", out);
    markup_number(out, value, 0.0);
    fputs("<br/><span class=\"muted\">", out);
    markup_number(out, gap->low[model], 0.0);
    fputs(" to ", out);
    markup_number(out, gap->high[model], 0.0);
    fputs("</span></td>", out);
}

static void write_gaps(FILE *out, const struct diagnosis *diagnosis) {
    fputs("<div class=\"scroll\"><table>\n<tr><th>measured minus simulated, rms on held-out data; below it the 90\xc2\xa0% interval</th>"
          "<th class=\"number\"><span class=\"swatch before\"></span>before</th>"
          "<th class=\"number\"><span class=\"swatch recalibrated\"></span>recalibrated</th>"
          "<th class=\"number\"><span class=\"swatch after\"></span>after</th>"
          "<th class=\"number\">| noise floor</th><th>unit</th><th></th></tr>\n",
          out);
    for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
        const struct diagnosis_gap *gap = &diagnosis->gap[k];
        if (gap->measured) {
            fputs("<tr><td>", out);
            write_residual_name(out, gap->name);
            fputs("</td>", out);
            write_rms_cell(out, gap, 0, gap->before);
            write_rms_cell(out, gap, 1, gap->after_recalibration);
            write_rms_cell(out, gap, 2, gap->after_effect);
            write_number_cell(out, gap->floor);
            fprintf(out, "<td>%s</td><td>", gap->unit);
            draw_strip(out, gap);
            fputs("</td></tr>\n", out);
        }
    }
    fputs("</table></div>\n", out);
}

static void write_angle_cell(FILE *out, double angle_rad) {
    fputs("<td class=\"number\">", out);
    markup_number(out, angle_rad * DEGREES, 0.01);
    fputs("</td>", out);
}

/* Which way the gap goes while a pressure is held. */
static void write_direction(FILE *out, const struct diagnosis *diagnosis) {
    const struct direction *direction = &diagnosis->direction;
    if (direction->holds == 0) {
        return;
    }
    fputs("<h3>Direction</h3>\n<p>", out);
    markup_text(out, direction->text);
    fputs(".</p>\n<details><summary>hold by hold</summary>\n<div class=\"scroll\"><table>\n<tr><th>run</th>"
          "<th class=\"number\">from, s</th><th class=\"number\">until, s</th><th class=\"number\">bend, deg</th>"
          "<th class=\"number\">measured minus nominal just after the step, deg</th><th class=\"number\">at its end, deg</th>"
          "<th class=\"number\">bend changes by, %</th><th class=\"number\">time constant, s</th></tr>\n",
          out);
    for (size_t i = 0; i < direction->holds; i++) {
        const struct direction_hold *hold = &direction->hold[i];
        fprintf(out, "<tr><td>%zu</td>", hold->run + 1);
        write_number_cell(out, hold->from_s);
        write_number_cell(out, hold->until_s);
        write_angle_cell(out, hold->bend_rad);
        write_angle_cell(out, hold->just_after_rad);
        write_angle_cell(out, hold->end_rad);
        write_number_cell(out, 100.0 * hold->growth);
        write_number_cell(out, hold->time_constant_s);
        fputs("</tr>\n", out);
    }
    fputs("</table></div></details>\n", out);
}

void report_verdict(FILE *out, const struct diagnosis *diagnosis, const struct search *search) {
    write_head(out, diagnosis, search->data);
    fputs("<div class=\"cards\">\n", out);
    write_where(out, diagnosis);
    write_which(out, diagnosis, search);
    fputs("</div>\n<section><h3>How far</h3>\n", out);
    if (has_gap(diagnosis)) {
        write_closed(out, diagnosis);
        write_gaps(out, diagnosis);
        write_direction(out, diagnosis);
    } else {
        fputs("<p>Nothing that was recorded can be held against the model.</p>\n", out);
    }
    fputs("</section>\n", out);
}
