#include "lcm/bridge_logs.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#define US_PER_S 1000000

static bool is_free(const char *path, char *error, size_t error_bytes) {
    if (path == NULL || access(path, F_OK) != 0) {
        return true;
    }
    (void)snprintf(error, error_bytes, "%s: is there already; remove it or choose another name", path);
    return false;
}

static bool use_large_buffer(FILE *file) {
    return file != NULL && setvbuf(file, NULL, _IOFBF, BRIDGE_LOGS_BUFFER_BYTES) == 0;
}

static bool open_files(struct bridge_logs *logs, const struct bridge_logs_paths *paths, char *error,
                       size_t error_bytes) {
    if (paths->lcm != NULL) {
        logs->lcm = lcm_eventlog_create(paths->lcm, "w");
        if (logs->lcm == NULL || !use_large_buffer(logs->lcm->f)) {
            (void)snprintf(error, error_bytes, "%s: %s", paths->lcm, strerror(errno));
            return false;
        }
    }
    if (paths->can != NULL) {
        logs->can = fopen(paths->can, "w");
        if (!use_large_buffer(logs->can)) {
            (void)snprintf(error, error_bytes, "%s: %s", paths->can, strerror(errno));
            return false;
        }
    }
    return true;
}

bool bridge_logs_open(struct bridge_logs *logs, const struct bridge_logs_paths *paths, const char *bus,
                      const struct run_log_metadata *metadata, char *error, size_t error_bytes) {
    memset(logs, 0, sizeof *logs);
    (void)snprintf(logs->interface, sizeof logs->interface, "%s", strchr(bus, ':') == NULL ? bus : "can0");
    if (!is_free(paths->lcm, error, error_bytes) || !is_free(paths->can, error, error_bytes) ||
        !is_free(paths->run, error, error_bytes)) {
        return false;
    }
    bool open = open_files(logs, paths, error, error_bytes);
    if (open && paths->run != NULL) {
        open = run_log_create(&logs->run, paths->run, metadata, error, error_bytes);
        logs->run_open = open;
        open = open && use_large_buffer(logs->run.file.stream);
    }
    if (!open) {
        char ignored[8];
        (void)bridge_logs_close(logs, ignored, sizeof ignored);
    }
    return open;
}

unsigned bridge_logs_message(struct bridge_logs *logs, const char *channel, const void *data, uint32_t bytes,
                             int64_t host_us) {
    char name[256];
    if (logs->lcm == NULL) {
        return 0;
    }
    (void)snprintf(name, sizeof name, "%s", channel);
    lcm_eventlog_event_t event = {.timestamp = host_us,
                                  .channellen = (int32_t)strlen(name),
                                  .datalen = (int32_t)bytes,
                                  .channel = name,
                                  .data = (void *)(uintptr_t)data};
    return lcm_eventlog_write_event(logs->lcm, &event) == 0 ? 0 : 1;
}

/* "(1700000000.123456) vcan0 171#E8280000" and, of CAN FD, "171##0E828..". */
unsigned bridge_logs_frame(struct bridge_logs *logs, const struct hal_can_frame *frame, int64_t host_us) {
    if (logs->can == NULL) {
        return 0;
    }
    bool written = fprintf(logs->can, "(%" PRId64 ".%06" PRId64 ") %s %0*" PRIX32 "%s", host_us / US_PER_S,
                           host_us % US_PER_S, logs->interface, frame->extended ? 8 : 3, frame->id,
                           frame->fd ? "##0" : "#") > 0;
    for (unsigned b = 0; b < frame->length; b++) {
        written = fprintf(logs->can, "%02X", frame->data[b]) > 0 && written;
    }
    return fputc('\n', logs->can) != EOF && written ? 0 : 1;
}

unsigned bridge_logs_report(struct bridge_logs *logs, const struct link_report *report,
                            const struct controller_command *command) {
    if (!logs->run_open) {
        return 0;
    }
    run_log_append(&logs->run, report, command);
    return ferror(logs->run.file.stream) != 0 ? 1 : 0;
}

static unsigned flush(FILE *file) {
    return file != NULL && fflush(file) != 0 ? 1 : 0;
}

unsigned bridge_logs_flush(struct bridge_logs *logs, int64_t monotonic_us) {
    if (monotonic_us < logs->flush_us) {
        return 0;
    }
    logs->flush_us = monotonic_us + BRIDGE_LOGS_FLUSH_US;
    return flush(logs->lcm != NULL ? logs->lcm->f : NULL) + flush(logs->can) +
           flush(logs->run_open ? logs->run.file.stream : NULL);
}

bool bridge_logs_close(struct bridge_logs *logs, char *error, size_t error_bytes) {
    bool whole = true;
    if (logs->lcm != NULL) {
        lcm_eventlog_destroy(logs->lcm);
        logs->lcm = NULL;
    }
    if (logs->can != NULL && fclose(logs->can) != 0) {
        (void)snprintf(error, error_bytes, "the CAN log: %s", strerror(errno));
        whole = false;
    }
    logs->can = NULL;
    if (logs->run_open) {
        whole = run_log_finish(&logs->run, error, error_bytes) && whole;
        logs->run_open = false;
    }
    return whole;
}
