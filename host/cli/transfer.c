#include "cli/transfer.h"

#include <inttypes.h>
#include <stdio.h>
#include <unistd.h>

#include "link/can_board.h"

struct progress {
    bool shown;
    uint32_t percent;
};

static bool show(void *context, uint32_t sent, uint32_t bytes) {
    struct progress *progress = context;
    const uint32_t percent = (uint32_t)(100ull * sent / bytes);
    if (progress->shown && percent != progress->percent) {
        progress->percent = percent;
        fprintf(stderr, "\r%3u %% of %u bytes", percent, bytes);
        (void)fflush(stderr);
    }
    return program_interrupted == 0;
}

int transfer_no_board(const struct bus_options *options) {
    return program_fail(EXIT_BUS, "node %u on bus %s did not answer", options->node, options->bus);
}

int transfer_image(struct bus *bus, const struct bus_options *options, enum transfer_kind kind,
                   const uint8_t *image, uint32_t bytes, bool any_module) {
    struct progress progress = {.shown = !options->quiet && isatty(STDERR_FILENO) != 0};
    struct can_board_transfer transfer;
    program_catch_interrupt();
    const enum can_board_result result =
        can_board_send(bus->can, kind, image, bytes, any_module, show, &progress, &transfer);
    if (progress.shown) {
        fputs("\n", stderr);
    }
    switch (result) {
    case CAN_BOARD_OK:
        fprintf(options->json ? stderr : stdout, "sent      %u bytes in %" PRIu64 " frames, %" PRIu64 " bytes of them again\n", bytes,
               transfer.frames, transfer.again);
        return EXIT_OK;
    case CAN_BOARD_REFUSED:
        return program_fail(EXIT_REFUSED,
                            "the board refused it after %u of %u bytes: %s. It keeps what it had",
                            transfer.sent, bytes, transfer_error_text(transfer.error));
    case CAN_BOARD_STOPPED:
        return program_fail(EXIT_INTERRUPTED, "stopped after %u of %u bytes; the board keeps what it had",
                            transfer.sent, bytes);
    case CAN_BOARD_SILENT:
    default:
        return transfer_no_board(options);
    }
}
