"""Texts of the parameter checks: one for agreement, one for a contradiction.

Each function returns both, in this order.
"""

Texts = tuple[str, str]


def area_texts(chamber: str, deviation: float) -> Texts:
    """Return the texts of a piston area that deviates by a share from the bench."""
    text = f"S_{chamber} comes out {percent(deviation)} against the bench"
    return (
        f"{text}: within metering and geometry.",
        f"{text}, more than flow metering (2 %) and geometry (1 %) allow: the valve passes another "
        "flow than it was metered to, its supply, the temperature or the area is another one, or "
        "a leak hides there.",
    )


def area_ratio_texts(deviation: float) -> Texts:
    """Return the texts of the ratio S_N/S_P that deviates by a share from the bench."""
    text = f"S_N/S_P comes out {percent(deviation)} against the bench"
    less = "less" if deviation > 0 else "more"
    return (
        f"{text}: both valves pass the same.",
        f"{text}, while the metering cancels in it: valve N passes "
        f"{100 * abs(1 / (1 + deviation) - 1):.1f} % {less} than valve P at the same command and "
        "pressure, or one chamber leaks or has another supply.",
    )


def polytropic_texts(chamber: str, k: float, limits: tuple[float, float]) -> Texts:
    """Return the texts of a polytropic exponent; `limits` are isothermal and adiabatic."""
    text = f"k_{chamber} = {k:.3f}"
    return (
        f"{text}: isothermal (1) to adiabatic (1.4), give or take what a fit misses.",
        f"{text} is outside {limits[0]:g} (isothermal) to {limits[1]:g} (adiabatic): a leak, heat "
        "or a sensor's lag hides in the chamber's parameters.",
    )


def polytropic_difference_texts(difference: float) -> Texts:
    """Return the texts of k_P − k_N."""
    text = f"k_P − k_N = {difference:+.3f}"
    return (
        f"{text}: no gross error.",
        f"{text}: heat exchange should be the same in both chambers; the parameters of one have "
        "absorbed an effect "
        "that the model lacks.",
    )


def volume_texts(chamber: str, dead_volume: float, dead_length: float, stroke: float) -> Texts:
    """Return the texts of a chamber's volume at mid-stroke, beyond S l/2 [m3, m, m]."""
    text = (
        f"V_{chamber}(0) = S l/2 {'+' if dead_volume >= 0 else '−'} {abs(dead_volume) * 1e6:.0f} "
        f"ml, a dead length of {1e3 * dead_length:.0f} mm"
    )
    reason = (
        "hoses or a vessel add volume."
        if dead_length > 0
        else "the chamber cannot be smaller than its swept half."
    )
    return f"{text}: plausible.", f"{text} of {1e3 * stroke:.0f} mm stroke: {reason}"


def mass_texts(mass: float, datasheet: float) -> Texts:
    """Return the texts of the mass against the data sheet [kg]."""
    text = f"M = {mass:.4g} kg, {percent(mass / datasheet - 1)} against the data sheet"
    return (
        f"{text}.",
        f"{text}: a load that is fixed elastically, a spring, or late sensors hide there; or weigh "
        "the mass.",
    )


def friction_texts(plus: float, minus: float, max_ratio: float) -> Texts:
    """Return the texts of the Coulomb friction in both directions [N]."""
    difference = plus - minus
    smaller, larger = min(plus, minus), max(plus, minus)
    load = (
        f"a load or tilt of {abs(difference) / 2:.1f} N in {'−' if difference > 0 else '+'}x would "
        "look the same"
    )
    ratio = (
        f"a factor of {larger / smaller:.0f} between the directions"
        if smaller > 0
        else "and one of them pushes along the motion"
    )
    text = f"F_c⁺ − F_c⁻ = {difference:.1f} N"
    return (
        f"{text}, as seals may differ; {load}, and no record of motion tells them apart.",
        f"{text}, {ratio}: seals hardly differ by more than {max_ratio:g}; {load}.",
    )


def flow_map_texts(rms: float) -> Texts:
    """Return the texts of the flow map's residual over that of its own fit."""
    text = f"The fit leaves {rms:.2f} times the residual of the flow map's own fit"
    return f"{text}.", f"{text}: trajectories and metered map disagree."


def flow_scale_text(scale: float) -> str:
    """Return the text of a flow map whose scale was moved too far."""
    return f"The fit moves the scale of the flow map by {percent(scale - 1)}."


def map_form_texts(misfit: float) -> Texts:
    """Return the texts of the part of the flow map that its form cannot follow."""
    text = f"The form of the flow map leaves {100 * misfit:.2f} % of the greatest flow"
    return (
        f"{text} that is smooth in pressure.",
        f"{text} that is smooth in pressure: the opening is not in proportion to the command (a "
        "notched or rounded edge); take iso6358_curve or a spline for the map.",
    )


def percent(share: float) -> str:
    """Return a share in per cent with its sign.

    Examples
    --------
    >>> percent(0.032)
    '+3.2 %'
    """
    return f"{100 * share:+.1f} %"
