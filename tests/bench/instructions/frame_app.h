/* An app that is fed from a frame and answers into it: the same lines on the host and on the emulated core. */
#ifndef TRIBEND_FRAME_APP_H
#define TRIBEND_FRAME_APP_H

#include "app.h"
#include "frame.h"

struct frame_app {
    struct app app;
    struct hal hal;
    struct bend_table table;
    struct frame *frame;
    uint32_t tip_next;
    struct bend_inverse inverse; /* of frame_app_begin() */
};

/* Binds the app to `frame` and the table image at `image`; false: the image was refused, frame->status says why. */
bool frame_app_open(struct frame_app *board, struct frame *frame, const void *image);
/* One control step, from frame->input to frame->output. */
void frame_app_step(struct frame_app *board);
/* Take up frame->inversion and do the first step of it, as a control step does. */
void frame_app_begin(struct frame_app *board);
/* A further step. */
void frame_app_invert(struct frame_app *board);

#endif
