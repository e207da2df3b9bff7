"""What there is to see of a mission, as data, and as missionStatus prints it."""
import time

from behavior_controller.cli import create_tree
from behavior_controller.events import HealthChanged, Noticed, RunStarted
from behavior_controller.gateway import Answer, Cause, Failure, PerformGesture, Say
from behavior_controller.health import GONE
from behavior_controller.leaves.vocabulary import registry
from behavior_controller.watch import status
from behavior_controller.watch.board import PARTS, Board
from mission_rig import Rig, refusal, visitor_who
from test_leaves import one_leaf

GONE_AWAY = HealthChanged("service", "/robotNavigation/set_goal", "robotNavigation", False, "gone", "it cannot drive")


def board_of(rig):
    board = Board(rig.mission.events, rig.mission.health, registry())
    board.show(rig.tree)
    return board


def letters(board):
    return board.part("statuses")["letters"]


def test_the_tree_has_the_nodes_of_the_mission_with_their_names_and_types():
    rig = Rig()
    outline = board_of(rig).part("mission")["tree"]

    def flat(node):
        return [node] + [one for child in node["children"] for one in flat(child)]

    assert [(node["uid"], node["name"], node["path"]) for node in flat(outline)] == [
        (node.uid, node.name, node.full_path) for node in rig.tree.nodes]
    assert len([node for node in flat(outline) if node["subtree"]]) == len(
        [node for node in rig.tree.nodes if node.registration_id == "SubTree"])


def test_nodes_are_called_what_py_trees_render_calls_them():
    rig = Rig()
    board = board_of(rig)
    rig.mission.events.emit(RunStarted("some/where/lab_tour.xml", [], {}))

    def labels(node):
        return [" ".join(filter(None, (node["name"], node["kind"])))] + [
            label for child in node["children"] for label in labels(child)]

    assert sorted(labels(board.part("mission")["tree"])) == sorted(node.name for node in create_tree("lab_tour").iterate())


def test_the_letter_of_each_node_and_the_leaf_that_runs():
    rig = one_leaf("<Sequence><WelcomeSpeech/><FollowMeSpeech/><SayGoodByeSpeech/></Sequence>",
                   lambda request: None if "ollow" in request.text else Answer())
    board = board_of(rig)
    assert board.part("statuses") == {"letters": "----", "tip": 0}
    rig.tick()
    assert board.part("statuses") == {"letters": "RSR-", "tip": 3}
    rig.gateway.calls[-1].finish(refusal(rig.requests[-1]))
    rig.tick()
    assert board.part("statuses") == {"letters": "fsf-", "tip": 0}


def test_each_part_has_a_version_that_grows_with_it():
    rig = Rig(answer=lambda request: refusal(request) if isinstance(request, PerformGesture) else NotImplemented)
    board = board_of(rig)
    before = dict(board.versions)
    rig.mission.health.report(GONE, GONE_AWAY)
    rig.run(visitor_who(says="yes"))
    board.look()
    assert [name for name in PARTS if board.versions[name] == before[name]] == []
    before = dict(board.versions)
    board.look()
    assert board.versions == before


def test_passes_health_trouble_and_blackboard():
    rig = Rig(answer=lambda request: refusal(request) if isinstance(request, PerformGesture) else NotImplemented)
    board = board_of(rig)
    rig.mission.health.report(GONE, GONE_AWAY)
    rig.run(visitor_who(says="yes"))
    assert board.part("passes")["count"] == 1 and board.part("passes")["last"][0]["outcome"] == "SUCCESS"
    ill = [part for part in board.part("health") if not part["well"]]
    assert [(part["name"], part["status"], part["consequence"]) for part in ill] == [
        ("/robotNavigation/set_goal", "gone", "it cannot drive")]
    assert len(board.part("health")) == 10
    texts = [line["text"] for line in board.part("trouble")]
    assert texts[0].endswith("WelcomeGesture::22 failed: refused: the server refused")
    assert texts[2].endswith("recovery: skipped (retry 1x, then skip)")
    assert not any("condition false" in text for text in texts)
    assert ["currentExhibit", "exhibit 2"] in board.part("blackboard")
    assert ["exhibits", "exhibit 1, exhibit 2"] in board.part("blackboard")


def test_calls_and_the_age_of_topics_are_part_of_the_health():
    rig = Rig()
    board = board_of(rig)
    before = board.versions["health"]
    rig.mission.health.ended("/textToSpeech/say_text", 0.25, 60.0, True)
    rig.mission.health.heard["/faceDetection/data"] = time.monotonic() - 3.0
    board.look()
    assert board.versions["health"] > before
    parts = {part["name"]: part for part in board.part("health")}
    said, seen = parts["/textToSpeech/say_text"], parts["/faceDetection/data"]
    assert (said["calls"], said["failures"], said["seconds"], said["age"]) == (1, 1, 0.25, None)
    assert 3.0 <= seen["age"] < 5.0


def test_what_the_terminal_shows():
    rig = one_leaf('<Sequence name="all"><WelcomeSpeech name="hello"/><FollowMeSpeech/><SayGoodByeSpeech/></Sequence>',
                   lambda request: None if "ollow" in request.text else Answer())
    board = board_of(rig)
    rig.tick()
    state = {name: board.part(name) for name in PARTS}
    assert status.lines(state, False)[1:] == [
        "▶ all (Sequence) #1: running", "  ✔ hello (WelcomeSpeech) #2: success", "  ▶ FollowMeSpeech #3: running"]
    assert status.lines(state, True)[-1] == "  · SayGoodByeSpeech #4"
    assert isinstance(rig.requests[0], Say)


def test_what_the_robot_says_stays_on_its_line():
    odd = "\x1b[2J\n\u202e\ud800"
    rig = one_leaf('<Sequence name="a&#10;b&#x202e;"><WelcomeSpeech/></Sequence>',
                   lambda request: Failure(Cause.HANDLER_EXCEPTION, odd, odd))
    board = board_of(rig)
    rig.tick()
    rig.mission.events.emit(Noticed("error", odd))
    rig.mission.events.emit(HealthChanged("service", Say.service, odd, False, odd, ""))
    state = {name: board.part(name) for name in PARTS}
    assert state["trouble"] and all(line["text"].isprintable() for line in state["trouble"])
    assert all(part["status"].isprintable() for part in state["health"])
    assert "\\n" in state["mission"]["tree"]["name"]
    assert "\\x1b[2J\\n\\u202e\\ud800" in "".join(status.lines(state, True))


def test_nobody_there_is_one_line(capsys):
    assert status.main(["--port", "9"]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "http://127.0.0.1:9" in error and "monitorPort" in error
