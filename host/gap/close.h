/* How far a calibration closes the gap: a recorded command, followed again in closed loop on the calibrated simulated
 * module, by a controller that knows nothing of the calibration (before) and by one that does (after); and by the first on
 * the nominal module (without gap), which is as well as it goes. Errors are those of the true bend and the true pressures,
 * not of what sensors show. */
#ifndef TRIBEND_GAP_CLOSE_H
#define TRIBEND_GAP_CLOSE_H

#include "gap/calibration_use.h"

#define CLOSE_SEEDS_MAX 100
#define CLOSE_SETTLED_S 1.0 /* a command that has stood for so long should have been reached */

enum close_kind { CLOSE_BEND, CLOSE_PRESSURE };
enum close_variant { CLOSE_BEFORE, CLOSE_AFTER, CLOSE_WITHOUT_GAP, CLOSE_VARIANTS };
enum close_quantity { CLOSE_BEND_RAD, CLOSE_DIRECTION_RAD, CLOSE_PRESSURE_PA, CLOSE_QUANTITIES };
enum close_window { CLOSE_WHOLE, CLOSE_SETTLED, CLOSE_WINDOWS };
enum close_feedback { CLOSE_TIP_SENSOR, CLOSE_NO_TIP_SENSOR, CLOSE_FEEDBACKS };

/* The command that holds from its time on. */
struct close_command {
    int64_t time_us; /* from the recording's start */
    struct controller_command command;
};

struct close_recording {
    enum close_kind kind;
    char module[256];
    double start_s;       /* of the recording, on its own clock */
    int64_t duration_us;
    bool supply_measured;
    size_t count;
    struct close_command *command;
};

/* Reads the commands of a run log. False: `error` names the file, what it lacks and the remedy. */
bool close_recording_read(struct close_recording *recording, const char *path, char *error, size_t error_bytes);
void close_recording_free(struct close_recording *recording);

/* Root mean square over time; mean and standard deviation over the seeds. */
struct close_figure {
    double mean;
    double spread;
    size_t seeds; /* how many had anything to measure; 0: nothing was */
};

struct close_result {
    struct close_figure figure[CLOSE_FEEDBACKS][CLOSE_WINDOWS][CLOSE_QUANTITIES][CLOSE_VARIANTS];
    uint32_t faults[CLOSE_FEEDBACKS][CLOSE_VARIANTS]; /* latched in any seed: errors are those until then */
    bool never_ready[CLOSE_FEEDBACKS][CLOSE_VARIANTS]; /* the controller did not come out of its self-test */
    double measured_from_s; /* on the recording's clock: errors count from the last onset of an effect on */
};

/* `seeds` up to CLOSE_SEEDS_MAX, from 1 on. False: `error` says why. */
bool close_run(struct close_result *result, const struct close_recording *recording, const struct bend_table *table,
               const struct calibration *calibration, const struct calibrated_controller *calibrated, size_t seeds,
               char *error, size_t error_bytes);
/* Share of the mean square over that without gap that is gone; NAN: there was no gap. */
double close_share(const struct close_figure figure[CLOSE_VARIANTS]);

#endif
