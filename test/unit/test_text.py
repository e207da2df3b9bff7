"""Outside text cannot act on a terminal or forge a line; a file that is not a text file is refused
at once."""
import os
import socket
import threading

import pytest

from behavior_controller.text import (
    Unreadable, clean, count, decode, did_you_mean, first_names, read_bytes, read_text,
    without_controls)


@pytest.mark.parametrize("text, shown", [
    ("plain text, é, 日本, \\ and \"", "plain text, é, 日本, \\ and \""),
    ("", ""),
    ("\x1b[31mred\x1b]0;title\x07", "\\x1b[31mred\\x1b]0;title\\x07"),
    ("\x9b31m", "\\x9b31m"),
    ("one\ntwo\r\nthree\ttabs", "one\\ntwo\\r\\nthree\\ttabs"),
    ("a\x0bb\x0cc\x1cd\x85e\u2028f\u2029g", "a\\x0bb\\x0cc\\x1cd\\x85e\\u2028f\\u2029g"),
    ("\u202egnp.exe\u2066\u200f", "\\u202egnp.exe\\u2066\\u200f"),
    ("\u200b\ufeff\x00\x7f", "\\u200b\\ufeff\\x00\\x7f"),
    ("\ud800 \udcff", "\\ud800 \\udcff"),
    ("\U000e0041", "\\U000e0041")])
def test_what_is_shown_of_outside_text(text, shown):
    assert clean(text) == shown
    assert clean(text).splitlines() == ([shown] if shown else [])
    shown.encode("utf-8")


def test_a_long_text_is_cut_in_the_middle():
    assert clean("x" * 1000) == "x" * 1000
    assert clean("a" * 999 + "b" * 10 ** 7) == "a" * 961 + " … " + "b" * 36
    assert clean("a" * 99 + "b" * 99, longest=100) == "a" * 61 + " … " + "b" * 36


def test_lines_and_tabs_stay_where_control_characters_are_shown():
    text = "one\ttwo\nthr\u00e9\u00e9\x1b[H\x1b[J\x1b[K\r\x1b[31m\x1b[2J\x9b\x00\u202e"
    shown = "\\x1b[31m\\x1b[2J\\x9b\\x00\\u202e"
    assert without_controls(text) == ("one\ttwo\nthr\u00e9\u00e9\\x1b[H\\x1b[J\\x1b[K\\r" + shown)
    assert without_controls(text, redraws=True) == (
        "one\ttwo\nthr\u00e9\u00e9\x1b[H\x1b[J\x1b[K\r" + shown)


@pytest.mark.parametrize("data", [
    b"k\xc3\xa9y 1\nb 2\n", b"\xef\xbb\xbfk\xc3\xa9y 1\r\nb 2\r\n", b"k\xc3\xa9y 1\rb 2\r",
    "kéy 1\nb 2\n".encode("utf-16"), b"\xfe\xff" + "kéy 1\nb 2\n".encode("utf-16-be")])
def test_every_way_to_save_a_text_file_is_the_same_text(tmp_path, data):
    path = tmp_path / "a.ini"
    path.write_bytes(data)
    assert read_text(str(path)) == "kéy 1\nb 2\n"


@pytest.mark.parametrize("data", [
    b"\xff", b"a\xc3", b"\xff\xfe\x00", "\ud800".encode("utf-8", "surrogatepass"), b"a\0b"])
def test_what_is_not_utf_8_text_is_refused(tmp_path, data):
    path = tmp_path / "a.ini"
    path.write_bytes(data)
    with pytest.raises(Unreadable, match="^it is not UTF-8 text"):
        read_text(str(path))


def test_the_limit_is_the_last_size_that_is_read(tmp_path):
    path = tmp_path / "a.ini"
    path.write_text("12345")
    assert read_bytes(str(path), 5) == b"12345"
    with pytest.raises(Unreadable, match="^it has 5 bytes; at most 4 are read$"):
        read_bytes(str(path), 4)


def test_a_huge_file_is_not_read(tmp_path):
    path = tmp_path / "a.ini"
    with open(str(path), "wb") as file:
        file.truncate(10 ** 12)  # sparse
    with pytest.raises(Unreadable, match="^it has 1000000000000 bytes; at most 1000000 are read$"):
        read_bytes(str(path))


def endless(place):
    os.mkfifo(os.path.join(place, "fifo"))
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(os.path.join(place, "socket"))
    os.symlink("/dev/zero", os.path.join(place, "link"))
    return [os.path.join(place, name) for name in ("fifo", "socket", "link")] + [
        "/dev/zero", "/dev/tty", place, os.path.join(place, "none"), "a\0b", "\ud800", ""]


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    refusals = []

    def read():
        for path in endless(str(tmp_path)):
            try:
                refusals.append(read_text(path))
            except Unreadable as error:
                refusals.append(str(error))

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    reader.join(20)
    assert not reader.is_alive(), "it blocks after {}".format(refusals)
    assert refusals[0] == refusals[2] == refusals[3] == "it is not a regular file"
    assert refusals[5] == "it is a folder" and refusals[6] == "No such file or directory" and len(
        refusals) == 10
    assert all(text and clean(text) == text for text in refusals)


def test_no_file_stays_open(tmp_path):
    (tmp_path / "a.ini").write_text("12345")
    before = os.listdir("/proc/self/fd")
    read_bytes(str(tmp_path / "a.ini"))
    for path, most in ((tmp_path, 5), (tmp_path / "a.ini", 4)):
        with pytest.raises(Unreadable):
            read_bytes(str(path), most)
    assert len(os.listdir("/proc/self/fd")) == len(before)


def test_a_wrong_byte_has_its_place():
    with pytest.raises(UnicodeDecodeError) as raised:
        decode(b"ab\xffcd")
    assert raised.value.start == 2


@pytest.mark.parametrize("word, expected", [
    ("WelcomSpeech", "did you mean WelcomeSpeech?"),
    ("welcomespeech", "did you mean WelcomeSpeech?"),
    ("Frobnicate", "")])
def test_suggestions(word, expected):
    assert did_you_mean(word, ["WelcomeSpeech", "Navigate"]) == expected


def test_a_suggestion_is_as_like_as_is_wanted():
    # of five letters four are equal: 2 * 4 / 10
    assert did_you_mean("WAVED", ["WAVES", "LAMPS"], 0.8) == "did you mean WAVES?"
    assert did_you_mean("WAVED", ["WAVES", "LAMPS"], 0.81) == ""


@pytest.mark.parametrize("number, ellipsis", [(0, ""), (1, ""), (20, ""), (21, ", …"), (99, ", …")])
def test_at_most_twenty_names_are_listed(number, ellipsis):
    names = list(map(str, range(number)))
    assert first_names(iter(names)) == ", ".join(names[:20]) + ellipsis


def test_a_number_has_its_noun():
    assert [count(number, "node", "nodes") for number in (0, 1, 2)] == [
        "0 nodes", "1 node", "2 nodes"]
