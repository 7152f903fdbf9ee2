#include "sim/effect.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define KINDS_MAX 64
#define TEXT_BYTES 256

static const struct effect_kind *kinds[KINDS_MAX];
static size_t kind_count;

void effect_register(const struct effect_kind *kind) {
    size_t at = kind_count;
    if (kind_count == KINDS_MAX) {
        (void)fprintf(stderr, "more than %d effects: raise KINDS_MAX\n", KINDS_MAX);
        abort();
    }
    for (; at > 0 && strcmp(kinds[at - 1]->name, kind->name) > 0; at--) {
        kinds[at] = kinds[at - 1];
    }
    kinds[at] = kind;
    kind_count++;
}

size_t effect_kind_count(void) {
    return kind_count;
}

const struct effect_kind *effect_kind_at(size_t index) {
    return index < kind_count ? kinds[index] : NULL;
}

const struct effect_kind *effect_kind_find(const char *name) {
    for (size_t i = 0; i < kind_count; i++) {
        if (strcmp(kinds[i]->name, name) == 0) {
            return kinds[i];
        }
    }
    return NULL;
}

void effect_init(struct effect *effect, const struct effect_kind *kind) {
    memset(effect, 0, sizeof *effect);
    effect->kind = kind;
    for (size_t i = 0; i < kind->parameter_count; i++) {
        effect->parameter[i] = kind->parameter[i].typical;
    }
}

static bool set_parameter(struct effect *effect, const char *name, const char *text, char *error, size_t bytes) {
    for (size_t i = 0; i < effect->kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &effect->kind->parameter[i];
        if (strcmp(parameter->name, name) != 0) {
            continue;
        }
        char *end = NULL;
        const double value = strtod(text, &end);
        if (end == text || *end != '\0' || !(value >= parameter->least) || !(value <= parameter->most)) {
            (void)snprintf(error, bytes, "effect %s: %s takes %g to %g %s, not '%s'", effect->kind->name, name,
                           parameter->least, parameter->most, parameter->unit, text);
            return false;
        }
        effect->parameter[i] = value;
        return true;
    }
    (void)snprintf(error, bytes, "effect %s has no parameter '%s'", effect->kind->name, name);
    return false;
}

bool effect_parse(const char *text, struct effect *effect, char *error, size_t error_bytes) {
    char copy[TEXT_BYTES], *rest = NULL;
    if (strlen(text) >= sizeof copy) {
        (void)snprintf(error, error_bytes, "the effect '%.32s...' is too long", text);
        return false;
    }
    (void)snprintf(copy, sizeof copy, "%s", text);
    const char *name = strtok_r(copy, ":", &rest);
    const struct effect_kind *kind = name == NULL ? NULL : effect_kind_find(name);
    if (kind == NULL) {
        int used = snprintf(error, error_bytes, "there is no effect '%s'; there are:", name == NULL ? "" : name);
        for (size_t i = 0; i < kind_count && used > 0 && (size_t)used < error_bytes; i++) {
            used += snprintf(error + used, error_bytes - (size_t)used, " %s", kinds[i]->name);
        }
        return false;
    }
    effect_init(effect, kind);
    for (char *pair = strtok_r(NULL, ",", &rest); pair != NULL; pair = strtok_r(NULL, ",", &rest)) {
        char *equals = strchr(pair, '=');
        if (equals == NULL) {
            (void)snprintf(error, error_bytes, "effect %s: '%s' is not parameter=value", kind->name, pair);
            return false;
        }
        *equals = '\0';
        if (!set_parameter(effect, pair, equals + 1, error, error_bytes)) {
            return false;
        }
    }
    return true;
}
