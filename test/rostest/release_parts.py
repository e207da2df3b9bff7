"""What tests of a robot of release 1.0 or 1.1 share: knowledge files, a mission, a server of the
action that recognises speech."""
import threading

import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from cssr_system.msg import recogniseSpeechActionGoal, recogniseSpeechActionResult

from robot import NodeCase

ACTION = "/speechEvent/recognise_speech_action"
ENVIRONMENT = """robotLocationDescription 1 the door
robotLocationPose 1 2.5 -1.25 90
gestureTarget 1 0 0 0
preGestureMessageEnglish 1 Hello
postGestureMessageEnglish 1 Come along
robotLocationDescription 2 the arm
robotLocationPose 2 -3.5 4 -90
gestureTarget 2 1 2 0.5
preGestureMessageEnglish 2 This is the arm
postGestureMessageEnglish 2 It has six joints
tourSpecification 2 1 2"""
CULTURE = "phraseLanguage English\n" + "".join("utilityPhraseEnglish{0} phrase {0}\n".format(n)
                                               for n in range(1, 8))
MISSION = """<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>{}
</Sequence></BehaviorTree></root>"""


class ReleaseCase(NodeCase):
    """A test case of the node, which has the knowledge files of a robot of a release."""

    def setUp(self):
        super().setUp()
        for name, text in (("environment", ENVIRONMENT), ("culture", CULTURE)):
            self.package.write("config/{}KnowledgeBaseConfiguration.ini".format(name),
                               "knowledgeBase {}.dat\n".format(name))
            self.package.write("data/{}.dat".format(name), text)


class EndingServer:
    """The action, which ends each goal by what ``parts`` names, with a pause between them: its
    status, its result.

    actionlib's own server publishes both at once, and the network decides which arrives first.
    """

    def __init__(self, parts, pause=0.0, status=GoalStatus.ABORTED):
        self._parts, self._pause, self._status = parts, pause, status
        self.goals = 0
        self._is_stopped = threading.Event()
        self._publishers = {
            "status":
                rospy.Publisher(ACTION + "/status", GoalStatusArray, queue_size=10), "result":
                    rospy.Publisher(ACTION + "/result", recogniseSpeechActionResult, queue_size=10)}
        self._subscribers = [
            rospy.Subscriber(ACTION + "/goal", recogniseSpeechActionGoal, self._end),
            rospy.Subscriber(ACTION + "/cancel", GoalID)]

    def _end(self, goal):
        self.goals += 1
        status = GoalStatus(goal.goal_id, self._status, "the microphone is away")
        messages = {"status": GoalStatusArray(status_list=[status]),
                    "result": recogniseSpeechActionResult(status=status)}
        for part in self._parts:
            if not self._is_stopped.is_set():
                self._publishers[part].publish(messages[part])
            self._is_stopped.wait(self._pause)

    @property
    def is_connected(self):
        """Whether a client hears all that is published."""
        return all(each.get_num_connections() for each in self._publishers.values())

    def stop(self):
        """Take the action away."""
        self._is_stopped.set()
        for end in self._subscribers + list(self._publishers.values()):
            end.unregister()
