#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Runs a command under an X server of its own, because rendering needs one even off screen: display.sh COMMAND [ARGUMENT...]
# The server picks a free display number itself and writes it to its standard output, which is our end of the coprocess's
# pipe. -noreset: it does not start anew when its last client leaves, because a client that comes meanwhile is turned away.
set -euo pipefail

log=$(mktemp)
coproc server { exec Xvfb -displayfd 1 -screen 0 1280x1024x24 -nolisten tcp -noreset 2>"$log"; }
server_pid=$!
trap 'kill "$server_pid" 2>/dev/null || true; rm -f "$log"' EXIT
if ! read -r -t 60 -u "${server[0]}" display; then
  echo "The virtual X server did not start:" >&2
  cat "$log" >&2
  exit 1
fi
DISPLAY=:$display "$@"
