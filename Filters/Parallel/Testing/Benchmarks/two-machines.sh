#!/bin/sh
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Runs a command by mpirun on two machines, which two network namespaces of this one stand for. What they send each other
# passes a link of limited rate and latency (link.py). Needs root, iproute2 and Open MPI.
#
#   two-machines.sh GBIT MS COMMAND...      two-machines.sh 1 0.5 /usr/bin/python3 train_in_parts.py ...
set -e
here=$(dirname "$(readlink -f "$0")")
rate=$1 delay=$2
shift 2
name=bigus$$
folder=$(mktemp -d)
clean() {
  [ -z "$link" ] || kill "$link"
  ip netns del "$name-1" 2>/dev/null || true
  ip netns del "$name-2" 2>/dev/null || true
  rm -r "$folder"
}
trap clean EXIT
for k in 1 2; do
  ip netns add "$name-$k"
  ip -n "$name-$k" link set lo up
done
/usr/bin/python3 "$here/link.py" "$rate" "$delay" "$name-1" "$name-2" >"$folder/link" &
link=$!
until grep -q ready "$folder/link"; do
  kill -0 "$link"
  sleep 0.1
done
# Instead of ssh: the first argument is the machine, the others make a command.
cat >"$folder/agent" <<END
#!/bin/sh
shift
exec ip netns exec "$name-2" sh -c "\$*"
END
chmod +x "$folder/agent"
ip netns exec "$name-1" mpirun --allow-run-as-root -np 2 --host 10.77.0.1:1,10.77.0.2:1 --bind-to none \
  --mca plm_rsh_agent "$folder/agent" --mca btl tcp,self --mca btl_tcp_if_include 10.77.0.0/24 \
  --mca oob_tcp_if_include 10.77.0.0/24 -x PYTHONPATH "$@"
