"""Parameters: names, values, units, bounds and scales, and which of them are free."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumo_casadi.errors import ModelError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One scalar parameter of a model.

    Parameters
    ----------
    name : str
        Symbol as in the paper, for example ``"X_s1"`` or ``"F_c_plus"``.
    value : float
        Present value, in `unit`.
    unit : str
        SI unit; ``"1"`` for a pure number.
    lower, upper : float, optional
        Bounds that the physics sets, in `unit`.
    scale : float, optional
        Size by which an optimiser divides the parameter; by default the magnitude of
        the value, or 1 where the value is zero.
    free : bool, optional
        Whether an estimator may change it.
    null : float, optional
        The value at which an effect vanishes; None for a parameter of the nominal axis.
    start : float, optional
        Where a fit that frees an effect starts, in `unit`; None means `value`.
    description, source : str, optional
        What it is, and where its form or range comes from.

    Raises
    ------
    ModelError
        If the value is not finite, value or start lie outside the bounds, or the scale is not
        positive.

    Examples
    --------
    >>> M = Parameter("M", 16.9, "kg", lower=0.0)
    >>> M.scale
    16.9
    """

    name: str
    value: float
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 0.0
    free: bool = True
    null: float | None = None
    start: float | None = None
    description: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        value = float(self.value)
        if not np.isfinite(value):
            raise ModelError(f"parameter {self.name}: {value} {self.unit} is not a finite number")
        if not self.lower <= value <= self.upper:
            raise ModelError(
                f"parameter {self.name}: {value:g} {self.unit} lies outside its bounds "
                f"[{self.lower:g}, {self.upper:g}] {self.unit}; change the value or the bounds"
            )
        if self.start is not None and not self.lower <= self.start <= self.upper:
            raise ModelError(
                f"parameter {self.name}: a fit would start at {self.start:g} {self.unit}, outside "
                f"the bounds [{self.lower:g}, {self.upper:g}] {self.unit}; change start or bounds"
            )
        scale = float(self.scale) or abs(value) or 1.0
        if not (np.isfinite(scale) and scale > 0):
            raise ModelError(f"parameter {self.name}: scale {scale:g} must be positive")
        object.__setattr__(self, "value", value)
        object.__setattr__(self, "scale", scale)


#: Parameters that a `repr` shows.
SHOWN = 12


@dataclass(frozen=True, slots=True, repr=False)
class Parameters:
    """An ordered, immutable collection of parameters: names on one side, vectors on the other.

    Parameters
    ----------
    items : iterable of Parameter
        Names must be unique.

    Examples
    --------
    >>> p = Parameters([Parameter("M", 17.0, "kg"), Parameter("f_v", 11.0, "N s/m")])
    >>> p.with_values({"M": 16.9}).values
    array([16.9, 11. ])
    >>> p.fix("M").free_names
    ('f_v',)
    """

    items: tuple[Parameter, ...]
    _index: Mapping[str, int] = field(repr=False, compare=False)

    def __init__(self, items: Iterable[Parameter] = ()) -> None:
        parameters = tuple(items)
        index = {item.name: position for position, item in enumerate(parameters)}
        if len(index) < len(parameters):
            names = [item.name for item in parameters]
            twice = sorted({name for name in names if names.count(name) > 1})
            raise ModelError(f"parameter named twice: {', '.join(twice)}")
        object.__setattr__(self, "items", parameters)
        object.__setattr__(self, "_index", index)

    def __repr__(self) -> str:
        """Return the first values with their units; a flow map alone has forty of them."""
        shown = [f"{item.name} = {item.value:.4g} {item.unit}" for item in self.items[:SHOWN]]
        left = len(self.items) - len(shown)
        more = f", and {left} more" if left else ""
        return f"Parameters({', '.join(shown)}{more})"

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.items)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __getitem__(self, name: str) -> Parameter:
        return self.items[self.index(name)]

    def __add__(self, other: "Parameters") -> "Parameters":
        return Parameters((*self.items, *other.items))

    def __reduce__(self) -> tuple[Any, ...]:
        return Parameters, (self.items,)

    def index(self, name: str) -> int:
        """Return the position of a parameter; a `ModelError` names those that exist."""
        if name not in self._index:
            raise ModelError(f"no parameter {name!r}; there are {', '.join(self._index)}")
        return self._index[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names, in order."""
        return tuple(self._index)

    @property
    def units(self) -> tuple[str, ...]:
        """Units, in order."""
        return tuple(item.unit for item in self.items)

    @property
    def values(self) -> FloatArray:
        """Values, shape (n,)."""
        return np.array([item.value for item in self.items], dtype=float)

    @property
    def lower(self) -> FloatArray:
        """Lower bounds, shape (n,)."""
        return np.array([item.lower for item in self.items], dtype=float)

    @property
    def upper(self) -> FloatArray:
        """Upper bounds, shape (n,)."""
        return np.array([item.upper for item in self.items], dtype=float)

    @property
    def scales(self) -> FloatArray:
        """Scales, shape (n,)."""
        return np.array([item.scale for item in self.items], dtype=float)

    @property
    def free_mask(self) -> NDArray[np.bool_]:
        """True where a parameter is free, shape (n,)."""
        return np.array([item.free for item in self.items], dtype=bool)

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the free parameters, in order."""
        return tuple(item.name for item in self.items if item.free)

    def as_dict(self) -> dict[str, float]:
        """Return ``{name: value}``."""
        return {item.name: item.value for item in self.items}

    def select(self, names: Iterable[str]) -> "Parameters":
        """Return the named parameters, in the order asked for."""
        return Parameters(self[name] for name in names)

    def with_values(self, values: Mapping[str, float] | ArrayLike) -> "Parameters":
        """Return a copy with new values, given by name or as a vector of shape (n,).

        Raises
        ------
        ModelError
            If a name is unknown, the length differs, or a value violates its bounds.
        """
        if isinstance(values, Mapping):
            new = self.values
            for name, value in values.items():
                new[self.index(name)] = value
        else:
            new = np.asarray(values, dtype=float)
            if new.shape != (len(self),):
                raise ModelError(f"expected {len(self)} values, got an array of shape {new.shape}")
        return Parameters(
            replace(item, value=float(value)) for item, value in zip(self.items, new, strict=True)
        )

    def fix(self, *names: str) -> "Parameters":
        """Return a copy in which the named parameters, if any, are held fixed."""
        return self._with_free(names, False)

    def fix_all(self) -> "Parameters":
        """Return a copy in which all parameters are held fixed."""
        return self._with_free(self.names, False)

    def release(self, *names: str) -> "Parameters":
        """Return a copy in which the named parameters, if any, are free."""
        return self._with_free(names, True)

    def release_all(self) -> "Parameters":
        """Return a copy in which all parameters are free."""
        return self._with_free(self.names, True)

    def bounded(self, name: str, lower: float, upper: float) -> "Parameters":
        """Return a copy with other bounds on one parameter; its start is moved inside them."""
        position = self.index(name)
        items = list(self.items)
        start = items[position].start
        inside = None if start is None else min(max(start, lower), upper)
        items[position] = replace(items[position], lower=lower, upper=upper, start=inside)
        return Parameters(items)

    def _with_free(self, names: tuple[str, ...], free: bool) -> "Parameters":
        chosen = {self.index(name) for name in names}
        return Parameters(
            replace(item, free=free) if position in chosen else item
            for position, item in enumerate(self.items)
        )
