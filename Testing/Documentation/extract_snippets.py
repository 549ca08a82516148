# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Takes the C++ snippets out of pages, so that TestSnippets.cxx compiles them as they stand there.

    extract_snippets.py FOLDER SOURCE PAGE...    the second one of Filters/README.md becomes FOLDER/Filters/README-2.h

Fails where SOURCE does not include one.
"""

import pathlib
import sys

from test_pages import ROOT, blocks_of

folder, source = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]).read_text()
for page in map(pathlib.Path, sys.argv[3:]):
    snippets = [block for block in blocks_of(page) if block.kind == "cpp"]
    for number, block in enumerate(snippets, 1):
        name = f"{page.resolve().relative_to(ROOT).with_suffix('')}-{number}.h"
        if f'#include "{name}"' not in source:
            sys.exit(f"{page}:{block.line}: no test compiles this snippet. Include it as \"{name}\" in {sys.argv[2]}.")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f'#line {block.line + 1} "{page}"\n{block.text}')
