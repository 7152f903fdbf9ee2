/* Effects on supply, valves and lines. */
#include <math.h>

#include "blind_effect.h"

#define CONDUCTANCE 2e-10
#define DENSITY_KGPM3 1.185
#define AMBIENT_PA_ABS 101325.0

static double gate_of(const struct blind_effect *effect, const struct blind_plant *plant) {
    return blind_effect_gate(effect, blind_time_s(plant));
}

/* --- supply_droop: a reservoir behind a regulator that lets through in proportion to its drop, and nothing back --- */

static void supply_droop_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 1e8, 1e9);
    effect->parameter[1] = blind_log_uniform(random, 0.1, 2.0);
}

static void supply_droop_ports(struct blind_effect *effect, const struct blind_plant *plant, struct blind_ports *ports) {
    const double resistance = fmax(effect->parameter[0] * gate_of(effect, plant), 1e5);
    ports->regulator_pas_per_kg = resistance;
    ports->reservoir_m3 = effect->parameter[1] * 287.0 * 293.15 / resistance;
}

/* --- valve_dead_time: the coil follows its command later --- */

static void valve_dead_time_draw(struct blind_effect *effect, struct blind_random *random,
                                 const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 0.002, 0.040);
}

static void valve_dead_time_command(struct blind_effect *effect, const struct blind_plant *plant,
                                    struct blind_pulse pulse[3]) {
    for (size_t c = 0; c < 3; c++) {
        if (blind_effect_on(effect, c)) {
            pulse[c].delay_us += llround(1e6 * effect->parameter[0] * gate_of(effect, plant));
        }
    }
}

/* --- valve_dead_band: short duties do nothing; softly, a stretch above the band does only part of its work --- */

static void valve_dead_band_draw(struct blind_effect *effect, struct blind_random *random,
                                 const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_uniform(random, 0.19, 0.35); /* under 0.15 a valve opens not at all anyway */
    effect->variant = (int)blind_below(random, 2);
    effect->form[0] = blind_uniform(random, 0.02, 0.06); /* width of the soft edge */
}

static double banded(const struct blind_effect *effect, double duty, double least) {
    if (effect->variant == 0) {
        return duty < least ? 0.0 : duty;
    }
    const double share = fmin(fmax((duty - least) / effect->form[0] + 0.5, 0.0), 1.0);
    return duty * share;
}

static void valve_dead_band_command(struct blind_effect *effect, const struct blind_plant *plant,
                                    struct blind_pulse pulse[3]) {
    for (size_t c = 0; c < 3; c++) {
        if (blind_effect_on(effect, c) && gate_of(effect, plant) > 0.5) {
            pulse[c].duty = banded(effect, pulse[c].duty, effect->parameter[0]);
        }
    }
}

/* --- valve_sluggish: one valve passes less, and its jet recovers worse --- */

static void valve_sluggish_draw(struct blind_effect *effect, struct blind_random *random,
                                const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_uniform(random, 0.3, 0.9);
    effect->form[0] = blind_uniform(random, 0.25, 0.35); /* critical ratio */
}

static void valve_sluggish_ports(struct blind_effect *effect, const struct blind_plant *plant,
                                 struct blind_ports *ports) {
    const size_t c = (size_t)effect->chamber - 1;
    const double gate = gate_of(effect, plant);
    ports->flow_scale[c] *= 1.0 + gate * (effect->parameter[0] - 1.0);
    ports->critical_ratio[c] += gate * (effect->form[0] - ports->critical_ratio[c]);
}

static void passed_share(const struct blind_effect *effect, const struct blind_measure *measure, double *parameter) {
    (void)effect;
    if (measure->line_nominal_kg > 0.0) {
        parameter[0] = measure->line_kg / measure->line_nominal_kg;
    }
}

/* --- line_volume --- */

static void line_volume_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 0.2e-6, 5e-6);
}

static void line_volume_ports(struct blind_effect *effect, const struct blind_plant *plant, struct blind_ports *ports) {
    for (size_t c = 0; c < 3; c++) {
        ports->line_volume_m3[c] += blind_effect_on(effect, c) ? effect->parameter[0] * gate_of(effect, plant) : 0.0;
    }
}

/* --- line_resistance: a laminar line in series; drawn as the share that it leaves of a filling flow at 5 kPa --- */

static void line_resistance_draw(struct blind_effect *effect, struct blind_random *random,
                                 const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_uniform(random, 0.3, 0.9);
}

/* The laminar resistance that leaves `share` of the flow from 40 kPa to 5 kPa. */
static double resistance_for(double share) {
    const double up = AMBIENT_PA_ABS + 40000.0, down = AMBIENT_PA_ABS + 5000.0;
    const double flow = share * blind_flow_kgps(CONDUCTANCE, 0.3, up, down, 293.15);
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 40; i++) {
        const double drop = 0.5 * (low + high) * (up - down);
        *(blind_flow_kgps(CONDUCTANCE, 0.3, up - drop, down, 293.15) > flow ? &low : &high) = 0.5 * (low + high);
    }
    return low * (up - down) / flow;
}

static void line_resistance_ports(struct blind_effect *effect, const struct blind_plant *plant,
                                  struct blind_ports *ports) {
    if (!(effect->memory[0] > 0.0)) {
        effect->memory[0] = resistance_for(fmin(effect->parameter[0], 0.9999));
    }
    for (size_t c = 0; c < 3; c++) {
        ports->line_pas_per_kg[c] += blind_effect_on(effect, c) ? effect->memory[0] * gate_of(effect, plant) : 0.0;
    }
}

/* --- chamber_leak: a hole, whose flow goes with the root of the pressure, or a porous seam, laminar --- */

static void chamber_leak_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 4e-12, 6e-11);
    effect->variant = (int)blind_below(random, 2);
}

static void chamber_leak_ports(struct blind_effect *effect, const struct blind_plant *plant, struct blind_ports *ports) {
    const size_t c = (size_t)effect->chamber - 1;
    const double reference_pa = 6000.0;
    const double flow = gate_of(effect, plant) * blind_flow_kgps(effect->parameter[0], 0.3, AMBIENT_PA_ABS + reference_pa,
                                                                  AMBIENT_PA_ABS, 293.15);
    if (effect->variant == 0) {
        ports->orifice_leak[c] += flow / sqrt(reference_pa);
    } else {
        ports->laminar_leak[c] += flow / reference_pa;
    }
}

static void leaked(const struct blind_effect *effect, const struct blind_measure *measure, double *parameter) {
    (void)effect;
    if (measure->leak_per_conductance > 0.0) {
        parameter[0] = measure->leak_kg / measure->leak_per_conductance;
    }
}

/* --- cross_coupling: a leak through the walls between chambers, or a pressure that a neighbour adds by squeezing --- */

static void cross_coupling_draw(struct blind_effect *effect, struct blind_random *random,
                                const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_uniform(random, 0.01, 0.1);
    effect->variant = (int)blind_below(random, 2);
}

/* The bridge is as wide as makes a vented chamber stand at that share of a neighbour's 6 kPa, vented by its valve. */
static void cross_coupling_ports(struct blind_effect *effect, const struct blind_plant *plant,
                                 struct blind_ports *ports) {
    const double reference_pa = 6000.0, share = effect->parameter[0];
    const double vented = blind_flow_kgps(CONDUCTANCE, 0.3, AMBIENT_PA_ABS + share * reference_pa, AMBIENT_PA_ABS, 293.15);
    for (size_t c = 0; c < 3 && effect->variant == 0; c++) {
        ports->bridge[c] += gate_of(effect, plant) * vented / (reference_pa * (1.0 - share));
    }
}

static void cross_coupling_pressure(struct blind_effect *effect, const struct blind_plant *plant, double pressure_pa[3]) {
    const double share = effect->variant == 1 ? effect->parameter[0] * gate_of(effect, plant) : 0.0;
    const double before[3] = {pressure_pa[0], pressure_pa[1], pressure_pa[2]};
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] += share * before[(c + 1) % 3];
    }
}

static const struct blind_effect_kind kinds[] = {
    {.name = "supply_droop",
     .stage = "supply",
     .parameter = {"drop_per_flow", "recovery_time"},
     .neutral = {0.0, NAN},
     .draw = supply_droop_draw,
     .ports = supply_droop_ports},
    {.name = "valve_dead_time",
     .stage = "valve",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"delay"},
     .draw = valve_dead_time_draw,
     .command = valve_dead_time_command},
    {.name = "valve_dead_band",
     .stage = "valve",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"least_duty"},
     .neutral = {0.15},
     .draw = valve_dead_band_draw,
     .command = valve_dead_band_command},
    {.name = "valve_sluggish",
     .stage = "valve",
     .reach = BLIND_ONE_CHAMBER,
     .parameter = {"flow_scale"},
     .neutral = {1.0},
     .draw = valve_sluggish_draw,
     .ports = valve_sluggish_ports,
     .amounts = passed_share},
    {.name = "line_volume",
     .stage = "valve",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"volume"},
     .draw = line_volume_draw,
     .ports = line_volume_ports},
    {.name = "line_resistance",
     .stage = "valve",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"conductance_scale"},
     .neutral = {1.0},
     .draw = line_resistance_draw,
     .ports = line_resistance_ports,
     .amounts = passed_share},
    {.name = "chamber_leak",
     .stage = "valve",
     .reach = BLIND_ONE_CHAMBER,
     .parameter = {"conductance"},
     .draw = chamber_leak_draw,
     .ports = chamber_leak_ports,
     .amounts = leaked},
    {.name = "cross_coupling",
     .stage = "valve",
     .parameter = {"fraction"},
     .draw = cross_coupling_draw,
     .ports = cross_coupling_ports,
     .pressure = cross_coupling_pressure},
};

const struct blind_kinds blind_valve_kinds = {kinds, sizeof kinds / sizeof kinds[0]};
