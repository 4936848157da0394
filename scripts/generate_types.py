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
WIRE_FORMATS = {
    "int8_t": "b", "int16_t": "h", "int32_t": "i", "int64_t": "q", "byte": "B",
    "float": "f", "double": "d", "boolean": "?",
}  # fmt: skip
"""Of the types of a fixed size, in the letters of the module ``struct``."""
NO_PLAIN_ARRAYS = {"byte", "boolean"}
"""Arrays of these are not decoded as tuples of numbers."""
CODEC = """
# Of scripts/generate_types.py: all fields have a fixed size, so that one compiled struct writes
# and reads the same bytes as the methods above in half the time.
_WIRE = struct.Struct(">8s{formats}")
_FIELDS = struct.Struct(">{formats}")
_FINGERPRINT = {name}._get_packed_fingerprint()


def _encode(self):
    return _WIRE.pack(_FINGERPRINT, {fields})


def _decode(data):
    if data[:8] != _FINGERPRINT:
        raise ValueError("Decode error")
    self = {name}.__new__({name})
    {targets} = _FIELDS.unpack_from(data, 8)
{arrays}    return self


{name}.encode = _encode
{name}.decode = staticmethod(_decode)
"""


def generate(sources: Path, target: Path) -> Path:
    """Run lcm-gen over ``sources/*.lcm`` and write the package below ``target``.

    Types whose fields all have a fixed size get a faster codec. Beside each module goes a
    ``.pyi`` stub, so that a type checker knows the fields, and ``py.typed``.

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
        generated = module.read_text()
        module.write_text(generated + codec(generated))
        module.with_suffix(".pyi").write_text(stub(generated))
    shutil.copy(package / "__init__.py", package / "__init__.pyi")
    (package / "py.typed").touch()
    return package


def codec(generated: str) -> str:
    """Return what to append to one generated module; nothing if its messages vary in size."""
    struct_name, table = _class_table(generated)
    typenames, shapes = table["__typenames__"], table["__dimensions__"]
    lengths = [_length(shape) for shape in shapes]
    if None in lengths or not WIRE_FORMATS.keys() >= set(typenames):
        return ""
    if any(n and t in NO_PLAIN_ARRAYS for n, t in zip(lengths, typenames, strict=True)):
        return ""
    formats, fields, targets, arrays = [], [], [], []
    for field, typename, length in zip(table["__slots__"], typenames, lengths, strict=True):
        letter = WIRE_FORMATS[typename]
        if length:
            formats.append(f"{length}{letter}")
            fields.append(f"*self.{field}[:{length}]")
            targets += [f"{field}_{k}" for k in range(length)]
            values = "".join(f"{field}_{k}, " for k in range(length))
            arrays.append(f"    self.{field} = ({values.rstrip()})\n")
        else:
            formats.append(letter)
            fields.append(f"self.{field}")
            targets.append(f"self.{field}")
    return CODEC.format(
        name=struct_name,
        formats="".join(formats),
        fields=", ".join(fields),
        targets=", ".join(targets),
        arrays="".join(arrays),
    )


def _length(shape: list[Any] | None) -> int | None:
    """Return the length of an array, 0 of what is none, None where it is not one fixed number."""
    if not shape:
        return 0
    return shape[0] if len(shape) == 1 and isinstance(shape[0], int) else None


def stub(generated: str) -> str:
    """Return the type stub of one generated module, given its source."""
    struct_name, table = _class_table(generated)
    constants = [
        f"    {name}: {type(value).__name__}"
        for name, value in table.items()
        if not name.startswith("_")
    ]
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
        f"class {struct_name}:",
        *constants,
        *fields,
        "    def __init__(self) -> None: ...",
        "    def encode(self) -> bytes: ...",
        "    @staticmethod",
        f"    def decode(data: bytes) -> {struct_name}: ...",
        "    @staticmethod",
        "    def _get_packed_fingerprint() -> bytes: ...",
        "    def get_hash(self) -> int: ...",
    ]
    return "\n".join(lines) + "\n"


def _class_table(generated: str) -> tuple[str, dict[str, Any]]:
    """Return the name of the class in a generated module, and the values in its body."""
    struct = next(n for n in ast.parse(generated).body if isinstance(n, ast.ClassDef))
    return struct.name, {
        node.targets[0].id: ast.literal_eval(node.value)
        for node in struct.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }


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
