/* tribend-tables published: the founding paper's figures (Elsayed, Vincensi, Lekakou, Geng, Saaj, Ranzani, Cianchetti,
 * Menciassi 2014) beside what the section says. Bend without end correction, as the paper's free length of 55 mm. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "material/material_fit.h"
#include "section/section_solver.h"

#define DEGREES (180.0 / M_PI)
#define RIGHT_ANGLE (0.5 * M_PI)
#define OUTER_M 0.0125
#define RADIUS_M 0.0037
#define WALL_M 0.0015
#define CHAMBER_M 0.055
#define LENGTH_M 0.065

struct answer {
    bool found;
    struct section_state state; /* at the goal, or at the greatest pressure of the path where the goal was not found */
};

static struct module_description paper_module(enum cavity_shape shape, double radius_m, double wall_m,
                                              const struct material *material) {
    struct module_description module;
    memset(&module, 0, sizeof module);
    module.outer_diameter_m = 2.0 * OUTER_M;
    module.three_fold = true;
    module.material = *material;
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        const double azimuth = (double)c * 2.0 * M_PI / 3.0, centre_m = OUTER_M - wall_m - radius_m;
        module.chamber[c].cavity_count = 1;
        module.chamber[c].cavity[0] =
            (struct cavity){.shape = shape,
                            .centre_m = {centre_m * cos(azimuth), centre_m * sin(azimuth)},
                            .radius_m = radius_m,
                            .orientation_rad = azimuth};
    }
    return module;
}

static bool keep_greatest(void *context, const struct section_state *state) {
    struct section_state *greatest = context;
    if (state->pressure_pa[0] > greatest->pressure_pa[0]) {
        *greatest = *state;
    }
    return program_interrupted == 0;
}

static void solve_to(const struct module_description *module, enum section_goal goal, double value,
                     struct answer *answer) {
    static const double direction_pa[3] = {1.0, 0.0, 0.0};
    struct description_error error = {""};
    struct section_mesh *mesh = section_mesh_create(module, NULL, &error);
    struct section_solver *solver = mesh == NULL ? NULL : section_solver_create(mesh, module, &error);
    memset(answer, 0, sizeof *answer);
    if (solver != NULL) {
        answer->found = section_solver_path(solver, direction_pa, goal, value, keep_greatest, &answer->state, &error);
        if (answer->found) {
            section_solver_state(solver, &answer->state);
        }
    }
    section_solver_free(solver);
    section_mesh_free(mesh);
}

static double bend_deg(const struct answer *answer) {
    return hypot(answer->state.curvature_x_1pm, answer->state.curvature_y_1pm) * CHAMBER_M * DEGREES;
}

static double pressure_at_bend_pa(const struct module_description *module, double bend_rad, double chamber_m) {
    struct answer answer;
    solve_to(module, SECTION_GOAL_CURVATURE, bend_rad / chamber_m, &answer);
    return answer.found ? answer.state.pressure_pa[0] : NAN;
}

static void row(const char *id, const char *paper, const char *ours, const char *verdict, const char *reason) {
    printf("%-20s %-26s %-38s %-9s %s\n", id, paper, ours, verdict, reason);
    (void)fflush(stdout);
}

static const char *verdict(double ours, double paper, double share) {
    return fabs(ours - paper) <= share * paper ? "agrees" : "differs";
}

/* --- materials as printed --- */

static struct material polynomial(const char *name, size_t terms, double c1, double c2, double c3) {
    struct material material;
    memset(&material, 0, sizeof material);
    (void)snprintf(material.name, sizeof material.name, "%s", name);
    material.law = terms == 3 ? MATERIAL_YEOH : MATERIAL_REDUCED_POLYNOMIAL;
    material.terms = terms;
    material.coefficient_pa[0] = c1;
    material.coefficient_pa[1] = c2;
    material.coefficient_pa[2] = c3;
    material.bulk_modulus_pa = 1e9;
    material.strain_max = 3.0;
    return material;
}

static void print_materials(void) {
    const struct material printed = polynomial("printed", 3, 5072.0, -331.0, -15.0);
    const struct material skin = polynomial("skin", 2, 1190.0, 23028.0, 0.0);
    const struct module_description module = paper_module(CAVITY_CIRCLE, RADIUS_M, WALL_M, &printed);
    struct answer answer;
    char ours[96];
    (void)snprintf(ours, sizeof ours, "stress falls beyond %.2f/%.2f/%.2f",
                   material_stable_stretch(&printed, DEFORMATION_UNIAXIAL, 4.0),
                   material_stable_stretch(&printed, DEFORMATION_SHEAR, 4.0),
                   material_stable_stretch(&printed, DEFORMATION_EQUIBIAXIAL, 4.0));
    row("mat-e30-c20", "-331 Pa", ours, "wrong",
        "as printed the law is unstable (stretch in uniaxial/shear/equibiaxial), yet called fitted to 300 %");
    solve_to(&module, SECTION_GOAL_PRESSURE, 8000.0, &answer);
    (void)snprintf(ours, sizeof ours, "%s %.0f Pa, %.1f deg", answer.found ? "reaches" : "no equilibrium beyond",
                   answer.state.pressure_pa[0], bend_deg(&answer));
    row("mat-e30-c30", "-15 Pa", ours, answer.found ? "agrees" : "wrong",
        "the paper's own results need 8 kPa; below, every sign is taken as positive (a variant)");
    (void)snprintf(ours, sizeof ours, "initial shear modulus %.1f kPa", 1e-3 * material_shear_modulus(&skin));
    row("mat-ds30-c10", "1190 Pa", ours, "wrong",
        "softer than the paper's Ecoflex; measured pulls of Dragon Skin 30 give about 200 kPa");
}

/* --- the module --- */

static void print_bends(const struct material *material) {
    const struct module_description circle = paper_module(CAVITY_CIRCLE, RADIUS_M, WALL_M, material);
    const struct module_description semicircle = paper_module(CAVITY_SEMICIRCLE, RADIUS_M, WALL_M, material);
    struct answer answer;
    char ours[96];
    solve_to(&circle, SECTION_GOAL_PRESSURE, 6000.0, &answer);
    (void)snprintf(ours, sizeof ours, "%.1f deg", bend_deg(&answer));
    row("e30-transition-low", "0 to 20 deg at 0.06 bar", ours, bend_deg(&answer) <= 20.0 ? "agrees" : "differs",
        "steep here too, but without a snap: the paper's jump needs a fold, and so another sign of C20");
    solve_to(&circle, SECTION_GOAL_PRESSURE, 8000.0, &answer);
    (void)snprintf(ours, sizeof ours, "%.1f deg", bend_deg(&answer));
    row("e30-transition-high", "over 150 deg at 0.08 bar", ours, bend_deg(&answer) > 150.0 ? "agrees" : "differs",
        "same: the transition lies in this range, but is spread over it");
    solve_to(&circle, SECTION_GOAL_PRESSURE, 10000.0, &answer);
    (void)snprintf(ours, sizeof ours, "%.2f mm", 1e3 * answer.state.width_bend_plane_m);
    row("e30-width-fea", "40.7 mm at 0.1 bar", ours, verdict(answer.state.width_bend_plane_m, 40.7e-3, 0.03),
        "balloon and section together; 5 % less, as the variant's bend at this pressure is less");
    row("e30-width-measured", "41.2 mm at 0.1 bar", ours, verdict(answer.state.width_bend_plane_m, 41.2e-3, 0.03),
        "as above");
    (void)snprintf(ours, sizeof ours, "%.2f MPa, mean through the apex", 1e-6 * answer.state.von_mises_apex_pa);
    row("e30-stress-low", "0.5 MPa at 0.1 bar", ours,
        answer.state.von_mises_apex_pa >= 0.5e6 && answer.state.von_mises_apex_pa <= 0.9e6 ? "agrees" : "differs",
        "inside the paper's 0.5 to 0.9 MPa");
    row("e30-stress-high", "0.9 MPa at 0.1 bar", ours,
        answer.state.von_mises_apex_pa >= 0.5e6 && answer.state.von_mises_apex_pa <= 0.9e6 ? "agrees" : "differs",
        "inside the paper's 0.5 to 0.9 MPa");
    const double p90_pa = pressure_at_bend_pa(&semicircle, RIGHT_ANGLE, CHAMBER_M);
    (void)snprintf(ours, sizeof ours, "%.4f bar", 1e-5 * p90_pa);
    row("e30-p90-semicircle", "0.08 bar", ours, verdict(p90_pa, 8000.0, 0.05),
        "14 % more with the variant; the coefficients behind the paper's curve are not the printed ones");
    struct answer other;
    solve_to(&circle, SECTION_GOAL_CURVATURE, RIGHT_ANGLE / CHAMBER_M, &answer);
    solve_to(&semicircle, SECTION_GOAL_CURVATURE, RIGHT_ANGLE / CHAMBER_M, &other);
    (void)snprintf(ours, sizeof ours, "circle %.2f, semicircle %.2f mm", 1e3 * answer.state.width_bend_plane_m,
                   1e3 * other.state.width_bend_plane_m);
    row("trend-balloon", "semicircle least", ours,
        other.state.width_bend_plane_m < answer.state.width_bend_plane_m ? "agrees" : "differs",
        "outer width at 90 deg and equal radius; the rank depends on material and area");
}

/* Correlation of pressure with the abscissa: how straight a trend is. */
static double correlation(const double *x, const double *y, size_t count) {
    double mx = 0.0, my = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    for (size_t i = 0; i < count; i++) {
        mx += x[i] / (double)count;
        my += y[i] / (double)count;
    }
    for (size_t i = 0; i < count; i++) {
        xx += (x[i] - mx) * (x[i] - mx);
        yy += (y[i] - my) * (y[i] - my);
        xy += (x[i] - mx) * (y[i] - my);
    }
    return xy / sqrt(xx * yy);
}

static void print_trend(const char *id, const char *paper, const double *x, const double *pressure_pa, double sign,
                        const char *reason) {
    char ours[96];
    const double r = correlation(x, pressure_pa, 4);
    (void)snprintf(ours, sizeof ours, "%.2f %.2f %.2f %.2f kPa, r = %+.3f", 1e-3 * pressure_pa[0], 1e-3 * pressure_pa[1],
                   1e-3 * pressure_pa[2], 1e-3 * pressure_pa[3], r);
    row(id, paper, ours, sign * r > 0.97 ? "agrees" : "differs", reason);
}

static void print_trends(const struct material *material) {
    static const double walls_m[4] = {0.001, 0.0013, 0.0016, 0.002};
    static const double ratios[4] = {0.6, 0.7, 0.8, 0.9};
    static const double radii_m[4] = {0.0028, 0.0031, 0.0034, 0.0037};
    double pressure_pa[4], area[4];
    for (size_t i = 0; i < 4; i++) {
        const struct module_description module = paper_module(CAVITY_SEMICIRCLE, RADIUS_M, walls_m[i], material);
        pressure_pa[i] = pressure_at_bend_pa(&module, RIGHT_ANGLE, CHAMBER_M);
    }
    print_trend("trend-wall", "falls as the wall thins", walls_m, pressure_pa, 1.0, "90 deg at walls 1, 1.3, 1.6, 2 mm");
    for (size_t i = 0; i < 4; i++) {
        const struct module_description module = paper_module(CAVITY_SEMICIRCLE, RADIUS_M, WALL_M, material);
        pressure_pa[i] = pressure_at_bend_pa(&module, RIGHT_ANGLE, ratios[i] * LENGTH_M);
    }
    print_trend("trend-length", "falls with length ratio", ratios, pressure_pa, -1.0,
                "90 deg at chamber/module length 0.6, 0.7, 0.8, 0.9");
    for (size_t i = 0; i < 4; i++) {
        const struct module_description module = paper_module(CAVITY_SEMICIRCLE, radii_m[i], WALL_M, material);
        area[i] = radii_m[i] * radii_m[i];
        pressure_pa[i] = pressure_at_bend_pa(&module, RIGHT_ANGLE, CHAMBER_M);
    }
    print_trend("trend-area", "falls with area ratio", area, pressure_pa, -1.0,
                "90 deg of semicircles of radius 2.8, 3.1, 3.4, 3.7 mm");
}

/* --- Ecoflex 0050: the printed Ogden law's uniaxial curve, refitted by a stable law --- */

static const struct material ogden_0050 = {.name = "ecoflex-0050-printed",
                                           .law = MATERIAL_OGDEN,
                                           .terms = 3,
                                           .coefficient_pa = {107900.0, 21.47, -87100.0},
                                           .exponent = {1.55, 7.86, -1.91},
                                           .bulk_modulus_pa = 1e9,
                                           .strain_max = 3.0};

static void print_ecoflex_0050(const struct material *ecoflex_0030) {
    double strain[61], stress_pa[61];
    char message[PROGRAM_ERROR_BYTES], ours[96];
    struct material_fit fit;
    for (size_t i = 0; i < 61; i++) {
        strain[i] = 0.05 * (double)i;
        stress_pa[i] = material_nominal_stress_pa(&ogden_0050, DEFORMATION_UNIAXIAL, 1.0 + strain[i]);
    }
    const struct tensile_test curve = {61, strain, stress_pa, DEFORMATION_UNIAXIAL};
    const struct material_fit_options how = {MATERIAL_YEOH, 3, 3.0, true};
    if (!material_fit(&curve, 1, &how, &fit, message, sizeof message)) {
        row("e50-pressure-ratio", "about 3", message, "failed", "");
        return;
    }
    fit.material.bulk_modulus_pa = 1e9;
    const bool stable = material_stable_stretch(&fit.material, DEFORMATION_UNIAXIAL, 4.0) >= 4.0 &&
                        material_stable_stretch(&fit.material, DEFORMATION_EQUIBIAXIAL, 4.0) >= 4.0;
    const struct module_description soft = paper_module(CAVITY_SEMICIRCLE, RADIUS_M, WALL_M, ecoflex_0030);
    const struct module_description stiff = paper_module(CAVITY_SEMICIRCLE, RADIUS_M, WALL_M, &fit.material);
    const double ratio = pressure_at_bend_pa(&stiff, RIGHT_ANGLE, CHAMBER_M) /
                         pressure_at_bend_pa(&soft, RIGHT_ANGLE, CHAMBER_M);
    (void)snprintf(ours, sizeof ours, "%.2f (Yeoh refit, %s)", ratio, stable ? "stable" : "unstable");
    row("e50-pressure-ratio", "about 3", ours, verdict(ratio, 3.0, 0.2),
        "90 deg; the printed Ogden law itself is unstable beyond equibiaxial stretch 1.06");
    struct answer answer;
    solve_to(&stiff, SECTION_GOAL_PRESSURE, 26000.0, &answer);
    if (answer.found) {
        (void)snprintf(ours, sizeof ours, "%.2f MPa, mean through the apex", 1e-6 * answer.state.von_mises_apex_pa);
    } else {
        (void)snprintf(ours, sizeof ours, "no equilibrium beyond %.0f Pa", answer.state.pressure_pa[0]);
    }
    row("e50-stress", "5 MPa above 0.26 bar", ours,
        answer.found ? verdict(answer.state.von_mises_apex_pa, 5e6, 0.3) : "differs",
        "the paper's is a local maximum above this pressure, ours the mean of a refitted law at it");
}

static void print_silent(void) {
    static const struct {
        const char *id;
        const char *reason;
    } silent[] = {{"e30-p90-ring", "ring sectors are not described yet"},
                  {"e30-angle-lag", "a comparison with a measured module, rate and age of the rubber included"},
                  {"e30-force, e50-force", "the tip against an obstacle: not a free section"},
                  {"e50-burst", "failure, not equilibrium"},
                  {"comp-*, e50-plain-*", "a composite of three rubbers and an accordion"},
                  {"geom-*, act-*, test-*", "what was built and measured: inputs, not results"}};
    printf("\nRows that a free section of one rubber cannot speak to:\n");
    for (size_t i = 0; i < sizeof silent / sizeof silent[0]; i++) {
        printf("  %-22s %s\n", silent[i].id, silent[i].reason);
    }
}

static const struct argp parser = {NULL, NULL, NULL, "Hold the solver against the founding paper's figures.", NULL,
                                   NULL, NULL};

int cli_published(int argc, char **argv) {
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, NULL) != 0) {
        return EXIT_USAGE;
    }
    const struct material positive = polynomial("ecoflex-0030-positive", 3, 5072.0, 331.0, 15.0);
    printf("Elsayed et al. 2014 against the section solver, Ecoflex 0030 with every printed sign taken as positive.\n\n");
    row("figure", "paper", "ours", "verdict", "reason");
    program_catch_interrupt();
    print_materials();
    print_bends(&positive);
    print_trends(&positive);
    print_ecoflex_0050(&positive);
    if (program_interrupted != 0) {
        return program_fail(EXIT_INTERRUPTED, "interrupted");
    }
    print_silent();
    return EXIT_OK;
}
