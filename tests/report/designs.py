"""A design made by hand: every part of its report, without a search."""

from dataclasses import replace

import numpy as np

from pneumo_casadi.design import (
    KINDS,
    Criterion,
    Design,
    DesignOptions,
    Limits,
    Part,
    Precision,
    Reference,
)
from pneumo_casadi.design.experiment import SimulatedExperiment


def made_design(**changes):
    N = 100
    t = np.linspace(0.0, 1.0, N)
    reference = Reference(0.01, 0.1 * np.sin(t), np.zeros(N))
    x = np.vstack([4e5 + 1e5 * t, 5e5 - 1e5 * t, 0.1 * np.sin(t), 0.1 * np.cos(t)])
    run = SimulatedExperiment(reference, x, np.vstack([t, -t]), x[:3], 1.25)
    kind = next(iter(KINDS))
    part = Part(kind, 1.0, tuple(number.start for number in KINDS[kind].numbers))
    now = np.array([0.2, np.inf])
    precision = Precision(
        ("M", "f_v"),
        ("kg", "N s/m"),
        np.array([16.9, 11.0]),
        now,
        np.array([0.1, 0.2]),
        np.array([0.05, 0.1]),
        Criterion("D"),
        *(0.04, 0.02, 0.01),
    )
    design = Design(
        reference,
        (part,),
        DesignOptions(Limits(0.2, 0.5, 1.5e5, 6e5, 3.0), 1.0, seed=3),
        {"axis": run},
        (0.5, 0.4),
        precision,
        (),
        1.5,
        ("A note.",),
    )
    return replace(design, **changes)
