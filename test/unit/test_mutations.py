"""The tool that breaks the code on purpose breaks what it says, and nothing else."""
import os
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.version_info < (3, 9),
                                reason="Python 3.8 cannot write a syntax tree as code")
sys.path.insert(
    0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "mutation"))

from mutate import Rule, Stale, broken, sample  # noqa: E402

SOURCE = '''"""Ä module."""
import os

LIMIT = 3  # a comment

class Door:
    def is_open(self, angle: int = 0) -> bool:
        if not angle:
            return False
        self.tell("é", angle)
        return "ö" != angle and angle > LIMIT - self.play
'''


def test_a_sample_has_each_place_once_and_leaves_the_rest_as_it_is():
    mutations = sample([("door.py", SOURCE)], 100, 1)
    changed = {(lines[0].strip(), lines[1].strip()) for mutation in mutations for lines in zip(
        SOURCE.splitlines(), mutation.source.splitlines()) if lines[0] != lines[1]}
    told = 'return "ö" != angle and angle > LIMIT - self.play'
    assert changed == {
        ("LIMIT = 3  # a comment", "LIMIT = (4)  # a comment"),
        ("def is_open(self, angle: int = 0) -> bool:",
         "def is_open(self, angle: int = (1)) -> bool:"), ("if not angle:", "if (not not angle):"),
        ("return False", "return (True)"), ('self.tell("é", angle)', "(None)"),
        (told, 'return ("ö" == angle) and angle > LIMIT - self.play'.replace('("ö"', "('ö'")),
        (told, 'return "ö" != angle and (angle >= LIMIT - self.play)'),
        (told, 'return "ö" != angle and angle > (LIMIT + self.play)'),
        (told, "return ('ö' != angle or angle > LIMIT - self.play)")}
    assert len(mutations) == len(changed) == len({mutation.key for mutation in mutations})
    assert {mutation.scope for mutation in mutations} == {"", "Door.is_open"}


def test_a_seed_draws_the_same_again_and_another_seed_does_not():
    drawn = [[mutation.key for mutation in sample([("door.py", SOURCE)], 4, seed)]
             for seed in (1, 1, 2, 3, 4)]
    assert drawn[0] == drawn[1] and drawn[1:] != 4 * drawn[:1] and len(drawn[0]) == 4


@pytest.mark.parametrize("old, new, line", [
    ("LIMIT - self.play", "LIMIT", "return 'ö' != angle and angle > LIMIT"),
    ("self.tell('é', angle)", "open()", "open()"),
    ("if not angle:\n  return False\nself.tell('é', angle)", "angle += 1", "angle += 1")])
def test_a_rule_is_broken_where_its_code_stands_however_it_is_formatted(old, new, line):
    after = broken(SOURCE, Rule("", "", "Door.is_open", old, new))
    assert line in [each.strip() for each in after.splitlines()]


@pytest.mark.parametrize("scope, old", [("Door.is_open", "angle"), ("Door.is_open", "speed"),
                                        ("Door.is_shut", "angle")])
def test_a_rule_whose_code_is_not_found_once_is_stale(scope, old):
    with pytest.raises(Stale):
        broken(SOURCE, Rule("", "", scope, old, "0"))
