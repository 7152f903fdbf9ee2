/* Opening a bus that is not simulated: who is there, does it speak our version, is it of the module that is
 * meant. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "link/can_board.h"

#define IDENTIFY_WITHIN_US 1500000
#define OTHERS_BYTES 64

static int nobody_there(struct bus *bus, const struct bus_options *options) {
    char others[OTHERS_BYTES];
    struct can_link_counters counters;
    can_link_others(bus->can, others, sizeof others);
    can_link_count(bus->can, &counters);
    return program_fail(
        EXIT_BUS,
        "bus %s: no board with node id %u answers (%" PRIu64 " frames heard, other nodes: %s; %" PRIu64
        " error frames). Is it powered, the bus terminated and the bit rate right? --node N is for a "
        "board with another id",
        options->bus, options->node, counters.received, others, counters.error_frames);
}

static int check_version(const struct bus_options *options, const struct can_link_identity *identity) {
    if (identity->protocol == MESSAGE_PROTOCOL) {
        return EXIT_OK;
    }
    return program_fail(
        EXIT_MISMATCH,
        "bus %s: node %u speaks version %u of the protocol, this program version %u: %s. Only vent works "
        "between them",
        options->bus, options->node, identity->protocol, MESSAGE_PROTOCOL,
        identity->protocol < MESSAGE_PROTOCOL ? "flash the board's firmware anew (make flash)"
                                              : "take a newer tribend on this computer");
}

/* The table that this computer would take is opened, for what is drawn and planned with it; it must be the board's where
 * --table names it, or where the subcommand cannot do without. */
static int check_table(struct bus *bus, const struct bus_options *options, const struct can_link_identity *identity) {
    if (options->table == NULL && !options->needs_table) {
        return EXIT_OK;
    }
    const char *path = bus_table_path(options->table, bus->found);
    const int code = table_file_open(&bus->file, path, NULL);
    if (code == EXIT_OK && bus->file.table.module.inputs_hash != identity->table_hash) {
        return program_fail(EXIT_MISMATCH,
                            "bus %s: node %u runs table %016" PRIx64 " of module '%s', but %s is %016" PRIx64
                            " of module '%s': name the board's with --table, or send this one with tribend update",
                            options->bus, options->node, identity->table_hash, identity->module, path,
                            bus->file.table.module.inputs_hash, bus->file.table.module.name);
    }
    return code;
}

static int check_module(const struct bus_options *options, const struct can_link_identity *identity) {
    if (options->module == NULL || strcmp(options->module, identity->module) == 0) {
        return EXIT_OK;
    }
    return program_fail(EXIT_MISMATCH,
                        "bus %s: node %u runs the table of module '%s', not '%s' (tribend update --any-module sends "
                        "another one)",
                        options->bus, options->node, identity->module, options->module);
}

/* Heartbeats and the gaps between reports follow the board's own numbers, where it gives them. */
static void adapt(struct can_link *can) {
    uint32_t timeout_us = 0, slowdown = 0;
    if (can_board_get(can, PARAMETER_command_timeout_us, &timeout_us) == CAN_BOARD_OK &&
        can_board_get(can, PARAMETER_telemetry_slowdown, &slowdown) == CAN_BOARD_OK) {
        can_link_adapt(can, timeout_us, slowdown);
    }
}

static int meet(struct bus *bus, const struct bus_options *options) {
    struct can_link_identity *identity = &bus->identity;
    if (!can_link_identify(bus->can, IDENTIFY_WITHIN_US, identity)) {
        return nobody_there(bus, options);
    }
    int code = options->vent_at_once ? EXIT_OK : check_version(options, identity);
    code = code == EXIT_OK ? check_module(options, identity) : code;
    code = code == EXIT_OK ? check_table(bus, options, identity) : code;
    if (code == EXIT_OK && identity->protocol == MESSAGE_PROTOCOL) {
        adapt(bus->can);
    }
    bus->module_name = identity->module;
    bus->table_hash = identity->table_hash;
    return code;
}

int bus_open_can(struct bus *bus, const struct bus_options *options) {
    const struct controller_command vent = {.kind = COMMAND_VENT};
    static struct can_link link;
    char error[PROGRAM_ERROR_BYTES];
    if (!can_link_open(&link, options->bus, options->node, error, sizeof error)) {
        return program_fail(EXIT_BUS, "%s", error);
    }
    bus->can = &link;
    bus->rate_hz = 200.0;
    bus->table_path = "on the board";
    can_link_bind(&link, &bus->link);
    if (options->vent_at_once) {
        can_link_command(&link, &vent);
    }
    const int code = meet(bus, options);
    if (code != EXIT_OK) {
        bus_close(bus);
    }
    return code;
}
