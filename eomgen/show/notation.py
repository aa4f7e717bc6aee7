"""How names are written in formulas: base letter, dots, superscript, subscripts.

There is one notation in all formats. A name is a base and, after the first underscore, its
subscripts, which commas separate: `f_hinge,x` and the scene's own `f_A_x` are f with the subscripts
of a joint or a body and of an axis. A base may end in dots (`eomgen.derivation.dots`), and have a
superscript, `I^A`.
"""

from dataclasses import dataclass
from functools import cache

from eomgen.derivation.dots import DOTS, MARK

AXES = ("x", "y", "z")
GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η",
    "theta": "θ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ",
    "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "φ", "chi": "χ", "psi": "ψ",
    "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ",
    "Sigma": "Σ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
"""Greek letters that have a name in LaTeX."""


@dataclass(frozen=True)
class Written:
    """A name in its parts; `dots` is 0, 1 or 2."""

    base: str
    dots: int
    above: str
    below: tuple[str, ...]

    @property
    def letter(self) -> str:
        """The base, as a Greek letter if it names one."""
        return GREEK.get(self.base, self.base)

    @property
    def single(self) -> bool:
        """Whether the base is one letter, which formulas write in italics."""
        return len(self.letter.rstrip("'")) == 1


@cache
def parsed(name: str) -> Written:
    """The parts of a name."""
    base, _, rest = name.partition("_")
    base, _, above = base.partition("^")
    base, mark, dots = base.partition(MARK)
    below = [part for part in rest.split(",") if part]
    head = base.rstrip("0123456789")
    if head and head != base and base.isalnum():  # x2 is x with the subscript 2
        base, below = head, [base[len(head) :], *below]
    if below and (split := below[-1].rpartition("_"))[2] in AXES and split[0]:
        below[-1:] = [split[0], split[2]]
    greek = (GREEK.get(part, part) for part in below)
    return Written(base, DOTS.index(mark + dots), above, tuple(greek))
