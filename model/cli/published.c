/* tribend-tables published: the founding paper's figures (Elsayed, Vincensi, Lekakou, Geng, Saaj, Ranzani, Cianchetti,
 * Menciassi 2014) beside what the section says. Bend without end correction, over the paper's free length of 55 mm.
 * Where the two differ, the reason is looked for by computing: with another bulk modulus, another law, another shape. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "material/material_fit.h"
#include "study/study.h"

#define DEGREES (180.0 / M_PI)
#define RIGHT_ANGLE (0.5 * M_PI)
#define MODULE_AREA_M2 (M_PI * PAPER_RADIUS_M * PAPER_RADIUS_M)
#define CIRCLE_AREA_M2 (M_PI * PAPER_CAVITY_RADIUS_M * PAPER_CAVITY_RADIUS_M)
#define STRETCH_MOST 4.0

/* The equilibria that single rows need; those of the studies follow behind. */
enum single {
    PRINTED_8KPA,
    CIRCLE_6KPA,
    CIRCLE_8KPA,
    CIRCLE_10KPA,
    CIRCLE_90,
    SEMICIRCLE_90,
    CIRCLE_6KPA_SOFT,
    CIRCLE_8KPA_SOFT,
    CIRCLE_10KPA_SOFT,
    SEMICIRCLE_90_SOFT,
    REFIT_0050_90,
    REFIT_0050_26KPA,
    MEASURED_0030_90,
    MEASURED_0050_90,
    COMPOSITE_90,
    SINGLES
};

struct rows {
    struct study_point point[4 * STUDY_POINTS_MAX];
    struct study_answer answer[4 * STUDY_POINTS_MAX];
    size_t count;
    size_t first[STUDY_KINDS]; /* point of each study */
    size_t length[STUDY_KINDS];
    struct material positive;
    struct material refit_0050;
};

/* Stiffness against volume change that a compressible finite-element model may have had, over the shear modulus. */
#define BULK_RATIO_SOFT 50.0

static const struct material printed_0030 = {.name = "ecoflex-0030-printed",
                                             .law = MATERIAL_YEOH,
                                             .terms = 3,
                                             .coefficient_pa = {5072.0, -331.0, -15.0},
                                             .bulk_modulus_pa = 1e9,
                                             .strain_max = 3.0};
static const struct material printed_0050 = {.name = "ecoflex-0050-printed",
                                             .law = MATERIAL_OGDEN,
                                             .terms = 3,
                                             .coefficient_pa = {107900.0, 21.47, -87100.0},
                                             .exponent = {1.55, 7.86, -1.91},
                                             .bulk_modulus_pa = 1e9,
                                             .strain_max = 3.0};
static const struct material printed_dragon_skin = {.name = "dragon-skin-0030-printed",
                                                    .law = MATERIAL_REDUCED_POLYNOMIAL,
                                                    .terms = 2,
                                                    .coefficient_pa = {1190.0, 23028.0},
                                                    .bulk_modulus_pa = 1e9,
                                                    .strain_max = 3.0};

/* --- what is to be solved --- */

static void set_point(struct rows *rows, enum single at, enum cavity_shape shape, const struct material *material,
                      enum section_goal goal, double value) {
    struct study_point *point = &rows->point[at];
    const double area_m2 = shape == CAVITY_CIRCLE ? CIRCLE_AREA_M2 : 0.5 * CIRCLE_AREA_M2;
    study_module(shape, area_m2, PAPER_WALL_M, material, &point->module);
    point->chamber_length_m = PAPER_CHAMBER_LENGTH_M;
    point->goal = goal;
    point->value = value;
}

/* A stable law with the uniaxial curve of the printed Ogden law of Ecoflex 0050. */
static bool refit(struct rows *rows, struct description_error *error) {
    double strain[61], stress_pa[61];
    struct material_fit fit;
    for (size_t i = 0; i < 61; i++) {
        double slope_pa;
        strain[i] = 0.05 * (double)i;
        material_uniaxial(&printed_0050, 1.0 + strain[i], &stress_pa[i], &slope_pa);
    }
    const struct tensile_test curve = {61, strain, stress_pa, DEFORMATION_UNIAXIAL};
    const struct material_fit_options how = {MATERIAL_YEOH, 3, 3.0, true};
    if (!material_fit(&curve, 1, &how, &fit, error->text, sizeof error->text)) {
        return false;
    }
    rows->refit_0050 = fit.material;
    return true;
}

static bool read_table_file(const char *folder, const char *name, struct material *material,
                            struct module_description *module, struct description_error *error) {
    char path[PROGRAM_PATH_BYTES];
    cli_table_path(folder, name, path);
    return material != NULL ? material_read(path, material, error)
                            : module_description_read(path, NULL, module, error);
}

static bool plan(struct rows *rows, struct description_error *error) {
    struct material soft, measured_0030, measured_0050;
    struct module_description composite;
    if (!refit(rows, error) || !read_table_file("materials", "ecoflex-0030-positive", &rows->positive, NULL, error) ||
        !read_table_file("materials", "ecoflex-0030-measured-ogden", &measured_0030, NULL, error) ||
        !read_table_file("materials", "ecoflex-0050-measured-ogden", &measured_0050, NULL, error) ||
        !read_table_file("modules", "paper-composite", NULL, &composite, error)) {
        return false;
    }
    const double bend = RIGHT_ANGLE / PAPER_CHAMBER_LENGTH_M;
    soft = rows->positive;
    soft.bulk_modulus_pa = BULK_RATIO_SOFT * material_shear_modulus(&soft);
    set_point(rows, PRINTED_8KPA, CAVITY_CIRCLE, &printed_0030, SECTION_GOAL_PRESSURE, 8000.0);
    set_point(rows, CIRCLE_6KPA, CAVITY_CIRCLE, &rows->positive, SECTION_GOAL_PRESSURE, 6000.0);
    set_point(rows, CIRCLE_8KPA, CAVITY_CIRCLE, &rows->positive, SECTION_GOAL_PRESSURE, 8000.0);
    set_point(rows, CIRCLE_10KPA, CAVITY_CIRCLE, &rows->positive, SECTION_GOAL_PRESSURE, 10000.0);
    set_point(rows, CIRCLE_90, CAVITY_CIRCLE, &rows->positive, SECTION_GOAL_CURVATURE, bend);
    set_point(rows, SEMICIRCLE_90, CAVITY_SEMICIRCLE, &rows->positive, SECTION_GOAL_CURVATURE, bend);
    set_point(rows, CIRCLE_6KPA_SOFT, CAVITY_CIRCLE, &soft, SECTION_GOAL_PRESSURE, 6000.0);
    set_point(rows, CIRCLE_8KPA_SOFT, CAVITY_CIRCLE, &soft, SECTION_GOAL_PRESSURE, 8000.0);
    set_point(rows, CIRCLE_10KPA_SOFT, CAVITY_CIRCLE, &soft, SECTION_GOAL_PRESSURE, 10000.0);
    set_point(rows, SEMICIRCLE_90_SOFT, CAVITY_SEMICIRCLE, &soft, SECTION_GOAL_CURVATURE, bend);
    set_point(rows, REFIT_0050_90, CAVITY_SEMICIRCLE, &rows->refit_0050, SECTION_GOAL_CURVATURE, bend);
    set_point(rows, REFIT_0050_26KPA, CAVITY_SEMICIRCLE, &rows->refit_0050, SECTION_GOAL_PRESSURE, 26000.0);
    set_point(rows, MEASURED_0030_90, CAVITY_SEMICIRCLE, &measured_0030, SECTION_GOAL_CURVATURE, bend);
    set_point(rows, MEASURED_0050_90, CAVITY_SEMICIRCLE, &measured_0050, SECTION_GOAL_CURVATURE, bend);
    set_point(rows, COMPOSITE_90, CAVITY_SEMICIRCLE, &measured_0050, SECTION_GOAL_CURVATURE, bend);
    rows->point[COMPOSITE_90].module = composite;
    rows->count = SINGLES;
    for (int kind = 0; kind < STUDY_SHAPE; kind++) { /* the shapes are compared within the study of areas */
        rows->first[kind] = rows->count;
        rows->length[kind] =
            study_points((enum study_kind)kind, &rows->positive, RIGHT_ANGLE, &rows->point[rows->count]);
        rows->count += rows->length[kind];
    }
    return true;
}

/* --- rows --- */

static void row(const char *id, const char *paper, const char *verdict, const char *ours, const char *reason) {
    printf("%-20s %-26s %-9s %s\n", id, paper, verdict, ours);
    if (reason[0] != '\0') {
        printf("%58s%s\n", "", reason);
    }
}

static const char *near_to(double ours, double paper, double share) {
    return fabs(ours - paper) <= share * fabs(paper) ? "agrees" : "differs";
}

static double bend_deg(const struct rows *rows, enum single at) {
    return study_bend_rad(&rows->point[at], &rows->answer[at]) * DEGREES;
}

static const struct section_state *state_of(const struct rows *rows, enum single at) {
    return &rows->answer[at].state;
}

static double growth_percent(const struct rows *rows, enum single at) {
    return 100.0 * (state_of(rows, at)->width_bend_plane_m / (2.0 * PAPER_RADIUS_M) - 1.0);
}

static void print_materials(const struct rows *rows) {
    char ours[160], reason[200];
    (void)snprintf(ours, sizeof ours, "stress falls beyond stretch %.2f uniaxial, %.2f shear, %.2f equibiaxial",
                   material_stable_stretch(&printed_0030, DEFORMATION_UNIAXIAL, STRETCH_MOST),
                   material_stable_stretch(&printed_0030, DEFORMATION_SHEAR, STRETCH_MOST),
                   material_stable_stretch(&printed_0030, DEFORMATION_EQUIBIAXIAL, STRETCH_MOST));
    row("mat-e30-c20", "-331 Pa", "wrong", ours, "printed as fitted up to stretch 4, where a stress that falls cannot be");
    (void)snprintf(ours, sizeof ours, "%s %.0f Pa, %.1f deg",
                   rows->answer[PRINTED_8KPA].found ? "reaches" : "no equilibrium beyond",
                   state_of(rows, PRINTED_8KPA)->pressure_pa[0], bend_deg(rows, PRINTED_8KPA));
    row("mat-e30-c30", "-15 Pa", rows->answer[PRINTED_8KPA].found ? "agrees" : "wrong", ours,
        "the paper's results reach 10 kPa; below, every sign is taken as positive (a variant)");
    (void)snprintf(ours, sizeof ours, "stress falls beyond equibiaxial stretch %.2f, not elliptic beyond %.2f",
                   material_stable_stretch(&printed_0050, DEFORMATION_EQUIBIAXIAL, STRETCH_MOST),
                   material_elliptic_stretch(&printed_0050, DEFORMATION_EQUIBIAXIAL, STRETCH_MOST));
    row("mat-e50-l1..a3", "Ogden, fitted", "wrong", ours,
        "a fit to one uniaxial test leaves the other ways of pulling free: l3 a3 has the wrong sign for them");
    (void)snprintf(ours, sizeof ours, "initial shear modulus %.1f kPa", 1e-3 * material_shear_modulus(&printed_dragon_skin));
    (void)snprintf(reason, sizeof reason, "softer than the paper's Ecoflex 0030 (%.1f kPa); pulls give about 200 kPa",
                   1e-3 * material_shear_modulus(&rows->positive));
    row("mat-ds30-c10", "1190 Pa", "wrong", ours, reason);
}

static void print_bends(const struct rows *rows) {
    char ours[160], reason[200];
    const double low = bend_deg(rows, CIRCLE_6KPA), high = bend_deg(rows, CIRCLE_8KPA);
    (void)snprintf(ours, sizeof ours, "%.1f deg", low);
    (void)snprintf(reason, sizeof reason,
                   "no snap: with every sign positive the curve rises without a fold; bulk %.0f x shear: %.1f deg",
                   BULK_RATIO_SOFT, bend_deg(rows, CIRCLE_6KPA_SOFT));
    row("e30-transition-low", "0 to 20 deg at 0.06 bar", low <= 20.0 ? "agrees" : "differs", ours, reason);
    (void)snprintf(ours, sizeof ours, "%.1f deg", high);
    (void)snprintf(reason, sizeof reason, "incompressible; with a bulk modulus of %.0f x shear: %.1f deg", BULK_RATIO_SOFT,
                   bend_deg(rows, CIRCLE_8KPA_SOFT));
    row("e30-transition-high", "over 150 deg at 0.08 bar", high > 150.0 ? "agrees" : "differs", ours, reason);
    const double width = state_of(rows, CIRCLE_10KPA)->width_bend_plane_m;
    const double soft_width = state_of(rows, CIRCLE_10KPA_SOFT)->width_bend_plane_m;
    (void)snprintf(ours, sizeof ours, "%.2f mm", 1e3 * width);
    (void)snprintf(reason, sizeof reason,
                   "the width grows with the bend; bulk modulus %.0f x shear gives %.2f mm: the paper's lies between",
                   BULK_RATIO_SOFT, 1e3 * soft_width);
    row("e30-width-fea", "40.7 mm at 0.1 bar", near_to(width, 40.7e-3, 0.03), ours,
        soft_width > 40.7e-3 && width < 40.7e-3 ? reason : "");
    row("e30-width-measured", "41.2 mm at 0.1 bar", near_to(width, 41.2e-3, 0.03), ours,
        soft_width > 41.2e-3 && width < 41.2e-3 ? reason : "");
    const double stress_pa = state_of(rows, CIRCLE_10KPA)->von_mises_apex_pa;
    (void)snprintf(ours, sizeof ours, "%.2f MPa, mean through the apex", 1e-6 * stress_pa);
    row("e30-stress-low/high", "0.5 to 0.9 MPa at 0.1 bar", stress_pa >= 0.5e6 && stress_pa <= 0.9e6 ? "agrees" : "differs",
        ours, "");
    const double p90_pa = state_of(rows, SEMICIRCLE_90)->pressure_pa[0];
    const double soft_pa = state_of(rows, SEMICIRCLE_90_SOFT)->pressure_pa[0];
    (void)snprintf(ours, sizeof ours, "%.4f bar", 1e-5 * p90_pa);
    (void)snprintf(reason, sizeof reason, "incompressible; with a bulk modulus of %.0f x shear %.4f bar: %s",
                   BULK_RATIO_SOFT, 1e-5 * soft_pa,
                   fabs(soft_pa - 8000.0) <= 400.0 ? "a compressible model explains it" : "compressibility does not explain it");
    row("e30-p90-semicircle", "0.08 bar", near_to(p90_pa, 8000.0, 0.05), ours, reason);
}

/* Correlation of pressure (or width) with what the study varies, over `count` points from `from`. */
static double trend(const struct rows *rows, size_t from, size_t count, bool width) {
    double x[STUDY_POINTS_MAX], y[STUDY_POINTS_MAX];
    for (size_t i = 0; i < count; i++) {
        x[i] = rows->point[from + i].x;
        y[i] = width ? rows->answer[from + i].state.width_bend_plane_m : rows->answer[from + i].state.pressure_pa[0];
    }
    return study_correlation(x, y, count);
}

static double pressure_kpa(const struct rows *rows, size_t at) {
    return 1e-3 * rows->answer[at].state.pressure_pa[0];
}

static double width_mm(const struct rows *rows, size_t at) {
    return 1e3 * rows->answer[at].state.width_bend_plane_m;
}

static void print_wall_and_length(const struct rows *rows) {
    char ours[160];
    size_t first = rows->first[STUDY_WALL], last = first + rows->length[STUDY_WALL] - 1;
    double straight = trend(rows, first, rows->length[STUDY_WALL], false);
    (void)snprintf(ours, sizeof ours, "%.2f to %.2f kPa from ratio %.2f to %.2f, r = %+.3f; width %.1f to %.1f mm",
                   pressure_kpa(rows, first), pressure_kpa(rows, last), rows->point[first].x, rows->point[last].x, straight,
                   width_mm(rows, first), width_mm(rows, last));
    row("trend-wall", "falls as the wall thins", straight > 0.97 ? "agrees" : "differs", ours, "");
    row("geom-wall-optimum", "0.04 by pressure alone", "differs", ours,
        "the pressure falls all the way to the thinnest wall: no optimum by pressure alone, only by strength");
    first = rows->first[STUDY_LENGTH];
    last = first + rows->length[STUDY_LENGTH] - 1;
    straight = trend(rows, first, rows->length[STUDY_LENGTH], false);
    (void)snprintf(ours, sizeof ours, "%.2f to %.2f kPa from ratio %.2f to %.2f, r = %+.3f", pressure_kpa(rows, first),
                   pressure_kpa(rows, last), rows->point[first].x, rows->point[last].x, straight);
    row("trend-length", "falls with length ratio", straight < -0.97 ? "agrees" : "differs", ours, "");
    const size_t middle = first + 4; /* ratio 0.8 */
    const double before = (width_mm(rows, first) - width_mm(rows, middle)) / 0.2;
    const double after = (width_mm(rows, middle) - width_mm(rows, last)) / 0.15;
    (void)snprintf(ours, sizeof ours, "width falls %.1f mm a unit of ratio below 0.8, %.1f above", before, after);
    row("geom-length-ratio-min", "0.8: flat above it", after < 0.25 * before ? "agrees" : "differs", ours,
        after < before ? "same direction, flatter above 0.8, but no plateau" : "");
}

static void print_shapes(const struct rows *rows) {
    char ours[200];
    const size_t series = rows->length[STUDY_AREA] / STUDY_SHAPES, first = rows->first[STUDY_AREA];
    bool falls = true, balloons = true;
    int used = snprintf(ours, sizeof ours, "r of pressure, of width:");
    for (size_t shape = 0; shape < STUDY_SHAPES; shape++) {
        const double pressure = trend(rows, first + shape * series, series, false);
        const double width = trend(rows, first + shape * series, series, true);
        falls = falls && pressure < -0.95;
        balloons = balloons && (shape == CAVITY_RING_SECTOR ? width < 0.0 : width > 0.9);
        used += snprintf(ours + used, sizeof ours - (size_t)used, " %s %+.2f %+.2f%s", cavity_shape_name[shape], pressure,
                         width, shape + 1 < STUDY_SHAPES ? "," : "");
    }
    row("trend-area", "falls for all; ring's width falls, others' grow", falls && balloons ? "agrees" : "differs", ours, "");
    const size_t ring = first + CAVITY_RING_SECTOR * series;
    (void)snprintf(ours, sizeof ours, "%.4f bar at area ratio %.3f: %s of the four shapes", 1e-2 * pressure_kpa(rows, ring + 1),
                   rows->point[ring + 1].x,
                   pressure_kpa(rows, ring + 1) < pressure_kpa(rows, first + CAVITY_SECTOR * series + 1) ? "the least"
                                                                                                      : "not the least");
    row("e30-p90-ring", "0.065 bar, the least", near_to(pressure_kpa(rows, ring + 1), 6.5, 0.05), ours,
        "the ring's angle is not printed: 60 deg taken here; 45, 75 and 90 deg give 0.081, 0.055 and 0.047 bar");
    size_t least = 0, most = 0;
    used = snprintf(ours, sizeof ours, "width at ratio 0.04:");
    for (size_t shape = 0; shape < STUDY_SHAPES; shape++) {
        const size_t at = first + shape * series + 2;
        least = width_mm(rows, at) < width_mm(rows, first + least * series + 2) ? shape : least;
        most = width_mm(rows, at) > width_mm(rows, first + most * series + 2) ? shape : most;
        used += snprintf(ours + used, sizeof ours - (size_t)used, " %s %.2f", cavity_shape_name[shape], width_mm(rows, at));
    }
    (void)snprintf(ours + used, sizeof ours - (size_t)used, " mm");
    row("trend-balloon", "semicircle least, ring most", least == CAVITY_SEMICIRCLE && most == CAVITY_RING_SECTOR ? "agrees" : "differs",
        ours, "ring sector most; at equal area the circle's balloon is narrower. At equal radius the semicircle's is:");
    (void)snprintf(ours, sizeof ours, "circle %.2f, semicircle %.2f mm, radius 3.7 mm",
                   1e3 * state_of(rows, CIRCLE_90)->width_bend_plane_m, 1e3 * state_of(rows, SEMICIRCLE_90)->width_bend_plane_m);
    row("", "  at equal radius",
        state_of(rows, SEMICIRCLE_90)->width_bend_plane_m < state_of(rows, CIRCLE_90)->width_bend_plane_m ? "agrees" : "differs",
        ours, "");
    double greatest = 0.0;
    for (size_t i = SINGLES; i < rows->count; i++) {
        greatest = fmax(greatest, pressure_kpa(rows, i));
    }
    (void)snprintf(ours, sizeof ours, "%.3f bar", 1e-2 * greatest);
    row("max-pressure-study", "0.09 bar", near_to(greatest, 9.0, 0.1), ours,
        "the circle of the smallest area; as for e30-p90-semicircle, and areas below 0.03 are ours");
}

static void print_other_rubbers(const struct rows *rows) {
    char ours[160], reason[200];
    const double ratio =
        state_of(rows, REFIT_0050_90)->pressure_pa[0] / state_of(rows, SEMICIRCLE_90)->pressure_pa[0];
    const double measured =
        state_of(rows, MEASURED_0050_90)->pressure_pa[0] / state_of(rows, MEASURED_0030_90)->pressure_pa[0];
    (void)snprintf(ours, sizeof ours, "%.2f at 90 deg (stable refit of the printed uniaxial curve)", ratio);
    (void)snprintf(reason, sizeof reason, "measured pulls of both rubbers give %.2f: their moduli differ by less", measured);
    row("e50-pressure-ratio", "about 3", near_to(ratio, 3.0, 0.2), ours, reason);
    const struct study_answer *high = &rows->answer[REFIT_0050_26KPA];
    (void)snprintf(ours, sizeof ours, "%s%.2f MPa, mean through the apex", high->found ? "" : "not reached; at most ",
                   1e-6 * high->state.von_mises_apex_pa);
    row("e50-stress", "5 MPa above 0.26 bar", high->found ? near_to(high->state.von_mises_apex_pa, 5e6, 0.3) : "differs", ours,
        high->found ? "the paper's is a local maximum above this pressure, ours the mean at it" : high->why);
    (void)snprintf(ours, sizeof ours, "%.1f %%, bend 90 deg at %.3f bar", growth_percent(rows, COMPOSITE_90),
                   1e-5 * state_of(rows, COMPOSITE_90)->pressure_pa[0]);
    row("comp-fea", "16 % wider at 90 deg", near_to(growth_percent(rows, COMPOSITE_90), 16.0, 0.3), ours,
        "accordion as hoop fibres in half of a 2.5 mm layer; its depth is not printed");
    row("comp-measured", "26 % wider", near_to(growth_percent(rows, COMPOSITE_90), 26.0, 0.2), ours,
        "at 0.8 bar by the figure's caption, which none of the paper's other pressures comes near");
    (void)snprintf(ours, sizeof ours, "%.1f %%", growth_percent(rows, MEASURED_0050_90));
    row("e50-plain-measured", "60 % wider", near_to(growth_percent(rows, MEASURED_0050_90), 60.0, 0.2), ours,
        "at 90 deg; the paper does not say at which bend. The order of plain and composite is the same");
}

static void print_silent(void) {
    static const struct {
        const char *id;
        const char *reason;
    } silent[] = {{"e30-angle-lag", "a comparison with a measured module, rate and age of the rubber included"},
                  {"e30-force, e50-force", "the tip against an obstacle: not a free section"},
                  {"e50-burst", "failure, not equilibrium"},
                  {"geom-*, act-*, test-*", "what was built and measured: inputs, not results"}};
    printf("\nRows that a free section cannot speak to:\n");
    for (size_t i = 0; i < sizeof silent / sizeof silent[0]; i++) {
        printf("  %-22s %s\n", silent[i].id, silent[i].reason);
    }
}

static const struct argp parser = {NULL, NULL, NULL, "Hold the solver against the founding paper's figures.\v"
                                   "Example: tribend-tables published", NULL,
                                   NULL, NULL};

int cli_published(int argc, char **argv) {
    static struct rows rows;
    struct description_error error = {""};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, NULL) != 0) {
        return EXIT_USAGE;
    }
    if (!plan(&rows, &error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error.text);
    }
    struct cli_progress progress = {.what = "points"};
    const struct study_options how = {.progress = cli_show_progress, .context = &progress, .stop = &program_interrupted};
    program_catch_interrupt();
    const enum sweep_outcome outcome = study_solve(rows.point, rows.count, &how, rows.answer, &error);
    if (outcome != SWEEP_DONE) {
        return program_fail(outcome == SWEEP_STOPPED ? EXIT_INTERRUPTED : EXIT_SOLVER, "%s", error.text);
    }
    printf("Elsayed et al. 2014 against the section solver, Ecoflex 0030 with every printed sign taken as positive.\n\n");
    row("figure", "paper", "verdict", "ours, and the reason where they differ", "");
    print_materials(&rows);
    print_bends(&rows);
    print_wall_and_length(&rows);
    print_shapes(&rows);
    print_other_rubbers(&rows);
    print_silent();
    return EXIT_OK;
}
