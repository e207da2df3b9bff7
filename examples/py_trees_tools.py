"""py_trees' own manager, visitor, display and behaviours on a mission drawn in Groot2:
py_trees_tools.py py_trees_tools.xml"""
import sys
import time

import py_trees

from behavior_controller import bt

registry = bt.Registry([bt.NodeSpec(
    "Count", bt.Kind.ACTION, lambda name: py_trees.behaviours.TickCounter(
        name, 2, py_trees.common.Status.SUCCESS))])
tree = py_trees.trees.BehaviourTree(bt.load(sys.argv[1], registry).root)
snapshot = py_trees.visitors.SnapshotVisitor()
tree.add_visitor(snapshot)
tree.add_post_tick_handler(
    lambda tree: print(py_trees.display.ascii_tree(tree.root, visited=snapshot.visited)))
tree.setup()
tree.tick()
while tree.root.status is bt.RUNNING:
    time.sleep(0.01)
    tree.tick()
print(tree.root.status.name, tree.tip().name)
