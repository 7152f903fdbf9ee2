/* Writes a blind run as a run log of the design page: irregular rows, a tip pose only in the row in which it arrived. */
#ifndef TRIBEND_BLIND_LOG_H
#define TRIBEND_BLIND_LOG_H

#include "blind_run.h"

struct blind_log_form {
    double rate_hz;     /* of rows, on average; at least that of the tip samples */
    bool supply;        /* has a column for it */
    bool temperature;
    bool orientation;
};

/* False: the file could not be written, errno says why. */
bool blind_log_write(const char *path, const struct bend_table_module *module, const struct blind_record *record,
                     const struct blind_log_form *form, struct blind_random *random);

#endif
