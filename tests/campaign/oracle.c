#include "campaign/oracle.h"

#include <math.h>
#include <string.h>

void oracle_init(struct oracle *oracle, const struct oracle_limits *limits, int64_t fault_us) {
    memset(oracle, 0, sizeof *oracle);
    oracle->limits = *limits;
    oracle->fault_us = fault_us;
    oracle->latched_us = ORACLE_NEVER;
    oracle->vented_us = ORACLE_NEVER;
    for (int w = 0; w < 32; w++) {
        oracle->warned_us[w] = ORACLE_NEVER;
    }
}

static void judge_pressure(struct oracle *oracle, double highest_pa, int64_t step_us) {
    oracle->highest_pa = fmax(oracle->highest_pa, highest_pa);
    oracle->over_us = highest_pa > oracle->limits.working_pa ? oracle->over_us + step_us : 0;
    oracle->over_longest_us = oracle->over_us > oracle->over_longest_us ? oracle->over_us : oracle->over_longest_us;
    oracle->burst = oracle->burst || highest_pa > oracle->limits.burst_pa;
}

static void note_warnings(struct oracle *oracle, const struct oracle_sample *sample) {
    const uint32_t fresh = sample->warnings & ~oracle->warnings_before & ~oracle->warnings;
    for (uint32_t w = 0; w < 32; w++) {
        if ((fresh >> w & 1u) != 0u) {
            oracle->warned_us[w] = sample->time_us - oracle->fault_us;
        }
    }
    oracle->warnings |= fresh;
}

void oracle_add(struct oracle *oracle, const struct oracle_sample *sample) {
    const double *p = sample->pressure_pa, highest_pa = fmax(fmax(p[0], p[1]), p[2]);
    const int64_t step_us = oracle->time_us > 0 ? sample->time_us - oracle->time_us : 0;
    oracle->time_us = sample->time_us;
    if (sample->time_us < oracle->fault_us) {
        oracle->faults_before |= sample->faults;
        oracle->warnings_before = sample->warnings;
        oracle->first_pa = highest_pa;
        return;
    }
    judge_pressure(oracle, highest_pa, step_us);
    oracle->moved = oracle->moved || sample->moves;
    note_warnings(oracle, sample);
    oracle->faults |= sample->faults;
    if (sample->faults == 0u) {
        return;
    }
    oracle->left_open_us += sample->air_may_flow ? step_us : 0;
    if (oracle->latched_us == ORACLE_NEVER) {
        oracle->latched_us = sample->time_us - oracle->fault_us;
    }
    if (oracle->vented_us == ORACLE_NEVER && highest_pa < ORACLE_VENTED_PA) {
        oracle->vented_us = sample->time_us - oracle->fault_us;
    }
}

int64_t oracle_warned_us(const struct oracle *oracle, uint32_t mask) {
    int64_t first_us = ORACLE_NEVER;
    for (uint32_t w = 0; w < 32; w++) {
        const int64_t at_us = oracle->warned_us[w];
        if ((mask >> w & 1u) != 0u && at_us != ORACLE_NEVER && (first_us == ORACLE_NEVER || at_us < first_us)) {
            first_us = at_us;
        }
    }
    return first_us;
}
