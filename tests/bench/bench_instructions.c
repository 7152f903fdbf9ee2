/* Instructions of a control step and of an inversion on an emulated Cortex-M4F, over random missions. Prints; asserts
 * the identical bits only. Arguments: the ELF of image.c, then tables. DETAILS=1 lists functions one by one. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instructions/compare.h"
#include "program/table_file.h"

#define DEGREES (180.0 / M_PI)
#define SEEDS 4u
#define STEPS 60000u
#define INVERSIONS 20000u

/* Shown one by one where DETAILS is set. */
static const char *const parts[] = {"app_step",
                                    "controller_step",
                                    "bend_inverse_begin",
                                    "bend_inverse_step",
                                    "bend_plane_evaluate",
                                    "bend_plane_node",
                                    "bend_table_locate_in_cell",
                                    "bend_table_cell",
                                    "bend_table_locate",
                                    "bend_table_gradient",
                                    "bend_table_value",
                                    "bend_table_keep_valid",
                                    "pressure_loop_predict",
                                    "pressure_loop_correct",
                                    "pressure_loop_duty",
                                    "tip_loop_update",
                                    "tip_loop_predict",
                                    "tip_loop_store",
                                    "gap_monitor_follow_pressures",
                                    "gap_monitor_follow_pose",
                                    "limits_check_table",
                                    "limits_check_pressures",
                                    "calibration_pose",
                                    "calibration_pressure",
                                    "supervisor_step",
                                    "crc32_update",
                                    "real_atan2",
                                    "real_sin",
                                    "real_cos",
                                    "memcpy",
                                    "memset",
                                    "__aeabi_ldivmod"};

static void print_cost(const char *what, const struct cost *cost) {
    printf("  %-28s %9zu calls  mean %6.0f  99.9 %% %6llu  worst %6llu instructions\n", what, cost->calls,
           cost_mean(cost), (unsigned long long)cost_quantile(cost, 0.999),
           (unsigned long long)cost_quantile(cost, 1.0));
}

static void print_parts(const struct call_counter *counter) {
    const struct call_counter_function *function;
    const size_t count = call_counter_followed(counter, &function);
    for (size_t i = 0; i < count; i++) {
        printf("    %-32s %9llu calls  mean %6.0f  worst %6llu\n", function[i].name,
               (unsigned long long)function[i].calls,
               function[i].calls == 0 ? 0.0 : (double)function[i].total / (double)function[i].calls,
               (unsigned long long)function[i].worst);
    }
}

static void merge(struct cost *sum, struct cost *part) {
    uint64_t *counts = realloc(sum->count, (sum->calls + part->calls + 1) * sizeof *counts);
    if (counts == NULL) {
        exit(1);
    }
    memcpy(counts + sum->calls, part->count, part->calls * sizeof *counts);
    sum->count = counts;
    sum->calls += part->calls;
}

static int measure(const char *elf, const struct table_file *file, enum frame_variant variant, const char *name) {
    struct cost step = {NULL, 0, 0}, inversion_step = {NULL, 0, 0}, inversion = {NULL, 0, 0};
    double preview_rad[2] = {0.0, 0.0};
    bool same = true;
    for (uint64_t seed = 1; seed <= SEEDS && same; seed++) {
        static struct compare compare;
        same = compare_open(&compare, elf, file->bytes, file->size, variant, seed);
        for (size_t i = 0; i < sizeof parts / sizeof parts[0] && same && getenv("DETAILS") != NULL; i++) {
            (void)call_counter_follow(compare.counter, parts[i]);
        }
        same = same && compare_steps(&compare, STEPS / SEEDS);
        if (same && getenv("DETAILS") != NULL) {
            print_parts(compare.counter);
        }
        same = same && compare_inversions(&compare, INVERSIONS / SEEDS);
        if (!same) {
            fprintf(stderr, "bench_instructions: %s\n", compare.difference);
        }
        merge(&step, &compare.step);
        merge(&inversion_step, &compare.inversion_step);
        merge(&inversion, &compare.inversion);
        preview_rad[0] = fmax(preview_rad[0], compare.preview_rad[0]);
        preview_rad[1] = fmax(preview_rad[1], compare.preview_rad[1]);
        compare_close(&compare);
    }
    printf("%s, %s\n", name, variant == FRAME_CALIBRATED ? "calibrated in every number" : "nominal");
    print_cost("control step (app_step)", &step);
    print_cost("inversion, each step", &inversion_step);
    print_cost("inversion, all steps", &inversion);
    printf("  of a bend that can be reached, the first step leaves %.3f deg at most, the second %.3f deg\n",
           preview_rad[0] * DEGREES, preview_rad[1] * DEGREES);
    free(step.count);
    free(inversion_step.count);
    free(inversion.count);
    return same ? 0 : 1;
}

int main(int argc, char **argv) {
    int failed = argc < 3 ? 2 : 0;
    for (int i = 2; i < argc && failed == 0; i++) {
        struct table_file file;
        failed = table_file_open(&file, argv[i], NULL);
        for (int variant = 0; variant < (int)FRAME_VARIANT_COUNT && failed == 0; variant++) {
            failed = measure(argv[1], &file, (enum frame_variant)variant, argv[i]);
        }
        table_file_close(&file);
    }
    return failed;
}
