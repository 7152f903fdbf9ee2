/* The tip's poses in the base frame, out of the recorded position, quaternion or markers, as a mapping says.
 */
#ifndef TRIBEND_TIP_TRACK_H
#define TRIBEND_TIP_TRACK_H

#include "log/mapping.h"

struct tip_pose {
    bool has_position;
    bool has_rotation;
    double position_m[3];
    double rotation[4]; /* takes the tip's frame into the base frame */
};

/* Rows [first, end) of the recording in which nothing moves yet; empty when the mapping names none. */
struct rest_rows {
    size_t first;
    size_t end;
};

/* Ask `table` for the columns that the tip needs, before it is read. False: too many. */
bool tip_track_want(const struct mapping *mapping, struct source_table *table);
/* `pose` has a place for each row. False: `error` names the file, the line and what is wrong. */
bool tip_track_build(const struct mapping *mapping, const struct source_table *table,
                     const struct rest_rows *rest, const char *path, struct tip_pose *pose, char *error,
                     size_t error_bytes);
/* Mean position over the rest rows; false: none of them has one. */
bool tip_track_rest_position(const struct tip_pose *pose, const struct rest_rows *rest, double position_m[3]);
bool tip_track_has_rotation(const struct mapping *mapping);

#endif
