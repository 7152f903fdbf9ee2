/* Does the section that a module describes exist: cavities inside the outline, apart from each other and from bore and
 * layers, centre solid or bored. Internal to model/description. */
#ifndef TRIBEND_MODULE_CHECK_H
#define TRIBEND_MODULE_CHECK_H

#include "description/module_description.h"

#define MODULE_WALL_LEAST_M 1e-4

enum module_fault {
    MODULE_SOUND,
    MODULE_CAVITY_LEAVES,
    MODULE_CAVITIES_OVERLAP,
    MODULE_CENTRE_HOLLOW,
    MODULE_BORE_OPENS,
    MODULE_LAYER_CUT
};

/* `first` and `second` (chambers, from 0; layers for MODULE_LAYER_CUT) say which are meant. */
enum module_fault module_check_section(const struct module_description *module, size_t *first, size_t *second);

#endif
