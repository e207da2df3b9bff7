"""What bash offers for rosrun of these packages, and that other packages are left to rosbash."""
import os
import subprocess

import pytest

HOOK = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))),
                    "env-hooks", "60.cssr_system.bash")


def offered(*words):
    """Return what bash would offer for the last word."""
    line = " ".join("'{}'".format(word) for word in ("rosrun",) + words)
    done = subprocess.run(
        ["bash", "-c", "_roscomplete_exe() {{ COMPREPLY=(of_rosbash); }}; . {}; COMP_WORDS=({}); "
         "COMP_CWORD={}; _cssr_system_complete 2>/dev/null; echo ${{COMPREPLY[*]}}".format(
             HOOK, line, len(words))], check=True, stdout=subprocess.PIPE, encoding="utf-8")
    return done.stdout.split()


@pytest.mark.parametrize("words, expected", [
    (("cssr_system", ""),
     "behaviorController exportNodeModel missionStatus missionViewer rehearseMission replayMission "
     "tryRobot validateMission"),
    (("unit_tests", "r"), "robotLocalization robotNavigation runTest"),
    (("cssr_system", "validateMission", "--w"), "--watch"),
    (("cssr_system", "behaviorController", "_asr"), "_asrEnabled:="),
    (("unit_tests", "runTest", "use_real_f"), "use_real_faceDetection:="),
    (("unit_tests", "textToSpeech", "_failureR"), "_failureRate:="),
    (("cssr_system", "validateMission", "data/"), ""),  # which bash completes as a file
    (("cssr_",), "of_rosbash"),
    (("rospy_tutorials", ""), "of_rosbash"),
    (("greeter", "lights", ""), "of_rosbash")])
def test_what_is_offered(words, expected):
    assert offered(*words) == expected.split()
