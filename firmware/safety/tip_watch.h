/* Watches the tip sensor's samples: which may be used, and whether they still tell anything. Frozen,
 * saturated, out of their box and jumping samples are kept from the tip loop; a bend far over the table's for
 * the measured pressures says that these are not the true ones. Not here: small gaps (gap_monitor.h), samples
 * that do not come (controller.c). Units: m, rad, us. */
#ifndef TRIBEND_TIP_WATCH_H
#define TRIBEND_TIP_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "control/bend_table.h"

/* Of a sample's status. */
#define TIP_WATCH_SATURATED 0x4u
#define TIP_WATCH_OUT_OF_BOX 0x1000u

struct tip_watch_parameters {
    float frozen_rad;  /* the table moved so far while samples stayed equal */
    int64_t frozen_us; /* for at least so long */
    float jump_rad;    /* between two samples */
    float reach_m;     /* beyond caps and the stretched module */
    float excess_rad;   /* bend over the table's, for whatever reason, */
    float over_rad;     /* and where the pressure that explains it is over the working limit */
    int64_t excess_us;  /* for so long */
    int64_t shown_us;  /* a warning stays after the sample that raised it */
};

struct tip_watch {
    float position_m[3]; /* of the sample before */
    float quaternion[4];
    bool any;
    bool equal; /* the last one was the same as before */
    bool frozen;
    int64_t equal_us;     /* since when, */
    float equal_rad[2];   /* with this gap to the table */
    float kept_rad[2];    /* and this correction */
    int64_t saturated_us; /* of the last such sample */
    int64_t out_us;
    int64_t erratic_us;
    int64_t sample_us; /* of the last one that was compared with the table */
    int64_t within_us; /* of the last one whose bend was not over the table's */
};

struct tip_watch_sample {
    int64_t time_us;
    const float *position_m; /* [3] */
    const float *quaternion; /* [4] */
    uint16_t status;
};

void tip_watch_default_parameters(struct tip_watch_parameters *parameters);
void tip_watch_init(struct tip_watch *watch);
/* May this sample be used? `module` NULL: its reach is not known. */
bool tip_watch_take(struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                    const struct bend_table_module *module, const struct tip_watch_sample *sample);
/* A sample that was compared with the table. */
struct tip_watch_view {
    int64_t time_us;
    const float *measured_rad; /* [2] bend vector */
    const float *gap_rad;      /* [2] measured minus the table's for the measured pressures */
    const float (*push_radppa)[2]; /* [3] slope of the table's bend vector by each pressure, */
    const float *slope_radppa;     /* [3] and its size */
    float pressure_pa[3];          /* estimates */
    float working_pa;              /* their limit */
};

/* `correction_rad` is the tip loop's; it goes back to that of before where the samples prove frozen. */
void tip_watch_follow(struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                      const struct tip_watch_view *view, float correction_rad[2]);
/* The bend is over what the pressures explain, and has been. */
bool tip_watch_disagrees(const struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                         int64_t time_us);
/* Bits of enum supervisor_warning. */
uint32_t tip_watch_warnings(const struct tip_watch *watch, const struct tip_watch_parameters *parameters,
                            int64_t time_us);

#endif
