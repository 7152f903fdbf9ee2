#include "gap/report_markup.h"

#include <math.h>
#include <string.h>

#define MINUS "\xe2\x88\x92"
#define DASH "\xe2\x80\x93"
#define REPLACEMENT "\xef\xbf\xbd"
#define DECIMALS_MOST 6
#define DIGITS_SHARE 5e-3 /* of a value, that is worth a decimal */
#define MILLISECONDS_BELOW_S 0.5

/* Bytes of the well-formed UTF-8 character at `text`; 0: there is none. */
static size_t character_bytes(const unsigned char *text) {
    static const unsigned least[5] = {0, 0, 0x80, 0x800, 0x10000};
    const size_t bytes = *text < 0x80       ? 1
                         : *text >> 5 == 6  ? 2
                         : *text >> 4 == 14 ? 3
                         : *text >> 3 == 30 ? 4
                                            : 0;
    unsigned code = bytes < 2 ? *text : *text & (0xffu >> (bytes + 1));
    for (size_t i = 1; i < bytes; i++) {
        if (text[i] >> 6 != 2) {
            return 0;
        }
        code = code << 6 | (text[i] & 0x3fu);
    }
    const bool wrong =
        bytes == 0 || code < least[bytes] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000);
    const bool control = code < 0x20 || (code >= 0x7f && code < 0xa0) || (code & 0xfffe) == 0xfffe;
    return wrong || (control && code != '\n' && code != '\t') ? 0 : bytes;
}

static const char *escaped(char c) {
    switch (c) {
    case '<':
        return "&lt;";
    case '>':
        return "&gt;";
    case '&':
        return "&amp;";
    case '"':
        return "&quot;";
    case '\'':
        return "&#39;";
    default:
        return NULL;
    }
}

void markup_text(FILE *out, const char *text) {
    while (*text != '\0') {
        const size_t bytes = character_bytes((const unsigned char *)text);
        const char *instead = bytes == 0 ? REPLACEMENT : escaped(*text);
        if (instead != NULL) {
            fputs(instead, out);
        } else {
            fwrite(text, 1, bytes, out);
        }
        text += bytes == 0 ? 1 : bytes;
    }
}

void markup_words(FILE *out, const char *name) {
    for (; *name != '\0'; name++) {
        const char letter[2] = {*name == '_' ? ' ' : *name, '\0'};
        markup_text(out, letter);
    }
}

void markup_number(FILE *out, double value, double resolution) {
    if (!isfinite(value)) {
        fputs(DASH, out);
        return;
    }
    const double fine = resolution > 0.0 ? resolution : DIGITS_SHARE * fabs(value);
    const double wanted = fine > 0.0 ? ceil(-log10(fine)) : 0.0;
    const int decimals = (int)fmin(fmax(wanted, 0.0), DECIMALS_MOST);
    char text[64];
    (void)snprintf(text, sizeof text, "%.*f", decimals, fabs(value));
    const bool is_zero = strspn(text, "0.") == strlen(text);
    fprintf(out, "%s%s", value < 0.0 && !is_zero ? MINUS : "", text);
}

void markup_percent(FILE *out, double share) {
    markup_number(out, 100.0 * share, 1.0);
    fputs("\xc2\xa0%", out);
}

struct markup_unit markup_unit(const char *si_unit, double size) {
    static const struct {
        const char *si;
        struct markup_unit shown;
    } units[] = {{"1", {1.0, ""}},
                 {"m", {1e3, "mm"}},
                 {"rad", {180.0 / M_PI, "deg"}},
                 {"Pa", {1e-3, "kPa"}},
                 {"m3", {1e6, "ml"}},
                 {"kg", {1e3, "g"}},
                 {"m3/(s Pa)", {6e10, "ml/(min kPa)"}},
                 {"Pa s/kg", {1e-6, "kPa/(g/s)"}},
                 {"1/K", {100.0, "%/K"}},
                 {"1/s", {6000.0, "%/min"}}};
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(units[i].si, si_unit) == 0) {
            return units[i].shown;
        }
    }
    if (strcmp(si_unit, "s") == 0 && fabs(size) < MILLISECONDS_BELOW_S) {
        return (struct markup_unit){1e3, "ms"};
    }
    return (struct markup_unit){1.0, si_unit};
}

static void put_unit(FILE *out, const struct markup_unit *unit) {
    fputs(*unit->name != '\0' ? "\xc2\xa0" : "", out);
    markup_text(out, unit->name);
}

void markup_interval(FILE *out, const struct diagnosis_interval *interval, const char *si_unit) {
    const struct markup_unit unit = markup_unit(si_unit, interval->value);
    const double half = 0.5 * unit.factor * (interval->high - interval->low);
    markup_number(out, unit.factor * interval->value, half);
    fputs(" (", out);
    markup_number(out, unit.factor * interval->low, half);
    fputs(" to ", out);
    markup_number(out, unit.factor * interval->high, half);
    fputs(")", out);
    put_unit(out, &unit);
}

void markup_quantity(FILE *out, double value, const char *si_unit) {
    const struct markup_unit unit = markup_unit(si_unit, value);
    markup_number(out, unit.factor * value, 0.0);
    if (isfinite(value)) {
        put_unit(out, &unit);
    }
}

void markup_parameters(FILE *out, const struct effect *effect) {
    if (effect->chamber > 0) {
        fprintf(out, "chamber %zu, ", effect->chamber);
    }
    for (size_t i = 0; i < effect->kind->parameter_count; i++) {
        fputs(i > 0 ? ", " : "", out);
        markup_words(out, effect->kind->parameter[i].name);
        fputs(" ", out);
        markup_quantity(out, effect->parameter[i], effect->kind->parameter[i].unit);
    }
}
