"""The numbers that decide a verdict, each with its reason, in one place."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Criteria:
    """What counts as a gap, as a gain, as explained and as sure.

    Residuals are those of the balances on held-out records, root mean square; a *floor* is what the
    white noise of the sensors leaves of them. The first seven say what is beside the noise, in
    floors, since noise is no choice: `in_floors` gives the residual, which is told in brackets.
    Shares refer to the gap of the nominal model. How widely the search looks (candidates a round,
    iterations of a fit) is no criterion; it stands with the search.

    Parameters
    ----------
    background : float
        What a right model leaves: errors of filters, map and quantisation add a tenth (1.1).
    clean : float
        Up to which a model leaves nothing that calls for a cause (1.3).
    visible : float
        Where a gap of any balance begins to be visible (1.5): less may be the misfit of a map.
    coarse_map, coarsest_map : float
        What the misfit of a coarse flow map leaves of a mass flow balance near null, usually (1.5)
        and at most (2): of some 80 axes of the virtual bench without an effect in these balances
        four had 1.7 to 2.0.
    clear : float
        Above which a balance in which every effect named has one form only is not explained (2.5),
        and above which a balance counts though its gap was small.
    near_noise : float
        Below which implausible areas say more than the gap: a valve with 4/3 of the gain left 5.3
        floors (6).
    main_gap : float
        Gaps below this share of the largest, in floors, are the misfit of its cause, unless what is
        left there is clear. A model that explains simulations may keep a gap below this share of
        the largest, in what the balances explain.
    matters : float
        Decrease of log σ in one balance that matters, and share of a gap that does.
    further : float
        The same of a further effect in a mass flow balance.
    share : float
        Share of the first gap that each effect must close by itself, a discovered term as well:
        less is what the form of another one misses. Large effects of another form than the
        catalogue's leave up to 0.15.
    certain : float
        Share of bootstrap replicates in which a gain must be there.
    form_gain : float
        Log-likelihood that a parameter or another form must gain, to be set free or preferred.
    map_ratio : float
        Residuals of the metered map over those of its own fit, from which on it contradicts a shape
        of the valve: the shape is there to lower them.
    plausible_gain : float
        Log-likelihood that an effect too small to be named must gain to be in the model.
    simulated, closed : float
        Where the motion is hidden: share of the simulated gap that a model may leave and explain
        it, and share of what was left that a further effect may leave; the latter also of a visible
        gap of the force balance. Of eight large forces of a form that no effect has, what was left
        fell by no other effect; of true second forces it fell to 0.6. A model that surely leaves
        less than the former is named though a balance keeps a small gap: three axes of another
        program left 0.18 at most, a wrong model of the virtual bench 0.5.
    unexplained : float
        Share of the gap that effects may leave and still explain it; more has another cause. So
        may a discovered term by itself (curves over signals that merely follow a cause closed up to
        0.42), or surely with what acts beside it.
    one_form, contradicted : float
        The same of a balance in which every effect named has one form only (true offsets and leaks
        leave a twentieth, what is taken for them a tenth), and where the parameters contradict
        geometry or data sheet.
    far : float
        Tolerances by which an area must be off to make an effect implausible; the misfit of an
        effect's form moves areas by two.
    one_size, one_size_std : float
        Two delays, or two offsets, are one within this share of them, or within so many standard
        deviations of their difference: a lag and a pure delay of one signal, of which one is not
        the true form, came out 8 and 11 % apart, offsets that stand for a supply 3 to 12 %.
    sharpness : float
        Rate at which the weight of an alternative falls with the share of the gain that it misses.
    alike, alone, further_alone : float
        Least probability of a model that the data cannot tell from the best, and least share of the
        catalogue's probability for a verdict of one model alone, and for the name of each further
        effect: between the two, three of four such names on the virtual bench were not there.
    """

    background: float = 0.458
    clean: float = 0.831
    visible: float = 1.118
    coarse_map: float = 1.118
    coarsest_map: float = 1.732
    clear: float = 2.291
    near_noise: float = 5.916
    main_gap: float = 0.3
    matters: float = 0.05
    further: float = 0.1
    share: float = 0.1
    certain: float = 0.95
    form_gain: float = 20.0
    map_ratio: float = 1.2
    plausible_gain: float = 100.0
    simulated: float = 0.35
    closed: float = 0.7
    unexplained: float = 0.5
    one_form: float = 0.08
    contradicted: float = 0.1
    far: float = 3.0
    one_size: float = 0.2
    one_size_std: float = 2.0
    sharpness: float = 25.0
    alike: float = 0.10
    alone: float = 0.6
    further_alone: float = 0.8


def in_floors(beside: float) -> float:
    """Return a residual in floors, given what is in it beside the noise; they add as squares.

    Examples
    --------
    >>> round(in_floors(1.118), 3), round(in_floors(0.0), 3)
    (1.5, 1.0)
    """
    floors: float = (1.0 + beside**2) ** 0.5
    return floors


CRITERIA = Criteria()
"""As calibrated on the virtual bench."""
