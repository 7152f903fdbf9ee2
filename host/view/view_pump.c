#include "view/view_pump.h"

#include <string.h>
#include <time.h>

#define AHEAD_US 4000    /* sleep when so far ahead of the clock */
#define BEHIND_US 200000 /* so far behind, the clock starts anew */
#define LOST_NS 50000000
#define VENT_WITHIN_US 10000000
#define VENTED_PA 500.0f

struct pace {
    bool running;
    int64_t clock_us;
    int64_t report_us;
};

static void pace(struct view_pump *pump, struct pace *pace, int64_t report_us) {
    const int64_t now_us = view_hub_now_us();
    const int64_t ahead_us = (report_us - pace->report_us) - (now_us - pace->clock_us);
    if (!pace->running || ahead_us < -BEHIND_US) {
        pump->slipped += pace->running ? 1u : 0u;
        *pace = (struct pace){.running = true, .clock_us = now_us, .report_us = report_us};
    } else if (ahead_us > AHEAD_US) {
        const struct timespec ahead = {.tv_sec = ahead_us / 1000000, .tv_nsec = (ahead_us % 1000000) * 1000};
        (void)nanosleep(&ahead, NULL);
    }
}

/* False: it does not come back. */
static bool wait_for_the_link(struct view_pump *pump) {
    const struct timespec moment = {.tv_nsec = LOST_NS};
    if (pump->comes_back) {
        pump->lost++;
        view_hub_lost(pump->hub);
        (void)nanosleep(&moment, NULL);
    }
    return pump->comes_back;
}

static bool exchange(struct view_pump *pump, struct pace *kept) {
    struct controller_command command;
    bool fresh = false;
    if (!pump->link.receive(pump->link.context, &pump->last)) {
        return wait_for_the_link(pump);
    }
    const bool send = view_hub_report(pump->hub, &pump->last, view_hub_now_us(), &command, &fresh);
    if (send && !pump->link.send(pump->link.context, &command)) {
        return wait_for_the_link(pump);
    }
    if (fresh) {
        pump->wake(pump->wake_context);
    }
    if (pump->paced) {
        pace(pump, kept, pump->last.time_us);
    }
    return true;
}

static bool is_vented(const struct link_report *report) {
    const float *pressure_pa = report->status.pressure_estimate_pa;
    return pressure_pa[0] < VENTED_PA && pressure_pa[1] < VENTED_PA && pressure_pa[2] < VENTED_PA;
}

/* As fast as the link gives reports. */
static bool vent(struct view_pump *pump) {
    const struct controller_command command = {.kind = COMMAND_VENT};
    const int64_t until_us = pump->last.time_us + VENT_WITHIN_US;
    do {
        if (!pump->link.send(pump->link.context, &command) ||
            !pump->link.receive(pump->link.context, &pump->last)) {
            return false;
        }
    } while (!is_vented(&pump->last) && pump->last.time_us < until_us);
    return is_vented(&pump->last);
}

static void *run(void *context) {
    struct view_pump *pump = context;
    struct pace kept = {.running = false};
    bool alive = true;
    while (alive && !atomic_load(&pump->stop)) {
        alive = exchange(pump, &kept);
    }
    pump->gone = !alive;
    pump->vented = alive && vent(pump);
    atomic_store(&pump->ended, true);
    return NULL;
}

bool view_pump_start(struct view_pump *pump) {
    atomic_init(&pump->stop, false);
    atomic_init(&pump->ended, false);
    memset(&pump->last, 0, sizeof pump->last);
    return pthread_create(&pump->thread, NULL, run, pump) == 0;
}

void view_pump_stop(struct view_pump *pump) {
    atomic_store(&pump->stop, true);
    (void)pthread_join(pump->thread, NULL);
}
