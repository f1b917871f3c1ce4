"""Pictures as nodes and pairs of them as links: what hangs together, and what falls apart without a link."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

Pair = tuple[int, int]


class _Groups:
    """Nodes that are joined into groups, one link after the other."""

    def __init__(self, count: int) -> None:
        self.parent = list(range(count))

    def of(self, node: int) -> int:
        while self.parent[node] != node:
            self.parent[node] = self.parent[self.parent[node]]
            node = self.parent[node]
        return node

    def join(self, i: int, j: int) -> bool:
        """Whether i and j were apart until now."""
        a, b = self.of(i), self.of(j)
        self.parent[max(a, b)] = min(a, b)
        return a != b


def components(count: int, pairs: Iterable[Pair], bodies: Sequence[int] | None = None) -> list[list[int]]:
    """Groups of the nodes 0 … count − 1 that hang together, the largest first. bodies: of each node the first that
    it is of one body with; a body hangs together and counts as one."""
    groups = _Groups(count)
    for i, j in pairs:
        groups.join(i, j)
    of = range(count) if bodies is None else bodies
    for node, first in enumerate(of):
        groups.join(first, node)
    found: dict[int, list[int]] = {}
    for node in range(count):
        found.setdefault(groups.of(node), []).append(node)
    return sorted(found.values(), key=lambda group: len({of[node] for node in group}), reverse=True)


def heaviest_component(
    count: int, pairs: Sequence[Pair], weights: Sequence[float], bodies: Sequence[int] | None = None
) -> list[int]:
    """Of the largest groups the one whose pairs weigh most together: does not depend on the numbering; bodies: as for
    `components`."""
    of = range(count) if bodies is None else bodies
    groups = components(count, pairs, bodies)
    sizes = [len({of[node] for node in group}) for group in groups]
    largest = [group for group, size in zip(groups, sizes, strict=True) if size == sizes[0]]
    if len(largest) == 1:
        return largest[0]
    total = dict.fromkeys(range(len(largest)), 0.0)
    member = {node: k for k, group in enumerate(largest) for node in group}
    for (i, _), weight in zip(pairs, weights, strict=True):
        if i in member:
            total[member[i]] += weight
    return largest[max(total, key=lambda k: total[k])]


def is_bridge(count: int, pairs: Sequence[Pair], pair: Pair) -> bool:
    """Whether some nodes that hang together would not without this pair."""
    without = [other for other in pairs if other != pair]
    return len(components(count, without)) > len(components(count, pairs))


def strongest_tree(count: int, pairs: Sequence[Pair], weights: Sequence[float]) -> list[Pair]:
    """Pairs that join all that hangs together, without any loop, of the greatest weight."""
    groups = _Groups(count)
    order = sorted(range(len(pairs)), key=lambda k: -weights[k])
    return [pairs[k] for k in order if groups.join(*pairs[k])]


def walk(tree: Iterable[Pair], root: int) -> list[Pair]:
    """The tree's links from the root on, each from a node that was reached to a new one."""
    beside: dict[int, list[int]] = {}
    for i, j in tree:
        beside.setdefault(i, []).append(j)
        beside.setdefault(j, []).append(i)
    way: list[Pair] = []
    reached, waiting = {root}, [root]
    while waiting:
        node = waiting.pop()
        for other in beside.get(node, []):
            if other not in reached:
                reached.add(other)
                waiting.append(other)
                way.append((node, other))
    return way
