/* Random pressure targets for the three chambers, a value every 20 ms. Begins with a second of rest. */
#ifndef TRIBEND_BLIND_EXCITATION_H
#define TRIBEND_BLIND_EXCITATION_H

#include "blind_field.h"
#include "blind_random.h"

#define BLIND_TARGET_US 20000
#define BLIND_REST_S 1.0

enum blind_excitation_kind {
    BLIND_EXCITE_ALL,     /* steps, ramps, holds and swings of all chambers */
    BLIND_EXCITE_ONE,     /* chamber 1 holds one pressure */
    BLIND_EXCITE_STRAIGHT /* all chambers hold the same pressure: the module never bends */
};

/* A bend that is commanded in place of pressures. */
struct blind_bend {
    bool wanted;
    double bend_rad;
    double direction_rad;
    double co_contraction_pa;
};

struct blind_excitation {
    size_t count;
    double (*target_pa)[3];
    struct blind_bend *bend; /* [count]; NULL: pressures throughout */
};

/* The pressure of one chamber that bends the module of stiffness one by a right angle, or the end of its range. */
double blind_pressure_most_pa(struct blind_field *field);
/* Targets up to `pressure_most_pa` and to a right angle of bend, for a module of the given stiffness. False: out of memory. */
bool blind_excitation_open(struct blind_excitation *excitation, enum blind_excitation_kind kind, struct blind_random *random,
                           struct blind_field *field, double stiffness_scale, double pressure_most_pa, double seconds);
void blind_excitation_close(struct blind_excitation *excitation);
/* Duty that holds a pressure with the nominal valve and supply, for runs without a controller. */
double blind_holding_duty(double pressure_pa);

#endif
