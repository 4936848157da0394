"""A package of a stranger, as an installer leaves it in a folder: modules and entry points."""

from pathlib import Path

NAME = "klab-stranger"


def install(
    folder: Path,
    entry_points: dict[str, dict[str, str]],
    modules: dict[str, str],
    *,
    name: str = NAME,
    requires: str = "koopman-lab>=0.1",
) -> Path:
    """Install into a folder that goes on the path; return the folder.

    Parameters
    ----------
    folder
        As of site packages.
    entry_points
        By group, then by name: where the row is.
    modules
        Their text by their names.
    name
        Of the package.
    requires
        What its metadata say that it needs.
    """
    information = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nRequires-Dist: {requires}\n"
    )
    (information / "entry_points.txt").write_text(
        "".join(
            f"[{group}]\n" + "".join(f"{row} = {where}\n" for row, where in rows.items())
            for group, rows in entry_points.items()
        )
    )
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text)
    return folder
