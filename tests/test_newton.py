"""When Newton's method factorises its derivative anew."""
from repro.fem.newton import ENOUGH, Jacobian


def visits(reused, defects):
    """Whether each iterate with these defects asks for a new factorisation."""
    jacobian, found = Jacobian(reused), []
    for defect in defects:
        found.append(jacobian.stale(defect))
        jacobian.factors = "made"
    return found


def test_fresh_derivatives_are_made_for_every_iterate():
    """Mutant: the choice ignored."""
    assert visits(False, [1.0, 1e-9, 1e-18]) == [True, True, True]


def test_a_derivative_is_used_again_while_it_does_enough():
    """The first is made, then one wherever the defect has fallen by less than ENOUGH. Mutants: the defect of the first
    iterate as the measure, never made again, ENOUGH turned round."""
    slow, quick = 2 * ENOUGH, ENOUGH / 2
    assert visits(True, [1.0, slow, slow * quick, slow * quick**2, slow**2 * quick**2]) == [
        True, True, False, False, True]
