#include "gap/calibration.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

_Static_assert(CALIBRATION_EFFECTS_MAX <= PLANT_EFFECTS_MAX, "the simulated module has room for a calibration");

struct check {
    const char *path;
    const struct calibration_effect_entry *entry;
    char *error;
    size_t error_bytes;
};

static bool reject(const struct check *check, int line, const char *key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
static bool reject(const struct check *check, int line, const char *key, const char *format, ...) {
    const int length = snprintf(check->error, check->error_bytes, "%s:%d: %s: ", check->path, line, key);
    const size_t used = length < 0 ? 0 : (size_t)length;
    va_list arguments;
    va_start(arguments, format);
    if (used < check->error_bytes) {
        (void)vsnprintf(check->error + used, check->error_bytes - used, format, arguments);
    }
    va_end(arguments);
    return false;
}

static bool unknown_effect(const struct check *check) {
    char list[1024];
    size_t used = 0;
    for (size_t i = 0; i < effect_kind_count() && used < sizeof list; i++) {
        used += (size_t)snprintf(list + used, sizeof list - used, " %s", effect_kind_at(i)->name);
    }
    return reject(check, check->entry->line, "name", "there is no effect '%s'; there are:%s", check->entry->name, list);
}

static bool take_chamber(const struct check *check, struct effect *effect) {
    const struct effect_kind *kind = effect->kind;
    const int least = kind->scope == EFFECT_ONE_CHAMBER ? 1 : 0, most = kind->scope == EFFECT_GLOBAL ? 0 : 3;
    if (check->entry->chamber < least || check->entry->chamber > most) {
        return reject(check, check->entry->line, "chamber", "%s takes %s, not %d", kind->name,
                      most == 0 ? "no chamber (0)" : (least == 1 ? "1 to 3" : "1 to 3, or 0 for all"),
                      check->entry->chamber);
    }
    effect->chamber = (size_t)check->entry->chamber;
    return true;
}

static bool take_form(const struct check *check, struct effect *effect) {
    const char *name = effect->kind->name;
    const int most = effect->kind->forms > 1 ? (int)effect->kind->forms - 1 : 0, form = check->entry->form;
    if (form > most) {
        return most == 0 ? reject(check, check->entry->line, "form", "%s has one form only, 0, not %d", name, form)
                         : reject(check, check->entry->line, "form", "%s has the forms 0 to %d, not %d", name, most, form);
    }
    effect->form = (size_t)form;
    return true;
}

static bool take_onset(const struct check *check, struct effect *effect) {
    effect->onset_s = check->entry->onset_s;
    return effect->onset_s >= 0.0 || reject(check, check->entry->line, "onset_s",
                                            "%g s is before the recording's clock starts; 0 is from its start",
                                            effect->onset_s);
}

static bool take_latent(const struct check *check, struct effect *effect) {
    const char *name = effect->kind->name;
    const int latent = check->entry->latent;
    if (latent > 1 || (latent > 0 && !effect->kind->remembers)) {
        return effect->kind->remembers
                   ? reject(check, check->entry->line, "latent", "%s takes 0 or 1, not %d", name, latent)
                   : reject(check, check->entry->line, "latent", "%s remembers nothing: 0, not %d", name, latent);
    }
    effect->latent = latent == 1;
    return true;
}

/* NULL: `error` says that it is missing or given twice. */
static const struct calibration_parameter_entry *find_parameter(const struct check *check, const char *name) {
    const struct calibration_effect_entry *entry = check->entry;
    const struct calibration_parameter_entry *found = NULL;
    for (unsigned i = 0; i < entry->parameters_count; i++) {
        if (strcmp(entry->parameters[i].name, name) == 0) {
            if (found != NULL) {
                (void)reject(check, entry->parameters[i].line, name, "this parameter of %s is given twice", entry->name);
                return NULL;
            }
            found = &entry->parameters[i];
        }
    }
    if (found == NULL) {
        (void)reject(check, entry->line, "parameters", "%s has a parameter %s, which is missing", entry->name, name);
    }
    return found;
}

static bool take_parameter(const struct check *check, struct effect *effect, size_t index) {
    const struct effect_parameter *parameter = &effect->kind->parameter[index];
    const struct calibration_parameter_entry *entry = find_parameter(check, parameter->name);
    if (entry == NULL) {
        return false;
    }
    const char *unit = entry->number.unit, *name = effect->kind->name;
    if (unit != NULL && strcmp(unit, parameter->unit) != 0) {
        return reject(check, entry->line, "unit", "%s of %s is in \"%s\", not \"%s\"", parameter->name, name,
                      parameter->unit, unit);
    }
    const double value = entry->number.value;
    if (!(value >= parameter->least && value <= parameter->most)) {
        const bool ratio = strcmp(parameter->unit, "1") == 0;
        return reject(check, entry->line, "value", "%s of %s takes %g to %g%s%s, not %g", parameter->name, name,
                      parameter->least, parameter->most, ratio ? "" : " ", ratio ? "" : parameter->unit, value);
    }
    effect->parameter[index] = value;
    return true;
}

static bool known_parameters(const struct check *check, const struct effect_kind *kind) {
    for (unsigned i = 0; i < check->entry->parameters_count; i++) {
        const struct calibration_parameter_entry *parameter = &check->entry->parameters[i];
        bool known = false;
        for (size_t k = 0; k < kind->parameter_count; k++) {
            known = known || strcmp(kind->parameter[k].name, parameter->name) == 0;
        }
        if (!known) {
            return reject(check, parameter->line, "name", "%s has no parameter '%s' (see tribend effects)", kind->name,
                          parameter->name);
        }
    }
    return true;
}

static bool take_effect(const struct check *check, struct effect *effect) {
    const struct effect_kind *kind = effect_kind_find(check->entry->name);
    if (kind == NULL) {
        return unknown_effect(check);
    }
    effect_init(effect, kind);
    bool sound = take_form(check, effect) && take_chamber(check, effect) && take_onset(check, effect) &&
                 take_latent(check, effect) &&
                 known_parameters(check, kind);
    for (size_t i = 0; i < kind->parameter_count && sound; i++) {
        sound = take_parameter(check, effect, i);
    }
    return sound;
}

static bool take(const struct calibration_file *file, const char *path, struct calibration *calibration, char *error,
                 size_t error_bytes) {
    memset(calibration, 0, sizeof *calibration);
    (void)snprintf(calibration->module, sizeof calibration->module, "%s", file->module);
    calibration->stiffness_scale = file->stiffness_scale.value;
    calibration->supply_scale = file->supply_scale.value;
    for (unsigned e = 0; e < file->effects_count; e++) {
        const struct check check = {path, &file->effects[e], error, error_bytes};
        if (!take_effect(&check, &calibration->effect[calibration->effects++])) {
            return false;
        }
    }
    return true;
}

bool calibration_read(const char *path, const char *module, struct calibration *calibration, char *error,
                      size_t error_bytes) {
    struct description_error why;
    struct calibration_file *file = calibration_file_read(path, module, &why);
    if (file == NULL) {
        (void)snprintf(error, error_bytes, "%s", why.text);
        return false;
    }
    const bool sound = take(file, path, calibration, error, error_bytes);
    calibration_file_free(file);
    return sound;
}

double calibration_onset_s(const struct calibration *calibration) {
    double onset_s = 0.0;
    for (size_t e = 0; e < calibration->effects; e++) {
        onset_s = fmax(onset_s, calibration->effect[e].onset_s);
    }
    return onset_s;
}
