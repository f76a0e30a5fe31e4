"""Whole rows of the table of edges: copied, emptied, removed."""

from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.memory import Bytes


def copy_row(edges: EdgeColumns, source: int, target: int) -> None:
    """Copy a row, with its history."""
    edges.x[target], edges.y[target] = edges.x[source], edges.y[source]
    edges.beta[target], edges.speed[target] = edges.beta[source], edges.speed[source]
    edges.bl[target], edges.trust[target] = edges.bl[source], edges.trust[source]
    edges.deviation[target] = edges.deviation[source]
    edges.origin_x[target], edges.origin_y[target] = edges.origin_x[source], edges.origin_y[source]
    edges.born_key[target], edges.circle[target] = edges.born_key[source], edges.circle[source]
    edges.square[target] = edges.square[source]
    edges.suspect_keys[target], edges.rebel[target] = edges.suspect_keys[source], edges.rebel[source]
    edges.held[target], edges.matched[target] = edges.held[source], edges.matched[source]
    edges.fixed_x[target], edges.fixed_y[target] = edges.fixed_x[source], edges.fixed_y[source]
    edges.fixed_s[target] = edges.fixed_s[source]
    edges.cos[target], edges.sin[target] = edges.cos[source], edges.sin[source]
    edges.variance_along[target] = edges.variance_along[source]
    edges.variance_across[target] = edges.variance_across[source]
    edges.covariance_speed[target] = edges.covariance_speed[source]
    edges.variance_speed[target] = edges.variance_speed[source]
    edges.words[target, 0], edges.words[target, 1] = edges.words[source, 0], edges.words[source, 1]
    for k in range(KEYS):
        edges.key_x[target, k], edges.key_y[target, k] = edges.key_x[source, k], edges.key_y[source, k]


def empty_row(edges: EdgeColumns, i: int) -> None:
    """Reset a row."""
    edges.x[i] = edges.y[i] = edges.beta[i] = edges.speed[i] = 0.0
    edges.bl[i] = edges.trust[i] = edges.deviation[i] = 0.0
    edges.origin_x[i] = edges.origin_y[i] = 0.0
    edges.born_key[i] = edges.suspect_keys[i] = 0
    edges.circle[i] = edges.square[i] = -1
    edges.rebel[i] = edges.held[i] = edges.matched[i] = 0
    edges.fixed_x[i] = edges.fixed_y[i] = 0
    edges.fixed_s[i] = 0.0
    edges.cos[i] = edges.sin[i] = 0.0
    edges.variance_along[i] = edges.variance_across[i] = 0.0
    edges.covariance_speed[i] = edges.variance_speed[i] = 0.0
    edges.words[i, 0] = edges.words[i, 1] = 0
    for k in range(KEYS):
        edges.key_x[i, k] = edges.key_y[i, k] = 0.0


def remove(edges: EdgeColumns, dead: Bytes) -> None:
    """Delete the rows where ``dead`` (count,) is set; the last rows move into the gaps."""
    alive = 0
    for i in range(edges.count):
        if not dead[i]:
            alive += 1
    mover = alive
    for i in range(alive):
        if dead[i]:
            while dead[mover]:
                mover += 1
            copy_row(edges, mover, i)
            mover += 1
    edges.count = alive
