"""Background: the many weak effects that every real axis has besides the one that is looked for."""

from collections.abc import Collection, Sequence
from types import MappingProxyType

import numpy as np

from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.catalogue import ALL_FORMS, form_named, forms_of
from pneumo_casadi.virtual_bench.effect import Severity, VirtualEffect, effect_at_severity

#: A weak effect acts with this share of a medium one: a play of 40 µm, a lag of 0.4 ms, a friction
#: of a newton. Small ones have a third of medium.
WEAK = 0.1
#: Least and greatest number of weak effects.
FEWEST, MOST = 4, 6
#: Width of the scatter of their sizes: half to twice.
SCATTER = 0.7


def draw_background(
    rng: np.random.Generator, without: Collection[str] = (), forms_varied: bool = True
) -> tuple[str, ...]:
    """Draw the forms of four to six weak effects of different causes.

    Parameters
    ----------
    rng : Generator
        Source of the draw.
    without : collection of str
        Causes that are not drawn.
    forms_varied : bool, optional
        Whether each may have any of its forms; else it has the usual one.

    Examples
    --------
    >>> names = draw_background(np.random.default_rng(1), without=["stribeck"])
    >>> 4 <= len(names) <= 6, [name for name in names if name.startswith("stribeck")]
    (True, [])
    """
    causes = sorted({form.cause for form in ALL_FORMS.values() if form.strength} - set(without))
    count = int(rng.integers(FEWEST, MOST + 1))
    chosen = rng.choice(len(causes), min(count, len(causes)), replace=False)
    names = []
    for i in sorted(int(index) for index in chosen):
        forms = forms_of(causes[i])
        names.append(forms[int(rng.integers(len(forms)))] if forms_varied else forms[0])
    return tuple(names)


def weak_effects(axis: VirtualAxis, names: Sequence[str], seed: int) -> tuple[VirtualEffect, ...]:
    """Return weak effects of an axis, a tenth of medium with scatter.

    Raises
    ------
    ModelError
        If the bench has no form of that name.
    """
    effects = []
    for name in names:
        form = form_named(name)
        medium = effect_at_severity(form, Severity.MEDIUM, axis, seed)
        scatter = np.random.default_rng([seed, 8, *name.encode()]).uniform(-SCATTER, SCATTER)
        share = WEAK * float(np.exp(scatter))
        parameters = {
            quantity: value * (share if quantity in form.strength else 1.0)
            for quantity, value in medium.parameters.items()
        }
        effects.append(VirtualEffect(form, MappingProxyType(parameters)))
    return tuple(effects)
