/* The plant of a case once more, after its two runs: under a plan, and under a random excitation of the same length, so that
 * it can be seen what the plan was worth. The rig's controller follows; noise is drawn anew. */
#ifndef TRIBEND_BLIND_NEXT_H
#define TRIBEND_BLIND_NEXT_H

#include "blind_case.h"

/* False: out of memory, or the simulation failed; close the record all the same. */
bool blind_next_planned(struct blind_case *blind, struct blind_field *field, const struct blind_excitation *plan, double seconds,
                        struct blind_record *record);
/* Steps, ramps, holds and swings of all chambers, made smaller until the module stays within its range. */
bool blind_next_random(struct blind_case *blind, struct blind_field *field, double seconds, struct blind_record *record);

#endif
