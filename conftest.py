"""What tests and the examples of docstrings share."""

import os
import re

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # before any import of numpy
    os.environ.setdefault(_name, "1")

from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402

import pytest  # noqa: E402

import pneumo_casadi as pc  # noqa: E402


@pytest.fixture(scope="session")
def embedded() -> Path:
    """Folder of the embedded record whose true parameters are known."""
    return pc.data.EXAMPLE


@pytest.fixture(scope="session")
def quick():
    """Return an identification of a few seconds of record: quick to make, not to be trusted."""
    case = pc.example_case()
    case = replace(case, validate=(case.validate[0].window(8.0, 10.0),))
    return pc.identify(
        case,
        pc.IdentifyOptions(pc.valve.FlowForm.POLYNOMIALS, start=10.0, end=13.0, windows=(0.5,)),
    )


@pytest.fixture(scope="session")
def quick_diagnosis():
    """Return a diagnosis of a few seconds of record with two effects."""
    case = pc.example_case()
    fitted, held_out = case.identify[0].window(10.0, 13.0), case.validate[0].window(8.0, 10.0)
    few = {name: pc.EFFECTS[name] for name in ("stribeck", "quadratic_drag")}
    return pc.diagnose(replace(case, identify=(fitted,), validate=(held_out,)), few)


#: Results that examples of docstrings may use by name, with the fixtures that make them.
_EXAMPLE_RESULTS = {"result": "quick", "diagnosis": "quick_diagnosis"}


@pytest.fixture(autouse=True)
def names_of_examples(request, doctest_namespace):
    """Give `pc`, and the shared results that an example reads, to the docstrings."""
    if isinstance(request.node, pytest.DoctestItem):
        doctest_namespace["pc"] = pc
        source = "".join(example.source for example in request.node.dtest.examples)
        for name, fixture in _EXAMPLE_RESULTS.items():
            used = re.search(rf"(?<![\w.]){name}\b", source)
            if used and not re.search(rf"^{name} = ", source, re.MULTILINE):
                doctest_namespace[name] = request.getfixturevalue(fixture)
