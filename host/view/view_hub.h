/* Where the link's thread and the HTTP server's meet: the last report, the arm, the event that pages are to
 * be sent. Everything behind one lock that is never held over I/O. Not here: threads (view_pump.h), HTTP
 * (view_server.h). */
#ifndef TRIBEND_VIEW_HUB_H
#define TRIBEND_VIEW_HUB_H

#include <pthread.h>

#include "view/view_event.h"

#define VIEW_EVENT_US 40000

struct view_hub {
    pthread_mutex_t lock;
    const struct bend_table *table;
    struct view_words words;
    struct view_arm arm;
    char event[VIEW_EVENT_BYTES];
    size_t event_length;
    uint64_t sequence; /* of the event; 0: none yet */
    int64_t next_event_us;
    enum supervisor_state state;
    uint64_t events_unmade; /* that did not fit or had no memory */
};

/* The table is kept by pointer. False: no lock to be had. */
bool view_hub_open(struct view_hub *hub, const struct bend_table *table, const struct view_words *words,
                   const struct view_arm_parameters *parameters);
void view_hub_close(struct view_hub *hub);
/* Of the clock that leases are counted in. */
int64_t view_hub_now_us(void);
/* A report has come. True: `command` is to be sent. `fresh`: there is a new event. */
bool view_hub_report(struct view_hub *hub, const struct link_report *report, int64_t now_us,
                     struct controller_command *command, bool *fresh);
/* No report has come for long. */
void view_hub_lost(struct view_hub *hub);
/* The event after `*sequence` into `text`; 0: there is none yet. */
size_t view_hub_event(struct view_hub *hub, uint64_t *sequence, char text[VIEW_EVENT_BYTES]);

/* Requests; each takes the lock. */
bool view_hub_arm(struct view_hub *hub, const char *page, const char **why);
bool view_hub_command(struct view_hub *hub, const char *page, const struct controller_command *command,
                      const char **why);
void view_hub_release(struct view_hub *hub, const char *page, enum view_arm_end end);
void view_hub_vent(struct view_hub *hub);
void view_hub_clear(struct view_hub *hub);

#endif
