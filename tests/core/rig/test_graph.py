"""Pictures and pairs as a graph."""

from edf_stitch.core.rig.averaging.graph import components, heaviest_component, is_bridge, strongest_tree, walk
from hypothesis import given
from hypothesis import strategies as st

links = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)).filter(lambda p: p[0] != p[1]), unique=True)


@given(links)
def test_components_are_what_can_be_walked_to(pairs):
    groups = components(7, pairs)
    assert sorted(node for group in groups for node in group) == list(range(7))
    for group in groups:
        assert {group[0]} | {node for _, node in walk(pairs, group[0])} == set(group)
    assert [len(group) for group in groups] == sorted((len(group) for group in groups), reverse=True)


@given(links)
def test_a_tree_joins_the_same_and_all_its_links_are_bridges(pairs):
    tree = strongest_tree(7, pairs, [1.0] * len(pairs))
    assert components(7, tree) == components(7, pairs)
    assert all(is_bridge(7, tree, pair) for pair in tree)


def test_a_tree_takes_the_strongest():
    assert set(strongest_tree(3, [(0, 1), (1, 2), (0, 2)], [1, 3, 2])) == {(1, 2), (0, 2)}


def test_a_bridge_is_what_no_loop_checks():
    pairs = [(0, 1), (1, 2), (0, 2), (2, 3)]
    assert [is_bridge(4, pairs, pair) for pair in pairs] == [False, False, False, True]


def test_of_equally_large_groups_the_heavier_counts_whatever_its_numbers():
    assert heaviest_component(4, [(0, 1), (2, 3)], [30, 90]) == [2, 3]
    assert heaviest_component(4, [(0, 1), (2, 3)], [90, 30]) == [0, 1]
    assert heaviest_component(5, [(0, 1), (2, 3), (3, 4)], [900, 30, 30]) == [2, 3, 4]
