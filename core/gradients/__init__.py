"""First-order changes of one frame of a replay with anything in the setup.

At equilibrium the residual R(u, p) vanishes, so du/dp = -K^-1 dR/dp (implicit function theorem):
one linear solve on a factor of the tangent K that exists already. dR/dp is the difference between
the residuals of the changed and the original setup at the same displacement, so that every effect
has its derivative without a formula of its own. A setup with history has no such derivative of a
single frame: all the frames before it change, too.
"""
