"""Measure the engine against plain py_trees and against lxml's bare parse, in one run; print ratios
as JSON.

The trees are those of the conformance collection's benchmark section. Each time is the best of
several rounds.
"""
import importlib.metadata
import json
import platform
import sys
import time

import py_trees
from lxml import etree
from py_trees.common import Status

from behavior_controller.bt.mission import load_text
from behavior_controller.bt.engine.builtins import builtin_specs
from behavior_controller.bt.engine.node_types import Registry

REGISTRY = Registry(builtin_specs())
ROUNDS = 7


def best(function, rounds=ROUNDS):
    """Return the shortest of several times, in seconds."""
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return min(times)


def document(body):
    """Return a mission around ``body``."""
    return '<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree></root>'.format(body)


def sequence_of(count):
    """Return one Sequence with so many leaves."""
    return "<Sequence>{}</Sequence>".format("<AlwaysSuccess/>" * count)


def balanced(levels):
    """Return a complete binary tree."""
    return "<AlwaysSuccess/>" if levels == 1 else "<Sequence>{0}{0}</Sequence>".format(
        balanced(levels - 1))


class Succeed(py_trees.behaviour.Behaviour):
    """The plain counterpart of AlwaysSuccess."""

    def update(self):
        """Succeed."""
        return Status.SUCCESS


def plain(body):
    """Return the same tree in plain py_trees."""
    def build(element):
        if element.tag == "AlwaysSuccess":
            return Succeed("AlwaysSuccess")
        node = py_trees.composites.Sequence("Sequence", memory=True)
        node.add_children([build(child) for child in element])
        return node
    return build(etree.fromstring(body))


def per_node(tick, count):
    """Return microseconds per node of a tick that visits ``count`` nodes."""
    repeat = max(1, 20000 // count)
    return best(lambda: [tick() for _ in range(repeat)]) / repeat / count * 1e6


def compared(body, count):
    """Return our time per ticked node and plain py_trees', in µs, and the ratio."""
    ours = per_node(load_text(document(body), REGISTRY).tick_exactly_once, count)
    theirs = per_node(plain(body).tick_once, count)
    return {
        "ours_us": round(ours, 3), "py_trees_us": round(theirs, 3),
        "ratio": round(ours / theirs, 3)
    }


def leaves(groups, attributes=""):
    """Return a mission of ``groups`` Sequences of 99 named leaves."""
    return document("<Sequence>{}</Sequence>".format("".join(
        '<Sequence name="s{0}">{1}</Sequence>'.format(
            group, "".join('<AlwaysSuccess name="n{}_{}"{}/>\n'.format(group, leaf, attributes)
                           for leaf in range(99))) for group in range(groups))))


def loading(text):
    """Return our time to load against lxml's bare parse, and the ratio."""
    data = text.encode()
    parse = best(lambda: etree.fromstring(data, etree.XMLParser(huge_tree=True)))
    load = best(lambda: load_text(text, REGISTRY), 5)
    return {
        "load_ms": round(load * 1e3, 2), "lxml_ms": round(parse * 1e3, 2),
        "ratio": round(load / parse, 1)
    }


def growth():
    """Return time per node of trees of 1,000, 10,000 and 100,000 nodes: linear cost means equal
    numbers."""
    found = {}
    for groups in (10, 100, 1000):
        text, count = leaves(groups), groups * 100 + 1
        load = best(lambda: load_text(text, REGISTRY), 3)
        tick = best(load_text(text, REGISTRY).tick_exactly_once, 3)
        found[str(count)] = {
            "load_us_per_node": round(load / count * 1e6, 2),
            "tick_us_per_node": round(tick / count * 1e6, 3)
        }
    return found


def main():
    """Print all measurements."""
    json.dump(
        {
            "python":
                platform.python_version(),
            "py_trees":
                importlib.metadata.version("py_trees"),
            "sequence_of_100":
                compared(sequence_of(100), 101),
            "balanced_1023":
                compared(balanced(10), 1023),
            "load_10001":
                loading(leaves(100)),
            "load_10001_two_scripts_a_leaf":
                loading(leaves(100, ' _onSuccess="a := 1" _skipIf="1 &lt; 0"')),
            "growth":
                growth(),
        }, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
