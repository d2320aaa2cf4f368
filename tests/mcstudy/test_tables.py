"""Tables as people's programs write them: read right, or refused with line and cure."""

from pathlib import Path

import pytest
from numpy import inf, nan
from numpy.testing import assert_array_equal

from mcstudy.errors import UserError
from mcstudy.tables import TextTable, read_csv


def table(tmp_path: Path, content: str | bytes, **options: tuple[str, ...]) -> TextTable:
    path = tmp_path / "table.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_csv(path, **options)


@pytest.mark.parametrize("content", [
    "hic,injured\n812.5,1\n90.25,0\n",
    "hic;injured\n812,5;1\n90,25;0\n",
    "hic;injured\n812.5;1\n90.25;0\n",
    "hic\tinjured\r\n812,5\t1\r\n90,25\t0\r\n",
    "sep=;\nhic;injured\n812,5;1\n90,25;0\n",
    "\n\nhic , injured\n 812.5 , 1\n90.25,0\n\n",
    '"hic","injured"\n"812.5","1"\n"90.25","0"\n',
    b"\xef\xbb\xbfhic,injured\n812.5,1\n90.25,0\n",
    "hic,injured\n812.5,1\n90.25,0\n".encode("utf-16"),
    "hic,injured\r812.5,1\r90.25,0",
    "hic,injured\n+8.125e2,1\n.9025E+2,0\n",
])  # fmt: skip
def test_the_same_numbers_however_they_are_written(tmp_path: Path, content: str | bytes) -> None:
    found = table(tmp_path, content)
    assert_array_equal(found.numbers("hic"), [812.5, 90.25])
    assert_array_equal(found.numbers("injured"), [1.0, 0.0])


@pytest.mark.parametrize(("content", "message"), [
    # Decimal commas between commas: every row has a field too many, or some have.
    ("hic,injured\n812,5,1\n", "line 2 has 3 fields, not 2 as line 1: .*812,5 .*semicolons"),
    ("hic,injured\n812,1\n90,25,0\n", "line 3 has 3 fields, not 2"),
    ("hic,injured\n812,1,\n", "line 2 has 3 fields, .*ends with a separator"),
    ("hic,injured\n812\n", "line 2 has 1 fields"),
    ("hic;injured\n812;1;0\n", "line 2 has 3 fields"),
    ("hic,hic\n1,2\n", "line 1 must name the columns, each once"),
    ("", "line 1 must name"),
    ('hic,injured\n"1,0\n', "cannot be read"),
    ("hic,injured\n1,\0\n", "no text"),
    # No numbers.
    ('hic,x\n"812,5",1\n', "line 2: column 'hic' .*decimal comma"),
    ("hic;x\n812,5;0.5\n", "line 2 has a decimal comma .*line 2 a decimal point"),
    ("hic;x\n1.234,5;1\n", "'1.234,5'"),
    ("hic;x\n1,234,567;1\n", "'1,234,567'"),
    ("hic,x\n1_000,1\n", "'1_000'"),
    ("hic,x\ninf,1\n", "'inf'"),
    ("hic,x\n1e999,1\n", "'1e999'"),
    ("hic,x\n0x10,1\n", "'0x10'"),
    ("hic,x\n\u0663,1\n", "line 2"),
])  # fmt: skip
def test_no_row_or_no_number_is_refused(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        table(tmp_path, content).numbers("hic")
    assert str(caught.value).startswith(str(tmp_path))


def test_words_for_nothing_infinite_bounds_names_and_lines(tmp_path: Path) -> None:
    found = table(tmp_path, "a,b\n,NA\n-inf,1\ninf,n/a\n")
    assert_array_equal(found.numbers("a", infinite=True), [nan, -inf, inf])
    assert_array_equal(found.numbers("b", missing=("na", "n/a")), [nan, 1, nan])
    # Names of tests are no decimal points.
    assert table(tmp_path, "test;v\n1.2;8,5\n", text=("test",)).numbers("v").tolist() == [8.5]
    # Lines are those of the file.
    assert table(tmp_path, 'a,b\n\n1,"two\nlines"\n\n3,4\n').lines == [4, 6]
