"""The trailer of the lab's key stands behind every message, and nobody trips over it.

Decoders that lcm-gen writes for Java were tried by hand, as no Java is needed to run the tests.
"""

import shutil
import subprocess
from pathlib import Path

import lcm
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_messages import messages

import lcmtypes
from koopman_lab.bus.authentication import Signer
from koopman_lab.bus.channels import CHANNELS
from koopman_lab.bus.header import header_reader, restamp
from koopman_lab.bus.lab_key import KEY_BYTES
from koopman_lab.data.message_arrays import decode_all, wire_dtype
from koopman_lab.eventlog.message_blocks import Messages
from koopman_lab.eventlog.older_layouts import OLDER_LAYOUTS, in_present_layout

TYPES = sorted({channel.type for channel in CHANNELS}, key=lambda kind: kind.__name__)
TEXTS = [kind for kind in TYPES if "string" in kind.__typenames__]
SOURCES = Path(__file__).parents[2] / "lcmtypes"


def signed(data):
    return Signer(bytes(KEY_BYTES)).sign("R1_MOTOR_CMD", data)


@pytest.mark.parametrize("kind", [kind for kind in TYPES if kind not in TEXTS])
@given(data=st.data())
def test_all_readers_read_a_message_and_not_what_follows(kind, data):
    encoded = data.draw(messages(kind)).encode()
    said = signed(encoded)
    assert kind.decode(said).encode() == encoded
    assert header_reader(kind)(said) == header_reader(kind)(encoded)
    stamped = restamp(said, 7)
    assert kind.decode(stamped).utime == 7
    assert stamped[len(encoded) :] == said[len(encoded) :]
    if wire_dtype(kind) is not None:
        one, bad = decode_all(kind, Messages.joined([encoded, said]))
        assert len(bad) == 0
        assert one[0].tobytes() == one[1].tobytes()


@pytest.mark.parametrize("kind", TEXTS)
@given(data=st.data())
def test_messages_with_texts_end_where_they_say(kind, data):
    message = kind()
    for name, wire in zip(kind.__slots__, kind.__typenames__, strict=True):
        if wire == "string":
            setattr(message, name, data.draw(st.text(st.characters(codec="utf-8"), max_size=20)))
    encoded = message.encode()
    assert kind.decode(signed(encoded)).encode() == encoded
    assert header_reader(kind)(signed(encoded)) == header_reader(kind)(encoded)


@pytest.mark.parametrize("layout", OLDER_LAYOUTS, ids=lambda row: row.message_type.__name__)
def test_messages_of_older_layouts_are_read_with_a_trailer(layout):
    zeros = layout.fingerprint + bytes(400)
    assert in_present_layout(signed(zeros)) == in_present_layout(zeros) != zeros


MAIN = """
#include <stdio.h>
#include <string.h>
%(includes)s
static unsigned char data[65536], again[65536];
static int read_file(const char *name) {
    FILE *file = fopen(name, "rb");
    int size = (int)fread(data, 1, sizeof data, file);
    fclose(file);
    return size;
}
int main(void) {
    int wrong = 0, size;
%(checks)s
    return wrong;
}
"""
CHECK = """
    size = read_file("%(name)s.bin");
    lcmtypes_%(name)s_t %(name)s;
    if (lcmtypes_%(name)s_t_decode(data, 0, size, &%(name)s) != size - %(trailer)d
        || lcmtypes_%(name)s_t_encode(again, 0, sizeof again, &%(name)s) != size - %(trailer)d
        || memcmp(data, again, size - %(trailer)d))
        wrong += printf("%(name)s\\n");
"""


def test_decoders_in_c_read_a_message_and_not_what_follows(tmp_path):
    names = [kind.__name__.removesuffix("_t") for kind in TYPES]
    for name in names:
        message = getattr(lcmtypes, f"{name}_t")()
        message.utime, message.sequence = 1_800_000_000_000_000, 77
        (tmp_path / f"{name}.bin").write_bytes(signed(message.encode()))
    sources = sorted(SOURCES.glob("*.lcm"))
    generator = Path(lcm.LCM_BIN_DIR) / "lcm-gen"
    here = ("--c", "--c-cpath", tmp_path, "--c-hpath", tmp_path)
    subprocess.run([generator, *here, *sources], check=True)
    trailer = len(signed(b""))
    text = MAIN % {
        "includes": "".join(f'#include "lcmtypes_{name}_t.h"\n' for name in names),
        "checks": "".join(CHECK % {"name": name, "trailer": trailer} for name in names),
    }
    (tmp_path / "main.c").write_text(text)
    wheel = Path(lcm.LCM_BIN_DIR).parent
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None, "the tests of the compiled controller need a C compiler as well"
    subprocess.run(
        [
            *(compiler, "-w", f"-I{wheel / 'include'}", "-o", "read", "main.c"),
            *sorted(file.name for file in tmp_path.glob("lcmtypes_*.c")),
            *(f"-L{wheel / 'lib'}", "-llcm", f"-Wl,-rpath,{wheel / 'lib'}"),
            "-Wl,--allow-shlib-undefined",
        ],
        cwd=tmp_path,
        check=True,
    )
    done = subprocess.run(
        [tmp_path / "read"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "")
