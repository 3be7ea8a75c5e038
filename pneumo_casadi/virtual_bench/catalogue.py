"""All effects of the virtual bench, and how they are requested."""

from collections.abc import Mapping
from types import MappingProxyType

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
    ('hose', 'hose_volume', 'hose_volume_at_valve')
    """
    return tuple(name for name, form in ALL_FORMS.items() if form.cause == cause)


def severity_of(wanted: Severity | str) -> Severity:
    """Return the severity of that name."""
    try:
        return Severity(wanted)
    except ValueError:
        known = ", ".join(severity.value for severity in Severity)
        raise ModelError(f"no severity {wanted!r}; there are {known}") from None
