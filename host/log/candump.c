#include "log/candump.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "log/can_layout.h"
#include "log/event_rows.h"

#define FD_BYTES_MAX 64
#define CLASSIC_BYTES_MAX 8
#define STANDARD_DIGITS 3
#define EXTENDED_DIGITS 8
#define MERGE_US 2000 /* the messages of one control step follow each other on the bus within this */
#define US_PER_S 1000000

struct frame {
    int64_t time_us;
    uint32_t identifier;
    bool standard; /* 11 bits */
    bool remote;
    size_t bytes;
    uint8_t data[FD_BYTES_MAX];
};

struct candump {
    int node;
    struct event_rows rows;
    struct candump_counts *counts;
    const char *first_malformed; /* what was wrong with it */
};

/* --- one line; each parser moves `at` on, and returns what is wrong or NULL --- */

static bool parse_digits(const char **at, size_t digits_most, int64_t *value, size_t *digits) {
    *value = 0;
    for (*digits = 0; isdigit((unsigned char)**at) && *digits < digits_most; (*digits)++, (*at)++) {
        *value = *value * 10 + (**at - '0');
    }
    return *digits > 0;
}

static const char *parse_time(const char **at, int64_t *time_us) {
    int64_t seconds = 0, fraction = 0;
    size_t digits = 0;
    if (*(*at)++ != '(' || !parse_digits(at, 12, &seconds, &digits) || *(*at)++ != '.' ||
        !parse_digits(at, 6, &fraction, &digits) || digits != 6 || *(*at)++ != ')' || *(*at)++ != ' ') {
        return "no time such as (1700000000.123456) at its start";
    }
    *time_us = seconds * US_PER_S + fraction;
    return NULL;
}

static int hexadecimal(char digit) {
    const char *const digits = "0123456789abcdef", *found = strchr(digits, tolower((unsigned char)digit));
    return digit == '\0' || found == NULL ? -1 : (int)(found - digits);
}

static const char *parse_identifier(const char **at, struct frame *frame) {
    size_t digits = 0;
    for (int digit = hexadecimal(**at); digit >= 0 && digits < EXTENDED_DIGITS; digit = hexadecimal(**at)) {
        frame->identifier = frame->identifier << 4 | (uint32_t)digit;
        digits++;
        (*at)++;
    }
    frame->standard = digits == STANDARD_DIGITS;
    if ((digits != STANDARD_DIGITS && digits != EXTENDED_DIGITS) || *(*at)++ != '#') {
        return "no identifier of 3 or 8 hexadecimal digits and '#'";
    }
    return frame->standard && frame->identifier > 0x7FFu ? "an identifier over 7FF" : NULL;
}

static const char *parse_data(const char **at, size_t bytes_most, struct frame *frame) {
    while (hexadecimal(**at) >= 0) {
        const int high = hexadecimal((*at)[0]), low = hexadecimal((*at)[1]);
        if (high < 0 || low < 0) {
            return "half a byte of data";
        }
        if (frame->bytes == bytes_most) {
            return "more data than a frame holds";
        }
        frame->data[frame->bytes++] = (uint8_t)(16 * high + low);
        *at += 2;
    }
    return NULL;
}

static const char *parse_line(const char *line, struct frame *frame) {
    const char *at = line;
    memset(frame, 0, sizeof *frame);
    const char *wrong = parse_time(&at, &frame->time_us);
    if (wrong != NULL) {
        return wrong;
    }
    const size_t interface = strcspn(at, " ");
    if (interface == 0 || at[interface] == '\0') {
        return "no interface and frame after the time";
    }
    at += interface + 1;
    wrong = parse_identifier(&at, frame);
    if (wrong != NULL) {
        return wrong;
    }
    if (*at == 'R') {
        frame->remote = true;
        return NULL;
    }
    const bool fd = *at == '#';
    if (fd && hexadecimal(at[1]) < 0) {
        return "no flags after '##'";
    }
    at += fd ? 2 : 0;
    wrong = parse_data(&at, fd ? FD_BYTES_MAX : CLASSIC_BYTES_MAX, frame);
    if (wrong == NULL && *at != '\0' && *at != ' ' && *at != '_') { /* ' ' direction, '_' raw length code */
        wrong = "a character that is no hexadecimal digit in its data";
    }
    return wrong;
}

/* --- the file --- */

static bool take(struct candump *dump, const struct frame *frame) {
    struct event_value values[CAN_FIELDS_MAX];
    enum can_message message;
    unsigned node = 0;
    dump->counts->frames++;
    if (frame->remote || !frame->standard || !can_layout_find(frame->identifier, &message, &node)) {
        dump->counts->other_message++;
        return true;
    }
    dump->node = dump->node == CANDUMP_FIRST_NODE ? (int)node : dump->node;
    if ((int)node != dump->node) {
        dump->counts->other_node++;
        return true;
    }
    if (frame->bytes < can_layout_bytes(message)) {
        dump->counts->short_frames++;
        return true;
    }
    dump->counts->decoded++;
    return event_rows_add(&dump->rows, frame->time_us, values,
                          can_layout_decode(message, frame->data, values));
}

static bool take_line(struct candump *dump, char *line, int number) {
    struct frame frame;
    line[strcspn(line, "\r\n")] = '\0';
    if (*line == '\0') {
        return true;
    }
    const char *wrong = parse_line(line, &frame);
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
