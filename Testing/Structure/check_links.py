# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Links between the project's pages lead somewhere, and the first page stays short.

    check_links.py FOLDER    the project's root; prints every dead link and page that is too long, fails when there is one

Looks at the Markdown files that git knows, or at all of them outside build folders where there is no git. Addresses of
the web are not followed.
"""

import pathlib
import re
import subprocess
import sys

MOST_LINES = {"README.md": 130}  # and elsewhere
MOST_LINES_ELSEWHERE = 250
GENERATED = "results"  # folders of tables that a program writes: as long as they need to be


def pages_of(root):
    git = subprocess.run(["git", "-C", str(root), "ls-files", "-co", "--exclude-standard", "*.md"], capture_output=True,
                         text=True)
    if git.returncode == 0:
        return [root / name for name in git.stdout.splitlines() if (root / name).is_file()]
    return [path for path in root.rglob("*.md") if not path.relative_to(root).parts[0].startswith("build")]


def without_code(text):
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors_of(page):
    """What a heading is called in a link, as GitHub and GitLab call it."""
    headings = re.findall(r"^#+ +(.*?) *$", re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL),
                          flags=re.MULTILINE)
    headings = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading) for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def dead_links(root, page):
    for target in re.findall(r"\]\(\s*([^)\s]+)", without_code(page.read_text())):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists():
            yield f"{page.relative_to(root)}: there is no {target}"
        elif anchor and path.suffix == ".md" and anchor not in anchors_of(path):
            yield f"{page.relative_to(root)}: {name or 'the page'} has no heading #{anchor}"
        elif path.is_dir():
            yield f"{page.relative_to(root)}: {target} is a folder, which the site has not; link to a page of it"
    headings = "\n".join(line for line in without_code(page.read_text()).splitlines() if line.startswith("#"))
    for target in re.findall(r"\]\(\s*([^)\s]+)", headings):
        if not re.search(r"\.md(#|$)|^#", target):
            yield f"{page.relative_to(root)}: a heading links to {target}, which stops Sphinx; link below the heading"


def too_long(root, page):
    name = str(page.relative_to(root))
    if GENERATED in page.relative_to(root).parts:
        return
    lines, most = len(page.read_text().splitlines()), MOST_LINES.get(name, MOST_LINES_ELSEWHERE)
    if lines > most:
        yield f"{name}: {lines} lines; a page of at most {most} is read to its end"


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    root = pathlib.Path(sys.argv[1]).resolve()
    pages = pages_of(root)
    wrong = [line for page in pages for check in (dead_links, too_long) for line in check(root, page)]
    print("\n".join(wrong) or f"The links of {len(pages)} pages lead somewhere.")
    return 1 if wrong or not pages else 0


if __name__ == "__main__":
    sys.exit(main())
