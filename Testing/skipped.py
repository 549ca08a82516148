# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Says which tests of a run of ctest were skipped, by the reason that they gave.

    skipped.py FILE     FILE: what `ctest --output-junit FILE` wrote
"""

import collections
import re
import sys
import xml.etree.ElementTree as ElementTree

# The line in which a test says why: GoogleTest's follows the place of GTEST_SKIP, Python's stands behind the name.
REASONS = (r": Skipped\n(.*)", r"\.\.\. skipped ['\"](.*)['\"]", r"^skipped: (.*)", r"^(.*is not .*)$")


def reasons_of(output):
    for pattern in REASONS:
        found = re.findall(pattern, output, re.MULTILINE)
        if found:
            return sorted(set(found))
    return []


def main():
    tests = collections.defaultdict(list)  # by reason
    for case in ElementTree.parse(sys.argv[1]).getroot().iter("testcase"):
        name = case.get("name").split(" ")[0]  # behind it GoogleTest has a parameter
        output = case.findtext("system-out") or ""
        if case.get("status") == "notrun":
            for reason in reasons_of(output)[:1] or ["no reason given"]:
                tests[reason].append(name)
        elif case.get("status") == "run":  # a part of it
            for reason in re.findall(REASONS[1], output):
                tests[reason].append(f"a part of {name}")
    for reason, names in sorted(tests.items(), key=lambda item: -len(item[1])):
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        print(f"Skipped: {', '.join(names[:3])}{more}: {reason}")


if __name__ == "__main__":
    main()
