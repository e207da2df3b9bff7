#!/usr/bin/env python3
"""Does the gateway distinguish every cause of failure, end each call in time, and free the
resources of a hung call?"""
import contextlib
import dataclasses
import os
import sys
import threading
import time
import unittest
from unittest import mock

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot import BUSY, forget_dead_entries, places, robot_for  # noqa: E402

from behavior_controller.bt.engine.clock import Clock, SimulatedClock  # noqa: E402
from behavior_controller.wakeup import WakeUp  # noqa: E402
from behavior_controller.run.safe_state import SafeState  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot.declarations import Publication, Success  # noqa: E402
from behavior_controller.robot.d543 import INTERFACE  # noqa: E402
from behavior_controller.robot.requests import (
    Answer, Exhibit, GoTo, Location, PerformGesture, Point, Prompt, QueryKnowledge, Request, Say,
    SetAnimation, SetAttention)
from behavior_controller.ros import types  # noqa: E402
from behavior_controller.ros.service_client import RosGateway  # noqa: E402

SAY = "/textToSpeech/say_text"
ATTENTION, ANIMATION = "/overtAttention/set_mode", "/animateBehaviour/set_activation"
ONE_OF_EACH = (SetAnimation("enabled"), PerformGesture("deictic", 2, 1500, Point(1.5, 2.5, 3.5),
                                                       10), QueryKnowledge("exhibits"),
               SetAttention("location", Point(4.5, 5.5, 6.5)), GoTo(Location(1.25, 2.5, 90.0)),
               Prompt(("Yes", "No")), Say("hello"))


class TestGateway(unittest.TestCase):
    """Each case has its own gateway, whose deadline is ``self.deadline`` for every service."""

    def setUp(self):
        self.deadline = 20.0
        self.clock = Clock()
        self.wake = WakeUp()
        self.gateway = RosGateway(INTERFACE, lambda service: self.deadline, self.clock,
                                  self.wake.emit)

    def tearDown(self):
        self.gateway.close()
        self.assert_at_rest()
        forget_dead_entries()

    def robot(self, modes=None):
        """Return a robot for this case."""
        return robot_for(self, modes)

    def finish(self, call, seconds=30.0):
        """Act as the runner does until ``call`` has a result; return it and how long it took."""
        started = time.monotonic()
        while call.result is None and time.monotonic() - started < seconds:
            due = self.clock.next_due()
            self.wake.wait(
                max(0.0, min(seconds, due - self.clock.now() if due is not None else seconds)))
            self.wake.test_and_clear()
            self.clock.run_due()
        self.assertIsNotNone(call.result, "no result in {} s".format(seconds))
        return call.result, time.monotonic() - started

    def ask(self, request, seconds=30.0):
        """Send ``request`` and return its result."""
        return self.finish(self.gateway.start(request), seconds)[0]

    def assert_fails(self, request, cause, *words):
        """Send ``request``, which must fail for ``cause``, with ``words`` in its one-line message.
        """
        failure = self.ask(request)
        self.assertEqual(getattr(failure, "cause", failure), cause)
        for word in words:
            self.assertIn(word, failure.message)
        self.assertNotIn("\n", failure.message)
        self.assertEqual(failure.resource,
                         rospy.resolve_name(INTERFACE.service(type(request)).name))

    # -------------------------------------------------------------------------------------- answers

    def test_each_request_arrives_as_the_contract_writes_it_and_is_answered(self):
        robot = self.robot()
        results = [self.ask(request) for request in ONE_OF_EACH]
        self.assertEqual([type(result) for result in results], [Answer] * 7)
        robot.wait_for_request(SAY, 10.0)  # what the robot was asked is read by a thread
        self.assertEqual(results[5].response, "Yes")
        self.assertEqual(results[2].exhibits,
                         tuple(Exhibit(place["name"], place["description1"], place["description2"],
                                       Location(*place["location"]), Point(*place["gesture"]))
                               for place in places()["exhibits"][:2]))
        self.assertEqual(
            [request["fields"] for request in robot.requests()], [{"state": "enabled"}, {
                "gesture_type": "deictic", "gesture_id": 2, "gesture_duration": 1500,
                "bow_nod_angle": 10, "location_x": 1.5, "location_y": 2.5, "location_z": 3.5
            }, {"parameters": "exhibits"}, {
                "state": "location", "location_x": 4.5, "location_y": 5.5, "location_z": 6.5
            }, {"goal_x": 1.25, "goal_y": 2.5, "goal_theta": 90.0}, {"message": "Yes|No"},
                                                                  {"message": "hello"}])

    def test_an_answer_wakes_and_is_handed_over_on_the_tick_thread(self):
        self.robot()
        call = self.gateway.start(Say("hello"))
        self.wake.wait(10.0)
        self.assertTrue(self.wake.test_and_clear())
        self.assertIsNone(call.result)
        self.clock.run_due()
        self.assertIsInstance(call.result, Answer)
        self.assertIsNone(self.clock.next_due(), "a timer was left behind")

    def test_an_answer_to_a_call_that_was_dropped_meanwhile_is_not_used(self):
        self.robot()
        call = self.gateway.start(Say("hello"))
        self.wake.wait(10.0)
        call.drop()
        self.clock.run_due()
        self.assertIsNone(call.result)
        self.assert_at_rest()
        self.assertIsInstance(self.ask(Say("next")), Answer)

    def test_a_refusal(self):
        self.robot({INTERFACE.service(type(request)).name: "refuse" for request in ONE_OF_EACH})
        for request in ONE_OF_EACH:
            self.assert_fails(request, Cause.REFUSED)

    def test_an_answer_that_means_nothing(self):
        self.robot({INTERFACE.service(type(request)).name: "odd" for request in ONE_OF_EACH})
        self.assert_fails(SetAnimation("enabled"), Cause.UNUSABLE_ANSWER, "'perhaps'")
        self.assert_fails(QueryKnowledge("home"), Cause.UNUSABLE_ANSWER, "nan")
        self.assert_fails(GoTo(Location(0.0, 0.0, 0.0)), Cause.UNUSABLE_ANSWER, "7")

    # --------------------------------------------------------------------------------------- causes

    def test_an_exception_in_the_server(self):
        self.robot({"/textToSpeech/say_text": "raise"})
        self.assert_fails(Say("hello"), Cause.HANDLER_EXCEPTION, "the robot was commanded to raise")

    def test_another_type(self):
        self.robot({"/textToSpeech/say_text": "wrong"})
        self.assert_fails(Say("hello"), Cause.TYPE_MISMATCH, "md5sum")

    def test_a_server_that_dies_while_it_works(self):
        self.robot({"/textToSpeech/say_text": "exit"})
        self.assert_fails(Say("hello"), Cause.CONNECTION_LOST)

    def test_a_request_that_does_not_fit_its_type(self):
        self.robot()
        self.assert_fails(PerformGesture("iconic", 256, 3000), Cause.TYPE_MISMATCH, "gesture_id")

    # ----------------------------------------------------------------------------------------- time

    def test_what_a_leaf_took_before_a_request_does_not_count_against_its_deadline(self):
        self.robot({SAY: "hang"})
        self.deadline = 0.5
        self.clock.hold()  # the traversal begins
        time.sleep(2 * self.deadline)  # in the code of a leaf
        call = self.gateway.start(Say("hello"))
        self.clock.release()
        failure, seconds = self.finish(call)
        self.assertEqual(failure.cause, Cause.NO_ANSWER)
        self.assertGreater(seconds, self.deadline - 0.05)

    def test_what_makes_the_robot_safe_has_its_seconds_of_the_process_too(self):
        """Simulated time may run so fast that no server answers within a deadline."""
        self.robot({ATTENTION: "hang"})
        self.deadline, began = 0.5, time.monotonic()
        self.clock = SimulatedClock(self.wake.emit)
        self.clock.set_to(100.0)
        self.gateway = RosGateway(INTERFACE, lambda service: self.deadline, self.clock,
                                  self.wake.emit)
        vital, other = map(self.gateway.start, (SetAttention("disabled"), SetAttention("social")))
        for moment in (200.0, 300.0):
            self.clock.set_to(moment)
            self.clock.run_due()
        self.assertEqual((vital.result, other.result.cause), (None, Cause.NO_ANSWER))
        while vital.result is None:
            self.wake.wait(self.clock.time_left())
            self.wake.test_and_clear()
            self.clock.run_due()
        self.assertEqual(vital.result.cause, Cause.NO_ANSWER)
        self.assertGreaterEqual(time.monotonic() - began, self.deadline)

    def test_two_hundred_hung_calls_leave_no_thread_and_no_socket_behind(self):
        robot = self.robot({"/textToSpeech/say_text": "hang"})
        self.deadline = 0.02
        self.ask(Say("warm up"))
        self.assert_at_rest()
        files = len(os.listdir("/proc/self/fd"))
        for _ in range(200):
            self.assertEqual(self.ask(Say("hello")).cause, Cause.NO_ANSWER)
        self.assert_at_rest()
        self.assertLessEqual(len(os.listdir("/proc/self/fd")), files)
        self.deadline = 20.0
        robot.set_mode(SAY, "done")
        self.assertIsInstance(self.ask(Say("at last")), Answer)

    def assert_at_rest(self):
        """Expect that soon no thread talks to a service."""
        ends = time.monotonic() + 2.0 * BUSY
        talking = [each for each in threading.enumerate() if each.name.startswith("service /")]
        for thread in talking:
            thread.join(max(0.0, ends - time.monotonic()))
        self.assertEqual([thread.name for thread in talking if thread.is_alive()], [])

    # ------------------------------------------------------------------- a computer without threads

    def test_without_a_new_thread_both_requests_of_the_safe_state_go_out(self):
        for hanging in (None, ATTENTION, ANIMATION):
            robot = self.robot({hanging: "hang"} if hanging else {})
            gateway = RosGateway(INTERFACE, lambda service: 20.0, self.clock, self.wake.emit)
            began = time.monotonic()
            with mock.patch.object(threading.Thread, "start",
                                   side_effect=RuntimeError("can't start new thread")):
                self.assertIn("no thread", self.ask(Say("hello")).message)
                report = SafeState(gateway, INTERFACE, (), self.clock.now).wait(self.doze)
            self.assertLess(time.monotonic() - began, 1.0 + 0.5 * BUSY)
            for service in (ATTENTION, ANIMATION):
                robot.wait_for_request(service, 5, state="disabled")
            failed = [part.service for part in report.parts if part.failure is not None]
            self.assertEqual(failed, [hanging] if hanging else [])
            gateway.close()
        self.robot()
        self.assertIsInstance(self.ask(INTERFACE.safe_state[0]), Answer)  # with threads again

    def doze(self, seconds):
        """Wait as the runner does at a stop."""
        self.wake.wait(seconds)
        self.wake.test_and_clear()
        self.clock.run_due()

    # ---------------------------------------------------------------------------------- connections

    def test_a_server_that_was_started_again_is_found_without_a_failure(self):
        robot = self.robot()
        self.assertIsInstance(self.ask(Say("first")), Answer)
        robot.kill()
        self.robot()
        self.assertIsInstance(self.ask(Say("second")), Answer)

    def test_a_dead_server_fails_each_call_with_its_cause_until_it_is_back(self):
        robot = self.robot()
        self.assertIsInstance(self.ask(Say("first")), Answer)
        robot.kill()
        for _ in range(2):
            self.assert_fails(Say("second"), Cause.NOT_REACHABLE)
        self.robot()
        self.assertIsInstance(self.ask(Say("third")), Answer)

    def test_remapped_names_are_used_and_told(self):
        self.robot()
        self.addCleanup(remap)
        remap(SAY + ":=/elsewhere/say")
        self.gateway = RosGateway(INTERFACE, lambda service: self.deadline, self.clock,
                                  self.wake.emit)
        failure = self.ask(Say("hello"))
        self.assertEqual((failure.cause, failure.resource),
                         (Cause.NOT_ADVERTISED, "/elsewhere/say"))

    def test_a_declaration_without_its_type_or_its_outcome_is_told_by_name(self):
        def one_text(request):
            return request.text

        declared = INTERFACE.service(Say)
        for changed, told in (({"type": "cssr_system/songService"},
                               "the type cssr_system/songService of /textToSpeech/say_text is not "
                               "built: the package cssr_system needs srv/songService.srv; build "
                               "its workspace when that is there"),
                              ({"answer": lambda response: Answer(response=response.text)},
                               "the declaration of /textToSpeech/say_text reads a field that "
                               "cssr_system/textService does not have: 'textServiceResponse' "
                               "object has no attribute 'text'"),
                              ({"fields": one_text},
                               "/textToSpeech/say_text: its declaration: fields "
                               "(rostest/test_gateway.py:{}) returned ''; cssr_system/textService "
                               "has the fields message: return a tuple with a value for "
                               "each".format(one_text.__code__.co_firstlineno)),
                              ({"success": Success("done", True, False)},
                               "the response of cssr_system/textService has no field done, which "
                               "is to tell the outcome of /textToSpeech/say_text; it has: success, "
                               "response")):
            with self.assertRaises(ImportError) as raised:
                types.message_class(dataclasses.replace(declared, **changed))
            self.assertEqual(str(raised.exception), told)
        self.assertIs(
            types.message_class(dataclasses.replace(
                declared, answer=lambda response: response.response[0],
                fields=lambda request: (request.text[0],))),
            types.TYPES[declared])  # neither need have a meaning while it is empty

    def test_a_declaration_with_a_field_that_a_message_lacks_is_told_before_it_is_sent(self):
        class Move(Request, frozen=True):
            x: float

        for name, told in ("position", ""), ("positon", "No field name"):
            goal = Publication(Move, "/goal", "base", "geometry_msgs/PoseStamped", lambda move: (
                {"stamp": "now"}, {name: {"x": move.x}}), None, 5.0, "the robot cannot drive")
            with self.assertRaisesRegex(ImportError, told) if told else contextlib.nullcontext():
                types.message_class(goal)


def remap(*arguments):
    """Remap names as these command-line arguments would."""
    rospy.names.reload_mappings(["test_gateway"] + list(arguments))
    rospy.names.initialize_mappings(rospy.get_name())


if __name__ == "__main__":
    rospy.init_node("test_gateway", disable_signals=True)
    rostest.rosrun("cssr_system", "gateway", TestGateway)
