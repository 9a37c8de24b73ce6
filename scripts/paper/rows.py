"""Rows of scripts/paper-tables' results, kept from run to run: one that is measured again takes the old one's place."""

# What tells the rows of a table apart.
KEYS = {"1": ("diffuse", "cluster"), "2": ("blend",), "3": ("model", "noisy", "name"), "peers": ("model", "noisy", "name"),
        "cells": ("model", "blend", "cell"), "edges": ("model", "name"), "fewer": ("name", "wanted"), "scans": ("scene", "name"), "scenes": ("scene", "name")}
# What all rows of a table must have in common, or the older ones go.
COUNTED = {"1": "large", "2": "large", "3": "count", "peers": "count", "cells": "count", "edges": "count", "fewer": "count"}


def merge(table, old, new, order):
    """Old rows with new ones in their places. `order` lists values of keys as they are to be printed, those that are not
    in it come last; rows it does not tell apart stay as they came."""
    def key(row):
        return tuple(row[k] for k in KEYS[table])

    def rank(value):  # True would be found as 1, which is a size
        if isinstance(value, bool):
            return int(value)
        return order.index(value) if value in order else len(order)

    rows = {key(r): r for r in old} | {key(r): r for r in new}
    return sorted(rows.values(), key=lambda r: [rank(v) for v in key(r)])


def join(first, second, order):
    """Two runs' results as one: the second's rows in place of the first's, whose rows of another number of samples go."""
    tables = {}
    for name in dict.fromkeys([*first["tables"], *second["tables"]]):
        counted = COUNTED.get(name)
        same = counted is None or first[counted] == second[counted]
        tables[name] = merge(name, first["tables"].get(name, []) if same else [], second["tables"].get(name, []), order)
    return first | second | {"tables": tables}
