"""The gap of simulations on held-out records, before and after effects are added."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pneumo_casadi.diagnosis.metrics.findings import Gap
from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_closure,
    residual_rms,
)
from pneumo_casadi.diagnosis.metrics.simulated_fit import (
    WINDOW,
)
from pneumo_casadi.diagnosis.metrics.simulations import (
    Simulations,
    closure_of,
    noise_percent,
    overall_gap,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.metrics import (
    combined_gap,
    gap,
)
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

View = dict[str, dict[str, float]]


def simulated_gap(
    done: Simulations,
    nominal: FittedModel,
    final: FittedModel,
    effects: Sequence[Effect],
    levels: BalanceLevels,
) -> tuple[Gap, tuple[str, ...]]:
    """Return the gap before and after, and notes on what it does not tell.

    Parameters
    ----------
    nominal, final : FittedModel
        Fits without and with effects.
    effects : sequence of Effect
        Those of `final`, in the order of its model.
    """
    study, models = done.study, ((nominal, ()), (final, effects))
    notes: list[str] = []
    views: dict[str, View] = {"balances": _balances(study, nominal, final, levels)}
    noise = noise_percent(study)
    before, after = (done.windows(*model) for model in models)
    failed = [why for why in (before, after) if isinstance(why, str)]
    notes += [f"windows of {WINDOW:g} s cannot be simulated: {why}" for why in failed]
    if not isinstance(before, str) and not isinstance(after, str):
        views["windows"] = _view(study.axis.outputs, before, after, noise)
    if done.have_loop:
        loops = [done.loop(*model) for model in models]
        notes += [f"the closed loop cannot be simulated: {w}" for w in loops if isinstance(w, str)]
        b, a = loops
        if not isinstance(b, str) and not isinstance(a, str):
            views["closed_loop"] = {
                name: {"before": b[name], "after": a[name], "noise": noise[name]}
                for name in study.axis.outputs
            }
    if isinstance(before, str) or isinstance(after, str):
        shown = views["balances"]
        sizes = {
            k: combined_gap([v[k] for v in shown.values()]) for k in ("before", "after", "noise")
        }
        balances = balance_closure(nominal, final, levels)
        balance_gap = Gap(sizes["before"], sizes["after"], sizes["noise"], balances, views)
        return balance_gap, (*notes, "the gap is that of the balances")
    floor = done.floor
    closed = closure_of(before, after, floor)
    gaps = overall_gap(before, floor), overall_gap(after, floor)
    if closed.upper < 0:
        notes.append(
            f"with the effects, simulations of held-out records are farther off ({gaps[1]:.2g} %) "
            f"than without ({gaps[0]:.2g} %), but balances are met better: do not use their sizes"
        )
    if final is nominal and done.alone_show_gap(nominal, (), levels):
        notes.append(
            f"the balances show no gap, but simulations of held-out records are {gaps[0]:.2g} % of "
            "the motion off, and no effect alone explains that"
        )
    return Gap(*gaps, combined_gap(floor), closed, views), tuple(notes)


def gap_with_term(
    done: Simulations,
    gap: Gap,
    with_term: tuple[FittedModel, Sequence[Effect]] | None,
    levels: BalanceLevels,
) -> Gap:
    """Return a gap to which that of the model with a discovered term is added, view by view.

    Parameters
    ----------
    gap : Gap
        As `simulated_gap` returns it.
    with_term : (FittedModel, sequence of Effect) or None
        The fit with the term, and its effects. Without one, or where it cannot be simulated, the
        gap stays as it is.
    """
    if with_term is None or "windows" not in gap.views:
        return gap
    squares = done.windows(*with_term)
    if isinstance(squares, str):
        return gap
    noise = noise_percent(done.study)
    fitted, _ = with_term
    sizes = {
        "windows": _gaps(done.study.axis.outputs, squares, noise),
        "balances": _balance_gaps(done.study, fitted, levels),
    }
    if "closed_loop" in gap.views:
        loop = done.loop(*with_term)
        sizes |= {} if isinstance(loop, str) else {"closed_loop": loop}
    views = {
        view: {
            name: dict(values) | ({"with_term": sizes[view][name]} if view in sizes else {})
            for name, values in outputs.items()
        }
        for view, outputs in gap.views.items()
    }
    overall = overall_gap(squares, done.floor)
    return replace(gap, views=views, with_term=overall)


def _view(
    outputs: Sequence[str], before: FloatArray, after: FloatArray, noise: Mapping[str, float]
) -> View:
    b, a = (_gaps(outputs, squares, noise) for squares in (before, after))
    return {name: {"before": b[name], "after": a[name], "noise": noise[name]} for name in outputs}


def _gaps(
    outputs: Sequence[str], squares: FloatArray, noise: Mapping[str, float]
) -> dict[str, float]:
    return {name: float(gap(squares[:, i].mean(), noise[name])) for i, name in enumerate(outputs)}


def _balances(
    study: Study, nominal: FittedModel, final: FittedModel, levels: BalanceLevels
) -> View:
    b, a = (_balance_gaps(study, fitted, levels) for fitted in (nominal, final))
    noise = 100 * levels.noise / levels.signal
    return {
        name: {"before": b[name], "after": a[name], "noise": float(noise[i])}
        for i, name in enumerate(study.axis.equations)
    }


def _balance_gaps(study: Study, fitted: FittedModel, levels: BalanceLevels) -> dict[str, float]:
    size, noise = (100 * part / levels.signal for part in (residual_rms(fitted), levels.noise))
    return {name: float(gap(size[i] ** 2, noise[i])) for i, name in enumerate(study.axis.equations)}
