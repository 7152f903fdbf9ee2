/* What really happened: judged by the true pressures of the chambers and by what the board's outputs do, never by what the
 * firmware believes. Fed one sample a millisecond by whoever runs the mission. */
#ifndef TRIBEND_ORACLE_H
#define TRIBEND_ORACLE_H

#include <stdbool.h>
#include <stdint.h>

#include "safety/supervisor.h"

#define ORACLE_VENTED_PA 2000.0
#define ORACLE_NEVER (-1)

struct oracle_limits {
    double working_pa;
    double burst_pa;
};

struct oracle_sample {
    int64_t time_us;
    double pressure_pa[3]; /* true */
    uint32_t faults;       /* as the board says */
    uint32_t warnings;
    bool air_may_flow;     /* outputs: a coil may be energised or the supply is open */
    bool moves;            /* a coil may be energised */
};

struct oracle {
    struct oracle_limits limits;
    int64_t fault_us;           /* when the first fault was put in; a time that never comes: none */
    double highest_pa;          /* since then, */
    double first_pa;            /* and the highest at that time */
    bool moved;                 /* a coil may have been energised */
    int64_t over_us;            /* over the working limit without a break, until now, */
    int64_t over_longest_us;    /* and at most */
    bool burst;
    uint32_t faults_before;     /* latched though nothing was wrong */
    uint32_t warnings_before;
    uint32_t faults;            /* latched since */
    uint32_t warnings;          /* that came since and had not been there */
    int64_t latched_us;         /* after fault_us, or ORACLE_NEVER */
    int64_t warned_us[32];      /* each warning, likewise */
    int64_t vented_us;          /* every chamber under ORACLE_VENTED_PA, after it latched, likewise */
    int64_t left_open_us;       /* a fault was latched and air might flow, in all */
    int64_t time_us;
};

void oracle_init(struct oracle *oracle, const struct oracle_limits *limits, int64_t fault_us);
void oracle_add(struct oracle *oracle, const struct oracle_sample *sample);
/* First of the warnings of `mask`, or ORACLE_NEVER. */
int64_t oracle_warned_us(const struct oracle *oracle, uint32_t mask);

#endif
