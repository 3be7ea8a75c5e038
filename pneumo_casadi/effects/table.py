"""The catalogue as data: what reports and docs print of an effect."""

from dataclasses import dataclass

from pneumo_casadi.model.effect import Effect, State
from pneumo_casadi.parameters import Parameter


@dataclass(frozen=True, slots=True)
class EffectRow:
    """One effect as data.

    Parameters
    ----------
    name : str
        Name in the catalogue.
    cause : str
        Name of the cause that it is a form of.
    equation : str
        What it adds to the nominal axis.
    junctions : tuple of str
        Where it acts, in the order of the physics.
    states : tuple of State
        Extra states.
    parameters : tuple of Parameter
        With unit, bounds, null value and starting value.
    shows : str
        Balance or sensor, and regime.
    confused_with : tuple of str
        Effects of the catalogue and nominal parameters.
    separated_by : str
        The experiment that distinguishes them.
    source : str
        Where the form comes from.
    """

    name: str
    cause: str
    equation: str
    junctions: tuple[str, ...]
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...]
    shows: str
    confused_with: tuple[str, ...]
    separated_by: str
    source: str


def effect_row(effect: type[Effect] | Effect) -> EffectRow:
    """Return an effect, of the catalogue or not, as a row."""
    instance = effect() if isinstance(effect, type) else effect
    return EffectRow(
        instance.name,
        instance.cause,
        instance.equation,
        instance.junctions,
        instance.states,
        instance.parameters,
        instance.shows,
        instance.confused_with,
        instance.separated_by,
        instance.source,
    )
