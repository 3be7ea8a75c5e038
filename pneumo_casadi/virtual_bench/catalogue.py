"""All effects of the virtual bench, how they are requested, and the weak ones in the background.

Every real axis has many weak effects besides the one that is looked for.
"""

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.virtual_bench import chambers_and_sensors, forces, further_forms, valves
from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.effect import (
    EffectForm,
    Severity,
    VirtualEffect,
    effect_at_severity,
    effect_from_quantities,
)

#: By name: first those that the catalogue of effects lists, then those that it does not.
FORMS: Mapping[str, EffectForm] = MappingProxyType(
    {
        form.name: form
        for form in (
            *forces.FORMS,
            *valves.FORMS,
            *chambers_and_sensors.FORMS,
            *chambers_and_sensors.UNLISTED,
        )
    }
)

#: With further forms of some causes, each after the usual one.
ALL_FORMS: Mapping[str, EffectForm] = MappingProxyType(
    {**FORMS, **{form.name: form for form in further_forms.FORMS}}
)

#: How an effect is requested: by a severity, or by quantities [SI] by name.
EffectRequest = Severity | str | Mapping[str, float]

#: A weak effect acts with this share of a small one. Small ones have a third of medium, so that a
#: tenth of medium, which can be asked for, is a harder background: a play of 40 µm, a lag of
#: 0.4 ms, a friction of a newton, of which small effects hardly stand out.
WEAK = 0.1
#: Least and greatest number of weak effects.
FEWEST_WEAK, MOST_WEAK = 4, 6
#: Width of the scatter of their sizes: half to twice.
WEAK_SCATTER = 0.7


def effects_for(
    axis: VirtualAxis, requests: Mapping[str, EffectRequest], seed: int | None = None
) -> tuple[VirtualEffect, ...]:
    """Return the requested effects of an axis.

    Parameters
    ----------
    axis : VirtualAxis
        Whose scales count.
    requests : mapping
        By name of the form, where there are several: a `Severity` or its value, or quantities [SI]
        by name.
    seed : int, optional
        Where given, sizes at a severity are scattered by up to 20 % and signs are drawn.

    Raises
    ------
    ModelError
        If an effect, a severity or a quantity is unknown.

    Examples
    --------
    >>> from pneumo_casadi.virtual_bench import random_axis
    >>> (effect,) = effects_for(random_axis(1), {"backlash": "medium"})
    >>> effect.parameters["gap"], effect.form.listed
    (0.0004, True)
    """
    effects = []
    for name, request in requests.items():
        form = form_named(name)
        if isinstance(request, Mapping):
            effects.append(effect_from_quantities(form, request, axis))
        else:
            effects.append(effect_at_severity(form, severity_of(request), axis, seed))
    return tuple(effects)


def form_named(name: str) -> EffectForm:
    """Return the form of that name.

    Raises
    ------
    ModelError
        If there is none.
    """
    if name not in ALL_FORMS:
        raise ModelError(f"the bench has no effect {name!r}; there are {', '.join(ALL_FORMS)}")
    return ALL_FORMS[name]


def forms_of(cause: str) -> tuple[str, ...]:
    """Return the forms of a cause, the usual one first.

    Examples
    --------
    >>> forms_of("hose")
    ('hose', 'hose_uneven', 'hose_volume', 'hose_volume_uneven', 'hose_volume_at_valve')
    """
    return tuple(name for name, form in ALL_FORMS.items() if form.cause == cause)


def severity_of(wanted: Severity | str) -> Severity:
    """Return the severity of that name."""
    try:
        return Severity(wanted)
    except ValueError:
        known = ", ".join(severity.value for severity in Severity)
        raise ModelError(f"no severity {wanted!r}; there are {known}") from None


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

    Returns
    -------
    tuple of str
        Names of forms, in the order of their causes.

    Examples
    --------
    >>> names = draw_background(np.random.default_rng(1), without=["stribeck"])
    >>> 4 <= len(names) <= 6, [name for name in names if name.startswith("stribeck")]
    (True, [])
    """
    causes = sorted({form.cause for form in ALL_FORMS.values() if form.strength} - set(without))
    count = int(rng.integers(FEWEST_WEAK, MOST_WEAK + 1))
    chosen = rng.choice(len(causes), min(count, len(causes)), replace=False)
    names = []
    for i in sorted(int(index) for index in chosen):
        forms = forms_of(causes[i])
        names.append(forms[int(rng.integers(len(forms)))] if forms_varied else forms[0])
    return tuple(names)


def weak_effects(
    axis: VirtualAxis, names: Sequence[str], seed: int, of: Severity = Severity.SMALL
) -> tuple[VirtualEffect, ...]:
    """Return weak effects of an axis, a tenth of small with scatter.

    Parameters
    ----------
    axis : VirtualAxis
        Whose scales count.
    names : sequence of str
        Forms, as `draw_background` returns them.
    seed : int
        Of sizes and signs.
    of : Severity, optional
        What they have a tenth of.

    Returns
    -------
    tuple of VirtualEffect
        In the order of the names.

    Raises
    ------
    ModelError
        If the bench has no form of that name.
    """
    effects = []
    for name in names:
        form = form_named(name)
        whole = effect_at_severity(form, of, axis, seed)
        scatter = np.random.default_rng([seed, 8, *name.encode()]).uniform(
            -WEAK_SCATTER, WEAK_SCATTER
        )
        share = WEAK * float(np.exp(scatter))
        parameters = {
            quantity: value * (share if quantity in form.strength else 1.0)
            for quantity, value in whole.parameters.items()
        }
        effects.append(VirtualEffect(form, MappingProxyType(parameters)))
    return tuple(effects)
