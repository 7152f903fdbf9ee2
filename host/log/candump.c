#include "log/candump.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "log/can_layout.h"
#include "log/can_text.h"
#include "log/event_rows.h"

#define MERGE_US 2000 /* the messages of one control step follow each other on the bus within this */

struct candump {
    int node;
    struct event_rows rows;
    struct candump_counts *counts;
    bool tip_known;
    uint16_t tip_measured;       /* of TELEMETRY's last tip sample */
    const char *first_malformed; /* what was wrong with it */
};

/* --- the file --- */

/* TELEMETRY says the last tip sample again until there is a new one. */
static bool is_told_again(struct candump *dump, enum message_id id, const union message *message) {
    if (id != MESSAGE_TELEMETRY) {
        return false;
    }
    const bool again = dump->tip_known && message->telemetry.tip_measured == dump->tip_measured;
    dump->tip_known = true;
    dump->tip_measured = message->telemetry.tip_measured;
    return again;
}

static bool take(struct candump *dump, const struct can_text *line) {
    const struct hal_can_frame *frame = &line->frame;
    struct event_value values[CAN_COLUMNS_MAX];
    struct message_trouble trouble = {.out_of_range = 0u};
    union message message;
    enum message_id id = MESSAGE_COUNT;
    unsigned node = 0;
    dump->counts->frames++;
    if (line->remote || frame->extended || !can_layout_find(frame->id, &id, &node)) {
        dump->counts->other_message++;
        return true;
    }
    dump->node = dump->node == CANDUMP_FIRST_NODE ? (int)node : dump->node;
    if ((int)node != dump->node) {
        dump->counts->other_node++;
        return true;
    }
    if (frame->length < message_row(id)->bytes) {
        dump->counts->short_frames++;
        return true;
    }
    dump->counts->decoded++;
    message_unpack(id, frame->data, &message, &trouble);
    const bool tip = !is_told_again(dump, id, &message);
    return event_rows_add(&dump->rows, line->time_us, values, can_layout_columns(id, &message, tip, values));
}

static bool take_line(struct candump *dump, char *line, int number) {
    struct can_text frame;
    line[strcspn(line, "\r\n")] = '\0';
    if (*line == '\0') {
        return true;
    }
    const char *wrong = can_text_parse_log(line, &frame);
    if (wrong == NULL) {
        return take(dump, &frame);
    }
    if (dump->counts->malformed++ == 0) {
        dump->counts->first_malformed_line = number;
        dump->first_malformed = wrong;
    }
    return true;
}

static bool check(const struct candump *dump, const char *path, char *error, size_t error_bytes) {
    const struct candump_counts *counts = dump->counts;
    if (counts->frames == 0 && counts->malformed > 0) {
        (void)snprintf(error, error_bytes, "%s:%d: no line of candump -L: %s", path,
                       counts->first_malformed_line, dump->first_malformed);
        return false;
    }
    if (dump->rows.log->rows < 2) {
        (void)snprintf(error, error_bytes,
                       "%s: %zu frames, and fewer than two rows out of them: %zu of other messages, %zu of "
                       "other nodes, %zu "
                       "too short, %zu malformed lines",
                       path, counts->frames, counts->other_message, counts->other_node, counts->short_frames,
                       counts->malformed);
        return false;
    }
    return true;
}

static bool note_counts(const struct candump *dump, struct run_log *log) {
    const struct candump_counts *counts = dump->counts;
    char text[256], malformed[256];
    (void)snprintf(
        text, sizeof text,
        "candump, node %d, %zu frames, %zu decoded, %zu of other messages, %zu of other nodes, %zu too short",
        dump->node, counts->frames, counts->decoded, counts->other_message, counts->other_node,
        counts->short_frames);
    (void)snprintf(malformed, sizeof malformed, "%zu lines skipped, the first is line %d: %s",
                   counts->malformed, counts->first_malformed_line,
                   dump->first_malformed == NULL ? "" : dump->first_malformed);
    return run_log_set_metadata(log, "imported", text) &&
           (counts->malformed == 0 || run_log_set_metadata(log, "malformed", malformed));
}

bool candump_read(const char *path, int node, struct run_log *log, struct candump_counts *counts, char *error,
                  size_t error_bytes) {
    struct candump dump = {.node = node, .counts = counts};
    char *line = NULL;
    size_t room = 0;
    bool memory = true;
    memset(counts, 0, sizeof *counts);
    memset(log, 0, sizeof *log);
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    event_rows_start(&dump.rows, log, MERGE_US);
    for (int number = 1; memory && getline(&line, &room, file) >= 0; number++) {
        memory = take_line(&dump, line, number);
    }
    (void)fclose(file);
    free(line);
    memory = memory && event_rows_finish(&dump.rows) && note_counts(&dump, log);
    if (!memory) {
        (void)snprintf(error, error_bytes, "%s: out of memory", path);
    }
    const bool sound = memory && check(&dump, path, error, error_bytes);
    if (!sound) {
        run_log_free(log);
    }
    return sound;
}
