/* A column mapping: how another program's text table becomes a run log. Read from YAML against a schema; the
 * keys are explained in tables/mappings/README.md. Applied by log/mapping_import.h. */
#ifndef TRIBEND_MAPPING_H
#define TRIBEND_MAPPING_H

#include "description/module_description.h"
#include "log/source_table.h"

/* Value in SI = unit(sign * scale * (source - offset)), less its mean at rest where asked. */
struct mapping_column {
    char *to;
    char *column;
    char *unit;
    double *sign;  /* NULL: 1 */
    double *scale; /* NULL: 1 */
    double offset;
    bool subtract_rest;
};

struct mapping_step {
    double at[2]; /* time in s, value in the constant's unit */
};

/* A column that the source lacks. Without value and steps, its value must be given by the caller. */
struct mapping_constant {
    char *to;
    char *unit;
    double *value;
    struct mapping_step *steps;
    unsigned steps_count;
    double while_moved_m; /* above 0: the value holds while the tip is farther than this from where it rests,
                             else 0 */
};

struct mapping_point {
    char *column[3];
};

struct mapping_tip {
    char *unit;
    char **position;   /* three columns, or NULL */
    char **quaternion; /* four columns, or NULL */
    int order;         /* enum mapping_order */
    bool inverse;      /* the source's quaternion takes the outer frame into the tip's */
    struct mapping_point *markers;
    unsigned markers_count;
    double *lever_arm_m;      /* three: the sensor in the tip's frame, from the centre of the tip face */
    double *mount_quaternion; /* four: takes the tip's frame into the sensor's */
};

enum mapping_order { MAPPING_WXYZ, MAPPING_XYZW };

struct mapping_axes {
    char *direction[3]; /* where base x, y, z point in the source's frame: +x, -x, ... */
};

struct mapping_frame {
    struct mapping_point
        *subtract_base; /* points of the base body, in the tip's unit; their mean is taken off row by row */
    unsigned subtract_base_count;
    double *origin_m;          /* three, in the source's axes */
    struct mapping_axes *axes; /* or */
    double *quaternion;        /* four: takes the source's axes into the base frame */
    double *rest_tip_m;        /* three: where the tip is at rest */
    bool rest_is_straight;     /* the tip's orientation at rest counts as that of the base */
};

struct mapping_rest {
    double from_s;
    double until_s;
};

struct mapping_gaps {
    double cut_after_s;
    double pressure_jump_pa;
};

struct mapping {
    char *name;
    char *source;
    char *module; /* NULL: unknown */
    char *note;   /* NULL: none */
    char *delimiter;
    int *header_lines;
    char *comment;
    struct mapping_column *columns;
    unsigned columns_count;
    struct mapping_constant *constants;
    unsigned constants_count;
    struct mapping_tip *tip;
    struct mapping_frame *frame;
    struct mapping_rest *rest;
    struct mapping_gaps *gaps;
};

/* Read and check. NULL: `error` names file, line and key. */
struct mapping *mapping_read(const char *path, struct description_error *error);
void mapping_free(struct mapping *mapping);
/* What the mapping says of the text itself. */
struct source_format mapping_format(const struct mapping *mapping);
/* Of mapping->frame, or no rotation. */
void mapping_rotation(const struct mapping *mapping, double rotation[4]);

#endif
