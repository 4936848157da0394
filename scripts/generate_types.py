"""Generate the Python types of ``lcmtypes/*.lcm``; the package build calls this.

By hand, to look at what is generated: ``python scripts/generate_types.py TARGET_FOLDER``.
"""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import lcm

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # run by hand, or by the tests: hatchling is only in the build environment
    BuildHookInterface = object

PACKAGE = "lcmtypes"
PYTHON_TYPES = {
    "int8_t": "int", "int16_t": "int", "int32_t": "int", "int64_t": "int", "byte": "int",
    "float": "float", "double": "float", "boolean": "bool", "string": "str",
}  # fmt: skip


def generate(sources: Path, target: Path) -> Path:
    """Run lcm-gen over ``sources/*.lcm`` and write the package below ``target``.

    Beside each module goes a ``.pyi`` stub, so that a type checker knows the fields, and
    ``py.typed``.

    Returns
    -------
    The folder of the generated package, ``target/lcmtypes``.

    Raises
    ------
    FileNotFoundError
        If ``sources`` holds no ``.lcm`` file.
    subprocess.CalledProcessError
        If lcm-gen refuses a file; its message is on standard error.
    """
    files = sorted(sources.glob("*.lcm"))
    if not files:
        raise FileNotFoundError(f"no .lcm files in {sources}")
    generator = Path(lcm.LCM_BIN_DIR) / "lcm-gen"
    subprocess.run([generator, "--python", "--ppath", target, *files], check=True)
    package = target / PACKAGE
    for module in sorted(package.glob("*_t.py")):
        module.with_suffix(".pyi").write_text(stub(module.read_text()))
    shutil.copy(package / "__init__.py", package / "__init__.pyi")
    (package / "py.typed").touch()
    return package


def stub(generated: str) -> str:
    """Return the type stub of one generated module, given its source."""
    struct = next(n for n in ast.parse(generated).body if isinstance(n, ast.ClassDef))
    table: dict[str, Any] = {}
    constants: list[str] = []
    for node in struct.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, value = node.targets[0].id, ast.literal_eval(node.value)
            table[name] = value
            if not name.startswith("_"):
                constants.append(f"    {name}: {type(value).__name__}")
    fields = []
    rows = zip(table["__slots__"], table["__typenames__"], table["__dimensions__"], strict=True)
    for name, typename, dimensions in rows:
        python = PYTHON_TYPES[typename]
        for _ in dimensions or []:
            python = f"Sequence[{python}]"
        fields.append(f"    {name}: {python}")
    lines = [
        "from collections.abc import Sequence",
        "",
        f"class {struct.name}:",
        *constants,
        *fields,
        "    def __init__(self) -> None: ...",
        "    def encode(self) -> bytes: ...",
        "    @staticmethod",
        f"    def decode(data: bytes) -> {struct.name}: ...",
        "    @staticmethod",
        "    def _get_packed_fingerprint() -> bytes: ...",
        "    def get_hash(self) -> int: ...",
    ]
    return "\n".join(lines) + "\n"


class CustomBuildHook(BuildHookInterface):  # type: ignore[misc,valid-type]
    """Put the generated package into the wheel, for normal and for editable installs alike."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate into a temporary folder and tell hatchling to include it."""
        self._folder = tempfile.TemporaryDirectory()
        package = generate(Path(self.root) / PACKAGE, Path(self._folder.name))
        key = "force_include_editable" if version == "editable" else "force_include"
        build_data[key][str(package)] = PACKAGE

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the temporary folder."""
        del version, build_data, artifact_path
        self._folder.cleanup()


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python scripts/generate_types.py TARGET_FOLDER")
    generate(Path(__file__).parent.parent / PACKAGE, Path(sys.argv[1]))
