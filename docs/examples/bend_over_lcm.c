/* A commander on LCM in forty lines: arms, bends the module by 30 degrees, vents once it has been there for a second; prints what the
 * board says.
 *
 *     gcc -Ibuild/lcm docs/examples/bend_over_lcm.c build/lcm/tribend_command_t.c build/lcm/tribend_status_t.c -llcm -o build/bend_over_lcm
 *
 * Commands are sent twenty times a second: half a second of silence vents. Any language that LCM speaks does the same. */
#include <lcm/lcm.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "tribend_command_t.h"
#include "tribend_status_t.h"

#define BEND_URAD 523599 /* 30 degrees */
#define NEAR_URAD 17453 /* 1 degree */

enum kind { ARM = 0, VENT = 1, BEND = 4 };

static void on_status(const lcm_recv_buf_t *buffer, const char *channel, const tribend_status_t *status, void *last) {
    (void)buffer;
    (void)channel;
    *(int *)last = status->bend_urad;
}

static void send(lcm_t *lcm, enum kind kind, int bend_urad, int direction_urad) {
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    const tribend_command_t command = {.utime = (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000,
                                       .kind = (int8_t)kind,
                                       .bend_urad = bend_urad,
                                       .direction_urad = direction_urad};
    (void)tribend_command_t_publish(lcm, "TRIBEND_COMMAND", &command);
}

int main(void) {
    int bend_urad = -1;
    lcm_t *lcm = lcm_create(NULL);
    if (lcm == NULL) {
        return 1;
    }
    (void)tribend_status_t_subscribe(lcm, "TRIBEND_STATUS", on_status, &bend_urad);
    send(lcm, ARM, 0, 0);
    for (int i = 0, there = 0; i < 600 && there < 20; i++) {
        const struct timespec pause = {.tv_nsec = 50000000};
        send(lcm, BEND, BEND_URAD, 0);
        (void)nanosleep(&pause, NULL);
        while (lcm_handle_timeout(lcm, 0) > 0) {
        }
        there = abs(bend_urad - BEND_URAD) < NEAR_URAD ? there + 1 : 0;
    }
    send(lcm, VENT, 0, 0);
    printf("bend %.1f deg\n", bend_urad * 57.29578e-6);
    lcm_destroy(lcm);
    return bend_urad < 0;
}
