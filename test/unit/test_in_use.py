"""Of two controllers that start at the same moment exactly one controls the robot."""
import pytest

rospy = pytest.importorskip("rospy", reason="needs ROS")

from behavior_controller.errors import NodesMissing  # noqa: E402
from behavior_controller.ros import in_use  # noqa: E402
from behavior_controller.ros.in_use import check_unused  # noqa: E402
from behavior_controller.ros.master import ServicesInUse  # noqa: E402
from ros_peers import Master, RpcPeer  # noqa: E402

SAY = "/textToSpeech/say_text"
STARTS, RUNS, REFUSED, OTHER = [False, [SAY]], [True, [SAY]], [False, []], [True, ["/x"]]


class Controller(RpcPeer):
    """A controller that gives these answers, the last one again and again."""

    def __init__(self, *answers):
        super().__init__()
        self.answers = list(answers)

    def servicesInUse(self, caller):
        """Answer another controller."""
        return 1, "", self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


@pytest.mark.parametrize("shared, words", [
    ([SAY], f"it asks {SAY}, and each"), ([SAY, "/x"], f"it asks {SAY} and 1 more of them, and"),
    ([SAY, "/x", "/y"], f"it asks {SAY} and 2 more of them, and")])
def test_the_refusal_counts_the_services_that_both_ask(monkeypatch, shared, words):
    master, other = Master(), Controller([True, [*shared, "/of_the_other"]])
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    master.publishers["/rosout"], master.nodes["/a"] = ["/a"], other.uri
    try:
        with pytest.raises(NodesMissing, match=words):
            check_unused(frozenset([*shared, "/of_ours"]))
    finally:
        for each in (other, master):
            each.close()


@pytest.mark.parametrize("name, answers, is_refused", [
    # its name comes after ours, and it may have looked before we were registered
    ("/z", [STARTS, STARTS, RUNS], True), ("/z", [STARTS, STARTS, REFUSED], False),
    ("/a", [STARTS, REFUSED], True), ("/a", [RUNS], True), ("/z", [OTHER], False)])
def test_one_of_two_stays(monkeypatch, name, answers, is_refused):
    master, other, used = Master(), Controller(*answers), ServicesInUse()
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    monkeypatch.setattr(in_use, "IN_USE", used)
    monkeypatch.setattr(in_use, "LOOK_AGAIN", 0.01)
    master.publishers["/rosout"], master.nodes[name] = [name], other.uri
    used.services = frozenset([SAY])
    try:
        check_unused(used.services, is_registered=True)
        assert not is_refused and used.services
    except NodesMissing as missing:
        assert is_refused and f"node {name} already controls this robot" in str(missing)
        assert not used.services  # so that the other one need not wait for our end
    finally:
        for each in (other, master):
            each.close()
