"""The code that made a result is told by its files."""

from pneumo_casadi.runtime.provenance import code_hash


def test_the_hash_of_code_changes_with_a_file_and_with_its_name(tmp_path):
    assert code_hash(tmp_path) == ""
    file = tmp_path / "stage" / "fit.py"
    file.parent.mkdir()
    file.write_text("x = 1\n", "utf-8")
    first = code_hash(tmp_path)
    assert code_hash(tmp_path) == first
    file.write_text("x = 2\n", "utf-8")
    second = code_hash(tmp_path)
    file.rename(file.with_name("fits.py"))
    assert len({first, second, code_hash(tmp_path)}) == 3
