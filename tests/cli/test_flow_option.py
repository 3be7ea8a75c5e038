"""The options --flow and --degrees take what the help prints."""

import pytest

from pneumo_casadi.cli.options import FlowOption, degrees_of
from pneumo_casadi.errors import CaseError
from pneumo_casadi.valve import FlowForm


def test_every_form_has_an_option_and_auto_leaves_the_choice_open():
    assert [option.form for option in FlowOption] == [None, *FlowForm]


def test_degrees_are_read_as_the_help_prints_them():
    assert degrees_of("7,7,4") == (7, 7, 4)
    assert degrees_of(None) is None


@pytest.mark.parametrize("text", ["7 7 4", "7,7", "7,7,4,4", "a,b,c", ""])
def test_degrees_that_are_none_are_refused(text):
    with pytest.raises(CaseError, match=r"three whole numbers, as 7,7,4"):
        degrees_of(text)
