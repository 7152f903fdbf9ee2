/* A plan, as `tribend gap plan` writes one, read as an excitation: what a rig is asked for next. Its own reader, so that
 * nothing of the diagnosis is linked here. */
#ifndef TRIBEND_BLIND_PLAN_H
#define TRIBEND_BLIND_PLAN_H

#include "blind_excitation.h"

/* A second of rest, the plan's steps, a second vented; `*seconds` is the length of it all. False: nothing to close, and
 * `error` names file, line and what is wrong. */
bool blind_plan_open(const char *path, struct blind_excitation *excitation, double *seconds, char *error, size_t error_bytes);

#endif
