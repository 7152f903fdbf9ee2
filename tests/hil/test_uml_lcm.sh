#!/bin/bash
# The emulated board, the bridge, and the tools of LCM and can-utils, all together inside user-mode Linux.
tests/hil/uml/boot tests/hil/uml/lcm_clients.sh 900
