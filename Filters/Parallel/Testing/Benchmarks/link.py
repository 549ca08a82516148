#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A link of limited rate and latency between two network namespaces, for kernels without netem. Needs root.

    link.py RATE_IN_GBIT DELAY_IN_MS NAMESPACE NAMESPACE

The namespaces get 10.77.0.1 and 10.77.0.2 on a device tun0. Each direction has the rate and the delay. It prints "ready"
and runs until it is killed.
"""

import collections
import ctypes
import fcntl
import os
import select
import struct
import subprocess
import sys
import time

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 1, 0x1000
CLONE_NEWNET = 0x40000000
MTU = 60000  # bytes: large packets spare this program from being the limit itself

libc = ctypes.CDLL(None, use_errno=True)


def enter(path):
    with open(path, encoding="ascii") as handle:
        if libc.setns(handle.fileno(), CLONE_NEWNET) != 0:
            raise OSError(ctypes.get_errno(), "setns")


def device(namespace, address):
    enter(f"/run/netns/{namespace}")
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH22x", b"tun0", IFF_TUN | IFF_NO_PI))
    for arguments in (f"addr add {address}/24 dev tun0", f"link set tun0 mtu {MTU} txqueuelen 10000 up"):
        subprocess.run(["ip", *arguments.split()], check=True)
    return tun


def main():
    seconds_of_byte = 8 / (float(sys.argv[1]) * 1e9)
    delay = float(sys.argv[2]) / 1000
    ends = [device(sys.argv[3], "10.77.0.1"), device(sys.argv[4], "10.77.0.2")]
    free = [0.0, 0.0]  # when the link is, by direction
    under_way = [collections.deque(), collections.deque()]
    os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(2))  # processes that compute hold no packets back
    print("ready", flush=True)
    while True:
        due = min((queue[0][0] for queue in under_way if queue), default=None)
        wait = None if due is None else max(0.0, due - time.monotonic())
        readable, _, _ = select.select(ends, [], [], wait)
        now = time.monotonic()
        for end in readable:
            k = ends.index(end)
            packet = os.read(end, 65536)
            free[k] = max(free[k], now) + len(packet) * seconds_of_byte
            under_way[k].append((free[k] + delay, packet))
        for k, queue in enumerate(under_way):
            while queue and queue[0][0] <= now:
                os.write(ends[1 - k], queue.popleft()[1])


if __name__ == "__main__":
    main()
