"""How grave each weakness of a result is, and what that makes of the result: the rules.

Every limit that grades a warning stands in `LIMITS`, every condition that is met or not in
`CONDITIONS`, each with its reason. Deviations from physics count beyond twice the robust standard
deviation of the estimate: an interval that contains the expected value contradicts nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from types import MappingProxyType

from pneumo_casadi.data import Grade

#: Standard deviations that count as the interval of an estimate: 95 %.
SIGMAS = 2.0
#: Polytropic coefficients: isothermal to adiabatic.
K_RANGE = (1.0, 1.4)


@dataclass(frozen=True, slots=True)
class Limit:
    """From which size on a weakness is worth a warning, and of which grade.

    Parameters
    ----------
    quantity : str
        What is compared, with its unit.
    reason : str
        Why the limits are where they are.
    note, caution, severe : float
        Sizes from which each grade is given; infinite where it never is.

    Examples
    --------
    >>> limit = Limit("share of samples", "example", note=0.001, caution=0.05)
    >>> [limit.grade(share) for share in (0.0, 0.01, 0.5)]
    [None, <Grade.NOTE: 'note'>, <Grade.CAUTION: 'caution'>]
    """

    quantity: str
    reason: str
    note: float = inf
    caution: float = inf
    severe: float = inf

    def grade(self, size: float) -> Grade | None:
        """Return the gravest grade whose limit a size exceeds; None below all of them."""
        limits = ((Grade.SEVERE, self.severe), (Grade.CAUTION, self.caution))
        graded = (grade for grade, limit in (*limits, (Grade.NOTE, self.note)) if size > limit)
        return next(graded, None)


#: Quantities that decide a warning, by name: from which size on which grade, and why.
LIMITS: Mapping[str, Limit] = MappingProxyType(
    {
        "mass": Limit(
            "distance of M from the data sheet beyond its interval [1]",
            "screws, cables and sensors are some per cent; a carried load that the data sheet "
            "leaves out is up to a third; beyond it a unit, a channel or the flow map is wrong",
            caution=0.1,
            severe=1 / 3,
        ),
        "area": Limit(
            "distance of X_s3 r T and X_s6 r T from the piston areas beyond the interval [1]",
            "tolerances of bore and rod are 1 %, of the flow meter 2 %, 15 K are 5 %; a quarter is "
            "another valve's map, or pressures of another unit or zero",
            caution=0.1,
            severe=0.25,
        ),
        "area ratio": Limit(
            "distance of X_s6/X_s3 from S_N/S_P beyond the interval [1]",
            "flow meter and temperature cancel, which leaves 1 % of geometry and the equality of "
            "the valves, a few per cent; a leak or exchanged chambers exceed it",
            caution=0.05,
            severe=0.25,
        ),
        "dead volume": Limit(
            "negative dead length beyond its interval, over half the stroke [1]",
            "no volume is negative; the form of the flow map shifts X_s1/X_s2 by up to 0.03",
            caution=0.03,
            severe=0.1,
        ),
        "large dead volume": Limit(
            "dead length beyond its interval, over half the stroke [1]",
            "a cylinder's own is a few per cent; as much as half the stroke are hoses on a small "
            "or short cylinder, or a stroke that is stated too small",
            note=1.0,
        ),
        "polytropic": Limit(
            "distance of k from isothermal ... adiabatic, 1 ... 1.4, beyond its interval [1]",
            "no gas is outside; the form of the flow map shifts k by up to 0.03",
            caution=0.03,
            severe=0.06,
        ),
        "map residuals": Limit(
            "residuals of the flow map over those of its own fit [1]",
            "the map's form leaves a third; at three times the trajectories contradict the map",
            caution=1.3,
            severe=3.0,
        ),
        "map scale": Limit(
            "distance from 1 of the factor by which the trajectories move all flows, beyond what "
            "the bench states of the meter [1]",
            "accuracy of a flow meter, 2 %; five times of it is no error of the meter",
            caution=0.02,
            severe=0.1,
        ),
        "data sheet": Limit(
            "logarithm of the flow that the records need over that of the data sheet, over the "
            "stated accuracy [1]",
            "up to twice the accuracy is a poor data sheet; four times 30 % is a factor of three, "
            "another unit or another valve, and its pull on the estimates is no longer right",
            caution=2.0,
            severe=4.0,
        ),
        "outside map": Limit(
            "share of the samples outside the metered range [1]",
            "single samples do not move an estimate; from a twentieth on extrapolation takes part",
            note=1e-3,
            caution=0.05,
        ),
        "map form": Limit(
            "error of the flow form at withheld points [% of the largest flow]",
            "the usual accuracy of a flow meter",
            caution=1.0,
        ),
        "misfit": Limit(
            "residual beyond the stated sensor noise [% of the signal]",
            "below one per cent the misfit biases no estimate by more than the map does",
            note=1.0,
            caution=10.0,
        ),
        "held out": Limit(
            "gap on held-out records, over windows of up to 2 s [% of the signal]",
            "a tenth shows in any figure; at half of the signal three quarters of its variance are "
            "explained only, and intervals say nothing of the bias",
            caution=10.0,
            severe=50.0,
        ),
        "widening": Limit(
            "robust over ideal standard deviation, the largest [1]",
            "half as wide again changes the first digit of an interval",
            note=1.5,
        ),
        "weak": Limit(
            "relative standard deviation of weighted least squares [%]",
            "eq. 17 calls such a parameter removable",
            note=10.0,
        ),
        "sampling": Limit(
            "100 bandwidths of the motion over the sampling frequency [1]",
            "eq. 14 asks for 100 times",
            note=1.0,
        ),
        "spread": Limit(
            "distances of single records' estimates from their mean, squared, over their limit [1]",
            "records of one axis exceed the limit by chance in one case of a hundred",
            caution=1.0,
        ),
    }
)

#: Warnings that no size decides, by name: grade and reason.
CONDITIONS: Mapping[str, tuple[Grade, str]] = MappingProxyType(
    {
        "not converged": (Grade.SEVERE, "the numbers are those of an iteration"),
        "axis at bound": (Grade.SEVERE, "X_s and M are bounded at 20 and 100 times the geometry"),
        "friction drives": (Grade.SEVERE, "friction takes energy from the motion"),
        "friction has a force": (Grade.CAUTION, "a load or a tilt is in the friction"),
        "at bound": (Grade.CAUTION, "the estimate is the bound's"),
        "uninformed": (Grade.CAUTION, "the value is the starting value"),
        "held map": (Grade.CAUTION, "noise of the map moves X_s2 and X_s5 by several σ"),
        "cause unknown": (Grade.SEVERE, "mass and friction take up what the model lacks"),
        "taken up": (Grade.CAUTION, "geometry or data sheet contradict the estimate"),
        "weak left out": (Grade.NOTE, "an effect too weak to be named shifts estimates little"),
        "not held out": (Grade.CAUTION, "nothing tells what a prediction is worth"),
        "stages": (Grade.NOTE, "the way to the optimum does not change it"),
        "long records": (Grade.NOTE, "initial states are free, and misfit lasts beyond a window"),
        "not alone": (Grade.NOTE, "the joint fit stands without it"),
        "wls impossible": (Grade.NOTE, "output error is bounded and does not inherit it"),
    }
)


class Usable(StrEnum):
    """What the warnings make of a result."""

    YES = "yes"
    """No warning, or notes only."""
    WITH_CARE = "with care"
    """A caution: some numbers are worse than their intervals say."""
    NO = "no"
    """A severe warning: the numbers are not to be used."""


_LEADS = {
    Usable.YES: "Usable",
    Usable.WITH_CARE: "Usable with care",
    Usable.NO: "Do not use",
}


@dataclass(frozen=True, slots=True)
class ResultWarning:
    """One weakness of a result.

    Parameters
    ----------
    grade : Grade
        How grave it is.
    about : str
        What it concerns: ``"recording"``, ``"flow_map"``, ``"wls"``, ``"output_error"``,
        ``"intervals"``, ``"physics"`` or ``"validation"``.
    text : str
        What was seen, with figures, and what to do; one sentence or two.
    """

    grade: Grade
    about: str
    text: str


@dataclass(frozen=True, slots=True)
class Usability:
    """Whether a result can be used, and why.

    Parameters
    ----------
    usable : Usable
        By the gravest warning.
    reason : str
        One sentence.
    """

    usable: Usable
    reason: str

    @property
    def sentence(self) -> str:
        """The first line of every report.

        Examples
        --------
        >>> Usability(Usable.NO, "the fit has not converged.").sentence
        'Do not use: the fit has not converged.'
        """
        return f"{_LEADS[self.usable]}: {self.reason}"


def limited(key: str, size: float, about: str, text: str) -> Iterator[ResultWarning]:
    """Yield a warning of the grade that the table gives to a size."""
    grade = LIMITS[key].grade(size)
    if grade is not None:
        yield ResultWarning(grade, about, text)


def met(key: str, about: str, text: str) -> ResultWarning:
    """Return the warning of a condition that is met.

    Parameters
    ----------
    key : str
        Name of the condition in `CONDITIONS`, which grades it.
    about, text : str
        See `ResultWarning`.
    """
    return ResultWarning(CONDITIONS[key][0], about, text)


def in_order(warnings: Sequence[ResultWarning]) -> tuple[ResultWarning, ...]:
    """Return warnings with the gravest first, otherwise in their order.

    Parameters
    ----------
    warnings : sequence of ResultWarning
        In any order.
    """
    return tuple(sorted(warnings, key=lambda item: list(Grade).index(item.grade)))


def judge_usability(warnings: Sequence[ResultWarning], otherwise: str) -> Usability:
    """Return what warnings make of a result.

    Parameters
    ----------
    warnings : sequence of ResultWarning
        The gravest first.
    otherwise : str
        The reason where there is neither a severe warning nor a caution.

    Examples
    --------
    >>> judge_usability([], "the fit converged.").usable.value
    'yes'
    """
    for grade, usable in ((Grade.SEVERE, Usable.NO), (Grade.CAUTION, Usable.WITH_CARE)):
        texts = [item.text for item in warnings if item.grade is grade]
        if texts:
            more = f" (and {len(texts) - 1} more of this grade)" if len(texts) > 1 else ""
            return Usability(usable, texts[0] + more)
    return Usability(Usable.YES, otherwise)
