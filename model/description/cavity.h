/* The four shapes of a cavity: outline, inside, area. Lengths in m, angles counter-clockwise from +x. */
#ifndef TRIBEND_CAVITY_H
#define TRIBEND_CAVITY_H

#include <stdbool.h>
#include <stddef.h>

enum cavity_shape { CAVITY_CIRCLE, CAVITY_SEMICIRCLE, CAVITY_SECTOR, CAVITY_RING_SECTOR };

struct cavity {
    enum cavity_shape shape;
    double centre_m[2];       /* of its arcs: a semicircle's flat side runs through it, a sector's tip lies on it */
    double radius_m;          /* of the (outer) arc */
    double inner_radius_m;    /* ring sector */
    double opening_rad;       /* sector and ring sector: the whole angle */
    double orientation_rad;   /* where the middle of the arc lies, seen from the centre */
    double hoop_stiffness_npm; /* of fibres wound round the cavity, N/m: force a length of axis, a hoop strain of one */
};

/* One piece of an outline; the outline runs counter-clockwise and is closed. */
struct cavity_piece {
    bool arc;
    double from_m[2];
    double to_m[2];
    double centre_m[2]; /* of an arc */
    double start_rad;
    double sweep_rad;   /* positive counter-clockwise */
};
#define CAVITY_PIECES_MAX 4

size_t cavity_outline(const struct cavity *cavity, struct cavity_piece piece[CAVITY_PIECES_MAX]);
/* Point at `share` (0 to 1) of a piece. */
void cavity_piece_point(const struct cavity_piece *piece, double share, double point_m[2]);
/* Distance from the outline, m, never negative. */
double cavity_outline_distance(const struct cavity *cavity, const double point_m[2]);
bool cavity_holds(const struct cavity *cavity, const double point_m[2]);
double cavity_area_m2(const struct cavity *cavity);
/* The cavity turned about the origin. */
void cavity_turn(const struct cavity *from, double angle_rad, struct cavity *to);
/* Is it its own image in the x axis? */
bool cavity_symmetric(const struct cavity *cavity);
/* Its image in the x axis. */
void cavity_mirror(const struct cavity *from, struct cavity *to);
/* Direction of its middle, seen from the origin. */
double cavity_azimuth(const struct cavity *cavity);

#endif
