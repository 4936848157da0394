"""The part of a page that a script writes, between two comments that readers do not see.

``<!-- NAME -->`` begins it, ``<!-- end of NAME -->`` ends it. Called by ./scripts/show-results:
``python scripts/generated_part.py PAGE NAME FILE``.
"""

from __future__ import annotations

import sys
from pathlib import Path


def with_part(page: str, name: str, part: str) -> str:
    """Return the text of a page with another generated part.

    Parameters
    ----------
    page
        Its text so far.
    name
        Of the part, as the two comments have it.
    part
        The new text.

    Raises
    ------
    ValueError
        If one of the comments is missing.
    """
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    before, _, rest = page.partition(begin)
    _, end_there, after = rest.partition(end)
    if not end_there:
        raise ValueError(f"the lines {begin.strip()} and {end.strip()} are missing")
    return f"{before}{begin}\n{part.strip()}\n\n{end}{after}"


def write_part(page: Path, name: str, part: str) -> None:
    """Write a generated part into a page; leave the script in words if the page has none."""
    try:
        page.write_text(with_part(page.read_text(), name, part))
    except ValueError as error:
        sys.exit(f"{page}: {error}")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("usage: python scripts/generated_part.py PAGE NAME FILE")
    write_part(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]).read_text())
