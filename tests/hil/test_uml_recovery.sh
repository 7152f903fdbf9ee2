#!/bin/bash
# Board, bridge and command line lose each other and find each other again, inside user-mode Linux.
tests/hil/uml/boot tests/hil/uml/recovery.sh 900 "ALL_ORDERS=${ALL_ORDERS:-}"
