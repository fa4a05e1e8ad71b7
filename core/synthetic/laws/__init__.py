"""Laws of the hidden effects on the virtual bench: the catalogue's kind, and a second one of each.

A real lump is no ball, and a real gel relaxes with more than one time constant. A suite whose
effects all follow the laws by which the diagnosis explains them says nothing about this.
"""

from palpate.synthetic.laws.second_laws import SECOND_LAWS, SecondLaw, with_second_laws

__all__ = ["SECOND_LAWS", "SecondLaw", "with_second_laws"]
