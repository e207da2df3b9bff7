"""rehearseMission: small missions with one mistake each, as an author makes them, and sound ones.
"""
import pytest

from behavior_controller.simulation.rehearsal import cli, findings

import flawed_tours

pytestmark = pytest.mark.slow


def safe(node):
    """Return a step with its recovery."""
    return "<Fallback><{}/><HandleFallBack/></Fallback>".format(node)


def steps(*nodes):
    return "<Sequence>{}</Sequence>".format("".join(nodes))


def wait(condition, milliseconds):
    return ('<ReactiveFallback><{}/><ForceFailure><Sleep msec="{}"/></ForceFailure>'
            "</ReactiveFallback>").format(condition, milliseconds)


def branches(*nodes):
    return '<Parallel success_count="{}" failure_count="1">{}</Parallel>'.format(
        len(nodes), "".join(nodes))


VISITOR = ("<ReactiveFallback><IsVisitorDiscovered/><KeepRunningUntilFailure><AlwaysSuccess/>"
           "</KeepRunningUntilFailure></ReactiveFallback>")
BEGIN = "<START_OF_TREE/>" + safe("ScanningOvertAttentionMode") + VISITOR
OFF = safe("DisabledOvertAttentionMode")
DRIVE = OFF + safe("Navigate")
HOME = safe("LookUpHome") + DRIVE
LIST = safe("RetrieveListOfExhibits")
DESCRIBE = safe('DescribeExhibitSpeech name="1"')
SHOW = "<SelectExhibit/>" + DRIVE + DESCRIBE
BYE = "<ForceSuccess>{}</ForceSuccess>".format(steps("<IsVisitorDiscovered/>",
                                                     safe("SayGoodByeSpeech")))


def each_exhibit(*nodes):
    return "<Inverter><KeepRunningUntilFailure>{}</KeepRunningUntilFailure></Inverter>".format(
        steps("<IsListWithExhibit/>", *nodes))


def times(number, *nodes):
    return '<Repeat num_cycles="{}">{}</Repeat>'.format(number, steps(*nodes))


def retry(number, *nodes):
    return '<RetryUntilSuccessful num_attempts="{}">{}</RetryUntilSuccessful>'.format(
        number, steps(*nodes) if len(nodes) > 1 else nodes[0])


ASK = safe("QueryTourSpeech") + "<ForceSuccess>{}</ForceSuccess>".format(
    retry(3, wait("IsYesNoUttered", 10000)))
TOUR = LIST + each_exhibit(SHOW) + BYE + HOME
IF_YES = "<Fallback>{}<Inverter><IsVisitorResponseYes/></Inverter></Fallback>"

ONE, VOICE = ["--visitors", "engages", "--kinds", "refused"], ["asrEnabled:=true"]
EITHER_WAY = ["--visitors", "engages", "--faults", "none"]


def calm(visitor="engages", *words):
    """Return the words for the one play that shows the mistake."""
    return ["--visitors", visitor, "--faults", "none", *VOICE, *words]



FLAWED = [
    ("a drive is retried for ever",
     [BEGIN, LIST, "<SelectExhibit/>", OFF,
      retry(-1, "<Navigate/>"), BYE, HOME], {"retries-for-ever": "Navigate"}, ONE),
    ("a speech is retried for ever, with a pause", [
        BEGIN,
        retry(
            -1, "<Fallback><WelcomeSpeech/><ForceFailure><Sleep msec='2000'/>"
            "</ForceFailure></Fallback>")], {"retries-for-ever": "WelcomeSpeech"}, ONE),
    ("a loop goes on until the speech succeeds, among other steps",
     [BEGIN, retry(-1, safe("WelcomeGesture"),
                   "<WelcomeSpeech/>")], {"retries-for-ever": "WelcomeSpeech"}, ONE),
    ("two drives at once", [
        BEGIN, LIST, "<SelectExhibit/>", OFF,
        branches(safe("Navigate"), safe("Navigate")), BYE, HOME
    ], {"shares-a-body": "Navigate"}, ONE),
    ("two speeches at once", [BEGIN,
                              branches(safe("WelcomeSpeech"), safe("QueryTourSpeech"))],
     {"shares-a-body": "QueryTourSpeech"}, calm()),
    ("the drive home is forgotten", [BEGIN, LIST, SHOW, BYE], {"not-home": "Navigate"}, calm()),
    ("the drive home is left out when the visitor leaves", [
        BEGIN, LIST,
        each_exhibit(SHOW),
        "<Fallback>{}<HandleFallBack/></Fallback>".format(wait("IsVisitorDiscovered", 3000)),
        safe("SayGoodByeSpeech"), HOME], {"not-home": "Navigate"}, calm("leaves")),
    ("a look-up's failure is swallowed",
     [BEGIN, LIST, SHOW, BYE, "<ForceSuccess><LookUpHome/></ForceSuccess>",
      DRIVE], {"swallowed-failure": "LookUpHome"}, ONE),
    ("a drive's failure is swallowed", [
        BEGIN, LIST, "<SelectExhibit/>", OFF, "<ForceSuccess><Navigate/></ForceSuccess>",
        safe('DescribeExhibitSpeech name="1"'), BYE, HOME], {"swallowed-failure": "Navigate"}, ONE),
    ("a branch that cannot be reached", [
        BEGIN,
        "<Fallback><ForceSuccess><WelcomeSpeech/></ForceSuccess><WelcomeGesture/></Fallback>", OFF
    ], {"unreached": "WelcomeGesture"}, []),
    ("a wait for a sign that does not come", [
        BEGIN,
        "<ReactiveFallback><IsMutualGazeDiscovered/><KeepRunningUntilFailure><AlwaysSuccess/>"
        "</KeepRunningUntilFailure></ReactiveFallback>"
    ], {"waits-for-ever": "KeepRunningUntilFailure"}, calm()),
    ("a call without a recovery", [BEGIN,
                                   "<WelcomeSpeech/>"], {"unrecovered": "WelcomeSpeech"}, ONE),
    ("attention is never set to seek",
     [BEGIN,
      safe("WelcomeSpeech"),
      wait("IsMutualGazeDiscovered", 15000),
      safe("WelcomeGesture")], {"never-true": "IsMutualGazeDiscovered"}, []),
    ("a tour without a goodbye", [BEGIN, LIST, each_exhibit(SHOW),
                                  HOME], {"no-goodbye": "Navigate"}, calm()),
    ("the goodbye is left out with the gesture before it", [
        BEGIN, LIST, SHOW, "<ForceSuccess>{}</ForceSuccess>".format(
            steps("<IsVisitorDiscovered/>", "<WelcomeGesture/>", "<SayGoodByeSpeech/>")), HOME
    ], {"left-out-step": "WelcomeGesture"}, ONE),
    ("more exhibits than there are", [BEGIN, LIST, times(6, SHOW), BYE,
                                      HOME], {"missing-data": "SelectExhibit"}, calm()),
    ("fewer exhibits than there are", [BEGIN, LIST, times(4, SHOW), BYE,
                                       HOME], {"left-out": "SelectExhibit"}, calm()),
    ("a limit shorter than the speech", [
        BEGIN,
        "<Fallback><Timeout msec='1000'><WelcomeSpeech/></Timeout><AlwaysSuccess/></Fallback>"
    ], {"cut-short": "WelcomeSpeech"}, calm()),
    ("home twice", [BEGIN, LIST, SHOW, BYE, HOME, HOME], {"drives-twice": "Navigate"}, calm()),
    ("an answer that is not waited for",
     [BEGIN, safe("QueryTourSpeech"),
      "<ForceSuccess><IsYesNoUttered/></ForceSuccess>"], {"never-true": "IsYesNoUttered"}, []),
    ("milliseconds for seconds", [
        BEGIN,
        safe("SeekOvertAttentionMode"),
        "<ForceSuccess>{}</ForceSuccess>".format(wait("IsMutualGazeDiscovered", 15))
    ], {"never-true": "IsMutualGazeDiscovered"}, []),
    ("a tour whatever the answer", [BEGIN, ASK,
                                    TOUR], {"unwanted-drive": "Navigate"}, calm("declines")),
    ("attention is left on", [BEGIN, LIST, SHOW, BYE, HOME,
                              safe("SocialOvertAttentionMode")],
     {"left-on": "SocialOvertAttentionMode"}, calm()),
    ("goodbye to nobody", [BEGIN, LIST,
                           each_exhibit(SHOW),
                           safe("SayGoodByeSpeech"),
                           HOME], {"goodbye-to-nobody": "SayGoodByeSpeech"}, calm("leaves")),
    ("a recovery from nothing", [BEGIN, steps("<WelcomeSpeech/>", "<HandleFallBack/>")],
     {"missing-data": "HandleFallBack"}, calm()),
    ("the question is repeated until it is answered",
     [BEGIN, retry(-1, safe("QueryTourSpeech"),
                   wait("IsYesNoUttered", 10000))], {"endless": "QueryTourSpeech"},
     calm("silent", "--limit", "900")),
    ("the end of the loop counts as a failure", [
        BEGIN, LIST, "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>".format(
            steps("<IsListWithExhibit/>", SHOW)), BYE, HOME], {"never-succeeds": "Sequence"}, []),
    ("a limit shorter than the drive", [
        BEGIN, LIST, SHOW, BYE,
        safe("LookUpHome"), OFF,
        "<ForceSuccess><Timeout msec='5000'><Navigate/></Timeout></ForceSuccess>"
    ], {"abandoned-drive": "Navigate"}, calm()),
    ("a description before the selection",
     [BEGIN, LIST, safe('DescribeExhibitSpeech name="1"'), SHOW, BYE,
      HOME], {"missing-data": "1"}, calm()),
    ("a description before the drive",
     [BEGIN, LIST, each_exhibit("<SelectExhibit/>", DESCRIBE, DRIVE), BYE,
      HOME], {"shown-away": "1"}, calm()),
    ("a description on the way",
     [BEGIN, LIST, "<SelectExhibit/>", OFF, branches(safe("Navigate"), DESCRIBE), BYE,
      HOME], {"shown-away": "1"}, calm()),
    ("a drive that ends with the words", [
        BEGIN, LIST, "<SelectExhibit/>", OFF,
        branches(safe("Navigate"), safe("FollowMeSpeech")).replace('count="2"', 'count="1"'),
        DESCRIBE, BYE, HOME], {"abandoned-drive": "Navigate"}, calm()),
    ("the answer to another question", [
        BEGIN, ASK, IF_YES.format(steps("<IsVisitorResponseYes/>", LIST, SHOW,
                                        safe("QueryTourSpeech"), "<IsVisitorResponseYes/>",
                                        SHOW, BYE, HOME))
    ], {"answer-mixed-up": "IsVisitorResponseYes"}, calm()),
    ("an answer that the tablet overwrites", [
        BEGIN, ASK, safe("PressYesNoSpeech"), "<ForceSuccess><PressYesNoDialogue/></ForceSuccess>",
        IF_YES.format(steps("<IsVisitorResponseYes/>", TOUR))
    ], {"answer-mixed-up": "PressYesNoDialogue"}, calm()),
    ("a question to which nothing listens", [BEGIN, safe("WelcomeSpeech"), safe("QueryTourSpeech")],
     {"answer-mixed-up": "QueryTourSpeech"}, calm()),
    ("a goodbye at each exhibit", [BEGIN, LIST, each_exhibit(SHOW, safe("SayGoodByeSpeech")), HOME],
     {"early-goodbye": "SayGoodByeSpeech"}, calm()),
    ("a further exhibit after the goodbye", [BEGIN, LIST, SHOW, safe("SayGoodByeSpeech"), SHOW,
                                             HOME], {"early-goodbye": "SayGoodByeSpeech"}, calm()),
    ("a tour by voice alone", [BEGIN, ASK, IF_YES.format(steps("<IsVisitorResponseYes/>", TOUR))],
     {"one-way-only": "Navigate"}, EITHER_WAY),
    ("a shorter tour by tablet", [
        BEGIN, LIST, "<IfThenElse><IsASREnabled/>{}{}</IfThenElse>".format(
            each_exhibit(SHOW), steps(SHOW)), BYE, HOME], {"one-way-only": "Navigate"}, EITHER_WAY),
    ("a condition on nothing",
     [BEGIN, "<WelcomeSpeech _skipIf='@answer == 1'/>"], {"exception": "WelcomeSpeech"}, calm()),
    ("a target for which a substitute has no use either",
     [BEGIN, LIST, SHOW, BYE, safe("LookUpHome"), safe("PerformDeicticGesture"),
      DRIVE], {"missing-data": "PerformDeicticGesture"}, calm()),
    ("lifelike movement is never switched off",
     ["<START_OF_TREE/>", safe("EnableAnimateBehavior"), VISITOR, safe("WelcomeSpeech")],
     {"never-off": "EnableAnimateBehavior"}, []),
    ("a wait for a visitor that never rests", [
        "<START_OF_TREE/>", safe("ScanningOvertAttentionMode"),
        VISITOR.replace("KeepRunningUntilFailure", "Repeat").replace(
            "<Repeat>", "<Repeat num_cycles='-1'>"), OFF], {"busy-loop": "Repeat"}, calm()),
    ("a sum of nothing", [BEGIN, "<Script code='n += 1'/>"], {"exception": "Script"}, calm())]

BY_TABLET = "<ForceSuccess>{}</ForceSuccess>".format(
    retry(3, safe("PressYesNoSpeech"), "<PressYesNoDialogue/>"))

SOUND = [
    ("a wait for a visitor before the first request",
     ["<START_OF_TREE/>", VISITOR, safe("WelcomeSpeech")]),
    ("one exhibit only", [BEGIN, LIST, SHOW, BYE, HOME]),
    ("a greeter", [BEGIN, safe("WelcomeGesture"), safe("WelcomeSpeech"), OFF]),
    ("a tour on the tablet's yes",
     [BEGIN, BY_TABLET, IF_YES.format(steps("<IsVisitorResponseYes/>", TOUR))]),
    ("two questions, and a look at each answer",
     [BEGIN, *[BY_TABLET + "<ForceSuccess>{}</ForceSuccess>".format(
         steps("<IsVisitorResponseYes/>", safe(node)))
               for node in ("WelcomeSpeech", "WelcomeGesture")], OFF]),
    ("another way after three refusals",
     [BEGIN, "<Fallback>{}<WelcomeGesture/><AlwaysSuccess/></Fallback>".format(
         retry(3, "<WelcomeSpeech/>")), OFF])]

SEARCHED = {"the end of the loop counts as a failure", "a tour on the tablet's yes",
            "two questions, and a look at each answer"}
"""The missions that need hundreds of plays."""


def case_of(row):
    return pytest.param(*row[1:], id=row[0], marks=pytest.mark.long if row[0] in SEARCHED else ())


def rehearse(tmp_path, nodes, words):
    path = tmp_path / "mission.xml"
    path.write_text('<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'.format(
        steps(*nodes)))
    return cli.rehearse(cli.Plan(cli.read([str(path), *words])), jobs=1)


def told(found):
    return "\n".join("{} at {} ({}): {}; {}".format(
        each.kind.name, each.where, each.place, each.what,
        [(other.kind.name, other.where) for other in each.consequences]) for each in found)


@pytest.mark.parametrize("nodes, expected, words", list(map(case_of, FLAWED)))
def test_a_mistake_is_found_at_its_node(tmp_path, nodes, expected, words):
    found = rehearse(tmp_path, nodes, words).findings
    assert {each.kind.name: each.where.rpartition("/")[2].partition("::")[0]
            for each in found} == expected, told(found)
    assert all(each.place.startswith(str(tmp_path)) for each in found)


def test_a_consequence_is_told_below_its_mistake(tmp_path):
    """A gaze that does not come is recovered from again and again."""
    gaze = "<Fallback><IsMutualGazeDiscovered/>{}</Fallback>".format(
        steps('<Sleep msec="1000"/>', "<HandleFallBack/>"))
    again = retry(40, gaze, "<AlwaysFailure/>")
    nodes = [BEGIN, safe("SeekOvertAttentionMode"), again, OFF]
    told, = rehearse(tmp_path, nodes, ["--faults", "none"]).findings
    assert told.kind.name == "missing-data"
    assert "budget-spent" in [other.kind.name for other in told.consequences]


def test_each_kind_of_mistake_is_found():
    found = {kind for _, _, kinds, _ in FLAWED for kind in kinds}
    assert found | {kind for _, _, kind, _ in flawed_tours.FLAWED} == set(
        findings.KIND_BY_NAME) - {"senseless-request", "budget-spent"}


@pytest.mark.parametrize("nodes", list(map(case_of, SOUND)))
def test_nothing_is_found_in_a_sound_mission(tmp_path, nodes):
    words = ["--kinds", "refused"] if HOME in nodes else []  # a tour has many calls
    found = rehearse(tmp_path, nodes, words).findings
    assert found == [], told(found)
