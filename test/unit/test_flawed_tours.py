"""rehearseMission: variations of the lab tour with one mistake each, and sound ones."""
import pytest

from behavior_controller.simulation.rehearsal import cli
from flawed_tours import FLAWED, SOUND, calm, changed

pytestmark = pytest.mark.long


def rehearse(tmp_path, changes, words):
    path = tmp_path / "lab_tour.xml"
    path.write_text(changed(changes), encoding="utf-8")
    return cli.rehearse(cli.Plan(cli.read([str(path), *words])), jobs=1)


def kinds(found):
    return [kind for each in found for kind in (each.kind.name, *kinds(each.consequences))]


def told(found):
    return "\n".join(f"{each.kind.name} at {each.where}: {each.what}" for each in found)


@pytest.mark.parametrize(
    "words, expected, changes", [pytest.param(*row[1:], id=row[0]) for row in FLAWED])
def test_a_mistake_in_a_tour_is_found(tmp_path, words, expected, changes):
    found = rehearse(tmp_path, changes, words).findings
    assert expected in kinds(found), told(found)


EVERY = [change for _, changes in SOUND[1:] for change in changes]


@pytest.mark.parametrize("changes, words", [
    pytest.param(SOUND[0][1], calm("engages,silent,leaves"), id=SOUND[0][0]),
    pytest.param(EVERY, calm("engages,silent,leaves"), id="all others"),
    pytest.param(EVERY, ["asrEnabled:=true", "--runs", "20", "--failureRate", "0.1"],
                 id="all others, when calls fail")])
def test_nothing_is_found_in_a_sound_tour(tmp_path, changes, words):
    found = rehearse(tmp_path, changes, words).findings
    assert found == [], told(found)
