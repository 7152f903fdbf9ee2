#include "description/cavity.h"

#include <math.h>

#define SAME 1e-9 /* of a length in m or an angle in rad that is taken as equal */

static void polar(const double centre_m[2], double radius_m, double angle_rad, double point_m[2]) {
    point_m[0] = centre_m[0] + radius_m * cos(angle_rad);
    point_m[1] = centre_m[1] + radius_m * sin(angle_rad);
}

static struct cavity_piece make_arc(const double centre_m[2], double radius_m, double start_rad, double sweep_rad) {
    struct cavity_piece piece = {.arc = true, .start_rad = start_rad, .sweep_rad = sweep_rad};
    piece.centre_m[0] = centre_m[0];
    piece.centre_m[1] = centre_m[1];
    polar(centre_m, radius_m, start_rad, piece.from_m);
    polar(centre_m, radius_m, start_rad + sweep_rad, piece.to_m);
    return piece;
}

static struct cavity_piece make_line(const double from_m[2], const double to_m[2]) {
    return (struct cavity_piece){.from_m = {from_m[0], from_m[1]}, .to_m = {to_m[0], to_m[1]}};
}

size_t cavity_outline(const struct cavity *cavity, struct cavity_piece piece[CAVITY_PIECES_MAX]) {
    const double *centre = cavity->centre_m, radius = cavity->radius_m, turn = cavity->orientation_rad;
    const double opening = cavity->shape == CAVITY_SEMICIRCLE ? M_PI : cavity->opening_rad;
    size_t count = 0;
    if (cavity->shape == CAVITY_CIRCLE) {
        piece[count++] = make_arc(centre, radius, turn, M_PI);
        piece[count++] = make_arc(centre, radius, turn + M_PI, M_PI);
        return count;
    }
    piece[count++] = make_arc(centre, radius, turn - 0.5 * opening, opening);
    if (cavity->shape == CAVITY_SEMICIRCLE) {
        piece[count] = make_line(piece[0].to_m, piece[0].from_m);
        return count + 1;
    }
    if (cavity->shape == CAVITY_SECTOR) {
        piece[count++] = make_line(piece[0].to_m, centre);
        piece[count++] = make_line(centre, piece[0].from_m);
        return count;
    }
    const struct cavity_piece inner = make_arc(centre, cavity->inner_radius_m, turn + 0.5 * opening, -opening);
    piece[count++] = make_line(piece[0].to_m, inner.from_m);
    piece[count++] = inner;
    piece[count++] = make_line(inner.to_m, piece[0].from_m);
    return count;
}

void cavity_piece_point(const struct cavity_piece *piece, double share, double point_m[2]) {
    if (piece->arc) {
        const double radius_m = hypot(piece->from_m[0] - piece->centre_m[0], piece->from_m[1] - piece->centre_m[1]);
        polar(piece->centre_m, radius_m, piece->start_rad + share * piece->sweep_rad, point_m);
        return;
    }
    for (int d = 0; d < 2; d++) {
        point_m[d] = piece->from_m[d] + share * (piece->to_m[d] - piece->from_m[d]);
    }
}

/* Into (-pi, pi]. */
static double wrap(double angle_rad) {
    return remainder(angle_rad, 2.0 * M_PI);
}

static double piece_distance(const struct cavity_piece *piece, const double point_m[2]) {
    if (piece->arc) {
        const double x = point_m[0] - piece->centre_m[0], y = point_m[1] - piece->centre_m[1];
        const double middle = piece->start_rad + 0.5 * piece->sweep_rad;
        if (fabs(wrap(atan2(y, x) - middle)) <= 0.5 * fabs(piece->sweep_rad)) {
            const double radius_m = hypot(piece->from_m[0] - piece->centre_m[0], piece->from_m[1] - piece->centre_m[1]);
            return fabs(hypot(x, y) - radius_m);
        }
        return fmin(hypot(point_m[0] - piece->from_m[0], point_m[1] - piece->from_m[1]),
                    hypot(point_m[0] - piece->to_m[0], point_m[1] - piece->to_m[1]));
    }
    const double x = piece->to_m[0] - piece->from_m[0], y = piece->to_m[1] - piece->from_m[1];
    const double along = ((point_m[0] - piece->from_m[0]) * x + (point_m[1] - piece->from_m[1]) * y) / (x * x + y * y);
    double foot_m[2];
    cavity_piece_point(piece, fmin(1.0, fmax(0.0, along)), foot_m);
    return hypot(point_m[0] - foot_m[0], point_m[1] - foot_m[1]);
}

double cavity_outline_distance(const struct cavity *cavity, const double point_m[2]) {
    struct cavity_piece piece[CAVITY_PIECES_MAX];
    const size_t count = cavity_outline(cavity, piece);
    double least = INFINITY;
    for (size_t i = 0; i < count; i++) {
        least = fmin(least, piece_distance(&piece[i], point_m));
    }
    return least;
}

bool cavity_holds(const struct cavity *cavity, const double point_m[2]) {
    const double x = point_m[0] - cavity->centre_m[0], y = point_m[1] - cavity->centre_m[1];
    const double radius = hypot(x, y), angle = fabs(wrap(atan2(y, x) - cavity->orientation_rad));
    if (!(radius < cavity->radius_m)) {
        return false;
    }
    switch (cavity->shape) {
    case CAVITY_CIRCLE:
        return true;
    case CAVITY_SEMICIRCLE:
        return angle < 0.5 * M_PI;
    case CAVITY_SECTOR:
        return angle < 0.5 * cavity->opening_rad;
    default:
        return angle < 0.5 * cavity->opening_rad && radius > cavity->inner_radius_m;
    }
}

double cavity_area_m2(const struct cavity *cavity) {
    const double square = cavity->radius_m * cavity->radius_m;
    switch (cavity->shape) {
    case CAVITY_CIRCLE:
        return M_PI * square;
    case CAVITY_SEMICIRCLE:
        return 0.5 * M_PI * square;
    case CAVITY_SECTOR:
        return 0.5 * cavity->opening_rad * square;
    default:
        return 0.5 * cavity->opening_rad * (square - cavity->inner_radius_m * cavity->inner_radius_m);
    }
}

void cavity_turn(const struct cavity *from, double angle_rad, struct cavity *to) {
    const double x = from->centre_m[0], y = from->centre_m[1];
    *to = *from;
    to->centre_m[0] = x * cos(angle_rad) - y * sin(angle_rad);
    to->centre_m[1] = x * sin(angle_rad) + y * cos(angle_rad);
    to->orientation_rad = from->orientation_rad + angle_rad;
}

void cavity_mirror(const struct cavity *from, struct cavity *to) {
    *to = *from;
    to->centre_m[1] = -from->centre_m[1];
    to->orientation_rad = -from->orientation_rad;
}

bool cavity_symmetric(const struct cavity *cavity) {
    return fabs(cavity->centre_m[1]) < SAME &&
           (cavity->shape == CAVITY_CIRCLE || fabs(sin(cavity->orientation_rad)) < SAME);
}

double cavity_azimuth(const struct cavity *cavity) {
    const double middle_m = cavity->shape == CAVITY_CIRCLE ? 0.0 : 0.5 * (cavity->radius_m + cavity->inner_radius_m);
    double point_m[2];
    polar(cavity->centre_m, middle_m, cavity->orientation_rad, point_m);
    return atan2(point_m[1], point_m[0]);
}
