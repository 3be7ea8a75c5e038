"""A record with its real time stamps gives the estimates of the uniform one."""

from dataclasses import replace

import numpy as np
import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import Clock, Recording

ROWS = 5  # rows of the example, recorded at 5 kHz, that become one


def thinned(record, clock):
    """Keep about every fifth row, with a jitter of a fifth of the step where stamps are kept."""
    rows = np.arange(0, record.N - 2 * ROWS, ROWS)
    if clock is Clock.AS_RECORDED:
        rows[1:] += np.random.default_rng(1).integers(-1, 2, rows.size - 1)
    ends = np.append(rows[1:], rows[-1] + ROWS)
    channels = {name: record[name][rows] for name in record.names}
    for name in ("u_P", "u_N"):  # what was held in between, with the same integral
        total = np.concatenate([[0.0], np.cumsum(record[name])])
        channels[name] = (total[ends] - total[rows]) / (ends - rows)
    return Recording(record.t[rows], channels, record.name, record.source, record.hold, clock=clock)


@pytest.mark.slow
def test_jitter_moves_the_estimates_by_less_than_one_interval():
    case = pc.example_case()
    frames = []
    for clock in (Clock.UNIFORM, Clock.AS_RECORDED):
        bench = replace(case.bench, sampling_frequency=1000.0, clock=clock)
        record = thinned(case.identify[0].window(5.0, 7.0), clock)
        made = replace(case, bench=bench, identify=(record,), validate=())
        frames.append(pc.identify(made).to_frame())
    uniform, jittered = frames
    shift = (jittered.output_error - uniform.output_error) / uniform.output_error_std
    assert shift.abs().max() < 1.0
    assert ((jittered.wls - uniform.wls) / uniform.wls_std).abs().max() < 2.0
