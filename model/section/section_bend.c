#include "section/section_bend.h"

#include <math.h>

void section_tip_bend(const struct module_description *module, const struct section_state *state, double bend_rad[2]) {
    const struct end_correction *ends = &module->end_correction;
    const double length_m =
        module->chamber_length_m - ends->balloon_ratio * (state->width_bend_plane_m - module->outer_diameter_m);
    bend_rad[0] = state->curvature_x_1pm * length_m;
    bend_rad[1] = state->curvature_y_1pm * length_m;
    for (size_t c = 0; c < MODULE_CHAMBERS && ends->cap_rotation > 0.0; c++) {
        const double turn = ends->cap_rotation * state->pressure_pa[c] / material_shear_modulus(&module->material);
        double x = 0.0, y = 0.0;
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            x += cos(cavity_azimuth(&module->chamber[c].cavity[k]));
            y += sin(cavity_azimuth(&module->chamber[c].cavity[k]));
        }
        bend_rad[0] -= turn * x / hypot(x, y);
        bend_rad[1] -= turn * y / hypot(x, y);
    }
}
