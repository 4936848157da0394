"""Works through a text from its first block to its last, in a folder of its own."""

import re
import sysconfig
import venv
from pathlib import Path

from guide_pages.pages import blocks
from guide_pages.terminals import by_the_shell

NAMED = re.compile(r"(?:#|//) (\S+\.\w+)\n")
"""The first line of a block that is the text of a file."""


def environment_of(folder: Path) -> Path:
    """Make a virtual environment that knows what this one does; return its programs' folder.

    What is installed into it is seen by what runs in it, and by nobody else.
    """
    venv.create(folder / ".venv", symlinks=True)
    (packages,) = (folder / ".venv" / "lib").glob("python*/site-packages")
    here = sysconfig.get_path("purelib")
    (packages / "of_the_tests.pth").write_text(f"import site; site.addsitedir({here!r})\n")
    programs = folder / ".venv" / "bin"
    for name, module in (("klab", "offboard.cli.main"), ("pip", "pip")):
        (programs / name).write_text(f'#!/bin/sh\nexec "{programs}/python" -m {module} "$@"\n')
        (programs / name).chmod(0o755)
    return programs


def work_through(text: str, folder: Path, **variables: str) -> str:
    """Do what each block of a text says; return what all of them printed.

    A block that begins with a comment that is a file's name is written to this file. Any other
    `bash` or `python` block is run. One without a language is a picture or an output.

    Raises
    ------
    AssertionError
        If a block fails, or is of another language and names no file: nothing would try it.
    """
    # What builds the package is what builds ours: nothing is fetched for each.
    variables["PIP_NO_BUILD_ISOLATION"] = "0"
    variables["PATH"] = f"{environment_of(folder)}:/usr/local/bin:/usr/bin:/bin"
    (folder / "runs").mkdir()
    printed = ""
    for language, inside in blocks(text):
        if named := NAMED.match(inside):
            file = folder / named.group(1)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(inside)
        elif language == "bash":
            printed += by_the_shell(inside, folder, **variables)
        elif language == "python":
            (folder / "block.py").write_text(inside)
            printed += by_the_shell("python block.py", folder, **variables)
        else:
            assert not language, f"nothing tries this block of {language}:\n{inside}"
    return printed
