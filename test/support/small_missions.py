"""Small missions as texts, and the check of them with a few node types beside the built-in ones."""
from behavior_controller.bt.engine.builtins import AlwaysSuccess, builtin_specs
from behavior_controller.bt.engine.node_types import Registry
from behavior_controller.bt.engine.registry import Direction, Kind, NodeSpec, Port
from behavior_controller.bt.loader.checks import check
from behavior_controller.bt.loader.document import parse

LEAF = "<AlwaysSuccess/>"
REGISTRY = Registry(builtin_specs() + [
    NodeSpec("Navigate", Kind.ACTION, AlwaysSuccess),
    NodeSpec("IsVisitorDiscovered", Kind.CONDITION, AlwaysSuccess),
    NodeSpec("Old", Kind.ACTION, AlwaysSuccess, warning="Old is another spelling of Navigate"),
    NodeSpec("Typed", Kind.ACTION, AlwaysSuccess,
             (Port("number", "int"), Port("flag", "bool"), Port("list", "vec_int"),
              Port("out", "double", Direction.INOUT), Port("text", "string"))),
    NodeSpec("Attend", Kind.ACTION, AlwaysSuccess, names=("social", "seeking"))])


def root(body, attributes='BTCPP_format="4" main_tree_to_execute="Main"'):
    return "<root {}>\n{}\n</root>".format(attributes, body)


def tree(body, name="Main"):
    """Return a tree whose body begins in the third line of a file made with ``root``, at its fifth
    column."""
    return '  <BehaviorTree ID="{}">\n    {}\n  </BehaviorTree>'.format(name, body)


def model(inside, tree_id="S"):
    """Return a model; its content begins a new line."""
    return '<TreeNodesModel><SubTree ID="{}">\n{}</SubTree></TreeNodesModel>'.format(
        tree_id, inside)


def main(body):
    return root(tree(body))


def checked(text, **options):
    return check([parse(text, "m.xml")], REGISTRY, **options)


def chain(length):
    """Return trees of which each calls the next one twice; the first unfolds to 4 * 2 ** ``length``
    - 3 nodes."""
    twice = ('<BehaviorTree ID="T{0}"><Sequence><SubTree ID="T{1}"/><SubTree ID="T{1}"/></Sequence>'
             '</BehaviorTree>')
    trees = [twice.format(number, number + 1)
             for number in range(length)] + [tree(LEAF, "T{}".format(length))]
    return root("".join(trees), 'BTCPP_format="4" main_tree_to_execute="T0"')


def circle(length):
    return root("".join(tree('<SubTree ID="T{}"/>'.format((number + 1) % length),
                             "T{}".format(number)) for number in range(length)),
                'BTCPP_format="4" main_tree_to_execute="T0"')
