/* The thread that talks to the controller: takes each report to the hub, sends what the hub wants sent, and
 * vents at the end. No other thread touches the link. */
#ifndef TRIBEND_VIEW_PUMP_H
#define TRIBEND_VIEW_PUMP_H

#include <stdatomic.h>

#include "view/view_hub.h"

struct view_pump {
    struct view_hub *hub;
    struct link link;
    bool comes_back; /* a link that gives up is tried again */
    bool paced; /* the link does not keep time by itself: hold it to the clock */
    /* Called after each new event, from the pump's thread. */
    void (*wake)(void *context);
    void *wake_context;
    atomic_bool stop;
    atomic_bool ended;
    bool gone;        /* the link ended by itself */
    bool vented;      /* at the end */
    uint32_t lost;    /* times that the link gave up */
    uint32_t slipped; /* times that it fell far behind the clock */
    struct link_report last;
    pthread_t thread;
};

/* Fields up to wake_context are the caller's. False: no thread to be had. */
bool view_pump_start(struct view_pump *pump);
/* Vent, and wait for the thread. */
void view_pump_stop(struct view_pump *pump);

#endif
