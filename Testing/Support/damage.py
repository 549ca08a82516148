# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Damages the bytes of a file as disks, careless programs and those who mean harm do."""
import re

NUMBERS = [b"1e308", b"-1", b"nan", b"inf", b"9223372036854775808", b"-9223372036854775809", b"0", b"1e19", b"99999999", b""]


def damaged(data, chance):
    """Changed once to three times, by a random.Random: a number by another, bytes changed, cut out, doubled or cut off."""
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(data) + 1)
        length = chance.randint(1, 16)
        number = [*re.finditer(rb"[-+.\deE]*\d[-+.\deE]*", data[:20000])]
        kind = chance.randrange(5)
        if kind == 0 and number:
            one = chance.choice(number)
            data = data[:one.start()] + chance.choice(NUMBERS) + data[one.end():]
        elif kind == 1:
            data = data[:at] + chance.randbytes(length) + data[at + length:]
        elif kind == 2:
            data = data[:at] + data[at + length:]
        elif kind == 3:
            data = data[:at] + data[at:at + length] * chance.randint(2, 9) + data[at + length:]
        else:
            data = data[:at]
    return data
