/* The ELF for the emulated core: no start-up, no vectors, no peripherals. The host writes image_frame, calls an entry
 * with the stack set and image_return as its return address, and reads the frame back. */
#include "frame_app.h"

void image_open(void);
void image_step(void);
void image_begin(void);
void image_invert(void);
void image_return(void);

struct frame image_frame;
static struct frame_app board;

void image_open(void) {
    (void)frame_app_open(&board, &image_frame, (const void *)(uintptr_t)FRAME_TABLE_ADDRESS);
}

void image_step(void) {
    frame_app_step(&board);
}

void image_begin(void) {
    frame_app_begin(&board);
}

void image_invert(void) {
    frame_app_invert(&board);
}

void image_return(void) {
    for (;;) {
    }
}
