#include "log/can_text.h"

#include <ctype.h>
#include <stddef.h>
#include <string.h>

#define CLASSIC_BYTES_MAX 8u
#define STANDARD_DIGITS 3u
#define EXTENDED_DIGITS 8u
#define STANDARD_MOST 0x7FFu
#define US_PER_S 1000000

/* Each parser moves `at` on, and returns what is wrong or NULL. */

static bool parse_digits(const char **at, size_t digits_most, int64_t *value, size_t *digits) {
    *value = 0;
    for (*digits = 0; isdigit((unsigned char)**at) && *digits < digits_most; (*digits)++, (*at)++) {
        *value = *value * 10 + (**at - '0');
    }
    return *digits > 0;
}

static const char *parse_time(const char **at, struct can_text *text) {
    int64_t seconds = 0, fraction = 0;
    size_t digits = 0;
    if (*(*at)++ != '(' || !parse_digits(at, 12, &seconds, &digits) || *(*at)++ != '.' ||
        !parse_digits(at, 6, &fraction, &digits) || digits != 6 || *(*at)++ != ')' || *(*at)++ != ' ') {
        return "no time such as (1700000000.123456) at its start";
    }
    text->has_time = true;
    text->time_us = seconds * US_PER_S + fraction;
    return NULL;
}

static int hexadecimal(char digit) {
    const char *const digits = "0123456789abcdef", *found = strchr(digits, tolower((unsigned char)digit));
    return digit == '\0' || found == NULL ? -1 : (int)(found - digits);
}

static const char *parse_interface(const char **at, struct can_text *text) {
    const size_t length = strcspn(*at, " ");
    if (length == 0 || (*at)[length] == '\0') {
        return "no interface and frame after the time";
    }
    const size_t kept = length < sizeof text->interface ? length : sizeof text->interface - 1;
    memcpy(text->interface, *at, kept);
    *at += length + 1;
    return NULL;
}

/* Followed by `end`. */
static const char *parse_identifier(const char **at, char end, struct hal_can_frame *frame) {
    size_t digits = 0;
    for (int digit = hexadecimal(**at); digit >= 0 && digits < EXTENDED_DIGITS; digit = hexadecimal(**at)) {
        frame->id = frame->id << 4 | (uint32_t)digit;
        digits++;
        (*at)++;
    }
    frame->extended = digits == EXTENDED_DIGITS;
    if ((digits != STANDARD_DIGITS && digits != EXTENDED_DIGITS) || *(*at)++ != end) {
        return "no identifier of 3 or 8 hexadecimal digits and '#'";
    }
    if (!frame->extended && frame->id > STANDARD_MOST) {
        return "an identifier over 7FF";
    }
    return NULL;
}

static const char *parse_byte(const char **at, size_t bytes_most, struct hal_can_frame *frame) {
    const int high = hexadecimal((*at)[0]), low = high < 0 ? -1 : hexadecimal((*at)[1]);
    if (high < 0 || low < 0) {
        return "half a byte of data";
    }
    if (frame->length == bytes_most) {
        return "more data than a frame holds";
    }
    frame->data[frame->length++] = (uint8_t)(16 * high + low);
    *at += 2;
    return NULL;
}

/* After the '#': `R`, or an FD frame's second '#' and flags, then bytes. */
static const char *parse_packed(const char **at, struct can_text *text) {
    struct hal_can_frame *frame = &text->frame;
    const char *wrong = NULL;
    if (**at == 'R') {
        text->remote = true;
        return NULL;
    }
    frame->fd = **at == '#';
    if (frame->fd && hexadecimal((*at)[1]) < 0) {
        return "no flags after '##'";
    }
    *at += frame->fd ? 2 : 0;
    while (hexadecimal(**at) >= 0 && wrong == NULL) {
        wrong = parse_byte(at, frame->fd ? HAL_CAN_DATA_BYTES : CLASSIC_BYTES_MAX, frame);
    }
    if (wrong == NULL && **at != '\0' && **at != ' ' &&
        **at != '_') { /* ' ' direction, '_' raw length code */
        wrong = "a character that is no hexadecimal digit in its data";
    }
    return wrong;
}

const char *can_text_parse_log(const char *line, struct can_text *text) {
    const char *at = line;
    memset(text, 0, sizeof *text);
    const char *wrong = parse_time(&at, text);
    if (wrong == NULL) {
        wrong = parse_interface(&at, text);
    }
    if (wrong == NULL) {
        wrong = parse_identifier(&at, '#', &text->frame);
    }
    return wrong != NULL ? wrong : parse_packed(&at, text);
}

static void skip_spaces(const char **at) {
    *at += strspn(*at, " ");
}

/* "[8]  01 02 ...", "[64]  01 ...", "[0]" or "[8]  remote request". */
static const char *parse_spread(const char **at, struct can_text *text) {
    struct hal_can_frame *frame = &text->frame;
    int64_t length = 0;
    size_t digits = 0;
    const char *wrong = NULL;
    if (*(*at)++ != '[' || !parse_digits(at, 2, &length, &digits) || *(*at)++ != ']' ||
        length > HAL_CAN_DATA_BYTES) {
        return "no length such as [8] after the identifier";
    }
    frame->fd = digits == 2; /* candump gives an FD frame's length two digits */
    skip_spaces(at);
    text->remote = strncmp(*at, "remote", 6) == 0;
    for (int64_t i = 0; i < length && wrong == NULL && !text->remote; i++) {
        wrong = parse_byte(at, frame->fd ? HAL_CAN_DATA_BYTES : CLASSIC_BYTES_MAX, frame);
        skip_spaces(at);
    }
    return wrong;
}

static const char *parse_screen(const char *at, struct can_text *text) {
    const char *wrong = NULL;
    if (*at == '(') {
        wrong = parse_time(&at, text);
        skip_spaces(&at);
    }
    if (wrong == NULL) {
        wrong = parse_interface(&at, text);
        skip_spaces(&at);
    }
    if (wrong == NULL) {
        wrong = parse_identifier(&at, ' ', &text->frame);
        skip_spaces(&at);
    }
    return wrong != NULL ? wrong : parse_spread(&at, text);
}

const char *can_text_parse(const char *line, struct can_text *text) {
    const char *at = line + strspn(line, " ");
    const size_t hash = strcspn(at, "#");
    memset(text, 0, sizeof *text);
    if (at[hash] == '\0') {
        return parse_screen(at, text);
    }
    if (*at == '(') {
        return can_text_parse_log(at, text);
    }
    const char *wrong = parse_identifier(&at, '#', &text->frame);
    return wrong != NULL ? wrong : parse_packed(&at, text);
}
