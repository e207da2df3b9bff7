"""Every word of a command line is read or refused: a node's, a command's, roslaunch's."""
import argparse
import os
import subprocess
import sys
from importlib import metadata

import pytest

from behavior_controller import folders, ros_arguments
from behavior_controller.config import config_file, settings


@pytest.mark.parametrize("word, field", (
    ("missionRuns:=1", "_missionRuns"), ("missionRun:=1", "_missionRuns"),
    ("asrenabled:=false", "_asrEnabled"), ("__nam:=x", "__name"), ("__nma:=x", "__name"),
    ("__qqqq:=x", "__hostname"), ("a:=b:=c", "name:=other_name")))
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


def test_a_command_reads_the_words_that_follow_its_name(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["tool", "a", "b", "__log:=y"])
    parser = argparse.ArgumentParser()
    parser.add_argument("files", nargs="*")
    assert ros_arguments.parse(parser).files == ["a", "b"]


def test_a_command_refuses_other_words_of_ros(capsys):
    with pytest.raises(SystemExit) as raised:
        parsed("a", "_verbose:=1")
    assert raised.value.code == 2
    assert "_verbose:=1" in capsys.readouterr().err


def outcome(capsys, parse):
    """Return the exit code with which the command line ends the program, and its output."""
    with pytest.raises(SystemExit) as raised:
        parse()
    out, err = capsys.readouterr()
    return raised.value.code, out, err


@pytest.mark.parametrize("word, hint", [
    ("--foldr", " (did you mean --folder?)"), ("--foldr=x", " (did you mean --folder?)"),
    ("--versio", " (did you mean --version?)"), ("--fol", " (did you mean --folder?)"), ("-q", "")])
def test_the_nearest_option_is_suggested_for_an_unknown_one(capsys, word, hint):
    parser = ros_arguments.CommandParser("tool", "Does it.", "0 always")
    parser.add_argument("--folder", action="store_true")
    code, _, err = outcome(capsys, lambda: parser.parse_args([word]))
    assert code == 2
    assert err.splitlines()[-1] == "tool: error: unrecognized arguments: {}{}".format(word, hint)


@pytest.mark.parametrize("manifest, version", [
    ("<package><version>7.8.9</version></package>", "7.8.9"), ("<package/>", "unknown")])
def test_the_version_is_that_of_the_manifest(tmp_path, monkeypatch, capsys, manifest, version):
    (tmp_path / "package.xml").write_text(manifest)
    monkeypatch.setattr(folders, "share", lambda: str(tmp_path))
    parser = ros_arguments.CommandParser("tool", "Does it.", "0 always")
    assert outcome(capsys, lambda: parser.parse_args(["--version"])) == (
        0, "tool {}\n".format(version), "")


@pytest.mark.parametrize("installed, version", [({"cssr_system": "3.2.1"}, "3.2.1"),
                                                ({}, "unknown")])
@pytest.mark.parametrize("manifest", [None, "<package>"])
def test_without_a_manifest_the_version_is_what_pip_has_installed(tmp_path, monkeypatch, manifest,
                                                                  installed, version):
    def found(name):
        if name not in installed:
            raise metadata.PackageNotFoundError(name)
        return installed[name]

    if manifest:
        (tmp_path / "package.xml").write_text(manifest)
    monkeypatch.setattr(folders, "share", lambda: str(tmp_path))
    monkeypatch.setattr(metadata, "version", found)
    assert ros_arguments.version() == version


def test_a_node_explains_itself_if_its_first_argument_asks_for_that(monkeypatch, capsys):
    def explain(*words):
        monkeypatch.setattr(sys, "argv", ["node", *words])
        ros_arguments.explain_node("node", "Does it.", "0 always")

    for words in ([], ["x", "--help"], ["_a:=1", "-h"], ["--helpful"]):
        explain(*words)
        assert capsys.readouterr().out == ""
    for word in ("-h", "--help"):
        code, out, _ = outcome(capsys, lambda: explain(word, "x"))
        assert code == 0 and "usage: node" in out and "Does it." in out
        assert "exit code: 0 always" in out
    code, out, _ = outcome(capsys, lambda: explain("--version"))
    assert (code, out) == (0, "node {}\n".format(ros_arguments.version()))


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
    ([], [])))
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


@pytest.mark.parametrize("command, expected", (
    (["/usr/bin/python3", "/usr/bin/roslaunch", "unit_tests", "x.launch"], True),
    (["roslaunch", "x.launch"], True), (["/usr/bin/python3", "/usr/bin/rostest", "x.test"], True),
    (["bash"], False), (["vi", "notes", "roslaunch"], False), ([], False)))
def test_only_roslaunch_is_asked_to_end(command, expected):
    assert ros_arguments.is_roslaunch(command) is expected
