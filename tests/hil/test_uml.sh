#!/bin/bash
# Real CAN sockets, with can-utils as clients, on any machine: the emulated board inside user-mode Linux.
tests/hil/uml/boot tests/hil/uml/can_clients.sh 900
