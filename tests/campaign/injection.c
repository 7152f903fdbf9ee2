#include "campaign/injection.h"

#include <string.h>

#define WARNS(NAME) (1u << (unsigned)WARNING_##NAME)
#define TIP_UNUSABLE WARNS(TIP_LOST)
#define VALVE_GAP (WARNS(LEAK) | WARNS(VENT_WEAK) | WARNS(MODEL_GAP))

#define APPLY(name)                                                                                                 \
    static void name(struct bench *bench, size_t chamber, struct random_stream *random)
#define UNUSED (void)bench, (void)chamber, (void)random
#define FAULTS bench->sim.faults
#define PLANT bench->sim.plant

static double between(struct random_stream *random, double least, double most) {
    return least + (most - least) * random_uniform(random);
}

/* --- pressure sensors */

APPLY(reads_too_much) {
    FAULTS.reading_replaced[chamber] = true;
    FAULTS.reading_pa[chamber] = (float)between(random, 13100.0, 40000.0);
}
APPLY(wire_open) {
    UNUSED;
    FAULTS.reading_replaced[chamber] = true;
    FAULTS.reading_pa[chamber] = 50000.0f;
}
APPLY(channel_lost) {
    UNUSED;
    FAULTS.channel_fails[chamber] = true;
}
APPLY(bus_lost) {
    UNUSED;
    FAULTS.pressure_bus_fails = true;
}
APPLY(shorted) {
    UNUSED;
    FAULTS.reading_replaced[chamber] = true;
    FAULTS.reading_pa[chamber] = 0.0f;
}
APPLY(stands) {
    UNUSED;
    FAULTS.reading_stands[chamber] = true;
}
APPLY(noisy) {
    FAULTS.noise_added_pa[chamber] = between(random, 600.0, 3000.0);
}
APPLY(jumps_down) {
    bench->sim.drifted_pa[chamber] -= between(random, 1500.0, 6000.0);
}
APPLY(jumps_up) {
    bench->sim.drifted_pa[chamber] += between(random, 1500.0, 6000.0);
}
APPLY(drifts_down) {
    FAULTS.reading_drift_paps[chamber] = -between(random, 100.0, 1500.0);
}
APPLY(drifts_up) {
    FAULTS.reading_drift_paps[chamber] = between(random, 100.0, 1500.0);
}
APPLY(reads_less) {
    FAULTS.reading_gain[chamber] = -between(random, 0.25, 0.6);
}
APPLY(exchanged) {
    UNUSED;
    FAULTS.readings_exchanged = true;
}

/* --- valves and air */

APPLY(stuck_filling) {
    UNUSED;
    PLANT.valve[chamber].stuck = VALVE_STUCK_FILLING;
}
APPLY(stuck_venting) {
    UNUSED;
    PLANT.valve[chamber].stuck = VALVE_STUCK_VENTING;
}
APPLY(exhaust_plugged) {
    PLANT.faults.vent_lost[chamber] = between(random, 0.95, 1.0);
}
APPLY(does_not_fill) {
    PLANT.faults.fill_lost[chamber] = between(random, 0.95, 1.0);
}
APPLY(hose_off) {
    UNUSED;
    PLANT.faults.leak_conductance[chamber] = 1e-9;
    PLANT.faults.fill_lost[chamber] = 1.0;
}
APPLY(leaks) {
    PLANT.faults.leak_conductance[chamber] = between(random, 1e-11, 1e-10);
}
APPLY(sluggish) {
    PLANT.faults.fill_lost[chamber] = PLANT.faults.vent_lost[chamber] = between(random, 0.4, 0.7);
}
APPLY(vents_weakly) {
    PLANT.faults.vent_lost[chamber] = between(random, 0.4, 0.7);
}
APPLY(supply_gone) {
    UNUSED;
    PLANT.faults.supply_replaced = true;
    PLANT.faults.supply_pa = between(random, 0.0, 8000.0);
}
APPLY(supply_over) {
    UNUSED;
    PLANT.faults.supply_replaced = true;
    PLANT.faults.supply_pa = between(random, 52000.0, 100000.0);
}
APPLY(supply_unread) {
    UNUSED;
    FAULTS.supply_unknown = true;
}

/* --- tip sensor */

APPLY(tip_stops) {
    UNUSED;
    FAULTS.tip_stops = true;
}
APPLY(tip_stands) {
    UNUSED;
    FAULTS.tip_stands = true;
}
APPLY(tip_saturates) {
    UNUSED;
    FAULTS.tip_status |= TIP_WATCH_SATURATED;
}
APPLY(tip_leaves) {
    UNUSED;
    FAULTS.tip_status |= TIP_WATCH_OUT_OF_BOX;
}
APPLY(tip_away) {
    FAULTS.tip_away_m = between(random, 0.3, 0.5);
    (void)chamber;
}
APPLY(tip_scatters) {
    UNUSED;
    FAULTS.tip_scatters = true;
}

/* --- board */

APPLY(host_silent) {
    UNUSED;
    bench->commands_stop = true;
}
APPLY(bus_off) {
    UNUSED;
    bench->app.bus_off = true;
    bench->app.error_passive = true;
    bench->commands_stop = true;
}
APPLY(error_passive) {
    UNUSED;
    bench->app.error_passive = true;
}
APPLY(table_bit) {
    UNUSED;
    bench_flip_table(bench);
}
APPLY(parameter_bit) {
    UNUSED;
    bench_flip_parameters(bench);
}
APPLY(stored_parameters) {
    UNUSED;
    bench->app.parameters_corrupt = true;
}
APPLY(steps_missing) {
    UNUSED;
    bench->steps_left_out = (uint32_t)between(random, 10.0, 19.0);
}
APPLY(steps_often_late) {
    UNUSED;
    bench->leave_out_every = (uint32_t)between(random, 2.0, 20.0);
}
APPLY(hangs) {
    UNUSED;
    bench->steps_left_out = UINT32_MAX;
}
APPLY(step_late) {
    UNUSED;
    bench->steps_left_out = (uint32_t)between(random, 1.0, 8.0);
}
APPLY(clock_stands) {
    UNUSED;
    bench->clock_stands = true;
}
APPLY(clock_slow) {
    UNUSED;
    PLANT.faults.clock_slow = between(random, -0.04, 0.04);
    FAULTS.health.clock_failed = true;
}
APPLY(outputs_fail) {
    UNUSED;
    FAULTS.outputs_fail = true;
}
APPLY(crash) {
    UNUSED;
    FAULTS.health.crashed = true;
    bench_reset(bench);
}
APPLY(brown_out) {
    UNUSED;
    FAULTS.health.brown_out_reset = true;
    bench_reset(bench);
}

static const struct injection injections[] = {
    {"reads too much", "FAULT_OVERPRESSURE", 0u, false, reads_too_much},
    {"wire open", "FAULT_SENSOR_RANGE", 0u, false, wire_open},
    {"channel lost", "FAULT_SENSOR_RANGE", 0u, false, channel_lost},
    {"all channels lost", "FAULT_SENSOR_RANGE", 0u, false, bus_lost},
    {"host falls silent", "FAULT_COMMAND_TIMEOUT", 0u, false, host_silent},
    {"table bit flips", "FAULT_TABLE_CORRUPT", 0u, false, table_bit},
    {"reading jumps down", "FAULT_PRESSURE_RATE", VALVE_GAP, false, jumps_down},
    {"reading jumps up", "FAULT_PRESSURE_RATE", VALVE_GAP, false, jumps_up},
    {"reading stands", "FAULT_SENSOR_STUCK", 0u, false, stands},
    {"reads zero", "FAULT_SENSOR_STUCK", 0u, false, shorted},
    {"reading noisy", "FAULT_SENSOR_NOISY", 0u, false, noisy},
    {"reading drifts down", "FAULT_SENSORS_DISAGREE", VALVE_GAP, false, drifts_down},
    {"reading drifts up", "FAULT_SENSORS_DISAGREE", VALVE_GAP, false, drifts_up},
    {"reads too little", "FAULT_SENSORS_DISAGREE", VALVE_GAP, false, reads_less},
    {"sensors exchanged", "FAULT_SENSORS_DISAGREE", VALVE_GAP, false, exchanged},
    {"valve stuck filling", "FAULT_VALVE_STUCK_FILLING", 0u, true, stuck_filling},
    {"exhaust plugged", "FAULT_VALVE_NOT_VENTING", VALVE_GAP, true, exhaust_plugged},
    {"valve stuck venting", "FAULT_VALVE_NOT_FILLING", 0u, false, stuck_venting},
    {"valve does not fill", "FAULT_VALVE_NOT_FILLING", 0u, false, does_not_fill},
    {"hose off", "FAULT_VALVE_NOT_FILLING", VALVE_GAP, false, hose_off},
    {"chamber leaks", "WARNING_LEAK", VALVE_GAP, false, leaks},
    {"valve sluggish", "WARNING_LEAK", VALVE_GAP, false, sluggish},
    {"valve vents weakly", "WARNING_VENT_WEAK", VALVE_GAP, false, vents_weakly},
    {"supply gone", "FAULT_SUPPLY_LOST", 0u, false, supply_gone},
    {"supply over", "FAULT_SUPPLY_HIGH", 0u, false, supply_over},
    {"supply not measured", "WARNING_SUPPLY_UNKNOWN", WARNS(SUPPLY_UNKNOWN), false, supply_unread},
    {"bus-off", "FAULT_CAN_BUS_OFF", WARNS(CAN_ERROR_PASSIVE), false, bus_off},
    {"error passive", "WARNING_CAN_ERROR_PASSIVE", WARNS(CAN_ERROR_PASSIVE), false, error_passive},
    {"parameter bit flips", "FAULT_PARAMETERS_CORRUPT", 0u, false, parameter_bit},
    {"stored parameters bad", "FAULT_PARAMETERS_CORRUPT", 0u, false, stored_parameters},
    {"steps missing", "FAULT_STEP_OVERRUN", WARNS(STEP_LATE), false, steps_missing},
    {"steps often late", "FAULT_STEP_OVERRUN", WARNS(STEP_LATE), false, steps_often_late},
    {"a step late", "WARNING_STEP_LATE", WARNS(STEP_LATE), false, step_late},
    {"clock stands", "FAULT_CLOCK", 0u, false, clock_stands},
    {"clock slow or fast", "WARNING_CLOCK_INTERNAL", WARNS(CLOCK_INTERNAL), false, clock_slow},
    {"outputs refused", "FAULT_OUTPUTS_REFUSED", 0u, false, outputs_fail},
    {"firmware hangs", "FAULT_WATCHDOG_RESET", 0u, false, hangs},
    {"firmware crashes", "FAULT_WATCHDOG_RESET", 0u, false, crash},
    {"brown-out", "FAULT_BROWN_OUT", 0u, false, brown_out},
    {"tip stops", "WARNING_TIP_LOST", TIP_UNUSABLE, false, tip_stops},
    {"tip stands", "WARNING_TIP_FROZEN", WARNS(TIP_FROZEN), false, tip_stands},
    {"tip saturates", "WARNING_TIP_SATURATED", WARNS(TIP_SATURATED), false, tip_saturates},
    {"tip out of box", "WARNING_TIP_OUT_OF_BOX", WARNS(TIP_OUT_OF_BOX), false, tip_leaves},
    {"tip positions away", "WARNING_TIP_OUT_OF_BOX", WARNS(TIP_OUT_OF_BOX), false, tip_away},
    {"tip scatters", "WARNING_TIP_ERRATIC", WARNS(TIP_ERRATIC), false, tip_scatters},
};

size_t injection_count(void) {
    return sizeof injections / sizeof injections[0];
}

const struct injection *injection_at(size_t index) {
    return &injections[index];
}

const char *injection_left_out(const char *row) {
    static const char *const reasons[][2] = {
        {"WARNING_NO_TABLE", "a board without a table bends nothing: tested with the controller"},
        {"WARNING_COMMAND_LIMITED", "a command, no fault: tested with the closed loop"},
        {"WARNING_MODEL_GAP", "what the gap monitor is for has tests of its own"},
    };
    for (size_t i = 0; i < sizeof reasons / sizeof reasons[0]; i++) {
        if (strcmp(row, reasons[i][0]) == 0) {
            return reasons[i][1];
        }
    }
    return NULL;
}
