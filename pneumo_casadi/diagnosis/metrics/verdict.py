"""The conclusions that a diagnosis may come to."""

from enum import Enum


class Verdict(Enum):
    """Conclusion on a case."""

    EFFECT = "effect"
    """One effect, or several together, close the gap, and no other explains it as well."""
    AMBIGUOUS = "ambiguous"
    """Several effects close the gap equally well: the data cannot separate them."""
    ABSORBED = "absorbed"
    """Parameters contradict geometry or data sheet, with no gap but in the flow of chamber N."""
    UNKNOWN = "unknown"
    """A gap that no effect of the catalogue explains; see `is_unknown`."""
    NONE = "none"
    """No significant gap."""
