/* `tribend`: command a module, simulated or real, and look at what it did. One file a subcommand. */
#include "cli/commands.h"

static const struct program_subcommand subcommands[] = {
    {"bend", cli_bend, "bend the tip to an angle in a direction, in closed loop"},
    {"pressure", cli_pressure, "hold three chamber pressures"},
    {"run", cli_run, "follow a plan of pressures, ramps, waves and bends"},
    {"vent", cli_vent, "vent all chambers, whatever else goes on"},
    {"hold", cli_hold, "keep the present pressures until Ctrl-C, then vent"},
    {"clear", cli_clear, "leave FAULT, once its cause is gone"},
    {"status", cli_status, "say what the controller sees and which faults it has"},
    {"monitor", cli_monitor, "watch a controller in a full-screen terminal"},
    {"params", cli_params, "read, change, save, back up and restore a board's parameters"},
    {"update", cli_update, "send another bend table to a board"},
    {"plot", cli_plot, "draw a recorded run"},
    {"record", cli_record, "write down what a controller does, without commanding it"},
    {"import", cli_import, "make a run log of another lab's recording"},
    {"effects", cli_effects, "list what the simulated module can be given, and what each leaves in a recording"},
    {"board", cli_board, "run the flashed firmware on an emulated board with the simulated module"},
    {"view", cli_view, "serve the live view, a page for a browser"},
    {"bridge", cli_bridge, "carry a board's telemetry to LCM, and commands from LCM to the board"},
    {"gap", cli_gap, "say why the module differs from its model"}};

int main(int argc, char **argv) {
    return program_run("tribend", subcommands, sizeof subcommands / sizeof subcommands[0], argc, argv);
}
