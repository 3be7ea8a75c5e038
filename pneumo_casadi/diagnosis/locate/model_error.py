"""What a model without a missing effect leaves: its flow map and friction law are approximations.

Both shares refer to a balance's own signal, but to different residuals: an estimated unknown input
also follows slow errors, which a row of the balances partly averages out.
"""

from collections.abc import Mapping

#: Unknown input over the balance's own terms (valve flow, driving force), root mean squares.
UNKNOWN_INPUT_ERROR: Mapping[str, float] = {
    "mass_flow_P": 0.01,
    "mass_flow_N": 0.01,
    "force": 0.015,
}
#: Balance residual over the signal of the balance (pressure rate, driving force), every balance.
RESIDUAL_ERROR = 5e-3
