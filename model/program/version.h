/* Which tribend this is: what `--version`, the man pages and the pkg-config file say. Not the protocol's version
 * (comms/messages.def) nor the table's (bend_table_format.h). */
#ifndef TRIBEND_VERSION_H
#define TRIBEND_VERSION_H

#define TRIBEND_VERSION "0.6.0"
#define TRIBEND_VERSION_DATE "2026-11-25"

#endif
