/* What the page is told, as JSON: the module once, then the state at each event. Numbers in the units that
 * people read (deg, kPa, mm). Not here: when and to whom (view_server.h). */
#ifndef TRIBEND_VIEW_EVENT_H
#define TRIBEND_VIEW_EVENT_H

#include "link/link.h"
#include "view/view_arm.h"

#define VIEW_EVENT_BYTES 4096u

/* Words for the faults' and warnings' bits, as `tribend status` prints them. */
struct view_words {
    void (*faults)(uint32_t faults, char *text, size_t bytes);
    void (*warnings)(const struct controller_status *status, char *text, size_t bytes);
};

/* Geometry and limits of the module, and what bus it is on; to be freed. NULL: out of memory. */
char *view_event_module(const struct bend_table *table, const char *bus,
                        const struct view_arm_parameters *parameters);
/* One event of the stream, "data: {..}" and an empty line, into `text`; the body is drawn as the table bends
 * it at the estimated pressures. Returns its length; 0: it did not fit, or no memory. */
size_t view_event_report(const struct bend_table *table, const struct view_words *words,
                         const struct link_report *report, const struct view_arm *arm,
                         char text[VIEW_EVENT_BYTES]);

#endif
