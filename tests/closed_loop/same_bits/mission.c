/* Drives the controller through a mission whose inputs are made of integers, and prints a hash of every output bit. Built
 * with different compilers and optimisations by test_same_bits.sh. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/controller.h"

#define STEPS 60000

static uint64_t random_state = 2014u;

static uint32_t random_u32(void) {
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 33);
}

static float random_to(float most) {
    return most * (float)(random_u32() >> 8) / 8388608.0f;
}

static uint64_t mix(uint64_t hash, const void *bytes, size_t size) {
    const uint8_t *byte = bytes;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ byte[i]) * 1099511628211u;
    }
    return hash;
}

static void *read_table(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    void *image = malloc(1u << 20);
    if (file == NULL || image == NULL) {
        exit(1);
    }
    *size = fread(image, 1, 1u << 20, file);
    (void)fclose(file);
    return image;
}

static struct controller_command next_command(int step) {
    static struct controller_command command;
    if (step % 700 == 50) {
        const uint32_t kind = random_u32() % 8u;
        command = (struct controller_command){
            .kind = kind < 5u ? COMMAND_BEND : (kind < 7u ? COMMAND_PRESSURE : COMMAND_HOLD),
            .pressure_pa = {random_to(12000.0f), random_to(12000.0f), random_to(12000.0f)},
            .bend_rad = random_to(2.5f),
            .direction_rad = random_to(7.0f) - 3.5f,
            .co_contraction_pa = random_u32() % 4u == 0u ? random_to(3000.0f) : 0.0f};
    }
    return step % 100 == 50 ? command : (struct controller_command){.kind = COMMAND_NONE};
}

int main(int argc, char **argv) {
    static struct controller controller;
    struct bend_table table;
    struct controller_parameters parameters;
    struct controller_output output;
    size_t size = 0;
    void *image = argc == 2 ? read_table(argv[1], &size) : NULL;
    uint64_t hash = 14695981039346656037u;
    if (image == NULL || bend_table_open(&table, image, size, NULL) != BEND_TABLE_OK) {
        return 1;
    }
    controller_default_parameters(&parameters, &table);
    /* readings that no plant makes: what the detectors compute still counts, what they find does not */
    parameters.sensor_watch.rate_pa = 1e9f;
    parameters.sensor_watch.noise_most_pa = 1e9f;
    parameters.flow_watch.most_pa = 1e9f;
    parameters.flow_watch.missing_pa = 1e9f;
    parameters.flow_watch.steady_pa = 1e9f;
    parameters.tip_watch.over_rad = 10.0f;
    parameters.tip_watch.excess_rad = 10.0f;
    parameters.tip_watch.jump_rad = 3.0f;
    controller_init(&controller, &table, &parameters);
    for (int step = 0; step < STEPS; step++) {
        struct controller_input input = {.time_us = (int64_t)step * CONTROLLER_STEP_US,
                                         .pressure_ok = {true, true, true},
                                         .supply_pa = 40000.0f,
                                         .supply_ok = true,
                                         .command = next_command(step)};
        for (uint32_t c = 0; c < 3u; c++) { /* near the target, as a plant would be */
            input.pressure_pa[c] = controller.status.pressure_target_pa[c] + random_to(300.0f) - 150.0f;
        }
        if (step % 10 == 3) {
            const float x = random_to(0.8f) - 0.4f, y = random_to(0.8f) - 0.4f;
            input.tip_new = true;
            input.tip_measured_us = input.time_us - 8000;
            input.tip_quaternion[0] = 1.0f - 0.5f * (x * x + y * y);
            input.tip_quaternion[1] = x;
            input.tip_quaternion[2] = y;
        }
        controller_step(&controller, &input, &output);
        hash = mix(hash, output.duty, sizeof output.duty);
        hash = mix(hash, controller.status.pressure_estimate_pa, sizeof controller.status.pressure_estimate_pa);
        hash = mix(hash, controller.status.pressure_target_pa, sizeof controller.status.pressure_target_pa);
        hash = mix(hash, &controller.status.warnings, sizeof controller.status.warnings);
        hash = mix(hash, controller.sensor_watch, sizeof controller.sensor_watch);
        hash = mix(hash, controller.flow_watch, sizeof controller.flow_watch);
        hash = mix(hash, &controller.status.bend_rad, sizeof controller.status.bend_rad);
        hash = mix(hash, &controller.status.direction_rad, sizeof controller.status.direction_rad);
    }
    printf("%016llx %s\n", (unsigned long long)hash, supervisor_state_name(controller.status.state));
    free(image);
    return 0;
}
