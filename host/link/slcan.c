/* An SLCAN adapter at a terminal. We send classic frames only: our commands are. */
#include "link/slcan.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "link/transport.h"

#define BIT_RATE_DEFAULT 1000000L
#define STANDARD_DIGITS 3u
#define EXTENDED_DIGITS 8u
#define TIME_DIGITS 4u
#define CLASSIC_BYTES 8u

static const long bit_rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
static const uint8_t fd_bytes[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

/* --- lines */

static bool number(const char *text, size_t digits, uint32_t *value) {
    *value = 0;
    for (size_t i = 0; i < digits; i++) {
        if (!isxdigit((unsigned char)text[i])) {
            return false;
        }
        const int digit = tolower((unsigned char)text[i]);
        *value = *value << 4 | (uint32_t)(isdigit(digit) ? digit - '0' : digit - 'a' + 10);
    }
    return true;
}

static bool parse_data(const char *text, uint32_t bytes, struct hal_can_frame *frame) {
    uint32_t value = 0;
    if (strlen(text) != 2u * bytes && strlen(text) != 2u * bytes + TIME_DIGITS) {
        return false;
    }
    for (uint32_t i = 0; i < bytes; i++) {
        if (!number(text + 2 * i, 2, &value)) {
            return false;
        }
        frame->data[i] = (uint8_t)value;
    }
    frame->length = (uint8_t)bytes;
    return true;
}

static bool parse_line(const char *line, struct hal_can_frame *frame) {
    const size_t digits = isupper((unsigned char)*line) ? EXTENDED_DIGITS : STANDARD_DIGITS;
    uint32_t code = 0;
    memset(frame, 0, sizeof *frame);
    frame->extended = digits == EXTENDED_DIGITS;
    frame->fd = strchr("dDbB", *line) != NULL;
    if (strlen(line) < 2u + digits || !number(line + 1, digits, &frame->id) ||
        !number(line + 1 + digits, 1, &code) || (!frame->fd && code > CLASSIC_BYTES) ||
        (!frame->extended && frame->id > 0x7FFu)) {
        return false;
    }
    return parse_data(line + 2 + digits, fd_bytes[code], frame);
}

/* Answers to commands are of no interest, a BEL is: the bus is full, or not open. */
static enum slcan_result judge(const char *line, struct hal_can_frame *frame) {
    if (*line == '\0' || strchr("zZVNF", *line) != NULL) {
        return SLCAN_MORE;
    }
    return strchr("tTdDbB", *line) != NULL && parse_line(line, frame) ? SLCAN_FRAME : SLCAN_MALFORMED;
}

enum slcan_result slcan_take(struct slcan_reader *reader, char byte, struct hal_can_frame *frame) {
    if (byte == '\a') {
        reader->bytes = 0;
        return SLCAN_MALFORMED;
    }
    if (byte == '\r') {
        reader->line[reader->bytes] = '\0';
        reader->bytes = 0;
        return judge(reader->line, frame);
    }
    if (reader->bytes + 1 < sizeof reader->line) { /* a longer one is malformed at its end */
        reader->line[reader->bytes++] = byte;
    }
    return SLCAN_MORE;
}

static uint32_t length_code(uint32_t bytes) {
    uint32_t code = 0;
    while (code < 15u && fd_bytes[code] < bytes) {
        code++;
    }
    return code;
}

size_t slcan_format(const struct hal_can_frame *frame, char line[SLCAN_LINE_BYTES]) {
    const char kind = frame->fd ? 'd' : 't';
    int at = snprintf(line, SLCAN_LINE_BYTES, frame->extended ? "%c%08X%X" : "%c%03X%X",
                      frame->extended ? toupper(kind) : kind, frame->id, length_code(frame->length));
    for (uint32_t i = 0; i < frame->length; i++) {
        at += snprintf(line + at, SLCAN_LINE_BYTES - (size_t)at, "%02X", frame->data[i]);
    }
    line[at++] = '\r';
    return (size_t)at;
}

/* --- the adapter */

static enum transport_result flush(struct transport *transport) {
    while (transport->out_bytes > 0) {
        const ssize_t written = write(transport->descriptor, transport->out, transport->out_bytes);
        if (written < 0 && errno == EINTR) {
            continue;
        }
        if (written <= 0) {
            return written < 0 && errno == EAGAIN ? TRANSPORT_NOTHING : TRANSPORT_GONE;
        }
        transport->out_bytes -= (size_t)written;
        memmove(transport->out, transport->out + written, transport->out_bytes);
    }
    return TRANSPORT_DONE;
}

static enum transport_result put(struct transport *transport, const char *text, size_t bytes) {
    if (flush(transport) == TRANSPORT_GONE) {
        return TRANSPORT_GONE;
    }
    if (bytes > sizeof transport->out - transport->out_bytes) {
        return TRANSPORT_NOTHING;
    }
    memcpy(transport->out + transport->out_bytes, text, bytes);
    transport->out_bytes += bytes;
    return flush(transport) == TRANSPORT_GONE ? TRANSPORT_GONE : TRANSPORT_DONE;
}

static enum transport_result send_frame(struct transport *transport, const struct hal_can_frame *frame) {
    char line[SLCAN_LINE_BYTES];
    return put(transport, line, slcan_format(frame, line));
}

/* More bytes of the terminal; TRANSPORT_NOTHING: there are none now. */
static enum transport_result fill(struct transport *transport) {
    for (;;) {
        const ssize_t count = read(transport->descriptor, transport->in, sizeof transport->in);
        if (count > 0) {
            transport->in_bytes = (size_t)count;
            transport->in_at = 0;
            return TRANSPORT_DONE;
        }
        if (count == 0 || errno != EINTR) {
            return count < 0 && errno == EAGAIN ? TRANSPORT_NOTHING : TRANSPORT_GONE;
        }
    }
}

static enum transport_result receive(struct transport *transport, struct transport_frame *frame) {
    memset(frame, 0, sizeof *frame);
    if (flush(transport) == TRANSPORT_GONE) {
        return TRANSPORT_GONE;
    }
    for (;;) {
        if (transport->in_at == transport->in_bytes) {
            const enum transport_result filled = fill(transport);
            if (filled != TRANSPORT_DONE) {
                return filled;
            }
        }
        const enum slcan_result result =
            slcan_take(&transport->reader, transport->in[transport->in_at++], &frame->frame);
        if (result == SLCAN_FRAME) {
            frame->time_us = transport_now_us();
            return TRANSPORT_DONE;
        }
        transport->malformed += result == SLCAN_MALFORMED ? 1u : 0u;
    }
}

static void close_adapter(struct transport *transport) {
    (void)put(transport, "C\r", 2);
    (void)ioctl(transport->descriptor, TIOCNXCL);
    (void)close(transport->descriptor);
}

/* --- opening */

static bool refuse(const char *device, const char *what, char *error, size_t error_bytes) {
    (void)snprintf(error, error_bytes, "bus slcan:%s: %s: %s", device, what, strerror(errno));
    return false;
}

/* The path before '@', and the digit of the bit rate behind it. */
static bool parse_device(const char *device, char path[TRANSPORT_PATH_BYTES], size_t *code, char *error,
                         size_t error_bytes) {
    const char *at = strrchr(device, '@');
    const size_t bytes = at != NULL ? (size_t)(at - device) : strlen(device);
    char *end = NULL;
    const long bit_rate = at != NULL ? strtol(at + 1, &end, 10) : BIT_RATE_DEFAULT;
    if (bytes == 0 || bytes >= TRANSPORT_PATH_BYTES) {
        (void)snprintf(error, error_bytes,
                       "bus slcan:%s: which device? For example slcan:/dev/ttyACM0@500000", device);
        return false;
    }
    (void)snprintf(path, TRANSPORT_PATH_BYTES, "%.*s", (int)bytes, device);
    for (*code = 0; *code < sizeof bit_rates / sizeof bit_rates[0]; ++*code) {
        if (bit_rates[*code] == bit_rate && (end == NULL || *end == '\0')) {
            return true;
        }
    }
    (void)snprintf(
        error, error_bytes,
        "bus slcan:%s: bit rates are 10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 and 1000000",
        device);
    return false;
}

static bool make_raw(int descriptor) {
    struct termios terminal;
    if (tcgetattr(descriptor, &terminal) != 0) {
        return false;
    }
    cfmakeraw(&terminal);
    terminal.c_cflag |= CLOCAL | CREAD;
    return cfsetspeed(&terminal, B115200) == 0 && tcsetattr(descriptor, TCSANOW, &terminal) == 0;
}

bool slcan_open(struct transport *transport, const char *device, char *error, size_t error_bytes) {
    char path[TRANSPORT_PATH_BYTES], start[16];
    size_t code = 0;
    if (!parse_device(device, path, &code, error, error_bytes)) {
        return false;
    }
    transport->descriptor = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (transport->descriptor < 0) {
        return refuse(device,
                      errno == EACCES
                          ? "no permission (join its group, often dialout: usermod -aG dialout USER)"
                          : "is the adapter plugged in? (ls /dev/ttyACM* /dev/ttyUSB*)",
                      error, error_bytes);
    }
    transport->receive = receive;
    transport->send = send_frame;
    transport->close = close_adapter;
    if (ioctl(transport->descriptor, TIOCEXCL) != 0 || !make_raw(transport->descriptor)) {
        return refuse(device, "this is no serial device", error, error_bytes);
    }
    const int bytes = snprintf(start, sizeof start, "\rC\rS%zu\rO\r", code);
    if (put(transport, start, (size_t)bytes) == TRANSPORT_GONE) {
        return refuse(device, "the adapter does not take commands", error, error_bytes);
    }
    return true;
}
