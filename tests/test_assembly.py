"""Sparse systems from element matrices: of one kind of element or several, some unknowns prescribed."""
import numpy as np
import pytest

from repro.fem.assembly import ElementSystem, saddle_blocks

LINE = np.column_stack([np.arange(9), np.arange(1, 10)])
#: Of the first kind all pieces of a line, of the second one piece with another far away.
KINDS = LINE, np.column_stack([LINE[:4], LINE[5:]])
ELEMENTS = tuple(part @ np.swapaxes(part, 1, 2) + np.eye(part.shape[1]) for part in (
    np.random.default_rng(3).standard_normal((len(k), k.shape[1], k.shape[1])) for k in KINDS))


def dense():
    found = np.zeros((10, 10))
    for kind, elements in zip(KINDS, ELEMENTS):
        for unknowns, element in zip(kind, elements):
            found[np.ix_(unknowns, unknowns)] += element
    return found


@pytest.mark.parametrize("held", [[], [0, 9], [4]])
def test_kinds_of_elements_make_one_system(held):
    """Its product, its matrix between free unknowns in elimination order, and its solution are those of the dense
    matrix."""
    rank, prescribed = np.random.default_rng(len(held)).permutation(10).astype(float), np.isin(np.arange(10), held)
    system, K = ElementSystem(KINDS, rank, prescribed), dense()
    right, value = np.arange(10.0), np.linspace(1, 2, 10)
    assert np.allclose(system.product(ELEMENTS, right), K @ right, rtol=1e-13)
    order = [i for i in np.argsort(rank) if i not in held]
    assert np.allclose(system.matrix(ELEMENTS).toarray(), K[np.ix_(order, order)], rtol=1e-13, atol=0)
    found = system.solve(ELEMENTS, right, value)
    assert np.array_equal(found[held], value[held])
    assert np.allclose((K @ found - right)[order], 0, atol=1e-11)
    assert np.array_equal(system.solve(ELEMENTS, right), system.solve(ELEMENTS, right, 0 * value))


def test_a_missing_kind_is_refused():
    system = ElementSystem(KINDS, np.arange(10.0), np.zeros(10, bool))
    with pytest.raises(ValueError):
        system.product(ELEMENTS[:1], np.ones(10))


def test_saddle_blocks_with_and_without_coupled_components():
    """The same from one component's matrix, told once for both, as from the pair; zero is the default below."""
    random = np.random.default_rng(4)
    one, divergence, lower = (random.standard_normal((4, *shape)) for shape in ((3, 3), (2, 6), (2, 2)))
    pair = np.zeros((4, 6, 6))
    pair[:, :3, :3] = pair[:, 3:, 3:] = one
    found = saddle_blocks(one, divergence, lower)
    assert np.array_equal(found, saddle_blocks(pair, divergence, lower))
    assert np.array_equal(found[:, 6:, 6:], -lower) and np.array_equal(found[:, 6:, :6], -divergence)
    assert not saddle_blocks(one, divergence)[:, 6:, 6:].any()


@pytest.mark.parametrize("held", [[], [0, 9], [4]])
def test_other_unknowns_may_be_prescribed(held):
    """Of the same elements: as a system made for them; the first one is left as it was."""
    rank, prescribed = np.random.default_rng(7).permutation(10).astype(float), np.isin(np.arange(10), held)
    first, fresh = (ElementSystem(KINDS, rank, at) for at in (np.arange(10) == 2, prescribed))
    before, other = first.matrix(ELEMENTS).toarray(), first.holding(prescribed)
    assert np.array_equal(other.matrix(ELEMENTS).toarray(), fresh.matrix(ELEMENTS).toarray())
    right, value = np.arange(10.0), np.linspace(1, 2, 10)
    assert np.array_equal(other.solve(ELEMENTS, right, value), fresh.solve(ELEMENTS, right, value))
    assert np.array_equal(first.matrix(ELEMENTS).toarray(), before)


@pytest.mark.parametrize("held", [[], [4]])
def test_a_matrix_may_be_filled_from_entries_of_each_kind(held):
    """What one kind adds is worked out apart."""
    system = ElementSystem(KINDS, np.arange(10.0)[::-1], np.isin(np.arange(10), held))
    entries = sum(system.entries(which, part) for which, part in enumerate(ELEMENTS))
    assert np.allclose(system.filled(entries).toarray(), system.matrix(ELEMENTS).toarray(), rtol=1e-14)
    alone = system.filled(system.entries(0, ELEMENTS[0])).toarray()
    assert np.allclose(alone, system.matrix((ELEMENTS[0], 0 * ELEMENTS[1])).toarray(), rtol=1e-14)


def test_a_factorised_system_serves_many_right_hand_sides_and_values():
    system = ElementSystem(KINDS, np.arange(10.0), np.isin(np.arange(10), [3]))
    factors = system.factored(ELEMENTS)
    for seed in (1, 2):
        right, value = np.random.default_rng(seed).standard_normal((2, 10))
        assert np.array_equal(factors.solve(right, value), system.solve(ELEMENTS, right, value))
