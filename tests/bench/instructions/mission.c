#include "mission.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TAU 6.283185307179586

static float uniform(struct mission *mission, double least, double most) {
    return (float)(least + (most - least) * random_uniform(&mission->random));
}

static bool happens(struct mission *mission, double chance) {
    return random_uniform(&mission->random) < chance;
}

/* --- commands --- */

/* A bend that some pressures over a floor give, so that it can be reached. */
static void reachable_bend(struct mission *mission, struct frame_command *command) {
    const struct bend_table *table = mission->table;
    const double most_pa = (double)table->module.working_pressure_pa;
    const float floor_pa = happens(mission, 0.5) ? uniform(mission, 0.0, 0.4 * most_pa) : 0.0f;
    const size_t lowest = (size_t)(3.0 * random_uniform(&mission->random));
    float pressure_pa[3];
    struct bend_table_stencil stencil;
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = c == lowest ? floor_pa : uniform(mission, (double)floor_pa, most_pa);
    }
    bend_table_locate(table, pressure_pa, &stencil);
    const float x = bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X);
    const float y = bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_Y);
    command->bend_rad = table->module.active_length_m * hypotf(x, y);
    command->direction_rad = atan2f(y, x);
    command->co_contraction_pa = floor_pa;
}

static void bend(struct mission *mission, struct frame_command *command) {
    const double limit_rad = (double)mission->table->module.bend_limit_rad;
    const double kind = random_uniform(&mission->random);
    reachable_bend(mission, command);
    if (kind < 0.15) { /* an end of the reachable set, or straight */
        command->bend_rad = happens(mission, 0.5) ? (float)limit_rad : uniform(mission, 0.0, 0.01);
        command->direction_rad = (float)(TAU / 6.0 * floor(6.0 * random_uniform(&mission->random)));
    } else if (kind < 0.25) { /* its edge */
        command->bend_rad = uniform(mission, 0.97 * limit_rad, 1.03 * limit_rad);
    } else if (kind < 0.4) { /* beyond */
        command->bend_rad = uniform(mission, limit_rad, 4.0);
        command->co_contraction_pa = happens(mission, 0.7) ? command->co_contraction_pa : 2e4f;
    }
}

static void pressures(struct mission *mission, struct frame_command *command) {
    const double most_pa = 1.2 * (double)mission->table->module.working_pressure_pa;
    for (size_t c = 0; c < 3; c++) {
        command->pressure_pa[c] = uniform(mission, -200.0, most_pa);
    }
}

static void next_command(struct mission *mission) {
    struct frame_command *command = &mission->command;
    const double kind = random_uniform(&mission->random);
    memset(command, 0, sizeof *command);
    mission->streams = kind < 0.15;
    if (kind < 0.75) {
        command->kind = COMMAND_BEND;
        bend(mission, command);
    } else if (kind < 0.88) {
        command->kind = COMMAND_PRESSURE;
        pressures(mission, command);
    } else {
        command->kind = kind < 0.93 ? COMMAND_HOLD : (kind < 0.97 ? COMMAND_VENT : COMMAND_CLEAR);
    }
    if (happens(mission, 0.02)) {
        command->bend_rad = NAN;
        command->pressure_pa[1] = INFINITY;
    }
}

static void command(struct mission *mission) {
    struct frame_command *given = &mission->frame.input.command;
    const int64_t time_us = mission->frame.input.time_us;
    memset(given, 0, sizeof *given);
    if (time_us < SUPERVISOR_PAUSE_US + 30000) {
        return; /* the self-test */
    }
    const bool fault = mission->frame.output.state == (uint32_t)SUPERVISOR_FAULT;
    if (time_us >= mission->next_us) {
        next_command(mission);
        mission->next_us = time_us + (int64_t)(1e3 * floor(uniform(mission, 5.0, 500.0)));
        *given = mission->command;
    } else if (mission->streams) {
        bend(mission, &mission->command);
        *given = mission->command;
    } else if (time_us % 100000 == 0) {
        *given = mission->command;
    }
    given->kind = fault && happens(mission, 0.02) ? (uint32_t)COMMAND_CLEAR : given->kind;
}

/* --- readings --- */

static void read_tips(struct mission *mission) {
    struct frame_input *input = &mission->frame.input;
    struct hal_tip_sample sample;
    while (input->tip_count < FRAME_TIP_SAMPLES && mission->plant.read_tip(mission->plant.context, &sample)) {
        struct frame_tip *tip = &input->tip[input->tip_count++];
        tip->measured_us = sample.measured_us;
        memcpy(tip->position_m, sample.position_m, sizeof tip->position_m);
        memcpy(tip->quaternion, sample.quaternion, sizeof tip->quaternion);
        tip->quality = sample.quality;
        tip->status = happens(mission, 0.02) ? 4u : sample.status;
    }
}

static void read_pressures(struct mission *mission) {
    struct frame_input *input = &mission->frame.input;
    struct hal_pressures pressures = {.supply_pa = 0.0f};
    input->pressures_read = mission->plant.read_pressures(mission->plant.context, &pressures) ? 1u : 0u;
    for (size_t c = 0; c < 3; c++) {
        input->chamber_pa[c] = pressures.chamber_pa[c];
        input->chamber_ok[c] = pressures.chamber_ok[c] ? 1u : 0u;
    }
    input->supply_pa = pressures.supply_pa;
    input->supply_ok = happens(mission, 0.99) && pressures.supply_ok ? 1u : 0u;
}

void mission_read(struct mission *mission) {
    struct frame_input *input = &mission->frame.input;
    if (mission->step % 1000u == 0u) {
        mission->sim.faults.tip_stops = happens(mission, 0.2);
    }
    mission->sim.faults.channel_fails[mission->step % 3u] = happens(mission, 1e-4);
    memset(input, 0, sizeof *input);
    input->time_us = mission->plant.time_us(mission->plant.context);
    read_pressures(mission);
    read_tips(mission);
    command(mission);
}

/* --- the mission --- */

/* The last ones are what frame_app.c's calibration knows of. */
static void add_effects(struct mission *mission, enum frame_variant variant) {
    static const char *const effects[] = {"creep:amplitude=0.06,time_constant=0.5",
                                          "chamber_leak:conductance=2e-12",
                                          "pressure_gain:gain=1.03",
                                          "pressure_offset:offset=120",
                                          "pressure_lag:time_constant=0.01",
                                          "valve_dead_time:delay=0.06",
                                          "valve_dead_band:least_duty=0.12,loss=0.4",
                                          "line_resistance:conductance_scale=0.9",
                                          "line_volume:volume=1e-6"};
    const size_t count = variant == FRAME_CALIBRATED ? sizeof effects / sizeof effects[0] : 2;
    for (size_t i = 0; i < count; i++) {
        struct effect effect;
        char text[256];
        if (!effect_parse(effects[i], &effect, text, sizeof text) || !sim_add_effect(&mission->sim, &effect)) {
            abort(); /* the catalogue has changed */
        }
    }
}

bool mission_open(struct mission *mission, const void *image, size_t bytes, enum frame_variant variant, uint64_t seed) {
    struct sim_parameters parameters;
    memset(mission, 0, sizeof *mission);
    mission->frame.table_bytes = (uint32_t)bytes;
    mission->frame.variant = (uint32_t)variant;
    if (!frame_app_open(&mission->board, &mission->frame, image)) {
        return false;
    }
    mission->table = &mission->board.table;
    sim_default_parameters(&parameters);
    parameters.sensor.tip_period_us = 5000;
    sim_init(&mission->sim, mission->table, &parameters, seed);
    add_effects(mission, variant);
    sim_bind(&mission->sim, &mission->plant);
    random_seed(&mission->random, seed, 77);
    return true;
}

void mission_step(struct mission *mission) {
    const struct frame_output *output = &mission->frame.output;
    struct hal_outputs outputs;
    frame_app_step(&mission->board);
    memcpy(outputs.duty, output->duty, sizeof outputs.duty);
    outputs.valves_enabled = output->valves_enabled != 0u;
    outputs.supply_enabled = output->supply_enabled != 0u;
    (void)mission->plant.write_outputs(mission->plant.context, &outputs);
    sim_advance(&mission->sim, CONTROLLER_STEP_US);
    mission->step++;
}

void mission_inversion(struct mission *mission, struct frame_inversion *inversion) {
    struct frame_command command;
    memset(&command, 0, sizeof command);
    memset(inversion, 0, sizeof *inversion);
    bend(mission, &command);
    inversion->bend_rad[0] = command.bend_rad * cosf(command.direction_rad);
    inversion->bend_rad[1] = command.bend_rad * sinf(command.direction_rad);
    inversion->co_contraction_pa = command.co_contraction_pa;
}
