"""Every word of a command line is read or refused: a node's, a command's, roslaunch's."""
import argparse
import os
import subprocess

import pytest

from behavior_controller import ros_arguments
from behavior_controller.config import config_file, settings


@pytest.mark.parametrize("word, field",
                         (("missionRuns:=1", "_missionRuns"), ("missionRun:=1", "_missionRuns"),
                          ("asrenabled:=false", "_asrEnabled"), ("__nam:=x", "__name"),
                          ("__nma:=x", "__name"), ("__qqqq:=x", "__hostname"),
                          ("a:=b:=c", "name:=other_name")))
def test_a_word_that_the_node_does_not_read(word, field):
    fault, = settings.unread([word])
    assert (fault.file, fault.line, fault.column) == ("argument " + word, 0, 0)
    assert field in str(fault)


@pytest.mark.parametrize(
    "word", ("/a:=/b", "/textToSpeech/say_text:=/voice/say", "textToSpeech/say_text:=voice",
             "rosout:=/elsewhere", "camera:=eye", "__name:=x", "__log:=/x.log", "__ns:=/hall",
             "__master:=http://x:1", "--help", "x"))
def test_what_ros_reads_or_others_judge(word):
    assert settings.unread([word]) == []


def parsed(*words):
    parser = argparse.ArgumentParser()
    parser.add_argument("files", nargs="*")
    return ros_arguments.parse(parser, words).files


def test_a_command_ignores_what_roslaunch_adds():
    assert parsed("a", "__name:=x", "__log:=y", "./b:=c") == ["a", "./b:=c"]


def test_a_command_refuses_other_words_of_ros(capsys):
    with pytest.raises(SystemExit) as raised:
        parsed("a", "_verbose:=1")
    assert raised.value.code == 2
    assert "_verbose:=1" in capsys.readouterr().err


def test_the_home_folder():
    assert config_file.folder("~/x") == os.path.join(os.path.expanduser("~"), "x")
    for word in ("~no_such_user/x", "a\0b"):
        with pytest.raises(ValueError):
            config_file.folder(word)


# ---------------------------------------------------------------------------------------- roslaunch


@pytest.mark.parametrize("command, given", (
    (["python3", "/usr/bin/roslaunch", "ours", "x.launch", "mision:=x", "__log:=y"], ["mision:=x"]),
    (["/usr/bin/roslaunch", "-p", "11312", "/tmp/x.launch", "_seed:=1"], ["_seed:=1"]),
    (["/usr/bin/roslaunch", "x.launch", "seed:=1"], ["seed:=1"]),
    (["/usr/bin/roslaunch", "--screen", "x.launch", "seed:=1"], ["seed:=1"]),
    (["/usr/bin/roslaunch", "theirs", "x.launch", "seed:=1"], []),
    # which may include ours
    (["/usr/bin/roslaunch", "theirs", "everything.launch", "mision:=x"], []),
    ([], []),
))
def test_what_roslaunch_was_given_for_our_file(command, given):
    assert ros_arguments.given_to_roslaunch(command, "ours", "x.launch") == given


def test_the_command_of_the_parent_is_read_word_by_word(monkeypatch):
    command = ["cat", "-", "-"]
    parent = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
    parent.stdin.write(b"x")
    assert parent.stdout.read(1) == b"x", "it runs"
    monkeypatch.setattr(ros_arguments.os, "getppid", lambda: parent.pid)
    assert ros_arguments.parent_command() == command
    parent.communicate()
    assert ros_arguments.parent_command() == []


@pytest.mark.parametrize(
    "command, expected",
    ((["/usr/bin/python3", "/usr/bin/roslaunch", "unit_tests", "x.launch"], True),
     (["roslaunch", "x.launch"], True), (["/usr/bin/python3", "/usr/bin/rostest", "x.test"], True),
     (["bash"], False), (["vi", "notes", "roslaunch"], False), ([], False)))
def test_only_roslaunch_is_asked_to_end(command, expected):
    assert ros_arguments.is_roslaunch(command) is expected
