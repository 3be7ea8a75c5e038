"""Small cases of the virtual bench, made once."""

import pytest


@pytest.fixture(scope="session")
def made_case(tmp_path_factory):
    """Return a function that records a case with hidden effects, 8 s each way at 1 kHz."""
    pytest.importorskip("numba")
    from pneumo_casadi.virtual_bench import make_case

    known = {}

    def make(seed, **effects):
        key = (seed, *sorted(effects.items()))
        if key not in known:
            folder = tmp_path_factory.mktemp("bench") / "case"
            known[key] = make_case(folder, seed, effects, duration=8.0).case
        return known[key]

    return make
