"""Presliding: at a reversal the contact is a spring; Coulomb friction builds up over a way."""

from pneumo_casadi.effects.common.bristle import Bristle
from pneumo_casadi.model.effect import Effect


class Presliding(Bristle, Effect):
    """Elastic-plastic bristle: it bends back elastically, and slips only bent far and bent further.

    Bouc's and Wen's law of hysteresis, exponent 3 (see `Bristle`)::

        ḣ = (v - (|v| h³ + v |h|³)/2) / L

    The bristle of LuGre slips at any force and creeps away under the least vibration.
    """

    name = "presliding"
    equation = "ḣ = (v − (|v| h³ + v |h|³)/2)/s₀, F_c h in place of F_c sign(v), with s₀ = F_c/σ₀"
    source = (
        "Wen (1976), Journal of the Engineering Mechanics Division ASCE 102(2), 249-263; drift of "
        "bristles: Dupont, Hayward, Armstrong, Altpeter (2002), IEEE Transactions on Automatic "
        "Control 47(5), 787-792"
    )
