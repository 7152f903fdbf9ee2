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

const char *effect_stage_name(enum effect_stage stage) {
    static const char *const names[EFFECT_STAGE_COUNT] = {
        [EFFECT_STAGE_SUPPLY] = "supply", [EFFECT_STAGE_VALVE] = "valve", [EFFECT_STAGE_PRESSURE_SENSOR] = "pressure sensor",
        [EFFECT_STAGE_BODY] = "body",     [EFFECT_STAGE_TIP_SENSOR] = "tip sensor"};
    return names[stage];
}

static effect_hook hook_of(const struct effect_kind *kind, enum effect_hook_kind hook) {
    switch (hook) {
    case EFFECT_HOOK_COMMAND:
        return kind->command;
    case EFFECT_HOOK_GAS:
        return kind->gas;
    case EFFECT_HOOK_READING:
        return kind->reading;
    case EFFECT_HOOK_LOAD:
        return kind->load;
    case EFFECT_HOOK_SHAPE:
        return kind->shape;
    case EFFECT_HOOK_POSE:
    default:
        return kind->pose;
    }
}

double effect_doubt(const struct effect_kind *kind) {
    double doubt = INFINITY;
    for (size_t i = 0; i < kind->parameter_count; i++) {
        doubt = kind->doubt[i] > 0.0 ? fmin(doubt, kind->doubt[i]) : doubt;
    }
    return isfinite(doubt) ? doubt : 0.0;
}

double effects_age_s(const struct effect *effect, size_t count, double time_s) {
    double age_s = 0.0;
    for (size_t e = 0; e < count; e++) {
        const struct effect_kind *kind = effect[e].kind;
        age_s += kind->age_s != NULL && time_s >= effect[e].onset_s ? kind->age_s(effect[e].parameter) : 0.0;
    }
    return age_s;
}

bool effect_has(const struct effect_kind *kind, enum effect_hook_kind hook) {
    return hook_of(kind, hook) != NULL;
}

/* What a hook may change of single chambers. */
struct per_chamber {
    double duty[3], late_s[3], reading_pa[3], load_pa[3];
    struct chamber_influence influence;
};

static void copy3(double *to, const double *from) {
    if (to != NULL && from != NULL) {
        memcpy(to, from, 3 * sizeof *to);
    }
}

static void keep(struct per_chamber *kept, const struct effect_signals *signals) {
    copy3(kept->duty, signals->duty);
    copy3(kept->late_s, signals->late_s);
    copy3(kept->reading_pa, signals->reading_pa);
    copy3(kept->load_pa, signals->load_pa);
    if (signals->influence != NULL) {
        kept->influence = *signals->influence;
    }
}

static void put_back(struct effect_signals *signals, const struct per_chamber *kept, size_t c) {
    double *const to[4] = {signals->duty, signals->late_s, signals->reading_pa, signals->load_pa};
    const double *const from[4] = {kept->duty, kept->late_s, kept->reading_pa, kept->load_pa};
    for (size_t i = 0; i < 4; i++) {
        if (to[i] != NULL) {
            to[i][c] = from[i][c];
        }
    }
    if (signals->influence != NULL) {
        signals->influence->conductance_scale[c] = kept->influence.conductance_scale[c];
        signals->influence->vent_scale_change[c] = kept->influence.vent_scale_change[c];
        signals->influence->leak_conductance[c] = kept->influence.leak_conductance[c];
        signals->influence->extra_volume_m3[c] = kept->influence.extra_volume_m3[c];
        signals->influence->bridge_kgpspa[c] = kept->influence.bridge_kgpspa[c];
        copy3(signals->influence->coupling[c], kept->influence.coupling[c]);
    }
}

static void run_one(struct effect *effect, effect_hook hook, struct effect_signals *signals) {
    struct per_chamber kept = {0};
    if (effect->chamber > 0) {
        keep(&kept, signals);
    }
    signals->chamber = effect->chamber;
    signals->form = effect->form;
    hook(effect->state, effect->parameter, signals);
    for (size_t c = 0; c < 3 && effect->chamber > 0; c++) {
        if (c + 1 != effect->chamber) {
            put_back(signals, &kept, c);
        }
    }
}

/* What it does is not seen, but what it makes of that for later. */
static void run_unseen(struct effect *effect, effect_hook hook, const struct effect_signals *signals) {
    struct per_chamber chambers = {0};
    struct body_shape shape = {0};
    struct tip_pose pose = {0};
    struct effect_signals unseen = *signals;
    keep(&chambers, signals);
    unseen.duty = signals->duty != NULL ? chambers.duty : NULL;
    unseen.late_s = signals->late_s != NULL ? chambers.late_s : NULL;
    unseen.reading_pa = signals->reading_pa != NULL ? chambers.reading_pa : NULL;
    unseen.load_pa = signals->load_pa != NULL ? chambers.load_pa : NULL;
    unseen.influence = signals->influence != NULL ? &chambers.influence : NULL;
    if (signals->shape != NULL) {
        shape = *signals->shape;
        unseen.shape = &shape;
    }
    if (signals->pose != NULL) {
        pose = *signals->pose;
        unseen.pose = &pose;
    }
    run_one(effect, hook, &unseen);
}

void effects_run(struct effect *effect, size_t count, enum effect_hook_kind hook, struct effect_signals *signals) {
    for (size_t i = 0; i < count; i++) {
        const effect_hook call = hook_of(effect[i].kind, hook);
        if (call != NULL && signals->time_s >= effect[i].onset_s) {
            run_one(&effect[i], call, signals);
        } else if (call != NULL && effect[i].latent) {
            run_unseen(&effect[i], call, signals);
        }
    }
}

void effect_shape_at(const struct effect_signals *signals, const double load_pa[3], struct body_shape *shape) {
    body_shape_at(signals->table, load_pa, shape);
}

void effect_init(struct effect *effect, const struct effect_kind *kind) {
    memset(effect, 0, sizeof *effect);
    effect->kind = kind;
    effect->chamber = kind->scope == EFFECT_ONE_CHAMBER ? 1 : 0;
    for (size_t i = 0; i < kind->parameter_count; i++) {
        effect->parameter[i] = kind->parameter[i].typical;
    }
}

/* A number within bounds, or a message. */
static bool read_value(const char *text, const char *what, const char *name, double least, double most, const char *unit,
                       double *value, char *error, size_t bytes) {
    char *end = NULL;
    *value = strtod(text, &end);
    if (end == text || *end != '\0' || !(*value >= least) || !(*value <= most)) {
        (void)snprintf(error, bytes, "effect %s: %s takes %g to %g %s, not '%s'", what, name, least, most, unit, text);
        return false;
    }
    return true;
}

static bool set_chamber(struct effect *effect, const char *text, char *error, size_t bytes) {
    double value;
    if (effect->kind->scope == EFFECT_GLOBAL) {
        (void)snprintf(error, bytes, "effect %s is not of a single chamber", effect->kind->name);
        return false;
    }
    const double least = effect->kind->scope == EFFECT_ONE_CHAMBER ? 1.0 : 0.0;
    if (!read_value(text, effect->kind->name, "chamber", least, 3.0, "1", &value, error, bytes)) {
        return false;
    }
    effect->chamber = (size_t)lround(value);
    return true;
}

static bool set_parameter(struct effect *effect, const char *name, const char *text, char *error, size_t bytes) {
    const struct effect_kind *kind = effect->kind;
    if (strcmp(name, "chamber") == 0) {
        return set_chamber(effect, text, error, bytes);
    }
    if (strcmp(name, "onset") == 0) {
        return read_value(text, kind->name, name, 0.0, 1e6, "s", &effect->onset_s, error, bytes);
    }
    if (strcmp(name, "latent") == 0 && kind->remembers) {
        double latent;
        if (!read_value(text, kind->name, name, 0.0, 1.0, "1", &latent, error, bytes)) {
            return false;
        }
        effect->latent = latent > 0.0;
        if (effect->latent && latent < 1.0) {
            (void)snprintf(error, bytes, "effect %s: latent takes 0 or 1, not '%s'", kind->name, text);
            return false;
        }
        return true;
    }
    if (strcmp(name, "form") == 0 && kind->forms > 1) {
        double form;
        if (!read_value(text, kind->name, name, 0.0, (double)(kind->forms - 1), "1", &form, error, bytes)) {
            return false;
        }
        effect->form = (size_t)lround(form);
        return true;
    }
    for (size_t i = 0; i < kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        if (strcmp(parameter->name, name) == 0) {
            return read_value(text, kind->name, name, parameter->least, parameter->most, parameter->unit,
                              &effect->parameter[i], error, bytes);
        }
    }
    (void)snprintf(error, bytes, "effect %s has no parameter '%s'", kind->name, name);
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
