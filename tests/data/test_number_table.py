"""Tables of numbers by other programs: each is read as it was meant, or refused by name."""

import codecs
import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.data.dat import read_folder
from koopman_lab.data.number_table import read_number_table
from koopman_lab.errors import DataError

SEMICOLON, COMMA, BLANK, TAB, COMMA_BLANK = ";", ",", " ", "\t", ", "
MARKS = {
    "utf-8": b"",
    "utf-8-sig": b"",
    "utf-16-le": codecs.BOM_UTF16_LE,
    "utf-16-be": codecs.BOM_UTF16_BE,
    "utf-32-le": codecs.BOM_UTF32_LE,
}
NUMBERS = st.one_of(
    st.floats(-1e3, 1e3), st.integers(-9, 9).map(float), st.floats(1e-150, 1e150, width=64)
)


def outcome(path):
    """Return the numbers of a file, or else None and why it was refused."""
    try:
        return read_number_table(path).numbers, ""
    except DataError as error:
        return None, str(error)


@st.composite
def written_tables(draw):
    """Give a table, how a program of some country writes it, and whether it may be refused.

    Numbers that a comma both separates and begins the fraction of may be refused, and so may
    a table with commas in which no decimal point says what they are.
    """
    rows, columns = draw(st.integers(1, 4)), draw(st.integers(1, 5))
    table = np.array(
        [draw(st.lists(NUMBERS, min_size=columns, max_size=columns)) for _ in range(rows)]
    )
    separator = draw(st.sampled_from([SEMICOLON, COMMA, BLANK, TAB, COMMA_BLANK, " ; ", "   "]))
    decimal = draw(st.sampled_from([".", ","]))
    exponent = draw(st.sampled_from(["e", "E", "D", "d"]))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    trailing = draw(st.sampled_from(["", separator.strip() or separator]))
    between = draw(st.sampled_from(["", end, f"# 1 2 3{end}", f"% Größe{end}"]))
    header = draw(st.sampled_from(["", end, "x1 x2 theta" + end, '"x1";"x2";"theta (rad)"' + end]))
    form = draw(st.sampled_from(["%.17g", "%.17e"]))

    def one(number):
        return (form % number).replace(".", decimal).replace("e", exponent)

    body = "".join(separator.join(map(one, row)) + trailing + end + between for row in table)
    encoding = draw(st.sampled_from(sorted(MARKS)))
    refusable = "," in body and (decimal == "," or "." not in body)
    return table, MARKS[encoding] + (header + body).encode(encoding), refusable


@given(written_tables())
def test_a_table_is_read_to_the_last_bit_or_refused(tmp_path_factory, written):
    table, content, refusable = written
    path = tmp_path_factory.mktemp("any") / "X_1.dat"
    path.write_bytes(content)
    numbers, refusal = outcome(path)
    if numbers is None:
        assert refusable
        assert "line " in refusal
    else:
        assert np.array_equal(numbers, table)


READ = {
    "decimal commas, semicolons": ("0,5;0,25\n-1,5;2\n", [[0.5, 0.25], [-1.5, 2.0]]),
    "decimal commas, blanks": ("0,5 0,25\n2 1,5e-3\n", [[0.5, 0.25], [2.0, 0.0015]]),
    "decimal commas, tabs": ("0,5\t0,25\r\n1\t2\r\n", [[0.5, 0.25], [1.0, 2.0]]),
    "commas": ("0.5,0.25\n1,2\n", [[0.5, 0.25], [1.0, 2.0]]),
    "commas and blanks": ("0.5, 0.25\n1,2\n", [[0.5, 0.25], [1.0, 2.0]]),
    "whole numbers": ("1, 2\n3, 4\n", [[1.0, 2.0], [3.0, 4.0]]),
    "a semicolon behind each line": ("1 2;\n3 4;\n", [[1.0, 2.0], [3.0, 4.0]]),
    "a comma behind each line": ("0.5,2,\n3,4,\n", [[0.5, 2.0], [3.0, 4.0]]),
    "Fortran": ("0.5D-03 -.25d2\n1.5-101 2.D0\n", [[0.5e-3, -25.0], [1.5e-101, 2.0]]),
    "quotation marks": ('"0.5","0.25"\n', [[0.5, 0.25]]),
    "a typeset minus": ("\N{MINUS SIGN}0.5 2\n", [[-0.5, 2.0]]),
    "a comment behind": ("1 2 # first\n\n% all\n3 4\n", [[1.0, 2.0], [3.0, 4.0]]),
    "titles": ("Robot, second run\nx1 (m), x2 (m)\n0.5,1\n", [[0.5, 1.0]]),
}


@pytest.mark.parametrize("name", READ)
def test_the_ways_to_write_a_table(tmp_path, name):
    text, numbers = READ[name]
    (tmp_path / "t.dat").write_text(text, newline="")
    assert read_number_table(tmp_path / "t.dat").numbers.tolist() == numbers


REFUSED = {
    b"1 2\n0,5,0,25\n": r"line 2: .*comma",
    b"0,648170,0,647128\n": r"line 1: a comma may be a decimal comma",
    b"0,648170,-0,647128\n": r"line 1: a comma may be a decimal comma",
    b"0,5, 0,25\n": r"line 1: a comma may be a decimal comma",
    b"0,5 ,25\n": r"line 1: a comma may be a decimal comma",
    b"0,5;0.25\n": r"line 1: decimal points and commas in one file",
    b"1 2\n1.234,5 6.789,5\n": r"line 2: commas and blanks both|line 1: commas and blanks both",
    b"1,234.5 6,789.5\n": r"line 1: commas and blanks both",
    b"1;2;3\n1;;3\n": r"line 2: nothing between two separators",
    b"1;2 3;4\n": r"line 1: '2 3' is no number",
    b"1 2\n1 2 3\n": r"line 2 holds 3 numbers, line 1 2",
    b"1 2\n1 ***\n": r"line 2: '\*\*\*' is no number; put # before",
    b"1 2\n1 1_0\n": r"line 2: '1_0' is no number",
    b"time 3 s\n1 2\n": r"line 1: 'time' is no number; put # before",
    b"NaN NaN\n1 2\n": r"nan in line 1, column 1",
    b"NA NA\n1 2\n": r"line 1: 'NA' is no number",
    b"1 2\n\n1 1e999\n": r"inf in line 3, column 2",
    b"1 1D999\n": r"inf in line 1, column 2",
    b"1 -Infinity\n": r"-inf in line 1, column 2",
    b"1 0.5+0.25i\n": r"line 1: '0\.5\+0\.25i' is a complex number",
    b"1 2j\n": r"line 1: '2j' is a complex number",
    b"1 2\n% Gr\xf6\xdfe\n": r"line 2 is not UTF-8",
    "1 2\n".encode("utf-16-le"): r"line 1 holds a byte of zero.*save it as UTF-8",
    codecs.BOM_UTF16_BE + b"\0": r"is not UTF-16-BE",
    b"PK\3\4\0\0": r"byte of zero",
}


@pytest.mark.parametrize("content", REFUSED, ids=repr)
def test_what_is_refused_names_file_line_and_remedy(tmp_path, content):
    (tmp_path / "t.dat").write_bytes(content)
    with pytest.raises(DataError, match=rf"t\.dat: .*({REFUSED[content]})"):
        read_number_table(tmp_path / "t.dat")


@given(st.binary(max_size=60))
def test_any_bytes_are_a_table_or_refused(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "t.dat"
    path.write_bytes(content)
    numbers, refusal = outcome(path)
    assert str(path) in refusal if numbers is None else np.isfinite(numbers).all()


@given(
    st.lists(st.lists(NUMBERS, min_size=3, max_size=3), min_size=1, max_size=4),
    st.sampled_from([";", " ", "\t", " ; ", ",", ", "]),
    st.sampled_from(["%.6f", "%g", "%.3e"]),
)
def test_no_number_is_cut_in_two(tmp_path_factory, rows, separator, form):
    """Whatever separates them: with decimal commas there are three numbers a line, or no table."""
    path = tmp_path_factory.mktemp("any") / "t.dat"
    lines = [separator.join((form % number).replace(".", ",") for number in row) for row in rows]
    path.write_text("\n".join(lines))
    numbers, _ = outcome(path)
    if numbers is not None:
        assert numbers.shape == (len(rows), 3)
        written = [[float(form % number) for number in row] for row in rows]
        assert np.array_equal(numbers, written)


def test_a_header_in_another_order_is_refused(tmp_path):
    for letter, index in itertools.product("XY", (1, 2)):
        (tmp_path / f"{letter}_{index}.dat").write_text("x1;x2;theta\n0,5;0,25;1\n0;0;0\n")
    assert read_folder(tmp_path, "kinematic", 0.05).X[1].tolist() == [[0.5, 0.25, 1.0], [0, 0, 0]]
    (tmp_path / "Y_2.dat").write_text("theta;x1;x2\n0,5;0,25;1\n0;0;0\n")
    with pytest.raises(DataError, match=r"Y_2\.dat: its header names theta, x1, x2; write"):
        read_folder(tmp_path, "kinematic", 0.05)


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero"), tmp_path / "not there"):
        with pytest.raises(DataError, match="cannot be read"):
            read_number_table(path)
